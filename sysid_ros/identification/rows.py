"""Filtered rows of the equation from a whole recording, for least squares over all of it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.effects import Effect, Motion
from sysid_ros.exceptions import DataError
from sysid_ros.identification.tolerances import TOL
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.signals.cutoff import default_cutoff
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.zero_phase import GaussianLowPass, KinematicFilter, SmoothMotion
from sysid_ros.torque.torque_model import TorqueModel

BoolArray = NDArray[np.bool_]

FORMS = ("acceleration", "momentum")

_CHUNK = 256
"""Rows of the links' columns worked out at once: theirs alone are too many for a whole recording."""

_IN_MEMORY = 400e6
"""Bytes of one recording's rows above which they are kept in a temporary file."""


@dataclass(frozen=True, slots=True)
class BagRows:
    """Rows of one recording: ``y = Y theta + noise``.

    Attributes:
        name: where they come from. t: shape (N,) [s]. period: time between rows [s].
        Y: shape (N, n, p). y: what the known effects leave of the torque, shape (N, n) [N m]. tau: measured torque, shape (N,
            n) [N m].
        moving: rows of joints whose friction is determined, shape (N, n), bool.
        q, v, a: smooth motion at the rows, shape (N, n). cutoff_hz: of the low-pass that both sides went through [Hz].
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
    """The rows of one run for one model, see :class:`SmoothRecording`.

    Args:
        model: known and free effects. measurements: of one run. name: for messages. cutoff_hz: [Hz]; 0 for what the rate allows.
        max_gap, form, measured_velocity, spoiled: as of :meth:`SmoothRecording.of`.

    Raises:
        DataError: the recording is too short to leave a row.
    """
    recording = measurements
    if not isinstance(recording, Recording):
        try:
            recording = Recording.from_measurements(name, recording)
        except DataError as error:
            raise DataError(f"{error} Record at least 10 s.") from None
    return SmoothRecording.of(model.robot, recording, name, cutoff_hz, max_gap, form, measured_velocity, spoiled).rows(model)


@dataclass(frozen=True, slots=True)
class SmoothRecording:
    """A recording after the filter of its kinematics, from which rows follow for any model.

    Both sides of the equation go through the same zero-phase low-pass F, four rows a period of its cut-off. With ``form``
    "acceleration", from smooth q, v and a: ``F(tau) = F(Y(q, v, a)) theta``. With "momentum", without any acceleration
    (Middleton, Goodwin 1988)::

        tau = d/dt(p) - C' v + g,   p = M(q) v = Y_p theta,   g - C' v = Y_r theta:   F(tau) = (dF/dt(Y_p) + F(Y_r)) theta

    where the derivative falls on the low-pass. Both are the same equation; the second bears noisier positions.

    The regressor is worked out at the rate of :class:`KinematicFilter`, several times above all that the low-pass lets through,
    and only filtered rows are kept.

    Attributes:
        name: for messages. robot: the arm. form: of the equation.
        start: the first stamp [s]. stretches: smooth motion without a gap. middles: indices of the rows in each of them.
        low_pass: F. period: time between rows [s]. cutoff_hz: of F [Hz].
    """

    name: str
    robot: RobotModel
    form: str
    start: float
    stretches: tuple[SmoothMotion, ...]
    middles: tuple[NDArray[np.intp], ...]
    low_pass: GaussianLowPass
    period: float
    cutoff_hz: float

    @classmethod
    def of(
        cls,
        robot: RobotModel,
        recording: Recording,
        name: str,
        cutoff_hz: float = 0.0,
        max_gap: float = 0.1,
        form: str = "acceleration",
        measured_velocity: bool = False,
        spoiled: BoolArray | None = None,
    ) -> SmoothRecording:
        """Filter a recording. Nothing is taken across a gap longer than ``max_gap`` [s] or across time that runs back.

        Args:
            cutoff_hz: [Hz]; 0 for what the rate allows. form: one of :data:`FORMS`.
            measured_velocity: take the velocity of the messages where there is one.
            spoiled: values that must not be fitted, shape of the recording's arrays; rows that hold any of them do not count.

        Raises:
            DataError: the recording is too short to leave a row.
        """
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
        seconds = sum(len(m) for m in middles) * every * grid_period
        if seconds < TOL.shortest_recording:
            raise DataError(
                f"{name}: {seconds:.1f} s are left once the filters are full; {TOL.shortest_recording:g} s are the least "
                "that can be used. Record at least 10 s without gaps."
            )
        start = float(recording.t[0])
        return cls(name, robot, form, start, tuple(stretches), tuple(middles), low_pass, every * grid_period, cutoff)

    @property
    def count(self) -> int:
        """Number of rows."""
        return sum(len(m) for m in self.middles)

    def rows(self, model: TorqueModel) -> BagRows:
        """Rows of the equation for a model's free effects."""
        n, count = self.robot.n, self.count
        Y = _space(count, n, model.p)
        for effect, where in zip(model.free, model.slices, strict=True):
            self.fill(effect, Y[:, :, where])
        t, y, tau, slow, q, v, a = np.empty(count), *(np.empty((count, n)) for _ in range(6))
        limit = np.where(self.robot.is_prismatic, TOL.slow_slide, TOL.slow)
        for smooth, middle, rows in self._parts():
            t[rows] = smooth.t[middle]
            q[rows], v[rows], a[rows] = smooth.q[middle], smooth.v[middle], smooth.a[middle]
            standing = np.maximum(np.maximum(1.0 - np.abs(smooth.v) / limit, 0.0), smooth.spoiled)
            left = smooth.tau - model.torque_along(self._motion(smooth, slice(None)))
            sides = np.hstack([left, smooth.tau, standing])
            filtered = np.empty((len(middle), 3 * n))
            self._smooth(sides, None, middle, filtered)
            y[rows], tau[rows], slow[rows] = filtered[:, :n], filtered[:, n : 2 * n], filtered[:, 2 * n :]
        return BagRows(self.name, t, self.period, Y, y, tau, slow < TOL.slow_part, q, v, a, self.cutoff_hz)

    def fill(self, effect: Effect, out: FloatArray) -> None:
        """Write the filtered columns of an effect into ``out``, shape (N, n, p)."""
        for smooth, middle, rows in self._parts():
            # an effect with a memory needs its recording from the start; the links have none
            size = _CHUNK if effect.replaces_links else len(middle)
            for first in range(0, len(middle), size):
                chunk = middle[first : first + size]
                begin, end = int(chunk[0]) - self.low_pass.half, int(chunk[-1]) + self.low_pass.half + 1
                if not effect.replaces_links:
                    begin, end = 0, len(smooth.t)
                columns, momentum = self._columns(effect, smooth, slice(begin, end))
                at = slice(rows.start + first, rows.start + first + len(chunk))
                filtered = np.empty((len(chunk), self.robot.n * effect.p))
                self._smooth(columns, momentum, chunk - begin, filtered)
                out[at] = filtered.reshape(len(chunk), self.robot.n, effect.p)

    def _parts(self) -> Iterator[tuple[SmoothMotion, NDArray[np.intp], slice]]:
        """Each stretch, its rows' indices in it, and where these rows stand among all."""
        at = 0
        for smooth, middle in zip(self.stretches, self.middles, strict=True):
            yield smooth, middle, slice(at, at + len(middle))
            at += len(middle)

    def _columns(self, effect: Effect, smooth: SmoothMotion, where: slice) -> tuple[FloatArray, FloatArray | None]:
        """Columns, shape (M, n p), and those of the momentum, or None where accelerations are used."""
        motion = self._motion(smooth, where)
        pair = effect.momentum_columns_along(motion) if self.form == "momentum" else None
        momentum, columns = (None, effect.columns_along(motion)) if pair is None else pair
        flat = columns.reshape(len(motion.t), -1)
        return flat, None if momentum is None else momentum.reshape(len(motion.t), -1)

    def _smooth(self, values: FloatArray, momentum: FloatArray | None, at: NDArray[np.intp], out: FloatArray) -> None:
        """Low-pass values, and the derivative of others, at some indices: shape (M, c) to (len(at), c)."""
        half = self.low_pass.half
        for k, m in enumerate(at):
            window = slice(int(m) - half, int(m) + half + 1)
            out[k] = self.low_pass.kernel @ values[window]
            if momentum is not None:
                out[k] += self.low_pass.slope @ momentum[window]

    def _motion(self, s: SmoothMotion, where: slice) -> Motion:
        return Motion(self.robot, s.t[where] - self.start, s.q[where], s.v[where], s.a[where], s.tau[where])


def _space(count: int, n: int, p: int) -> FloatArray:
    if count * n * p * 8 <= _IN_MEMORY:
        return np.empty((count, n, p))
    with tempfile.TemporaryFile(prefix="sysid_rows_") as file:
        return np.memmap(file, dtype=np.float64, mode="w+", shape=(count, n, p))
