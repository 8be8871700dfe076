"""The MuJoCo model of a robot that hides something: bodies, joints and surroundings by MuJoCo's own means.

Nothing of the package's own simulation is used but the values of the hidden effects: inertials, armature, damping, frictionloss,
stiffness, gravity and a second joint in line are MuJoCo's.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping

import mujoco
import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.hidden_effects import HiddenEffect, TrueRobot

STEP = 0.5e-3
_SMALL = 1e-9
_DRY = (
    "coulomb_friction", "stribeck_friction", "asymmetric_coulomb_friction", "load_dependent_friction", "friction_drift",
    "outside_neighbour_friction",
)  # fmt: skip


def values(effects: tuple[HiddenEffect, ...], name: str, *ids: str) -> dict[str, float]:
    """A parameter by joint, summed over the effects that have it (of those ids, where some are given)."""
    out: dict[str, float] = {}
    for effect in effects:
        if not ids or effect.id in ids:
            for joint, value in effect.per_joint(name).items():
                out[joint] = out.get(joint, 0.0) + value
    return out


def build(true: TrueRobot, carries: HiddenEffect | None, step: float = STEP) -> mujoco.MjModel:
    """The model, with the body of ``carries`` on the tip link."""
    spec = mujoco.MjSpec.from_string(_prepared(true.robot))
    effects = true.effects
    spec.option.timestep = step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = _gravity(effects)
    spec.option.tolerance = 1e-12
    spec.option.iterations = 50
    joints = {joint.name: joint for joint in spec.joints}
    for joint in joints.values():
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        joint.solref_friction = [2.0 * step, 1.0]
        joint.solimp_friction = [0.99, 0.999, 0.001, 0.5, 2.0]
    dry = {j for e in effects if e.id in _DRY for j in e.joints}
    dry |= {j for j, fc in zip(true.robot.joint_names, true.robot.friction, strict=True) if fc > 0.0}
    for name in dry:
        joints[name].frictionloss = _SMALL  # the level of the moment is set at each step
    for name, inertia in values(effects, "J").items():
        joints[name].armature = inertia
    for effect in effects:
        if effect.id == "spring" and effect.kind == "cable":
            for name, k in effect.per_joint("k").items():
                joints[name].stiffness = [k, 0.0, 0.0] if np.ndim(joints[name].stiffness) else k
                joints[name].springref = effect.per_joint("q0")[name]
        if effect.id in ("joint_elasticity", "backlash"):
            _second_joint(joints[effect.joints[0]], effect, step)
    if carries is not None:
        _add_body(spec, true.robot.default_frame, carries)
    model = spec.compile()
    for effect in effects:
        if effect.id == "link_inertia":
            _change_link(model, true.robot, effect.joints[0], effect.settings)
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


def _gravity(effects: tuple[HiddenEffect, ...]) -> np.ndarray:
    """Gravity in the axes of a base that is rolled about its x axis, then pitched about the world's y axis."""
    down = np.array([0.0, 0.0, -9.81])
    for effect in effects:
        if effect.id == "base_tilt":
            half_roll, half_pitch = 0.5 * effect.vector("roll")[0], 0.5 * effect.vector("pitch")[0]
            rolled = np.array([np.cos(half_roll), np.sin(half_roll), 0.0, 0.0])
            pitched = np.array([np.cos(half_pitch), 0.0, np.sin(half_pitch), 0.0])
            base, back, out = np.zeros(4), np.zeros(4), np.zeros(3)
            mujoco.mju_mulQuat(base, pitched, rolled)
            mujoco.mju_negQuat(back, base)
            mujoco.mju_rotVecQuat(out, down, back)
            down = out
    return down


def _second_joint(motor: mujoco.MjsJoint, effect: HiddenEffect, step: float) -> None:
    """Behind the motor's joint a second one on the same axis, with a spring or with a play."""
    body, name = motor.parent, motor.name
    motor.armature = motor.armature + effect.settings["motor_inertia"][0]
    second = body.add_joint(name=f"{name}_play", type=motor.type, axis=motor.axis, pos=motor.pos)
    if effect.id == "joint_elasticity":
        k = effect.per_joint("stiffness")[name]
        damping = 2.0 * 0.03 * np.sqrt(k * effect.settings["motor_inertia"][0])
        second.stiffness = [k, 0.0, 0.0] if np.ndim(second.stiffness) else k
        second.damping = [damping, 0.0, 0.0] if np.ndim(second.damping) else damping
        return
    half = 0.5 * effect.per_joint("gap")[name]
    second.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    second.range = [-half, half]
    second.solref_limit = [8.0 * step, 1.0]
    second.solimp_limit = [0.95, 0.99, 0.001, 0.5, 2.0]


def _add_body(spec: mujoco.MjSpec, tip: str, effect: HiddenEffect) -> None:
    link = next(body for body in spec.bodies if body.name == tip)
    body = link.add_body(name="carried")
    inertia = np.array(effect.settings["inertia_com"])
    body.mass = effect.vector("mass")[0]
    body.ipos = effect.vector("com")
    body.fullinertia = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    body.explicitinertial = True


def _change_link(model: mujoco.MjModel, robot: RobotModel, joint: str, settings: Mapping[str, object]) -> None:
    body = model.jnt_bodyid[model.joint(joint).id]
    model.body_mass[body] *= settings["mass_factor"]
    model.body_inertia[body] *= settings["mass_factor"]
    model.body_ipos[body] += np.array(settings["com_shift"])
