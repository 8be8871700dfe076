"""Small bags of test arms with known truth, for the tests of a fleet."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from motions import Motion
from robots import robot, urdf
from scipy import signal

from sysid_ros.effects import Payload
from sysid_ros.robot.inertial_parameters import from_com
from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.signals.motion import Motion as Along
from sysid_ros.signals.recording import Recording
from sysid_ros.sources import BagRecorder

ARM = "small_arm"
DAY = 86400.0
START = 1_767_600_000.0
"""5 January 2026, 8:00 UTC [s]."""


@dataclass(frozen=True)
class Hidden:
    """What a bag's robot has that its URDF lacks, for each joint alike, and what it carries."""

    coulomb_friction: float = 0.4
    viscous_friction: float = 0.3
    torque_offset: float = 0.2
    torque_gain: float = 1.0
    joint_offset: float = 0.0
    rotor_inertia: float = 0.05
    torque_delay: float = 0.0
    noise: float = 0.1
    colour: float = 0.0
    mass: float = 0.0
    pick: float = 0.0
    still: tuple[str, ...] = ()
    extra: dict[str, Any] = field(default_factory=dict)


def recording(hidden: Hidden, seed: int, seconds: float = 12.0, rate: float = 200.0, start: float = START) -> Recording:
    """What the sensors measure."""
    model, rng = robot(ARM), np.random.default_rng([seed, 7])
    fine = 5
    t = np.arange(round(seconds * rate) * fine) / (rate * fine)
    q, v, a = Motion(model, seed, speed=0.8, still=hidden.still)(t)
    theta = from_com(hidden.mass, np.array([0.02, -0.01, 0.06]), 1e-3 * hidden.mass * np.eye(3))
    carried = Payload(model).columns_along(Along(model, t, q, v, a, q)) @ theta
    tau = model.rnea_along(q, v, a) + hidden.rotor_inertia * a + hidden.viscous_friction * v
    tau += hidden.coulomb_friction * np.tanh(v / 0.02) + carried * (t >= hidden.pick)[:, None]
    late = np.stack([np.interp(t - hidden.torque_delay, t, x) for x in tau.T], axis=1)[::fine]
    noise = signal.lfilter([np.sqrt(1 - hidden.colour**2)], [1.0, -hidden.colour], rng.standard_normal(late.shape), axis=0)
    measured = q[::fine] + hidden.joint_offset + 1e-6 * rng.standard_normal(late.shape)
    efforts: FloatArray = hidden.torque_gain * late + hidden.torque_offset + hidden.noise * noise
    return Recording(f"seed {seed}", start + t[::fine], measured, None, efforts)


def write_bag(path: Path, hidden: Hidden, seed: int, seconds: float = 6.0, rate: float = 100.0, start: float = START) -> Path:
    """A bag with its URDF."""
    of, names = recording(hidden, seed, seconds, rate, start), robot(ARM).joint_names
    path.parent.mkdir(parents=True, exist_ok=True)
    with BagRecorder(path) as recorder:
        recorder.write_robot_description(urdf(ARM), start)
        recorder.write_joint_states(
            JointStateRecord(t, t, names, q, (), tau) for t, q, tau in zip(of.t.tolist(), of.q, of.tau, strict=True)
        )
    return path


def write_fleet(folder: Path, robots: int, bags: int, broken: tuple[int, ...] = ()) -> list[Path]:
    """Bags of some robots, one every 10 days each; those that are ``broken`` by their number hold what is no bag."""
    paths = []
    for k in range(robots * bags):
        which, at = divmod(k, bags)
        path = folder / f"arm_{which}" / f"bag_{at}"
        if k in broken:
            path.parent.mkdir(parents=True, exist_ok=True)
            path = path.with_suffix(".mcap")
            path.write_bytes(b"no bag %d" % k)
        else:
            write_bag(path, Hidden(coulomb_friction=0.3 + 0.05 * which), seed=k, start=START + 10 * DAY * at)
        paths.append(path)
    return paths
