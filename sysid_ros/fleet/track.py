"""track: what a bag says of a robot that is known, by one least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.fleet.known_robot import KnownRobot
from sysid_ros.fleet.levers import Levers, levers_of
from sysid_ros.fleet.payload_steps import with_changes
from sysid_ros.fleet.schema import JOINT_PARAMETERS, UNITS
from sysid_ros.fleet.track_fit import TrackFit
from sysid_ros.fleet.track_rows import EACH, GAIN, TrackRows
from sysid_ros.identification.channel_checks import check_channels
from sysid_ros.identification.least_squares import rms
from sysid_ros.identification.rows import SmoothRecording
from sysid_ros.identification.tolerances import TOL
from sysid_ros.input_gate.recording_check import refusal_of
from sysid_ros.sample import FloatArray
from sysid_ros.signals.cutoff import default_cutoff, position_noise
from sysid_ros.signals.recording import Recording

_TOLD = 0.7
"""Standard deviation over the prior's up to which a parameter is told: the bag at least halves its variance."""
_FAR = 3.0
"""Standard deviations of the prior that a parameter may lie from the model before that is said."""
_CUTOFF = 0.5
"""Of the cut-off that the rate and the noise of the positions allow: at 1 the errors of rotors, zeros and delays are 1.1 to 1.2
of their standard deviations, at 0.5 they are 1.0, and the standard deviations the larger by 1 to 6 %."""
_BLOCKS = 20
"""Parts of a bag whose noise is compared, for how well it is known."""
_FOURTH = 70.0
"""Sum of the squares of a fourth difference's weights."""
_OF_MEDIAN = 1.167
"""Standard deviation of a Gaussian's, found by that median of N values, times the root of N (Rousseeuw, Croux 1993)."""
_OVERLAP = 2.626
"""Fourth differences of white noise that count as one: the sum of their squared correlations over all lags."""
_MEDIAN = 0.6745
"""Of the size of a Gaussian in standard deviations."""


@dataclass(frozen=True, slots=True)
class CarriedBody:
    """What was carried for a time.

    Attributes:
        t_from, t_to: since the first stamp [s]. theta: ten parameters about the frame's origin, with what the robot always
            carries, shape (10,). covariance: of them, shape (10, 10). told: which the bag tells, shape (10,).
    """

    t_from: float
    t_to: float
    theta: FloatArray
    covariance: FloatArray
    told: np.ndarray[tuple[int], np.dtype[np.bool_]]


@dataclass(frozen=True, slots=True)
class Tracked:
    """What a bag says of n joints, and of what they carried.

    Attributes:
        joint_names: n. values, std: by the names of :data:`.schema.JOINT_PARAMETERS`, shape (8, n), NaN where the bag does not
            tell. covariance: of each joint's, shape (n, 8, 8), NaN alike.
        from_prior: of each joint, parameters that the prior tells better than the bag. model_error: of each joint, in words.
        residual, torque: rms below the cut-off while the joint moves, shape (n,) [N m]. levers: what errors cost.
        carried: one after the other. notes: of the whole bag, in words. frame: of what was carried.
    """

    joint_names: tuple[str, ...]
    values: FloatArray
    std: FloatArray
    covariance: FloatArray
    from_prior: tuple[tuple[str, ...], ...]
    model_error: tuple[str, ...]
    residual: FloatArray
    torque: FloatArray
    levers: Levers
    carried: tuple[CarriedBody, ...]
    notes: tuple[str, ...]
    frame: str


def track(known: KnownRobot, recording: Recording, max_gap: float = 0.1) -> Tracked:
    """Friction, offset, gain, zero, rotor, delay and noise of each joint, and the payload, with what they may be wrong by.

    Args:
        known: the robot. recording: its raw channels. max_gap: a longer gap is not bridged [s].

    Raises:
        DataError: the recording can't be used, or the robot as it is known does not explain it.
    """
    if reason := refusal_of(known.robot, [recording]):
        raise DataError(reason)
    checked = check_channels(known.robot, recording, max_gap)
    smooth = SmoothRecording.of(known.robot, recording, recording.name, cutoff_of(recording), max_gap, spoiled=checked.spoiled)
    fit = with_changes(TrackRows.of(known, smooth))
    moving = fit.rows.rows.moving
    residual, torque = rms(fit.left, moving), rms(fit.rows.rows.tau, moving)
    _require_explained(recording.name, residual, torque)
    values, covariance = _joints(known, fit, recording)
    told = np.vstack([_told(fit)[: EACH * known.robot.n].reshape(EACH, -1), np.isfinite(values[EACH])])
    covariance = np.where(told.T[:, :, None] & told.T[:, None, :], covariance, np.nan)
    untold = tuple(
        tuple(name for name, is_told in zip(JOINT_PARAMETERS, column, strict=True) if not is_told) for column in told.T
    )
    return Tracked(
        joint_names=known.robot.joint_names,
        values=np.where(told, values, np.nan),
        std=np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)).T,
        covariance=covariance,
        from_prior=untold,
        model_error=_doubts(known, fit, [(p.joint, p.text) for p in checked.problems]),
        residual=residual,
        torque=torque,
        levers=levers_of(fit.rows),
        carried=_carried(known, fit, recording),
        notes=tuple(p.text for p in checked.problems if not p.joint),
        frame=known.frame,
    )


def cutoff_of(recording: Recording) -> float:
    """Of the low-pass [Hz]: low enough that the noise of the positions, which grows with its fifth power in an acceleration's
    variance, biases nothing by a notable part of its standard deviation."""
    return _CUTOFF * default_cutoff(recording.rate, position_noise(recording.q))


def _require_explained(name: str, residual: FloatArray, torque: FloatArray) -> None:
    """Check that most of the torque is explained.

    Raises:
        DataError: it is not.
    """
    part = float(np.sum(residual**2) / max(float(np.sum(torque**2)), 1e-12))
    if part > 1.0 - TOL.follows_urdf:
        raise DataError(
            f"{name}: the robot as it is known, with any friction, offsets, gains and payload, leaves {100.0 * part:.0f} % of "
            f"the torque's power; {100.0 * (1.0 - TOL.follows_urdf):g} % is the most. Check in robots.yaml that it is this "
            "robot, and its effort_scale."
        )


def _joints(known: KnownRobot, fit: TrackFit, recording: Recording) -> tuple[FloatArray, FloatArray]:
    """Values (8, n) and covariances (n, 8, 8) of the joints' parameters, the noise last."""
    n, model = known.robot.n, known.model
    nothing = np.zeros(n)
    of_model = np.stack([model.dry_friction(), model.damping(), known.offset, nothing + 1.0, nothing, model.armature(), nothing])
    noise, noise_std = effort_noise(recording)
    values = np.vstack([of_model + fit.theta[: EACH * n].reshape(EACH, n), noise])
    covariance = np.zeros((n, EACH + 1, EACH + 1))
    for j in range(n):
        here = np.arange(EACH) * n + j
        covariance[j, :EACH, :EACH] = fit.covariance[np.ix_(here, here)]
    covariance[:, EACH, EACH] = noise_std**2
    return values, covariance


def effort_noise(recording: Recording) -> tuple[FloatArray, FloatArray]:
    """Standard deviation of the white noise of the efforts as they were published, and its own, shape (n,) each [N m].

    From fourth differences, in which a motion does not show; by their median, to which the jumps of dry friction are few. NaN
    where that is 0, as of efforts in steps larger than the noise, and where the bag is too short. Its own is that of
    white noise, or that between parts of the bag where it is larger.
    """
    fourth = np.abs(np.diff(recording.tau, 4, axis=0))
    if len(fourth) < 10 * _BLOCKS:
        return np.full(fourth.shape[1], np.nan), np.full(fourth.shape[1], np.nan)
    scale = _MEDIAN * np.sqrt(_FOURTH)
    noise = np.nanmedian(fourth, axis=0) / scale
    parts = np.array([np.nanmedian(part, axis=0) for part in np.array_split(fourth, _BLOCKS)]) / scale
    of_parts = parts.std(axis=0, ddof=1) / np.sqrt(_BLOCKS)
    std = np.maximum(of_parts, _OF_MEDIAN * noise * np.sqrt(_OVERLAP / len(fourth)))
    known = noise > 0.0
    return np.where(known, noise, np.nan), np.where(known, std, np.nan)


def _told(fit: TrackFit) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Parameters that the bag tells, shape (p,)."""
    return np.asarray(fit.std < _TOLD * fit.prior_std)


def _doubts(known: KnownRobot, fit: TrackFit, problems: list[tuple[str, str]]) -> tuple[str, ...]:
    """What speaks against the model or the channels of each joint."""
    n = known.robot.n
    far = np.abs(fit.theta[: EACH * n] / fit.prior_std[: EACH * n]).reshape(EACH, n)
    out = []
    for j, joint in enumerate(known.robot.joint_names):
        said = [text for name, text in problems if name == joint]
        for i in np.flatnonzero(far[:, j] > _FAR):
            name, value = JOINT_PARAMETERS[i], fit.theta[i * n + j] + (i == GAIN)
            said.append(
                f"{name} is {value:.3g} {UNITS[name]} beside the model, {far[i, j]:.1f} standard deviations of the prior: is it "
                "this robot, in these units?"
            )
        out.append(" ".join(said))
    return tuple(out)


def _carried(known: KnownRobot, fit: TrackFit, recording: Recording) -> tuple[CarriedBody, ...]:
    first = EACH * known.robot.n
    bounds = [0.0, *fit.rows.changes, recording.seconds]
    out = []
    for s in range(fit.rows.payloads):
        here = slice(first + 10 * s, first + 10 * s + 10)
        body = known.payload + fit.theta[here]
        out.append(CarriedBody(bounds[s], bounds[s + 1], body, fit.covariance[here, here], _told(fit)[here]))
    return tuple(out)
