"""track: a control law on the simulated arm, which picks up what the law does not know."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sysid_ros.control import LAWS, ArmTorque, ComputedTorque, ControlSettings, Reference, believed_payload, make_law
from sysid_ros.control.controller import TrackingController
from sysid_ros.control.tracking_run import TrackingRun
from sysid_ros.exceptions import SettingsError
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.arm_simulation import ArmSimulation
from sysid_ros.simulation.scenario import CONTROL_RATE, ArmScenario
from sysid_ros.simulation.trajectory import ExcitingTrajectory
from sysid_ros.torque.model_file import ModelFile

_LOST = 1.0
"""A joint this far from the wanted motion has lost it [rad]."""

_KEPT_EVERY = 10

_BELIEVED_STD = 0.2
"""Largest standard deviation of a mass that a law believes [kg]."""

TRACKED = (*reversed(LAWS), "informed")
"""``informed`` is computed torque that knows the true payload at the pick, to compare with."""


class _Tracked:
    """The law with its eyes: noisy states, and an estimator on the noisy messages."""

    def __init__(self, law: TrackingController, scenario: ArmScenario, robot: RobotModel, delay: float) -> None:
        self._law, self._scenario = law, scenario
        self._noise = np.random.default_rng(np.random.SeedSequence(scenario.seed).spawn(3)[2])
        self._limit = robot.effort_limit
        # the law's answer to one state acts until the next, so a period is there without it
        self._late: deque[FloatArray] = deque(maxlen=max(1, round(delay * CONTROL_RATE)))
        self.clipped, self._steps = 0, 0
        self.motion: ExcitingTrajectory | None = None
        self.wanted = np.zeros(robot.n)

    def command(self, q: FloatArray, v: FloatArray, reference: Reference) -> FloatArray:
        s = self._scenario
        seen_q = q + s.encoder_noise * self._noise.standard_normal(len(q))
        seen_v = v + s.velocity_noise * self._noise.standard_normal(len(q))
        self.wanted = reference.q
        assert self.motion is not None
        lead = self._law.feedback.lead
        later = Reference(*(x[0] for x in self.motion.sample(np.array([self._steps / CONTROL_RATE + lead]))))
        self._steps += 1
        tau = self._law.torque(*reference.advance(later, seen_q, seen_v), later, 1.0 / CONTROL_RATE)
        allowed = np.clip(tau, -self._limit, self._limit)
        self.clipped += bool(np.any(allowed != tau))
        self._late.append(allowed)
        return self._late[0]


def track(
    law: str,
    scenario: ArmScenario,
    settings: ControlSettings | None = None,
    known: ModelFile | None = None,
    progress: Callable[[int], None] = lambda count: None,
) -> TrackingRun:
    """Let a law follow the scenario's motion.

    Args:
        law: one of :data:`TRACKED`. scenario: of finite duration. settings: of the law; its ``loop_delay``
            is that of the simulated loop too, 1 ms at least and by default. known: the identified model that law and
            estimator have; None: the URDF.
        progress: called with the number of new messages now and then.

    Raises:
        SettingsError: there is no such law. ModelFileError: the model does not fit the arm.
    """
    if law not in TRACKED:
        raise SettingsError(f"the law is {law!r}; it must be one of {', '.join(TRACKED)}.")
    scenario = replace(scenario, rate=CONTROL_RATE)
    settings = settings or ControlSettings(loop_delay=1.0 / CONTROL_RATE)
    probe = ArmSimulation(scenario)
    probe.close()
    robot, frame = probe.robot, probe.frame
    arm = ArmTorque(robot, known.known_effects(robot) if known else (), frame)
    controller = make_law("computed_torque" if law == "informed" else law, arm, settings)
    tracked = _Tracked(controller, scenario, robot, settings.loop_delay)
    simulation = ArmSimulation(scenario, tracked.command)
    tracked.motion = simulation.trajectory
    listens = law in ("certainty_equivalence", "composite")
    estimation = OnlineEstimation(robot, OnlineSettings(frame_id=frame), known) if listens else None
    rows, lost, events = [], None, 0
    try:
        for k in range(round(scenario.duration * CONTROL_RATE)):
            exact = simulation.step()
            if estimation is not None and (estimate := estimation.step(simulation.noisy(exact))) is not None:
                controller.tell(believed_payload(estimate, _BELIEVED_STD))
            if law == "informed" and isinstance(controller, ComputedTorque) and len(simulation.events) > events:
                events = len(simulation.events)
                body = simulation.payload if simulation.carries else None
                controller.carry(np.zeros(10) if body is None else body.theta)
            error = tracked.wanted - exact.q
            if k % _KEPT_EVERY == 0:
                tip = [robot.frame_placement(at, frame)[1] for at in (tracked.wanted, exact.q)]
                rows.append((exact.t, error, float(np.linalg.norm(tip[0] - tip[1])), controller.payload[0], exact.tau, exact.q))
            if k % 100 == 99:
                progress(100)
            # not >, so that NaN is lost too
            if not np.abs(error).max() <= _LOST:
                lost = exact.t
                break
    finally:
        simulation.close()
    t, error, tip_error, mass, tau, q = (np.array(column) for column in zip(*rows, strict=True))
    return TrackingRun(law, t, error, tip_error, mass, tau, tracked.clipped, lost, controller.feedback.notes, q)
