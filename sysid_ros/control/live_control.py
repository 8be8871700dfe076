"""LiveControl: a law on a running arm, with what keeps it from doing harm. The node without ROS."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.control.allowed_motion import require_allowed
from sysid_ros.control.arm_torque import ArmTorque
from sysid_ros.control.control_settings import SafetySettings
from sysid_ros.control.controller import Reference, TrackingController
from sysid_ros.control.loop_faults import TOO_FAST, loop_fault
from sysid_ros.control.refined_payload import RefinedPayload
from sysid_ros.control.state_age import StatePeriod
from sysid_ros.control.timed_motion import TimedMotion
from sysid_ros.control.unmodelled_torque import ToldPayload, UnmodelledTorque
from sysid_ros.control.wanted_motion import WantedMotion, shortly
from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray

_YIELDING = 0.5
"""Bandwidth of an arm that yields, in those of its law, where its states come fast enough for that."""
_GIVES_WAY = 0.05
"""From its posture an arm that yields is pulled back by no more than a distance of so much would do [rad or m]."""
_STAYS_FAST = 0.1
"""For so long may an arm that yields be too fast [s]."""
_COAST = 0.03
"""So far may a joint go without states along the motion that it has, before it is brought to rest [rad or m]."""
_NEAR = 0.1
"""Error, in parts of ``error_limit``, up to which what the law learns from it is no stranger's force."""
_OLDEST = 2.0
"""Age of a state in delays of the loop from which it counts as lost: with the delay itself that makes three, and from pi on what
is damped as firmly as :class:`.Feedback` allows swings up."""
_RESTS = 0.02
"""Speed below which a joint stands [rad/s or m/s]."""


class LiveControl:
    """Holds the arm where it stands, follows motions that it is given, and yields where something is wrong.

    Where a joint is too far from its motion or too fast, something holds it, or the loop swings up. Then the feedback is no help:
    the arm yields until :meth:`hold`: its weight and that of the payload are held, its motion is damped, and it stays where it is
    pushed to. Where states stay away, :meth:`without_states` brings it to rest on the model alone.

    Args:
        law: the control law. arm: its model, whose limits hold. safety: see :class:`SafetySettings`.
        refinement: refines the payload that is told by the torques that are sent, and finds when they act; None: neither.

    Attributes:
        yields: True from such a fault on until :meth:`hold`. given_up: True where that makes it worse: nothing should be sent.
        following: True while a motion is under way.
        reference: what is wanted now, None before the first state. error: the last one, wanted minus measured, shape (n,).
        clipped: steps in which a torque was at its limit, by joint, shape (n,).
        trouble: why the last motion ended early or the arm yields, "" where neither is so.
        unmodelled: what the feedback adds to the model. told: the payload that was told last.
    """

    def __init__(
        self, law: TrackingController, arm: ArmTorque, safety: SafetySettings, refinement: RefinedPayload | None = None
    ) -> None:
        robot, self.refinement = arm.robot, refinement
        self.law, self.robot, self.safety, self._arm = law, robot, safety, arm
        self.following = self.yields = self.given_up = False
        self.reference: Reference | None = None
        self.error, self.clipped, self.trouble = np.zeros(robot.n), np.zeros(robot.n, dtype=int), ""
        self._period, self._fast_since = StatePeriod(), 0.0
        self._limit = safety.effort_limit_scale * robot.effort_limit
        self.unmodelled, self.told = UnmodelledTorque(robot.effort_limit), ToldPayload()
        self._sent: FloatArray | None = None
        self._calm = law.payload
        self._braking: tuple[TimedMotion, float] | None = None
        self._wanted: WantedMotion | None = None
        self._last_t: float | None = None
        self._state: tuple[FloatArray, FloatArray] | None = None

    @property
    def motion(self) -> object:
        """The motion under way or at its end: another object for every new one, and where the arm comes to rest."""
        return self._wanted and self._wanted.motion

    @property
    def oldest(self) -> float:
        """Age beyond that of the fastest up to which states may be answered [s]."""
        return min(self.safety.state_timeout, _OLDEST * self.law.feedback.delay)

    def forget(self) -> None:
        """Hold the arm where the next state finds it."""
        self.following = self.yields = self.given_up = False
        self.reference = self._wanted = self._last_t = self._state = self._sent = self._braking = None
        self.unmodelled.forget()
        if self.refinement is not None:
            self.refinement.own.interrupt()

    def command(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Torques for the state at t, within the limits, shape (n,) [N m].

        Args:
            t: stamp of the state [s]. q, v: shape (n,) each.
        """
        period = 0.0 if self._last_t is None else t - self._last_t
        if self._last_t is None or self._braking is not None or not 0.0 < period <= self.safety.state_timeout:
            if self.following:
                self.trouble = f"there was no joint state for {period:.2f} s; the motion was given up"
            self._come_to_rest(t, q, v, shortly(v, self.safety.braking_time))
            period, self._braking = 0.0, None
        if period > 0.0:
            self._period.add(period)
        self._last_t, self._state = t, (q, v)
        assert self._wanted is not None
        self.reference = self._wanted.at(t)
        self.error = self.reference.q - q
        if self.following and self._wanted.ends_by(t):
            self.following = False
        limit, delay = self.safety.error_limit, self.law.feedback.delay
        if not self.yields and (fault := loop_fault(self.robot, self.error, v, limit, self._period, delay)):
            self.trouble, self.yields, self.following, self._fast_since = fault, True, False, t
            self._come_to_rest(t, q, np.zeros_like(q), self.safety.braking_time)
            self.unmodelled.forget()  # what the feedback has been adding may be somebody's force, and what was learned from it
            self.law.recall(self._calm)
            if self.refinement is not None:
                self.refinement.own.forget()
        if not np.any(np.abs(self.error) > _NEAR * self.safety.error_limit):
            self._calm = self.law.payload
        if self.yields:
            self._give_up_if_fast(t, v)
            return self._limited(self._yielding(t, q, v, period), period)
        wanted = self._wanted.held(t + self.law.feedback.lead, self._period.mean)
        q, v = self.reference.advance(wanted, q, v)
        tau = self._limited(self.law.torque(q, v, wanted, period), period)
        columns, rest = self._arm.split(q, v, v, wanted.a, wanted.v)
        self.unmodelled.add(tau - rest - columns @ self.law.payload, period, columns @ (self.law.payload - self.told.payload))
        if (payload := self.told.choose(columns, self.law.payload, self.unmodelled)) is not None:
            found = self.refinement.of(payload) if self.refinement and self.told.believed else None
            self.law.tell(payload if found is None else found)
        return tau

    def learn(self) -> None:
        """Learn from the torque of the last :meth:`command`: once that is sent, as it takes its time."""
        if self.refinement is None or self.yields or self._last_t is None or self._state is None or self._sent is None:
            return
        learned = self.refinement.own.add(self._last_t, *self._state, self._sent)
        self.law.feedback.lead = self.refinement.own.lead
        if learned and self.told.believed and (payload := self.refinement.of(self.told.payload)) is not None:
            self.law.tell(payload)

    def _limited(self, tau: FloatArray, period: float) -> FloatArray:
        """Within the limits of the torque and of its change, shape (n,)."""
        allowed = np.clip(tau, -self._limit, self._limit)
        if self._sent is not None and np.isfinite(self._limit).all():
            step = self._limit * min(max(period, self._period.mean) / self.safety.effort_rise_time, 1.0)
            allowed = np.clip(allowed, self._sent - step, self._sent + step)
        self.clipped += allowed != tau
        self._sent = np.asarray(allowed)
        return self._sent

    def tell(self, payload: FloatArray, covariance: FloatArray | None = None) -> None:
        """Hear of the payload that an estimator believes in, shape (10,), and of its covariance, shape (10, 10), if that is
        known; taken over where the torques do not say otherwise."""
        self.told.tell(payload)
        if self.refinement is not None:
            self.refinement.covariance = covariance

    def _give_up_if_fast(self, t: float, v: FloatArray) -> None:
        """Where an arm that yields stays too fast, states or model are not its own: no torque of this controller is better."""
        if not np.any(np.abs(v) > TOO_FAST * self.robot.velocity_limit):
            self._fast_since = t
        elif t - self._fast_since > _STAYS_FAST and not self.given_up:
            self.given_up = True
            self.trouble = (
                "the arm became faster while it should yield: the states are too old, or the model is another arm's. Nothing is "
                "sent any more, until ~/hold; the robot's own watch over its commands must stop it"
            )

    def _yielding(self, t: float, q: FloatArray, v: FloatArray, period: float) -> FloatArray:
        """What holds the weight, damps, and pulls back to a posture that gives way, shape (n,)."""
        assert self.reference is not None
        away = np.clip(self.reference.q - q, -_GIVES_WAY, _GIVES_WAY)
        still = np.zeros_like(q)
        self._wanted = WantedMotion(TimedMotion.braking(q + away, still, self.safety.braking_time), t)
        self.reference = self._wanted.at(t)
        self.error = away
        feedback = self.law.feedback
        w = min(_YIELDING * feedback.bandwidth, feedback.calm(max(self._period.mean, feedback.delay)))
        pull = feedback.weighted(q, w**2 * away - 2.0 * w * v)
        self.unmodelled.add(pull, period)
        return np.asarray(self._weight(q) + pull)

    def hold(self, at_once: bool = False) -> None:
        """Bring the arm to rest now, along the motion that it has, within ``braking_time`` or as shortly as after a fault; where
        it yields, hold it where it is."""
        if self._wanted is not None and self._last_t is not None:
            begin = self._next_effect
            now = self._wanted.at(begin)
            time = shortly(now.v, self.safety.braking_time) if at_once else self.safety.braking_time
            self._wanted, self.following = self._wanted.then(TimedMotion.braking(now.q, now.v, time), begin, self._last_t), False
            self.yields, self.given_up, self.trouble = False, False, ""

    def without_states(self, silent: float) -> FloatArray | None:
        """Torque on the model alone while states stay away, shape (n,) [N m]; None while none is missing yet, and once the arm
        must have come to rest and :meth:`torque_at_rest` is all that is left to say.

        The motion goes on for the time that its speed allows, then it is braked. What the feedback has been adding goes on too.

        Args:
            silent: time since the last state [s].
        """
        if self._wanted is None or self._last_t is None or self._state is None or silent <= self._period.missing:
            return None
        speed = float(np.abs(self.reference.v).max()) if self.reference is not None else 0.0
        if self._braking is None and silent > min(_COAST / max(speed, 1e-9), self.safety.state_timeout):
            now = self._wanted.at(self._last_t + silent)
            self._braking = TimedMotion.braking(now.q, now.v, shortly(now.v, self.safety.braking_time)), silent
        if self._braking is None:
            wanted = self._wanted.at(self._last_t + silent)
        else:
            motion, begin = self._braking
            if silent - begin > motion.end:
                return None
            wanted = motion.at(silent - begin)
        columns, rest = self._arm.split(wanted.q, wanted.v, wanted.v, wanted.a, wanted.v)
        return self._limited(rest + columns @ self.law.payload + self.unmodelled.mean, self._period.mean)

    def torque_at_rest(self) -> FloatArray | None:
        """Torque that holds the posture where the arm is, or must be by now, shape (n,) [N m]; None before the first state."""
        if self._state is None:
            return None
        held = self._weight(self._place(self._state[0])) + self.unmodelled.mean
        return np.asarray(np.clip(held, -self._limit, self._limit))

    def _weight(self, q: FloatArray) -> FloatArray:
        """Torque that holds arm and payload at rest at q, by all that is known, shape (n,) [N m]."""
        still = np.zeros_like(q)
        columns, rest = self._arm.split(q, still, still, still, still)
        return np.asarray(rest + columns @ self.law.payload)

    def gravity(self) -> FloatArray:
        """Torque that the links' weight asks for where the arm is, or must be by now, by the URDF, shape (n,) [N m]."""
        if self._state is None:
            return np.zeros(self.robot.n)
        still = np.zeros(self.robot.n)
        return self.robot.rnea(self._place(self._state[0]), still, still)

    def _place(self, q: FloatArray) -> FloatArray:
        """Where the arm is that was last seen at q, or where it must have come to rest by now, shape (n,)."""
        return q if self._braking is None else np.asarray(self._braking[0].at(np.inf).q)

    @property
    def rests(self) -> bool:
        """True where no motion is under way or wanted, and no joint moves by more than noise."""
        return (
            self.reference is not None
            and self._state is not None
            and not np.any(self.reference.v)
            and bool(np.all(np.abs(self._state[1]) < _RESTS))
        )

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
        if self._wanted is None or self._last_t is None:
            raise DataError("there is no joint state yet, so where the motion would begin is not known. Send it again later.")
        if self.yields:
            raise DataError(f"the arm yields: {self.trouble}. Call ~/hold first.")
        if sorted(joint_names) != sorted(self.robot.joint_names):
            raise DataError(
                f"the motion is of joints {', '.join(joint_names)}; it must be of {', '.join(self.robot.joint_names)}."
            )
        order = [list(joint_names).index(name) for name in self.robot.joint_names]
        q, v, a = q[:, order], *(None if x is None else x[:, order] for x in (v, a))
        if len(t) and not t[0] >= 0.0:
            raise DataError(f"the motion begins at {t[0]:g} s; it must begin at 0 or later.")
        now, speed = self._wanted.at(begin := self._next_effect), None
        if len(t) and t[0] > 0.0:
            t, q, speed = np.concatenate([[0.0], t]), np.vstack([now.q, q]), now.v
            v = None if v is None else np.vstack([now.v, v])
            a = None if a is None else np.vstack([now.a, a])
        motion = TimedMotion(t, q, v, a, speed)
        require_allowed(motion, q[0] - now.q, self.robot, self.safety.start_tolerance)
        self._wanted = self._wanted.then(motion, begin, self._last_t)
        self.following, self.trouble = True, ""

    @property
    def _next_effect(self) -> float:
        """Time from which on the answer to the next state acts [s]."""
        assert self._last_t is not None
        return self._last_t + self.law.feedback.lead + 0.5 * self._period.mean

    def _come_to_rest(self, t: float, q: FloatArray, v: FloatArray, time: float) -> None:
        self._wanted, self.following = WantedMotion(TimedMotion.braking(q, v, time), t), False
        self.reference = self._wanted.at(t)
