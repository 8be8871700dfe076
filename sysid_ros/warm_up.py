"""Runs the whole estimation once on a made-up motion, so that everything is compiled before the first message."""

from __future__ import annotations

import numpy as np

from sysid_ros.input_gate import InputGate
from sysid_ros.online import OnlineEstimation
from sysid_ros.physical_projection import project
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import JointStateRecord, Measurement
from sysid_ros.settings import OnlineSettings

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
    )
    gate, estimation = InputGate(robot, free), OnlineEstimation(robot, free)
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
    gate.health(1.0 + duration)
    return estimates
