"""Filtered rows of the equation from a whole recording, for least squares over all of it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.effects import LinkInertia, Motion, RotorInertia
from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.signals.causal_derivative import default_cutoff
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.zero_phase import GaussianLowPass, KinematicFilter, SmoothMotion
from sysid_ros.torque.torque_model import TorqueModel

BoolArray = NDArray[np.bool_]

FORMS = ("acceleration", "momentum")

_SLOW, _SLOW_SLIDE = 0.06, 0.03
"""Speed of a joint below which dry friction is not what a model says [rad/s], [m/s]."""

_SLOW_PART = 0.1
"""Part of a row that may come from a joint hardly moving, where dry friction leaves its torque undetermined."""

_SHORTEST = 2.0
"""Rows of a recording must cover at least this [s]."""

_CHUNK = 256
"""Rows worked out at once."""

_IN_MEMORY = 400e6
"""Bytes of one recording's rows above which they are kept in a temporary file."""


@dataclass(frozen=True, slots=True)
class BagRows:
    """Rows of one recording: ``y = Y theta + noise``.

    Attributes:
        name: where they come from.
        t: shape (N,) [s]. period: time between rows [s].
        Y: shape (N, n, p). y: what the known effects leave of the torque, shape (N, n) [N m]. tau: measured torque, shape (N,
            n) [N m].
        moving: rows of joints whose friction is determined, shape (N, n), bool.
        q, v, a: smooth motion at the rows, shape (N, n).
        cutoff_hz: of the low-pass that both sides went through [Hz].
    """

    name: str
    t: FloatArray
    period: float
    Y: FloatArray
    y: FloatArray
    tau: FloatArray
    moving: BoolArray
    q: FloatArray
    v: FloatArray
    a: FloatArray
    cutoff_hz: float

    @property
    def seconds(self) -> float:
        """Time that the rows cover [s]."""
        return len(self.t) * self.period

    def part(self, where: slice | BoolArray, name: str) -> BagRows:
        """Some of the rows, under another name."""
        Y, y, tau, q, v, a = (x[where] for x in (self.Y, self.y, self.tau, self.q, self.v, self.a))
        return BagRows(name, self.t[where], self.period, Y, y, tau, self.moving[where], q, v, a, self.cutoff_hz)


def collect_rows(
    model: TorqueModel,
    measurements: Recording | Iterable[Measurement],
    name: str,
    cutoff_hz: float = 0.0,
    max_gap: float = 0.1,
    form: str = "acceleration",
    measured_velocity: bool = False,
    spoiled: BoolArray | None = None,
) -> BagRows:
    """Both sides of the equation through the same zero-phase low-pass F, four rows a period of its cut-off.

    With ``form`` "acceleration", from smooth q, v and a: ``F(tau) = F(Y(q, v, a)) theta``. With "momentum", without any
    acceleration (Middleton, Goodwin 1988)::

        tau = d/dt(p) - C' v + g,   p = M(q) v = Y_p theta,   g - C' v = Y_r theta:   F(tau) = (dF/dt(Y_p) + F(Y_r)) theta

    where the derivative falls on the low-pass. Both are the same equation; the second bears noisier positions.

    The regressor is worked out at the rate of :class:`KinematicFilter`, several times above all that the low-pass lets through,
    and only filtered rows are kept. Nothing is taken across a gap longer than ``max_gap`` [s] or across time that runs back.

    Args:
        model: known and free effects. measurements: of one run. name: for messages. cutoff_hz: [Hz]; 0 for what the rate allows.
        measured_velocity: take the velocity of the messages where there is one.
        spoiled: values that must not be fitted, shape of the recording's arrays; rows that hold any of them do not count.

    Raises:
        DataError: the recording is too short to leave a row.
    """
    recording = measurements if isinstance(measurements, Recording) else Recording.from_measurements(name, measurements)
    period = recording.period
    cutoff = cutoff_hz or default_cutoff(1.0 / max(period, 1e-9))
    stretches: list[SmoothMotion] = []
    if period > 0.0:
        kinematics = KinematicFilter(period, cutoff)
        for part in recording.stretches(max_gap):
            t, q, tau = (x[part] for x in (recording.t, recording.q, recording.tau))
            v = recording.v[part] if measured_velocity and recording.v is not None else None
            bad = None if spoiled is None else spoiled[part]
            long_enough = part.stop - part.start > 2 * kinematics.half
            smooth = kinematics.apply(t, q, v, tau, bad) if long_enough else None
            if smooth is not None:
                stretches.append(smooth)
    grid_period = kinematics.grid_period if stretches else 0.25 / cutoff
    low_pass = GaussianLowPass(cutoff, grid_period)
    every = max(1, round(0.25 / cutoff / grid_period))
    middles = [np.arange(low_pass.half, len(s.t) - low_pass.half, every) for s in stretches]
    count, row_period = sum(len(m) for m in middles), every * grid_period
    if count * row_period < _SHORTEST:
        raise DataError(
            f"{name}: {count * row_period:.1f} s are left once the filters are full; {_SHORTEST:g} s are the least that can be "
            "used. Record at least 10 s without gaps."
        )
    n = model.robot.n
    Y = _space(count, n, model.p)
    t, y, tau, slow, q, v, a = np.empty(count), *(np.empty((count, n)) for _ in range(6))
    at = 0
    for smooth, middle in zip(stretches, middles, strict=True):
        rows = slice(at, at + len(middle))
        at += len(middle)
        t[rows] = smooth.t[middle]
        q[rows], v[rows], a[rows] = smooth.q[middle], smooth.v[middle], smooth.a[middle]
        _filter(model, smooth, middle, low_pass, form, Y[rows], y[rows], tau[rows], slow[rows])
    return BagRows(name, t, row_period, Y, y, tau, slow < _SLOW_PART, q, v, a, cutoff)


def _space(count: int, n: int, p: int) -> FloatArray:
    if count * n * p * 8 <= _IN_MEMORY:
        return np.empty((count, n, p))
    with tempfile.TemporaryFile(prefix="sysid_rows_") as file:
        return np.memmap(file, dtype=np.float64, mode="w+", shape=(count, n, p))


def _filter(
    model: TorqueModel,
    motion: SmoothMotion,
    middle: NDArray[np.intp],
    low_pass: GaussianLowPass,
    form: str,
    Y: FloatArray,
    y: FloatArray,
    tau: FloatArray,
    slow: FloatArray,
) -> None:
    n, half = model.robot.n, low_pass.half
    rest = motion.tau - _known(model, motion)
    limit = np.where(model.robot.is_prismatic, _SLOW_SLIDE, _SLOW)
    standing = np.maximum(np.maximum(1.0 - np.abs(motion.v) / limit, 0.0), motion.spoiled)
    beside = np.hstack([rest, motion.tau, standing])
    for first in range(0, len(middle), _CHUNK):
        chunk = middle[first : first + _CHUNK]
        begin, end = int(chunk[0]) - half, int(chunk[-1]) + half + 1
        columns, momentum = _columns(model, motion, slice(begin, end), form)
        flat = columns.reshape(end - begin, -1)
        flat_momentum = None if momentum is None else momentum.reshape(end - begin, -1)
        for k, m in enumerate(chunk):
            window = slice(int(m) - half - begin, int(m) + half + 1 - begin)
            row = low_pass.kernel @ flat[window]
            if flat_momentum is not None:
                row = row + low_pass.slope @ flat_momentum[window]
            Y[first + k] = row.reshape(n, -1)
            side = low_pass.kernel @ beside[int(m) - half : int(m) + half + 1]
            y[first + k], tau[first + k], slow[first + k] = side[:n], side[n : 2 * n], side[2 * n :]


def _known(model: TorqueModel, motion: SmoothMotion) -> FloatArray:
    return model.torque_along(_along(model, motion, slice(None)))


def _along(model: TorqueModel, motion: SmoothMotion, where: slice) -> Motion:
    return Motion(model.robot, motion.t[where], motion.q[where], motion.v[where], motion.a[where], motion.tau[where])


def _columns(model: TorqueModel, motion: SmoothMotion, where: slice, form: str) -> tuple[FloatArray, FloatArray | None]:
    """Columns of the free effects, shape (M, n, p), and those of the momentum, or None where accelerations are used."""
    part = _along(model, motion, where)
    columns = np.zeros((len(part.t), model.robot.n, model.p))
    if form == "acceleration":
        for effect, s in zip(model.free, model.slices, strict=True):
            columns[:, :, s] = effect.columns_along(part)
        return columns, None
    momentum = np.zeros_like(columns)
    for effect, s in zip(model.free, model.slices, strict=True):
        if isinstance(effect, LinkInertia):
            picked = [10 * int(j) + k for j in effect.joints for k in range(10)]
            for k in range(len(part.t)):
                of_momentum, of_rest = model.robot.momentum_regressors(part.q[k], part.v[k])
                momentum[k, :, s], columns[k, :, s] = of_momentum[:, picked], of_rest[:, picked]
        elif isinstance(effect, RotorInertia):
            momentum[:, effect.joints, np.arange(s.start, s.stop)] = part.v[:, effect.joints]
        else:
            columns[:, :, s] = effect.columns_along(part)
    return columns, momentum
