"""Filtered rows of the equation from a whole recording, for least squares over all of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sysid_ros.effects import Effect, Motion
from sysid_ros.exceptions import DataError
from sysid_ros.floating.feet_along import STANDS, FeetAlong
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.leg_priors import DRY, standing_torque
from sysid_ros.floating.sticking import without_sticking
from sysid_ros.identification.bag_sums import BagRows, BoolArray, space_for
from sysid_ros.identification.tolerances import TOL
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray, Measurement
from sysid_ros.signals.cutoff import default_cutoff
from sysid_ros.signals.floating_motion import contacts_at, smooth_stretch
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.signals.zero_phase import GaussianLowPass, KinematicFilter, SmoothMotion
from sysid_ros.torque.torque_model import TorqueModel

__all__ = ["FORMS", "BagRows", "BoolArray", "SmoothRecording", "collect_rows"]

FORMS = ("acceleration", "momentum")

_CHUNK = 256
"""Rows of the links' columns worked out at once: theirs alone are too many for a whole recording."""


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

    A robot on legs has the rows of :class:`.FeetAlong`: before the low-pass, both sides are multiplied by P.

    Attributes:
        name: for messages. robot: the arm, or the robot on its floating base. form: of the equation.
        start: the first stamp [s]. stretches: smooth motion without a gap. middles: indices of the rows in each of them.
        low_pass: F. period: time between rows [s]. cutoff_hz: of F [Hz].
        feet: of a robot on legs, along each stretch. setup: by which IMU and feet have been corrected.
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
    feet: tuple[FeetAlong, ...] = ()
    setup: TrunkSetup | None = None
    _motions: dict[int, Motion] = field(default_factory=dict, repr=False, compare=False)
    _of_links: dict[tuple[str, ...] | None, FloatArray] = field(default_factory=dict, repr=False, compare=False)

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
        base: FloatingBase | None = None,
        setup: TrunkSetup | None = None,
        known: TorqueModel | None = None,
        stands: float = STANDS[0],
    ) -> SmoothRecording:
        """Filter a recording. Nothing is taken across a gap longer than ``max_gap`` [s] or across time that runs back.

        Args:
            cutoff_hz: [Hz]; 0 for what the rate allows. form: one of :data:`FORMS`.
            measured_velocity: take the velocity of the messages where there is one.
            spoiled: values that must not be fitted, shape of the recording's arrays; rows that hold any of them do not count.
            base: of a robot on legs, whose recording has a trunk. setup: what is known of its IMU and feet. known: what is of
                its torques, from which it follows when a foot is in the air; None: the URDF's links. stands: see
                :data:`.feet_along.STANDS`.

        Raises:
            DataError: the recording is too short to leave a row.
        """
        setup = setup or TrunkSetup()
        period = recording.period
        cutoff = cutoff_hz or default_cutoff(1.0 / max(period, 1e-9))
        stretches: list[SmoothMotion] = []
        reported: list[FloatArray | None] = []
        if period > 0.0:
            kinematics = KinematicFilter(period, cutoff)
            for part in recording.stretches(max_gap):
                if part.stop - part.start <= 2 * kinematics.half:
                    continue
                whole = recording.at(part)
                bad = None if spoiled is None else spoiled[part]
                smooth = smooth_stretch(kinematics, whole, measured_velocity, bad, setup if base else None)
                if smooth is not None:
                    stretches.append(smooth)
                    reported.append(contacts_at(whole.t, whole.trunk, smooth.t) if whole.trunk else None)
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
        along = zip(stretches, reported, strict=True) if base else ()
        ringing = 1.0 / (3.0 * cutoff)  # near contacts the filter of the kinematics rings at the edge of its band
        feet = [FeetAlong.of(base, x, ringing, setup.radius, _torque_of(known, x), r, stands) for x, r in along] if base else []
        whole_robot, filtered = robot if base is None else base.robot, (tuple(stretches), tuple(middles), low_pass)
        return cls(name, whole_robot, form, start, *filtered, every * grid_period, cutoff, tuple(feet), setup)

    @property
    def count(self) -> int:
        """Number of rows."""
        return sum(len(m) for m in self.middles)

    def every(self, step: int) -> SmoothRecording:
        """The same with each of so many rows."""
        return replace(self, middles=tuple(middle[::step] for middle in self.middles), period=step * self.period, _of_links={})

    def rows(self, model: TorqueModel, slow_part: float = TOL.slow_part) -> BagRows:
        """Rows of the equation for a model's free effects; of a joint those count of which less than ``slow_part`` is slow."""
        n, count = self.robot.n, self.count
        Y = space_for(count, n, model.p)
        for effect, where in zip(model.free, model.slices, strict=True):
            self.fill(effect, Y[:, :, where])
        t, y, tau, slow, q, v, a = np.empty(count), *(np.empty((count, n)) for _ in range(6))
        for smooth, middle, rows in self._parts():
            t[rows] = smooth.t[middle]
            q[rows], v[rows], a[rows] = smooth.q[middle], smooth.v[middle], smooth.a[middle]
            left = smooth.tau - model.torque_along(self._motion(smooth, slice(0, len(smooth.t))))
            sides = np.hstack([self._projected(smooth, left), self._projected(smooth, smooth.tau), self._doubtful(smooth)])
            filtered = np.empty((len(middle), 3 * n))
            self._smooth(sides, None, middle, filtered)
            y[rows], tau[rows], slow[rows] = filtered[:, :n], filtered[:, n : 2 * n], filtered[:, 2 * n :]
        moving = slow < slow_part
        if self.feet:
            self._settle(model, Y, y)
            Y[~moving], y[~moving], tau[~moving] = 0.0, 0.0, 0.0
            rubs = np.full(n - FREE, DRY * standing_torque(float(self.robot.pi[::10].sum())))
            for smooth, middle, rows in self._parts():
                hidden, lever = self._sticking(smooth, middle, rubs)
                without_sticking(hidden, lever, self.period, Y[rows], y[rows], tau[rows])
        return BagRows(self.name, t, self.period, Y, y, tau, moving, q, v, a, self.cutoff_hz, bool(self.feet))

    def _settle(self, model: TorqueModel, Y: FloatArray, y: FloatArray) -> None:
        """What IMU and feet have been corrected by already counts as a torque again, so that their parameters are whole."""
        for effect, where in zip(model.free, model.slices, strict=True):
            known = effect.of_setup(self.setup) if self.setup else None
            if known is not None:
                y += Y[:, :, where] @ known

    def _sticking(self, smooth: SmoothMotion, middle: NDArray[np.intp], rubs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What dry friction, shape (n - 6,) [N m], does to the filtered rows of the whole robot at joints that stand, and at all,
        shape (N, 6, n - 6) each."""
        feet = self._feet_of(smooth)
        assert feet is not None
        stands = np.maximum(1.0 - np.abs(smooth.v[:, FREE:]) / TOL.slow, 0.0)
        lever = feet.matrix * (rubs * feet.trusted[:, None])[:, None, :]
        both = np.stack([lever * stands[:, None, :], lever], axis=1).reshape(len(smooth.t), -1)
        out = np.empty((len(middle), both.shape[1]))
        self._smooth(both, None, middle, out)
        hidden, lever = np.moveaxis(out.reshape(len(middle), 2, FREE, -1), 1, 0)
        return hidden, lever

    def _doubtful(self, smooth: SmoothMotion) -> FloatArray:
        """How doubtful each value is, shape (M, n): 1 where a joint stands, 10 where it must not be used."""
        limit = np.where(self.robot.is_prismatic, TOL.slow_slide, TOL.slow)
        standing = np.maximum(1.0 - np.abs(smooth.v) / limit, 0.0)
        feet = self._feet_of(smooth)
        if feet is not None:
            standing[:, :FREE] = 0.0
            standing = np.maximum(standing, feet.unusable)
            standing[:, :FREE] *= TOL.slow_part / TOL.off_ground
        return np.maximum(standing, smooth.spoiled)

    def _feet_of(self, smooth: SmoothMotion) -> FeetAlong | None:
        return next((f for f, s in zip(self.feet, self.stretches, strict=True) if s is smooth), None) if self.feet else None

    def _projected(self, smooth: SmoothMotion, values: FloatArray, where: slice = slice(None)) -> FloatArray:
        """Values of all joints along a stretch, (M, n, ...), as rows that are free of the forces on the feet."""
        feet = self._feet_of(smooth)
        return values if feet is None else feet.project(values, where)

    def fill(self, effect: Effect, out: FloatArray) -> None:
        """Write the filtered columns of an effect into ``out``, shape (N, n, p). Those of the links are kept."""
        key = effect.joint_names if effect.replaces_links and effect.robot is self.robot else None
        if key in self._of_links:
            out[:] = self._of_links[key]
            return
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
        if key is not None:
            self._of_links[key] = out.copy()

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
        columns = self._projected(smooth, columns, where)
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
        feet = self._feet_of(s)
        if feet is None and where == slice(0, len(s.t)):
            if id(s) not in self._motions:
                # kept with the torque of its links, which each setting of a knob needs again
                self._motions[id(s)] = Motion(self.robot, s.t - self.start, s.q, s.v, s.a, s.tau)
            return self._motions[id(s)]
        drive = None if feet is None else feet.drive[where]
        motion = Motion(self.robot, s.t[where] - self.start, s.q[where], s.v[where], s.a[where], s.tau[where], drive_torque=drive)
        motion.by_radius = None if feet is None else feet.by_radius[where]
        return motion


def _torque_of(known: TorqueModel | None, x: SmoothMotion) -> FloatArray | None:
    """The torque along a stretch of what is known, shape (M, n)."""
    return None if known is None else known.torque_along(Motion(known.robot, x.t, x.q, x.v, x.a, x.tau))
