"""diagnose_on_legs: from recordings of a robot on legs to the causes of what its model gets wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sysid_ros.diagnosis.channel_faults import undone
from sysid_ros.diagnosis.claims import Judged
from sysid_ros.diagnosis.covariance import Gains
from sysid_ros.diagnosis.extended_model import extended_model, urdf_part
from sysid_ros.diagnosis.fault_findings import finding_of
from sysid_ros.diagnosis.heldout import split
from sysid_ros.diagnosis.legs.corrected import corrected_again, corrections, leg_model
from sysid_ros.diagnosis.legs.leg_channels import Channelled, channels_on_legs
from sysid_ros.diagnosis.legs.leg_rows import leg_libraries
from sysid_ros.diagnosis.legs.leg_search import search_legs
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.reporting import report
from sysid_ros.diagnosis.result import Diagnosis, Predictions, TorqueRmse
from sysid_ros.estimators.one_thread import on_one_thread
from sysid_ros.exceptions import DataError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.leg_priors import standing_torque
from sysid_ros.identification.channel_checks import CheckedRecording, check_legs
from sysid_ros.identification.from_legs import shown_by
from sysid_ros.identification.spectrum import choose_cutoff
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.torque.model_file import ModelFile, urdf_digest

_UNITS = ("N",) * 3 + ("N m",) * 3
_AGAIN = 2
"""How often recordings are corrected by gains and delays that were found."""
_JUDGED = (
    "A robot on legs is judged by the force and the moment on all of it, free of the forces on its feet: what the torques of the "
    "legs, with the ground, would have to be, less what they are."
)
_UNDONE = "All errors are those of the recordings with the faults of the channels undone."
_NOT_SIMULATED = "Nothing was simulated: the gain in simulation is one of arms."

_FORCES, _MORE_WRONG = 3, 0.5
"""The forces among the rows, and the part of one from which a model that leaves it is more wrong than right."""
_NEVER_KNOWN = 0.03
"""Part of the weight that gains and offsets which no robot is free of can be of a force: 2 % and 1 %."""

Progress = Callable[[str], None]


@on_one_thread
def diagnose_on_legs(
    base: FloatingBase,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    progress: Progress = lambda sentence: None,
    provenance: dict[str, Any] | None = None,
    gravity: float = 9.81,
    max_gap: float = 0.1,
) -> Diagnosis:
    """What is wrong with the nominal model of a robot on legs, its IMU and its feet.

    Its rows are those of :func:`.identify_on_legs`; the search, the probabilities and the report are those of an arm.

    Args:
        base: the nominal model. recordings: to fit on, with a trunk. validation: to judge on, never fitted; without any, the last
            part of the recordings is held out. gravity: its size [m/s^2]. max_gap: a longer gap is not bridged [s].

    Raises:
        DataError: no recording is given, one has no IMU or is too short, the IMU does not show what it is said to, or the torques
            do not carry the robot.
    """
    progress("filtering")
    told, fitted, notes, channels = judged_on_legs(base, recordings, validation, progress, gravity, max_gap)
    found, train = _with_channels(report(told), base, channels), told.train
    if reason := _not_what_acts(base, _torque(told, found.torque)):
        return Diagnosis("refused", base.robot.joint_names[:FREE], refusal=reason, notes=notes)
    model = extended_model(base.robot, None, told.fit, told.values, train, {r.name: r.start for r in fitted}, provenance or {})
    model = replace(model, urdf_sha256=urdf_digest(base.legs.urdf), torque_std=_errors_of_legs(told, model, fitted))
    urdf_model, changes = urdf_part(base.robot, model, train)
    return replace(
        _of_trunk(found, told),
        model=model,
        urdf_model=urdf_model,
        notes=(_JUDGED, *notes, *changes, *found.notes, _NOT_SIMULATED),
    )


def judged_on_legs(
    base: FloatingBase,
    recordings: Sequence[Recording],
    validation: Sequence[Recording] = (),
    progress: Progress = lambda sentence: None,
    gravity: float = 9.81,
    max_gap: float = 0.1,
) -> tuple[Judged, Sequence[Recording], tuple[str, ...], Channelled]:
    """The search of :func:`diagnose_on_legs`, which has the arguments, the recordings that were fitted, what is doubtful about
    the recordings, a sentence each, and the faults of the channels, which were undone.

    Raises:
        DataError: as there.
    """
    if not recordings:
        raise DataError("no recording is given. Give at least one bag.")
    fitted, judged = (recordings, validation) if validation else split(recordings)
    first, second = ([check_legs(base.legs, r, max_gap) for r in part] for part in (fitted, judged))
    cutoff = choose_cutoff(recordings, base.legs.joint_names, max_gap).hz
    progress("weighing faults of the channels")
    channels = channels_on_legs(base, first, cutoff, max_gap)
    if reason := channels.refusal:
        raise DataError(reason)
    if channels.faults:
        fitted, judged = ([undone(r, channels.faults) for r in part] for part in (fitted, judged))
        first, second = ([check_legs(base.legs, r, max_gap) for r in part] for part in (fitted, judged))
    notes = tuple(dict.fromkeys(p.text for c in (*first, *second) for p in c.problems))
    return _searched(base, first, second, cutoff, gravity, progress), fitted, notes, channels


def _with_channels(found: Diagnosis, base: FloatingBase, channels: Channelled) -> Diagnosis:
    """The diagnosis with the faults of the channels after its causes."""
    if not channels.faults:
        return found
    names, unknown = base.legs.joint_names, Gains((), np.zeros(0), np.zeros((0, 0)), frozenset())
    own = [finding_of(f, names, e, unknown) for f, e in zip(channels.faults, channels.evidence, strict=True)]
    verdict = "explained" if found.verdict == "nothing_wrong" else found.verdict
    return replace(found, verdict=verdict, findings=(*found.findings, *own), notes=(*found.notes, _UNDONE))


def _searched(
    base: FloatingBase,
    fitted: Sequence[CheckedRecording],
    judged: Sequence[CheckedRecording],
    cutoff_hz: float,
    gravity: float,
    progress: Progress,
) -> Judged:
    """The most probable causes. IMU, feet, gains and delays of the torques are found to first order; then the recordings are
    corrected by them, or no longer by one that is no cause, and all is asked again."""
    shown = shown_by(fitted, gravity)
    by = corrections(base, fitted, cutoff_hz, shown, progress)
    for turn in range(_AGAIN + 1):
        progress("computing what each effect would do")
        train, held = leg_libraries(base, (fitted, judged), cutoff_hz, shown, by)
        selection, posterior, on = search_legs(train, held, progress)
        if turn == _AGAIN:
            break
        by, moved = corrected_again(leg_model(base, shown), by, selection.fit, standing_torque(base.mass))
        if not moved:
            break
    return Judged(train.prepared, selection, posterior, on)


def _errors_of_legs(told: Judged, model: ModelFile, recordings: Sequence[Recording]) -> FloatArray:
    """Standard deviation of what is left of each row, shape (n,); that of the legs' joints is the same part of their torque as
    that of the force is of the force on the whole robot."""
    out, tau = model.torque_std.copy(), np.concatenate([m.tau for m in told.train.motions])
    out[:FREE] = _rms(told.train, told.fit.residual)[:FREE]
    size = np.sqrt(np.mean(tau**2, axis=0))
    part = float(np.linalg.norm(out[:3]) / max(float(np.linalg.norm(size[:3])), 1e-12))
    out[FREE:] = part * np.sqrt(np.mean(np.concatenate([r.tau for r in recordings]) ** 2, axis=0))
    return out


def _rms(prepared: Prepared, rows: FloatArray) -> FloatArray:
    """Of what rows of shape (K, n) are as forces and moments, shape (n,) [N], [N m]."""
    samples = sum(len(m.t) for m in prepared.motions)
    return np.asarray(np.sqrt(np.sum(prepared.band.unmixed(rows) ** 2, axis=0) / samples))


def _not_what_acts(base: FloatingBase, torque: TorqueRmse) -> str:
    """Why nothing can be told where the torques are not those that act; else empty."""
    weight, left = 9.81 * base.mass, torque.after[:_FORCES]
    wrong = (left > _MORE_WRONG * torque.torque[:_FORCES]) & (left > _NEVER_KNOWN * weight)
    if not wrong.any():
        return ""
    axis = int(np.argmax(np.where(wrong, left, 0.0)))
    return (
        f"With everything that is known here {left[axis]:.3g} N (rms) of the force along the trunk's {'xyz'[axis]} axis are left "
        f"on held-out data, of {torque.torque[axis]:.3g} N: the torques of the messages are not those that act, whatever else is "
        "wrong, or something pulls at the robot. Torques that change faster than they are published are shown wrongly. "
        "Publish their mean over the time between messages, and see whether a controller chatters."
    )


def _torque(told: Judged, torque: TorqueRmse | None) -> TorqueRmse:
    """Errors as forces and moments, of the rows of the whole robot."""
    held, rows = told.held.prepared, slice(None, FREE)
    samples = sum(len(m.t) for m in held.motions)
    floor = np.sqrt(np.sum(held.band.unmixed_variance(told.noise), axis=0) / samples)
    measured = held.band.rows([m.tau for m in held.motions])
    each = (_rms(held, held.problem.measured), _rms(held, told.after), floor, _rms(held, measured))
    names = told.robot.joint_names if torque is None else torque.joints
    return TorqueRmse(names[rows], *(x[rows] for x in each))


def _of_trunk(found: Diagnosis, told: Judged) -> Diagnosis:
    """A diagnosis with the rows alone that are judged: those of the whole robot."""
    rows = slice(None, FREE)
    p = found.predictions
    torque = None if found.torque is None else _torque(told, found.torque)
    predictions = None
    if p is not None:
        channels = (x[:, rows] for x in (p.measured, p.nominal, p.extended, p.q, p.v, p.a))
        predictions = Predictions(p.t, p.joints[rows], *channels)
    return replace(found, joints=found.joints[rows], units=_UNITS, torque=torque, predictions=predictions)
