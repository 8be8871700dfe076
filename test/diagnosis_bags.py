"""Small bags for the diagnosis: sums of sines, torques by inverse dynamics plus friction, and what went wrong on the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from motions import Motion
from robots import robot

from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.sources import BagRecorder
from sysid_ros.sources.joint_state_cdr import typestore
from sysid_ros.sources.temperatures import TEMPERATURE

ARM = "small_arm"
RATE = 200.0
FRICTION = 0.6
Torque = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], FloatArray]


def messages(seed: int = 0, seconds: float = 12.0, torque: Torque | None = None, noise: float = 0.03) -> list[JointStateRecord]:
    """Joint states of an arm with Coulomb friction on each joint.

    Args:
        torque: (t, q, v, a) -> torque (N, n) that comes on top [N m].
    """
    model, rng = robot(ARM), np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    q, v, a = Motion(model, seed, speed=1.2)(t)
    tau = model.rnea_along(q, v, a) + FRICTION * np.sign(v) + noise * rng.normal(size=q.shape)
    if torque is not None:
        tau += torque(t, q, v, a)
    q = np.round((q + 1e-5 * rng.normal(size=q.shape)) / 2e-5) * 2e-5
    names = model.joint_names
    return [
        JointStateRecord(100.0 + x, 100.0 + x, names, *values)
        for x, values in zip(t.tolist(), zip(q, v, tau, strict=True), strict=True)
    ]


def changed(
    records: Sequence[JointStateRecord],
    position: Callable[[FloatArray], FloatArray] = lambda x: x,
    effort: Callable[[FloatArray], FloatArray] = lambda x: x,
) -> list[JointStateRecord]:
    """The messages with other positions (and velocities) and efforts, each given for all messages at once, shape (N, n)."""
    q, v, tau = (np.array([getattr(r, name) for r in records]) for name in ("position", "velocity", "effort"))
    q, v, tau = position(q), position(v), effort(tau)
    return [replace(r, position=q[i], velocity=v[i], effort=tau[i]) for i, r in enumerate(records)]


def bag(path: Path, records: Sequence[JointStateRecord]) -> Path:
    """A bag of the messages, recorded in the order in which they are given."""
    with BagRecorder(path) as recorder:
        recorder.write_joint_states(replace(r, receive_time=100.0 + i / RATE) for i, r in enumerate(records))
    return path


def write_temperatures(recorder: BagRecorder, topic: str, frame: str, t: FloatArray, values: FloatArray) -> None:
    """Readings of one sensor, a ``sensor_msgs/Temperature`` each, recorded at their stamps t (K,) [s]."""
    kinds = typestore().types
    for x, value in zip(t.tolist(), values.tolist(), strict=True):
        sec, nanosec = divmod(round(x * 1e9), 10**9)
        header = kinds["std_msgs/msg/Header"](
            stamp=kinds["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec), frame_id=frame
        )
        recorder.write(topic, TEMPERATURE, kinds[TEMPERATURE](header=header, temperature=value, variance=0.0), x)
