"""Stretch: a recording without gaps, with the torque of the model beside the measured one, both with their phase untouched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.effects import Motion
from sysid_ros.exceptions import DataError
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.identification.channel_checks import CheckedRecording
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.zero_phase import KinematicFilter, on_even_grid
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel

_SEGMENT = 1024
_SAMPLED = 100
"""Postures that the mass matrix is taken at."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """Channels of a stretch on an even grid, all through one zero-phase low-pass that is flat below ``top_hz``.

    Attributes:
        name: of the recording. motion: q, v, a and the measured torque.
        model: torque that the model says for this motion, shape (N, n) [N m]. smooth: the same without dry friction.
        published: velocity of the messages, shape (N, n), or None.
        mass: entries of the mass matrix with rotors, mean of their squares over the motion, shape (n, n) [(kg m^2)^2].
        inertia: of the links alone about each joint, mean and standard deviation over the motion, shape (2, n) [kg m^2].
        position_noise: variance of white noise in the raw positions, shape (n,) [rad^2]. raw_period: between messages [s].
    """

    name: str
    motion: Motion
    model: FloatArray
    smooth: FloatArray
    published: FloatArray | None
    mass: FloatArray
    inertia: FloatArray
    position_noise: FloatArray
    raw_period: float

    @property
    def period(self) -> float:
        """Spacing of the grid [s]."""
        return self.motion.period

    def rests(self, joint: int) -> tuple[slice, FloatArray, float]:
        """Where a joint moves at all; its rests in there, shape (r, 2); the part of the time that it moves."""
        limit = TOLERANCES.stands_slide if self.motion.robot.is_prismatic[joint] else TOLERANCES.stands
        # a reversal is no rest, however slow it is: the speed is that of a short while
        width = max(1, round(0.5 * TOLERANCES.rest / self.period))
        speed = np.sqrt(np.convolve(self.motion.v[:, joint] ** 2, np.ones(width) / width, "same"))
        moving = np.flatnonzero(speed > limit)
        if not moving.size:
            return slice(0, 0), np.zeros((0, 2)), 0.0
        whole = slice(int(moving[0]), int(moving[-1]) + 1)
        still = np.concatenate([[False], speed[whole] <= limit, [False]])
        edges = np.flatnonzero(np.diff(still.astype(int)))
        spans = edges.reshape(-1, 2).astype(float)
        spans = spans[(spans[:, 1] - spans[:, 0]) * self.period > TOLERANCES.rest]
        part = 1.0 - float(np.sum(spans[:, 1] - spans[:, 0])) / (whole.stop - whole.start)
        return whole, spans, part

    def tells(self, whole: slice, part: float) -> bool:
        """Whether a joint that moves there, for a part of the time, moves enough to be judged."""
        return part >= TOLERANCES.moving and (whole.stop - whole.start) * self.period >= TOLERANCES.shortest

    def torque_noise(self, f: FloatArray) -> FloatArray:
        """What the noise of the positions makes of the model's torque: E|X(f)|^2 of an orthonormal transform, shape (K, n).

        ``sum_k M_jk^2 (2 pi f)^4 sigma_k^2``, spread over the bandwidth of the raw messages.
        """
        level = self.mass @ self.position_noise * (self.raw_period / self.period)
        return np.multiply.outer((2.0 * np.pi * f) ** 4, level)

    def velocity_noise(self, f: FloatArray) -> FloatArray:
        """The same for the velocity from positions, shape (K, n)."""
        return np.multiply.outer((2.0 * np.pi * f) ** 2, self.position_noise * (self.raw_period / self.period))


def top_frequency(recordings: Sequence[Recording], asked: float = 0.0) -> float:
    """Upper end of the band [Hz]: a fifth of the slowest rate, 40 Hz at most, or what is asked for.

    Raises:
        DataError: more is asked for than the rate allows, or no rate can be determined.
    """
    slowest = min(recordings, key=lambda r: 1.0 / max(r.period, 1e-9) if r.period > 0.0 else 0.0)
    if not slowest.period > 0.0:
        raise DataError(f"{slowest.name}: it holds {len(slowest.t)} samples without a rate. Record at least 10 s.")
    allowed = TOLERANCES.of_rate / slowest.period
    if not asked <= allowed * (1.0 + 1e-6):  # NaN neither
        raise DataError(
            f"{slowest.name}: its rate of {1.0 / slowest.period:.4g} Hz allows a check up to {allowed:.3g} Hz (a fifth of it); "
            f"{asked:g} Hz is asked for. Ask for less, or record at {asked / TOLERANCES.of_rate:.0f} Hz or more."
        )
    return asked or min(TOLERANCES.highest, allowed)


def stretches_of(
    robot: RobotModel, checked: CheckedRecording, known: Sequence[KnownEffect], top_hz: float, max_gap: float = 0.1
) -> list[Stretch]:
    """The stretches of a recording that are long enough; values that do not measure cut it like gaps.

    Args:
        robot: the URDF's model. checked: the recording and what is spoiled in it. known: effects of a model.yaml; none for the
            URDF's links and ``<dynamics>``. top_hz: below it the filters leave everything as it is [Hz].
    """
    recording, model, n = checked.recording, TorqueModel(robot, [], known), robot.n
    out = []
    for part in recording.stretches(max_gap):
        t, q, tau = (x[part] for x in (recording.t, recording.q, recording.tau))
        if len(t) < 8:
            continue
        period = _mean_period(t, recording.period)
        kinematics = KinematicFilter(period, top_hz / 3.0)
        if len(t) <= 2 * kinematics.half + 8 or t[-1] - t[0] < TOLERANCES.shortest:
            continue
        channels = tau if recording.v is None else np.hstack([tau, recording.v[part]])
        smooth = kinematics.apply(t, q, None, channels, checked.spoiled[part])
        if smooth is None:
            continue
        noise = _position_noise(t, q, period)
        for good in _clean(smooth.spoiled.max(axis=1)):
            if (good.stop - good.start) * kinematics.grid_period < TOLERANCES.shortest:
                continue
            at = (x[good] for x in (smooth.t - recording.t[0], smooth.q, smooth.v, smooth.a, smooth.tau[:, :n]))
            motion = Motion(robot, *at)
            velocity = None if recording.v is None else smooth.tau[good, n:]
            out.append(_stretch(model, recording, motion, velocity, noise))
    return out


def _mean_period(t: FloatArray, usual: float) -> float:
    """Mean step where none is lost: stamps are rounded, and a grid with a rounded step drifts through the samples."""
    whole = float(np.max(np.diff(t))) < 1.6 * usual
    return float((t[-1] - t[0]) / (len(t) - 1)) if whole else usual


def _position_noise(t: FloatArray, q: FloatArray, period: float) -> FloatArray:
    """Variance of raw positions (N, n) if their noise were white with the density that it has next above the band, shape (n,).

    Median of the power spectrum (Welch 1967) from a fifth of the rate on, where an arm does not move any more. What the
    interpolation to an even grid takes from noise there is seen on noise of variance 1. It holds the noise of stamps as well.
    """
    from scipy import signal  # takes longer to load than the rest of the package

    white = np.random.default_rng(0).standard_normal((len(t), 1))
    _, even = on_even_grid(t, np.hstack([q - q[0], white]), period)
    f, power = signal.welch(even, nperseg=min(len(even), _SEGMENT), detrend="linear", axis=0)
    level = np.median(power[(f > TOLERANCES.floor[0]) & (f < TOLERANCES.floor[1])], axis=0)
    return np.asarray(level[:-1] / level[-1])


def _clean(spoiled: FloatArray) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.concatenate([[1.0], spoiled > 0.0, [1.0]])))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _stretch(
    model: TorqueModel, recording: Recording, motion: Motion, published: FloatArray | None, noise: FloatArray
) -> Stretch:
    torque = model.torques_along(motion)
    some = np.unique(np.linspace(0, len(motion.t) - 1, _SAMPLED).astype(int))
    masses = model.mass_along(motion.q[some])
    own = np.einsum("kjj->kj", masses)
    total = masses + np.diag(model.armature())
    return Stretch(
        name=recording.name,
        motion=motion.with_torques(torque.link, torque.total),
        model=torque.total,
        smooth=torque.total - torque.jumps,
        published=published,
        mass=np.mean(total**2, axis=0),
        inertia=np.stack([own.mean(axis=0), own.std(axis=0)]),
        position_noise=noise,
        raw_period=_mean_period(recording.t, recording.period),
    )
