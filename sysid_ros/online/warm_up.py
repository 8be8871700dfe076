"""Runs the whole estimation once on a made-up motion, so that everything is compiled before the first message."""

from __future__ import annotations

import numpy as np

from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.input_gate import FloatingGate, InputGate
from sysid_ros.online.evidence_kernels import BEHIND, LOCAL, another_payload, told_if_exact, without_payload
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.inertial_parameters import body_of, project
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, ContactRecord, ImuRecord, JointStateRecord, Measurement

RATE = 250.0
"""Samples a second of the made-up motion [Hz]."""


def warm_up(robot: RobotModel, settings: OnlineSettings, duration: float = 6.0) -> int:
    """Compile, or load from the cache, what a message will call; returns how many estimates came out.

    The robot moves sinusoidally, picks up a kilogram half-way (so that the search for jumps runs too), and a gap follows;
    nothing of it is kept.

    Args:
        robot: its joints give the shapes.
        settings: of the estimation that will run.
        duration: of the motion [s].
    """
    # per-joint settings may belong to fewer joints than the robot has before the messages have said which are used
    free = OnlineSettings(
        update_rate=RATE / 2,
        effort_type=settings.effort_type,
        estimator=settings.estimator,
        estimate_friction=settings.estimate_friction,
        base=settings.base,
        contact_frames=settings.contact_frames,
        foot_radius=settings.foot_radius,
        accelerometer_bias_std=settings.accelerometer_bias_std,
    )
    estimation = OnlineEstimation(robot, free)
    if estimation.base is not None:
        return _warm_up_on_legs(estimation, estimation.base, free, duration)
    gate = InputGate(robot, free)
    frame = robot.frame_id(robot.default_frame)
    payload = np.array([1.0, 0.0, 0.0, 0.1, 0.02, 0.0, 0.02, 0.0, 0.0, 0.02])
    noise = np.random.default_rng(0)
    w = np.linspace(2.0, 4.0, robot.n)
    low, high = np.clip(robot.position_lower, -1.0, 1.0), np.clip(robot.position_upper, -1.0, 1.0)
    middle, swing = 0.5 * (low + high), 0.2 * (high - low)
    estimates = 0
    for k in range(round(duration * RATE)):
        t = k / RATE
        q, v, a = middle + swing * np.sin(w * t), swing * w * np.cos(w * t), -swing * w**2 * np.sin(w * t)
        tau = robot.rnea(q, v, a) + 0.01 * noise.standard_normal(robot.n)
        if t > 0.5 * duration:
            tau += robot.payload_regressor(q, v, a, frame) @ payload
        stamp = 1.0 + t + (2.0 * settings.max_gap if t > 0.9 * duration else 0.0)
        measurement = gate.accept(JointStateRecord(stamp, stamp, robot.joint_names, q, v, tau))
        if isinstance(measurement, Measurement) and estimation.step(measurement) is not None:
            estimates += 1
    project(np.concatenate([payload[:4], -payload[4:]]), np.eye(10))
    body_of(payload, np.eye(10))
    # asked while it is not known yet whether what was picked up is a body, which takes longer than this motion
    whole, since = np.eye(10 + LOCAL + BEHIND), np.zeros((1, 10 + LOCAL + BEHIND, 10 + LOCAL + BEHIND))
    told_if_exact(since, np.ones(1), np.zeros(10))
    another_payload(whole, since, np.ones(1), 10, 10 + LOCAL, np.ones((1, 2)), np.zeros(1))
    without_payload(whole)
    gate.health(1.0 + duration)
    return estimates


def _warm_up_on_legs(estimation: OnlineEstimation, base: FloatingBase, settings: OnlineSettings, duration: float) -> int:
    """As :func:`warm_up`, of a robot that stands on bent legs and is loaded half-way."""
    gate, noise, legs = FloatingGate(base, settings), np.random.default_rng(0), base.legs
    low, high = np.clip(legs.position_lower, -1.5, 1.5), np.clip(legs.position_upper, -1.5, 1.5)
    q, still, zero = low + 0.7 * (high - low), np.zeros(legs.n), np.zeros(3)
    _, jacobians = base.contacts.jacobians(np.concatenate((np.zeros(FREE), q)))
    gravity = np.array([0.0, 0.0, 9.81])
    estimates = 0
    for k in range(round(duration * RATE)):
        t = 1.0 + k / RATE
        weight = (base.mass + (1.0 if t > 1.0 + 0.5 * duration else 0.0)) * 9.81 / len(jacobians)
        tau = base.robot.rnea(*base.state(q, still, still, zero, gravity, zero))[FREE:] - weight * jacobians[:, 2, FREE:].sum(
            axis=0
        )
        gate.take(ContactRecord(t, np.ones(len(jacobians))))
        gate.take(ImuRecord(t, t, base.trunk, (0.0, 0.0, 0.0, 1.0), zero, gravity + 0.01 * noise.standard_normal(3)))
        tau = tau + 0.01 * noise.standard_normal(legs.n)
        for measurement in gate.take(JointStateRecord(t, t, legs.joint_names, q, (), tau)):
            estimates += estimation.step(measurement) is not None
    gate.health(1.0 + duration)
    return estimates
