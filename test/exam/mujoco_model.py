"""The MuJoCo model of a robot that hides something: bodies, joints and surroundings by MuJoCo's own means.

Nothing of the package's own simulation is used but the values that a true robot has: inertials, armature, damping, frictionloss,
stiffness, gravity and a second joint in line are MuJoCo's.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import mujoco
import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.hidden_effects import TrueRobot
from sysid_ros.simulation.hidden_effects.joint_physics import Joints
from sysid_ros.simulation.payload import Payload

STEP = 0.5e-3
_SMALL = 1e-9
_TIP = "where a body is carried"


def build(true: TrueRobot, bodies: Sequence[Payload], step: float = STEP) -> mujoco.MjModel:
    """The model, with bodies on the tip link."""
    spec = mujoco.MjSpec.from_string(_prepared(true.robot))
    spec.option.timestep = step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = _gravity(*true.tilt)
    spec.option.tolerance = 1e-12
    spec.option.iterations = 50
    joints = {joint.name: joint for joint in spec.joints}
    for joint in joints.values():
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        joint.solref_friction = [2.0 * step, 1.0]
        joint.solimp_friction = [0.99, 0.999, 0.001, 0.5, 2.0]
    hidden = true.joints
    dry = (hidden.coulomb_forward + hidden.coulomb_backward + hidden.breakaway + hidden.load_factor > 0.0) & (
        hidden.presliding == 0.0
    )
    for j, name in enumerate(true.robot.joint_names):
        joint = joints[name]
        if dry[j]:
            joint.frictionloss = _SMALL  # the level of the moment is set at each step
        if hidden.rotor[j]:
            joint.armature = hidden.rotor[j]
        if hidden.spring[j]:
            joint.stiffness = _polynomial(hidden.spring[j], joint.stiffness)
            joint.springref = hidden.spring_origin[j]
        if hidden.stiffness[j]:
            _second_joint(joint, hidden, j, step)
    tip = next(body for body in spec.bodies if body.name == true.robot.default_frame).add_site(name=_TIP)
    spec.compile()
    # links that are welded to one another are one body now; what is carried is none of theirs, or it would grow with the link
    spec.compiler.fusestatic = False
    for carried in bodies:
        _add_body(tip, carried)
    model = spec.compile()
    for change in true.link_changes:
        body = model.jnt_bodyid[model.joint(true.robot.joint_names[change.joint]).id]
        model.body_mass[body] *= change.mass_factor
        model.body_inertia[body] *= change.mass_factor
        model.body_ipos[body] += change.com_shift
    for name, factor in zip(true.robot.body_names, true.mass_factors, strict=True):
        body = model.body(name).id
        model.body_mass[body] *= factor
        model.body_inertia[body] *= factor
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _prepared(robot: RobotModel) -> str:
    """The URDF with its other joints welded."""
    root = ElementTree.fromstring(robot.urdf)
    for joint in root.findall("joint"):
        for element in joint.findall("dynamics"):
            joint.remove(element)
        if joint.get("type") != "fixed" and joint.get("name") not in robot.joint_names:
            joint.set("type", "fixed")
            for tag in ("limit", "mimic", "axis"):
                for element in joint.findall(tag):
                    joint.remove(element)
    return ElementTree.tostring(root, encoding="unicode")


def _gravity(roll: float, pitch: float) -> np.ndarray:
    """Gravity in the axes of a base that is rolled about its x axis, then pitched about the world's y axis."""
    rolled = np.array([np.cos(0.5 * roll), np.sin(0.5 * roll), 0.0, 0.0])
    pitched = np.array([np.cos(0.5 * pitch), 0.0, np.sin(0.5 * pitch), 0.0])
    base, back, out = np.zeros(4), np.zeros(4), np.zeros(3)
    mujoco.mju_mulQuat(base, pitched, rolled)
    mujoco.mju_negQuat(back, base)
    mujoco.mju_rotVecQuat(out, np.array([0.0, 0.0, -9.81]), back)
    return out


def _second_joint(motor: mujoco.MjsJoint, hidden: Joints, j: int, step: float) -> None:
    """Behind the motor's joint a second one on the same axis, with a spring or with a play."""
    motor.armature = motor.armature + hidden.motor_inertia[j]
    second = motor.parent.add_joint(name=f"{motor.name}_play", type=motor.type, axis=motor.axis, pos=motor.pos)
    if hidden.gap[j] == 0.0:
        second.stiffness = _polynomial(hidden.stiffness[j], second.stiffness)
        second.damping = _polynomial(hidden.compliance_damping[j], second.damping)
        return
    half = 0.5 * hidden.gap[j]
    second.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    second.range = [-half, half]
    second.solref_limit = [8.0 * step, 1.0]
    second.solimp_limit = [0.95, 0.99, 0.001, 0.5, 2.0]


def _polynomial(value: float, like: object) -> float | list[float]:
    """A coefficient as this version of MuJoCo takes it: newer ones want those of higher orders too."""
    return [value, 0.0, 0.0] if np.ndim(like) else value  # type: ignore[arg-type]


def _add_body(tip: mujoco.MjsSite, carried: Payload) -> None:
    body = tip.parent.add_body(pos=tip.pos, quat=tip.quat)
    inertia = carried.inertia_com
    body.mass = carried.mass
    body.ipos = carried.com
    body.fullinertia = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    body.explicitinertial = True
