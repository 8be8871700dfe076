"""Feasibility: whether a motion keeps all limits, millisecond by millisecond, and which of them leaves no motion at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.excitation.motion_limits import MotionLimits
from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.robot.collision_model import CollisionModel
from sysid_ros.sample import FloatArray

_POSTURES = 1000


@dataclass(frozen=True, slots=True)
class Use:
    """What a motion uses of its limits.

    Attributes:
        limits: largest part of each limit, shape (4, n), in the order of :data:`.motion_limits.KINDS`.
        room: least distance of each pair of links less what it must keep, shape (P,) [m]; exact for the pair with the least, for
            others of the times that had to be looked at.
    """

    limits: FloatArray
    room: FloatArray

    @property
    def feasible(self) -> bool:
        """All limits are kept; a ten thousandth is left for the rounding of what is written."""
        return bool(np.all(self.limits <= 1.0 - TOLERANCES.rounding) and np.all(self.room >= 0.0))


class Sampled(Protocol):
    """A motion that can be looked at."""

    def grid(self, step: float, one_period: bool = False) -> FloatArray:
        """Times ``step`` apart [s]."""

    def sample(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and acceleration, shape (len(t), n) each."""


class Feasibility:
    """Checks motions against limits and collisions.

    Args:
        limits: of position, velocity, acceleration and torque. collision: shapes; None: there are none to check.
    """

    def __init__(self, limits: MotionLimits, collision: CollisionModel | None = None) -> None:
        self.limits = limits
        self.collision = collision if collision is not None and collision.pairs else None

    def use(self, trajectory: Sampled, step: float = TOLERANCES.step) -> Use:
        """What a motion uses, at times ``step`` [s] apart over one period, which the others repeat."""
        q, v, a = trajectory.sample(trajectory.grid(step, one_period=True))
        limits = np.abs(self.limits.use(q, v, a, self.limits.torque(q, v, a))).max(axis=1)
        return Use(limits, self._least_room(q, np.abs(v).max(axis=0), step, stop=False))

    def keeps(self, trajectory: Sampled) -> bool:
        """All limits are kept at times 1 ms apart; fast where they are not.

        Between times at which no pair of links can have come together, collisions need no look.
        """
        q, v, a = trajectory.sample(trajectory.grid(TOLERANCES.step, one_period=True))
        quick = slice(None, None, 20)
        if np.abs(self.limits.use(q, v, a, np.zeros_like(q))).max() > 1.0 - TOLERANCES.rounding:
            return False
        if not self._torque_kept(q[quick], v[quick], a[quick]):
            return False
        room = self._least_room(q, np.abs(v).max(axis=0), TOLERANCES.step, stop=True)
        return bool(np.all(room >= 0.0)) and self._torque_kept(q, v, a)

    def _torque_kept(self, q: FloatArray, v: FloatArray, a: FloatArray) -> bool:
        return bool(np.abs(self.limits.torque(q, v, a) / self.limits.effort).max() <= 1.0 - TOLERANCES.rounding)

    def _least_room(self, q: FloatArray, speed: FloatArray, step: float, stop: bool) -> FloatArray:
        """Least room of each pair, shape (P,) [m], leaving out times at which none can have less than what was seen before.

        Args:
            speed: no joint is faster, shape (n,). step: time between the postures q, shape (N, n) [s].
            stop: only whether the room stays above 0 is asked, and the search ends where it does not.
        """
        if self.collision is None:
            return np.zeros(0)
        rates = np.maximum(self.collision.approach_rates(speed), 1e-9)
        least = np.full(len(rates), np.inf)
        k = 0
        while k < len(q):
            room = self.collision.room(q[k])
            least = np.minimum(least, room)
            bottom = 0.0 if stop else float(least.min())
            if stop and np.any(room < 0.0):
                break
            k += max(1, int(np.min((room - bottom) / rates) / step))
        return least

    def postures(self, random: np.random.Generator, count: int) -> FloatArray:
        """Random postures in which the robot can stand, shape (count, n) [rad or m].

        Raises:
            DataError: there is none; the message says what prevents it.
        """
        found: list[FloatArray] = []
        uses, rooms = [], []
        for _ in range(max(_POSTURES, 50 * count)):
            q = random.uniform(self.limits.lower, self.limits.upper)
            use = self.at_rest(q)
            uses.append(use.limits[3])
            rooms.append(use.room)
            if use.feasible:
                found.append(q)
                if len(found) == count:
                    break
        if not found:
            raise DataError(self._refusal(np.array(uses), np.array(rooms)))
        return np.array([found[i % len(found)] for i in range(count)])

    def at_rest(self, q: FloatArray) -> Use:
        """What standing still in a posture uses."""
        zero = np.zeros((1, self.limits.robot.n))
        limits = np.abs(self.limits.use(q[None], zero, zero, self.limits.torque(q[None], zero, zero)))[:, 0]
        return Use(limits, self.collision.room(q) if self.collision else np.zeros(0))

    def require_posture(self, q: FloatArray) -> None:
        """Raise where the robot can't stand in a posture that was asked for.

        Raises:
            DataError: a limit is violated there; the message names it.
        """
        robot, use = self.limits.robot, self.at_rest(q)
        for i, name in enumerate(robot.joint_names):
            if use.limits[0, i] > 1.0 - TOLERANCES.rounding:
                raise DataError(
                    f"the start posture has joint {name} at {q[i]:g}; {self.limits.lower[i]:.4g} to {self.limits.upper[i]:.4g} "
                    "is allowed there. Choose another start, or let the motion use more of the joint's range."
                )
            if use.limits[3, i] > 1.0:
                raise DataError(
                    f"holding the start posture takes {use.limits[3, i] * self.limits.effort[i]:.4g} N m of joint {name}; "
                    f"{self.limits.effort[i]:.4g} N m is allowed. Choose another start."
                )
        if self.collision is not None and np.any(use.room < 0.0):
            worst = int(np.argmin(use.room))
            raise DataError(f"in the start posture, {self._violated(worst, float(use.room[worst]))}. Choose another start.")

    def _violated(self, pair: int, room: float) -> str:
        assert self.collision is not None
        first, second = self.collision.pairs[pair]
        keep = self.collision.clearance[pair]
        distance = 1e3 * (room + keep)
        if distance < 0.0:
            return f"{first} and {second} overlap by {-distance:.0f} mm; they must keep {1e3 * keep:.0f} mm"
        return f"{first} and {second} are {distance:.0f} mm apart; they must keep {1e3 * keep:.0f} mm"

    def _refusal(self, uses: FloatArray, rooms: FloatArray) -> str:
        """Which limit prevents any motion, from postures that all fail."""
        robot, effort = self.limits.robot, self.limits.effort
        start = f"no motion is feasible: the robot can stand in none of {len(uses)} random postures within its position limits. "
        least = uses.min(axis=0)
        if np.any(least > 1.0):
            j = int(np.argmax(least))
            return (
                f"{start}Joint {robot.joint_names[j]} needs at least {least[j] * effort[j]:.4g} N m to hold still, and "
                f"{effort[j]:.4g} N m is allowed. Allow more of its effort limit, or correct the effort limit or the masses "
                "in the URDF."
            )
        best = rooms.max(axis=0) if rooms.size else np.zeros(0)
        if np.any(best < 0.0):
            k = int(np.argmin(best))
            return (
                f"{start}In the best of them, {self._violated(k, float(best[k]))}. Lower the floor or the clearance, or leave "
                "this pair out of the check."
            )
        torque = (uses > 1.0).mean(axis=0)
        near = (rooms < 0.0).mean(axis=0) if rooms.size else np.zeros(0)
        j, k = int(np.argmax(torque)), int(np.argmax(near)) if near.size else -1
        if k < 0 or torque[j] >= near[k]:
            return (
                f"{start}Most often ({100 * torque[j]:.0f} %) joint {robot.joint_names[j]} can't hold still with the "
                f"{effort[j]:.4g} N m that is allowed. Allow more of its effort limit, or correct the URDF."
            )
        assert self.collision is not None
        return (
            f"{start}Most often ({100 * near[k]:.0f} %) {' and '.join(self.collision.pairs[k])} come nearer than "
            f"{1e3 * self.collision.clearance[k]:.0f} mm. Lower the floor or the clearance, or leave this pair out of the check."
        )
