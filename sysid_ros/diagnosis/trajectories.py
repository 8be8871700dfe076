"""The simulation driven as the robot was: PyBullet under the measured torques, from measured states, before and after."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sysid_ros.diagnosis.joint_side import JointSide
from sysid_ros.diagnosis.result import Predictions
from sysid_ros.robot.drive import Drive
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

HORIZON = 0.5
"""Length of a window, after which the simulation starts from the measured state again [s]."""
_WINDOWS = 12
_STEP = 1e-3
_DIVERGED = 3.0

Step = Callable[[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Positions over windows one after the other, NaN between them.

    Attributes:
        t: since the first stamp, shape (N,) [s]. measured, nominal, extended: positions, shape (N, n) [rad or m].
        simulator: which it was, in words.
    """

    t: FloatArray
    measured: FloatArray
    nominal: FloatArray
    extended: FloatArray
    simulator: str


def simulated_trajectories(robot: RobotModel, p: Predictions, sides: tuple[JointSide, JointSide]) -> Trajectories | None:
    """Windows of the held-out recording, simulated with the nominal and with the extended model.

    As :func:`sysid_ros.diagnosis.forward_simulation.forward_simulation`: friction and rotors at the state that the simulation
    reaches, every other effect as the torque that it has along the measured motion.

    Args:
        p: torques and motion on held-out data, without faults of units, signs or order.
        sides: friction and rotors of both models.
    """
    step, name, close = _simulator(robot)
    links = robot.rnea_along(p.q, p.v, p.a)
    period = float(np.median(np.diff(p.t)))
    length = round(HORIZON / period)
    whole = (
        np.flatnonzero(np.abs(p.t[length:] - p.t[:-length] - HORIZON) < 0.5 * period) if len(p.t) > length else np.zeros(0, int)
    )
    if not whole.size:
        close()
        return None
    starts = whole[np.unique(np.linspace(0, whole.size - 1, _WINDOWS).astype(int))]
    starts = starts[np.concatenate([[True], np.diff(starts) > length])]
    parts: list[tuple[FloatArray, ...]] = []
    nothing = np.full((1, robot.n), np.nan)
    try:
        for start in starts:
            window = slice(int(start), int(start) + length + 1)
            runs = []
            for model, side in zip((p.nominal, p.extended), sides, strict=True):
                torque = p.measured[window] - (model - links)[window] + side.torque(p.v[window], p.a[window])
                runs.append(_run(robot, p.t[window], p.q[start], p.v[start], torque, side.drive(_STEP), step))
            parts.append((p.t[window], p.q[window], *runs))
            parts.append((np.array([np.nan]), nothing, nothing, nothing))
    finally:
        close()
    t, measured, nominal, extended = (np.concatenate([part[i] for part in parts]) for i in range(4))
    return Trajectories(t, measured, nominal, extended, name)


def _run(
    robot: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, torque: FloatArray, drive: Drive, step: Step
) -> FloatArray:
    """Positions at t, shape (N, n); NaN after the simulation went away."""
    fine = np.arange(t[0], t[-1] + 0.5 * _STEP, _STEP)
    at = np.stack([np.interp(fine, t, torque[:, j]) for j in range(robot.n)], axis=1)
    out = np.full((len(fine), robot.n), np.nan)
    q, v = q.copy(), v.copy()
    first = q.copy()
    for k in range(len(fine)):
        out[k] = q
        if not np.all(np.abs(q - first) < _DIVERGED):
            out[k:] = np.nan
            break
        q, v = step(q, v, drive.link_torque(robot, q, v, at[k]))
    return np.stack([np.interp(t, fine, out[:, j]) for j in range(robot.n)], axis=1)


def _simulator(robot: RobotModel) -> tuple[Step, str, Callable[[], None]]:
    """One step of PyBullet, or of the forward dynamics where it is not installed; its name; what frees it."""
    try:
        from sysid_ros.simulation.arm import ArmWorld
    except ModuleNotFoundError:
        return (
            _forward_dynamics(robot),
            "forward dynamics (PyBullet is not installed: pip install 'sysid_ros[sim]')",
            lambda: None,
        )
    world = ArmWorld(_bare_urdf(robot), robot.default_frame, (robot.gravity[0], robot.gravity[1], robot.gravity[2]))
    there = [world.joint_names.index(name) for name in robot.joint_names]
    back = np.argsort(there)
    reached: list[tuple[FloatArray, FloatArray]] = [(np.zeros(0), np.zeros(0))]

    def step(q: FloatArray, v: FloatArray, tau: FloatArray) -> tuple[FloatArray, FloatArray]:
        if q is not reached[0][0] or v is not reached[0][1]:
            world.reset(q[back], v[back])
        world.step(tau[back])
        reached[0] = world.q[there], world.v[there]
        return reached[0]

    return step, "PyBullet", world.close


def _forward_dynamics(robot: RobotModel) -> Step:
    def step(q: FloatArray, v: FloatArray, tau: FloatArray) -> tuple[FloatArray, FloatArray]:
        v = v + _STEP * robot.forward_dynamics(q, v, tau, np.zeros(robot.n))
        return q + _STEP * v, v

    return step


def _bare_urdf(robot: RobotModel) -> str:
    """The robot's URDF without shapes, with the joints that do not move fixed, without end stops."""
    root = ElementTree.fromstring(robot.urdf)
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
        if link.find("inertial") is None:
            inertial = ElementTree.SubElement(link, "inertial")
            ElementTree.SubElement(inertial, "mass", value="0")
            ElementTree.SubElement(inertial, "inertia", dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0"))
    for joint in root.findall("joint"):
        if joint.get("name") not in robot.joint_names:
            joint.set("type", "fixed")
        elif joint.get("type") == "revolute":
            joint.set("type", "continuous")
    return ElementTree.tostring(root, encoding="unicode")
