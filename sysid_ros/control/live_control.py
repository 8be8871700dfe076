"""LiveControl: a law on a running arm, with what keeps it from doing harm. The node without ROS."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.control.arm_torque import ArmTorque
from sysid_ros.control.control_settings import SafetySettings
from sysid_ros.control.controller import Reference, TrackingController
from sysid_ros.control.timed_motion import TimedMotion
from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray

_GRID = 0.01
_TOO_FAST = 1.5
"""Speed in parts of the URDF's limit from which something is wrong."""
_JITTER = 1.05
_TO_KNOW, _AVERAGE = 20, 200
"""States after which their period is known, and over which it is averaged."""
_YIELDING = 0.25
"""Damping of an arm that yields, in bandwidths of its law."""
_NEARLY = 1e-3
"""By which a limit may be exceeded between points, in radians or parts."""


class LiveControl:
    """Holds the arm where it stands, follows motions that it is given, and yields where something is wrong.

    Where a joint is too far from its motion or too fast, something holds it, or the loop swings up. Then the feedback is no help:
    the arm yields, its weight and that of the payload held, its motion damped, until :meth:`hold`.

    Args:
        law: the control law. arm: its model, whose limits hold. safety: see :class:`SafetySettings`.

    Attributes:
        yields: True from such a fault on until :meth:`hold`. following: True while a motion is under way.
        reference: what is wanted now, None before the first state. error: the last one, wanted minus measured, shape (n,).
        clipped: steps in which a torque was at its limit, by joint, shape (n,).
        trouble: why the last motion ended early or the arm yields, "" where neither is so.
    """

    def __init__(self, law: TrackingController, arm: ArmTorque, safety: SafetySettings) -> None:
        robot = arm.robot
        self.law, self.robot, self.safety, self._arm = law, robot, safety, arm
        self.following = self.yields = False
        self.reference: Reference | None = None
        self.error: FloatArray = np.zeros(robot.n)
        self.clipped = np.zeros(robot.n, dtype=int)
        self.trouble = ""
        self._period, self._states = 0.0, 0
        self._limit = safety.effort_limit_scale * robot.effort_limit
        self._motion: TimedMotion | None = None
        self._begin = 0.0
        self._last_t: float | None = None
        self._state: tuple[FloatArray, FloatArray] | None = None

    def forget(self) -> None:
        """Hold the arm where the next state finds it."""
        self.following = self.yields = False
        self.reference, self._motion, self._last_t, self._state = None, None, None, None

    def command(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Torques for the state at t, within the limits, shape (n,) [N m].

        Args:
            t: stamp of the state [s]. q, v: shape (n,) each.
        """
        period = 0.0 if self._last_t is None else t - self._last_t
        if self._last_t is None or not 0.0 < period <= self.safety.state_timeout:
            if self.following:
                self.trouble = f"there was no joint state for {period:.2f} s; the motion was given up"
            self._come_to_rest(t, q, v)
            period = 0.0
        if period > 0.0:
            self._states += 1
            self._period += (period - self._period) / min(self._states, _AVERAGE)
        self._last_t, self._state = t, (q, v)
        assert self._motion is not None
        self.reference = self._motion.at(t - self._begin)
        self.error = self.reference.q - q
        if self.following and t - self._begin >= self._motion.end:
            self.following = False
        if not self.yields and (fault := self._fault(v)):
            self.trouble, self.yields, self.following = fault, True, False
        if self.yields:
            self._motion, self._begin = TimedMotion.braking(q, np.zeros_like(q), self.safety.braking_time), t
            self.reference = self._motion.at(0.0)
            tau = self._yielding(q, v)
        else:
            tau = self.law.torque(q, v, self.reference, period)
        allowed = np.clip(tau, -self._limit, self._limit)
        self.clipped += allowed != tau
        return np.asarray(allowed)

    def _fault(self, v: FloatArray) -> str:
        far, fast = np.abs(self.error), np.abs(v) / self.robot.velocity_limit
        j, k = int(np.argmax(far)), int(np.argmax(fast))
        names, end = self.robot.joint_names, "The arm yields, its weight held, until ~/hold"
        # not >, so that NaN is a fault too
        if not far[j] <= self.safety.error_limit:
            limit = self.safety.error_limit
            return f"{names[j]} was {far[j]:.2f} from where it should be; {limit:g} is allowed (error_limit). {end}"
        if not fast[k] <= _TOO_FAST:
            return f"{names[k]} moved at {abs(v[k]):.1f} a second, {fast[k]:.1f} times what the URDF allows. {end}"
        if self._states > _TO_KNOW and not self._period <= _JITTER * self.law.feedback.delay:
            period, assumed = 1e3 * self._period, 1e3 * self.law.feedback.delay
            return (
                f"The joint states come every {period:.1f} ms; the gains are for a loop_delay of {assumed:g} ms. Set it to more. "
                f"{end}"
            )
        return ""

    def _yielding(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """What holds the weight and damps, shape (n,)."""
        still = np.zeros(self.robot.n)
        columns, rest = self._arm.split(q, still, still, still, still)
        damping = _YIELDING * self.law.feedback.bandwidth * self._arm.inertial_torque(q, v, np.zeros(10))
        return np.asarray(rest + columns @ self.law.payload - damping)

    def hold(self) -> None:
        """Bring the arm to rest now, along the motion that it has; where it yields, hold it where it is."""
        if self.reference is not None and self._last_t is not None:
            self._come_to_rest(self._last_t, self.reference.q, self.reference.v)
            self.yields, self.trouble = False, ""

    def torque_at_rest(self) -> FloatArray | None:
        """Torque that would hold the last known posture, for a robot that tells no states any more; None before the first."""
        if self._state is None:
            return None
        tau = self._yielding(self._state[0], np.zeros(self.robot.n))
        return np.asarray(np.clip(tau, -self._limit, self._limit))

    def follow(
        self, joint_names: Sequence[str], t: FloatArray, q: FloatArray, v: FloatArray | None, a: FloatArray | None
    ) -> None:
        """Begin a motion now, in place of the one under way. A first point later than 0 is reached from where the arm is wanted
        now.

        Args:
            joint_names: of the columns, each joint of the robot once. t, q, v, a: as of :class:`TimedMotion`.

        Raises:
            DataError: what is wrong with it; nothing has changed then.
        """
        if self.reference is None or self._last_t is None:
            raise DataError("there is no joint state yet, so where the motion would begin is not known. Send it again later.")
        if self.yields:
            raise DataError(f"the arm yields: {self.trouble}. Call ~/hold first.")
        if sorted(joint_names) != sorted(self.robot.joint_names):
            raise DataError(
                f"the motion is of joints {', '.join(joint_names)}; it must be of {', '.join(self.robot.joint_names)}."
            )
        order = [list(joint_names).index(name) for name in self.robot.joint_names]
        q = q[:, order]
        v, a = (None if x is None else x[:, order] for x in (v, a))
        if len(t) and not t[0] >= 0.0:
            raise DataError(f"the motion begins at {t[0]:g} s; it must begin at 0 or later.")
        now = self.reference
        if len(t) and t[0] > 0.0:
            t, q = np.concatenate([[0.0], t]), np.vstack([now.q, q])
            v = None if v is None else np.vstack([now.v, v])
            a = None if a is None else np.vstack([now.a, a])
        motion = TimedMotion(t, q, v, a)
        self._require_allowed(motion, q[0] - now.q)
        self._motion, self._begin, self.following, self.trouble = motion, self._last_t, True, ""

    def _require_allowed(self, motion: TimedMotion, jump: FloatArray) -> None:
        names, robot = self.robot.joint_names, self.robot
        far = int(np.argmax(np.abs(jump)))
        if abs(jump[far]) > self.safety.start_tolerance:
            raise DataError(
                f"the motion begins {abs(jump[far]):.3f} from where {names[far]} is wanted; {self.safety.start_tolerance:g} is "
                "allowed (start_tolerance). Give its first point a later time, in which the arm comes there."
            )
        t, q, v = motion.along(_GRID)
        if np.abs(v[-1]).max() > _NEARLY:
            worst = int(np.argmax(np.abs(v[-1])))
            raise DataError(f"the motion ends with {names[worst]} at {v[-1, worst]:.3f} a second; it must end at rest.")
        beyond = np.maximum(q - robot.position_upper, robot.position_lower - q).max(axis=0)
        if beyond.max() > _NEARLY:
            worst = int(np.argmax(beyond))
            raise DataError(
                f"the motion takes {names[worst]} from {q[:, worst].min():.3f} to {q[:, worst].max():.3f}; the URDF allows "
                f"{robot.position_lower[worst]:.3f} to {robot.position_upper[worst]:.3f}."
            )
        ratio = np.abs(v).max(axis=0) / robot.velocity_limit
        if ratio.max() > 1.0 + _NEARLY:
            worst = int(np.argmax(ratio))
            when = t[np.argmax(np.abs(v[:, worst]))]
            raise DataError(
                f"the motion moves {names[worst]} at {np.abs(v[:, worst]).max():.2f} a second after {when:.2f} s; the URDF "
                f"allows {robot.velocity_limit[worst]:.2f}. Give it more time."
            )

    def _come_to_rest(self, t: float, q: FloatArray, v: FloatArray) -> None:
        self._motion, self._begin, self.following = TimedMotion.braking(q, v, self.safety.braking_time), t, False
        self.reference = self._motion.at(0.0)
