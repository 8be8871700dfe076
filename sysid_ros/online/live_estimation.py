"""LiveEstimation: from the joint states as they are received to estimates; CommitGate: which of them a controller receives."""

from __future__ import annotations

import copy
import math
from collections import Counter
from dataclasses import replace

import numpy as np

from sysid_ros.estimators import Estimator
from sysid_ros.exceptions import SysidError
from sysid_ros.input_gate import Gate, GateHealth, Level, gate_for
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.online_settings import CommitSettings, OnlineSettings
from sysid_ros.robot.flange import gripper_joints
from sysid_ros.robot.joint_choice import JointChoice
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import ContactRecord, ImuRecord, JointStateRecord
from sysid_ros.torque.model_file import ModelFile


def explained(estimate: PayloadEstimate, gate: Gate | None) -> str:
    """The reason of an estimate's status; where the model does not fit the torques, with what the efforts then are."""
    suspicion = gate.suspicion if gate is not None and estimate.status == "inconsistent" else ""
    return f"{estimate.reason} {suspicion}".rstrip()


_OTHER, _BETTER, _SAME = "other", "better", "same"
"""What an estimate is beside one before: of another payload, of the same but known better, and of the same."""


class CommitGate:
    """Passes an estimate on when it is known well, has held still for a while, and differs from the last one that passed or is
    known much better.

    Args:
        settings: the thresholds; may be replaced at any time.

    Attributes:
        committed: the last estimate that passed, or None. blocked: why nothing passes now, whatever is offered; empty: it may.
        reason: why the last estimate offered did not pass, or that it did.
    """

    def __init__(self, settings: CommitSettings) -> None:
        self.settings = settings
        self.committed: PayloadEstimate | None = None
        self.reason, self.blocked = "No estimate yet.", ""
        self._anchor: PayloadEstimate | None = None

    def interrupt(self, reason: str) -> None:
        """What came before says nothing about what comes next: the dwell starts anew."""
        self._anchor = None
        self.reason = reason

    def block(self, reason: str) -> None:
        """Let nothing pass until the reason is gone, that is, empty."""
        self.blocked = reason
        if reason:
            self.interrupt(reason)

    def offer(self, estimate: PayloadEstimate) -> PayloadEstimate | None:
        """The estimate if it is to be committed now, else None."""
        if refusal := self._refusal(estimate):
            self.interrupt(refusal)
            return None
        change = _OTHER if self.committed is None else self._change(estimate, self.committed)
        if change == _BETTER:
            return self._pass(estimate)
        if change == _SAME:
            self._anchor = self.committed
            self.reason = "Committed; changes since are within the dead band."
            return None
        anchor = self._anchor
        if anchor is None or estimate.t < anchor.t or self._change(estimate, anchor) == _OTHER:
            self._anchor = anchor = estimate
        held = estimate.t - anchor.t
        if held < self.settings.dwell:
            self.reason = f"The estimate has held still for {held:.1f} of {self.settings.dwell:g} s."
            return None
        return self._pass(estimate)

    def commit_now(self, estimate: PayloadEstimate | None) -> tuple[bool, str]:
        """Commit without dwell and dead band; whether it was done, and a sentence."""
        if estimate is None:
            return False, "There is no estimate yet, so nothing was committed."
        if refusal := self._refusal(estimate):
            return False, refusal
        self._pass(estimate)
        if estimate.is_empty:
            return True, "Committed: no payload."
        return True, f"Committed: {estimate.mass:.3f} kg (std {estimate.mass_std:.3f} kg)."

    def _pass(self, estimate: PayloadEstimate) -> PayloadEstimate:
        self.committed = estimate
        self.reason = "Committed."
        return estimate

    def _refusal(self, estimate: PayloadEstimate) -> str:
        if self.blocked:
            return self.blocked
        if estimate.status not in ("ok", "no_payload"):
            return f"The status is {estimate.status}: {estimate.reason}"
        s = self.settings
        mass_std = math.sqrt(estimate.covariance[0, 0])
        if not mass_std <= s.mass_std:
            return f"The std of the mass is {mass_std:.3g} kg; at most {s.mass_std:g} kg is committed (commit.mass_std)."
        if estimate.status == "no_payload":
            return ""
        com_std = math.sqrt(max(estimate.body.com_covariance.diagonal().tolist()))
        if not com_std <= s.com_std:
            return f"The std of the centre of mass is {com_std:.3g} m; at most {s.com_std:g} m is committed (commit.com_std)."
        return ""

    def _change(self, a: PayloadEstimate, b: PayloadEstimate) -> str:
        """Whether a is another payload than b, or knows mass or centre of mass so much better that b's errors are worth mending:
        none passes often."""
        if a.is_empty or b.is_empty:
            return _SAME if a.is_empty == b.is_empty else _OTHER
        if (
            abs(a.body.mass - b.body.mass) > self.settings.mass_dead_band
            or math.dist(a.body.com, b.body.com) > self.settings.com_dead_band
            or a.frame != b.frame
        ):
            return _OTHER
        better = b.covariance[0, 0] / a.covariance[0, 0], np.trace(b.body.com_covariance) / np.trace(a.body.com_covariance)
        return _BETTER if max(better) >= self.settings.refinement**2 > 0.0 else _SAME


class LiveEstimation:
    """Chooses the joints, gates the messages, estimates, and decides what is committed. Nothing in a stream of messages stops it.

    The joints are ``settings.joint_names``, else those of the model file, else those that the first messages name; all others
    are locked.

    Args:
        urdf: the URDF's text.
        settings: of the estimation.
        commit: passes on what a controller may receive.
        known: the identified model.
        enabled: False to start frozen.

    Attributes:
        robot: the model; until the joints are known, with every movable joint.
        gate: None until the joints are known.
        estimation: runs on ``robot``.
        troubles: what went wrong inside, counted by kind; the estimate was set back each time.
        last_trouble: the last of them.

    Raises:
        SysidError: URDF, model or settings can't be used together.
    """

    def __init__(
        self, urdf: str, settings: OnlineSettings, commit: CommitGate, known: ModelFile | None = None, enabled: bool = True
    ) -> None:
        self.urdf, self.settings, self.commit, self.known = urdf, settings, commit, known
        self.enabled = enabled
        commit.block("")
        joints = settings.joint_names or (known.joints if known else ())
        self.robot = RobotModel.from_urdf(urdf, joints, settings.gravity)
        self.gate: Gate | None = None
        self.troubles: Counter[str] = Counter()
        self.last_trouble = ""
        self._choice: JointChoice | None = None
        self._good: tuple[Estimator, PayloadEstimate] | None = None
        self._breaks = (0, 0)
        if joints:
            self._begin()
        else:
            self._choice = JointChoice(self.robot.joint_names, gripper_joints(urdf))
            self.estimation = OnlineEstimation(self.robot, _without_joint_settings(settings))

    def take(self, record: JointStateRecord | ImuRecord | ContactRecord) -> PayloadEstimate | None:
        """Take in one message; the estimate when one is due, else None. Never raises."""
        estimate = None
        try:
            gate = self.gate or self._choose(record)
            if gate is None:
                return None
            for measurement in gate.take(record):
                if (gate.gaps, gate.restarts) != self._breaks:
                    self._interrupted(gate)
                estimate = self.estimation.step(measurement) or estimate
            if fault := self.estimation.fault:
                raise FloatingPointError(fault)
            if estimate is not None and not (np.isfinite(estimate.theta).all() and np.isfinite(estimate.covariance).all()):
                raise FloatingPointError("the estimate is not finite")
        except Exception as error:  # noqa: BLE001 - a fault that nobody foresaw must not end the stream; it is counted and shown
            self._set_back(error)
            return None
        return estimate

    def commit_now(self) -> tuple[bool, str]:
        """Commit the present estimate without dwell and dead band; whether it was done, and a sentence."""
        return self.commit.commit_now(self.estimation.latest)

    def health(self, now: float) -> GateHealth | None:
        """State of the input at ``now`` [s], or None until the joints are known; to be asked about once a second."""
        if self.gate is None:
            return None
        health = self.gate.health(now)
        wrong = health.level >= Level.ERROR
        self.commit.block(f"The input is in error: {health.text}" if wrong else "")
        if not wrong:
            self._keep_good()
        return health

    def status(self, age: float) -> tuple[str, str]:
        """Status and reason of the estimate when the last usable sample is ``age`` old [s]."""
        latest = self.estimation.latest
        if self._choice is not None:
            return "warming_up", self._choice.text
        if age > self.settings.sensor_timeout:
            since = "" if age == float("inf") else f" for {age:.1f} s"
            return "stale", f"No usable sample{since}; the estimate is not published."
        if latest is None:
            return "warming_up", "Nothing is known yet. Keep moving."
        return latest.status, explained(latest, self.gate)

    def reset(self, reason: str) -> None:
        """Forget what was estimated, and start again."""
        self.estimation.reset(reason)
        self.commit.interrupt(f"The estimation was started again: {reason}.")
        self._good = None

    def tare(self) -> tuple[bool, str]:
        """As of :class:`.OnlineEstimation`; whether it was done, and a sentence."""
        known = self.estimation.latest is not None
        self.commit.interrupt("The estimate was tared.")
        said = self.estimation.tare()
        self._good = None  # it holds what is carried no more
        return known, said

    def set_enabled(self, enabled: bool) -> None:
        """Freeze the estimate, or go on."""
        self.enabled = enabled
        self.estimation.set_enabled(enabled)
        if not enabled:
            self.commit.interrupt("The estimation is disabled.")

    def _begin(self) -> Gate:
        self.estimation = OnlineEstimation(self.robot, self.settings, self.known)
        gate = gate_for(self.robot, self.estimation.base, self.settings)
        self.estimation.set_enabled(self.enabled)
        self.gate, self._choice = gate, None
        return gate

    def _choose(self, record: JointStateRecord | ImuRecord | ContactRecord) -> Gate | None:
        if not isinstance(record, JointStateRecord):
            return None
        assert self._choice is not None
        joints = self._choice.offer(record)
        if joints is None:
            return None
        if joints != self.robot.joint_names:
            self.robot = RobotModel.from_urdf(self.urdf, joints, self.settings.gravity)
        try:
            return self._begin()
        except SysidError as error:
            self._choice.text = str(error)
            return None

    def _interrupted(self, gate: Gate) -> None:
        restarted = gate.restarts != self._breaks[1]
        self._breaks = gate.gaps, gate.restarts
        self.commit.interrupt("Samples were missing.")
        if restarted:
            self.reset("the stamps jumped back, as when a bag is played again")

    def _keep_good(self) -> None:
        estimator, latest = self.estimation.estimator, self.estimation.latest
        if estimator is None or latest is None or latest.status not in ("ok", "no_payload", "not_excited"):
            return
        if np.isfinite(estimator.theta).all() and np.isfinite(estimator.covariance()).all():
            self._good = copy.deepcopy(estimator), latest

    def _set_back(self, error: Exception) -> None:
        self.last_trouble, self.estimation.fault = f"{type(error).__name__}: {error}", ""
        self.troubles[type(error).__name__] += 1
        self.commit.interrupt(f"An internal error set the estimate back: {self.last_trouble}.")
        if self._good is None:
            self.estimation.reset(f"an internal error, {self.last_trouble}")
            return
        estimator, latest = self._good
        self.estimation.estimator, self.estimation.latest = estimator, latest
        if isinstance(error, ArithmeticError | np.linalg.LinAlgError):  # one that fails again was not good
            self._good = None
        else:
            self._good = copy.deepcopy(estimator), latest
        self.estimation.set_enabled(False)
        self.estimation.set_enabled(self.enabled)


def _without_joint_settings(settings: OnlineSettings) -> OnlineSettings:
    """Settings for a robot whose joints are not known yet: those that need one value a joint are left out."""
    return replace(settings, torque_std=())
