"""The same true robot with PyBullet moving the links."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.arm import STEP, ArmWorld
from sysid_ros.simulation.hidden_effects.chain import chain_of
from sysid_ros.simulation.hidden_effects.channels import Signals
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect
from sysid_ros.simulation.hidden_effects.integrator import solve_step, state_at
from sysid_ros.simulation.hidden_effects.motion import DiagnosisMotion
from sysid_ros.simulation.hidden_effects.run import check_followed
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot
from sysid_ros.simulation.payload import Payload, urdf_with_payload

_PUSH = 2


def pybullet_can(true: TrueRobot) -> bool:
    """False where PyBullet's step of a millisecond is too long: bristles, elastic joints, play."""
    return not (np.any(true.joints.stiffness) or np.any(true.joints.presliding))


def move_in_pybullet(
    true: TrueRobot,
    motion: DiagnosisMotion,
    rate: int,
    stiffening: FloatArray,
    progress: Callable[[int], None] = lambda n: None,
) -> Signals:
    """As :func:`.run.move`: PyBullet moves the links, a body that is picked up is tied to the tip, and what the joints hide is in
    the torque that the links get at each step.

    Raises:
        SettingsError: the arm does not follow the motion, or something is hidden that needs shorter steps.
    """
    if not pybullet_can(true):
        raise SettingsError(
            "PyBullet's step of 1 ms is too long for presliding, elastic joints and backlash. Use the compiled physics."
        )
    robot, stride = true.robot, round(1.0 / (rate * STEP))
    world = ArmWorld(_true_urdf(true), robot.default_frame, (true.gravity[0], true.gravity[1], true.gravity[2]))
    try:
        count = int(motion.duration * rate)
        wanted = np.stack(motion.sample(np.arange(count * stride) * STEP), axis=1)
        believed = chain_of(robot, robot.pi, robot.gravity)
        before, after = chain_of(robot, true.pi, true.gravity), chain_of(robot, true.pi_after, true.gravity)
        world.reset(wanted[0, 0], np.zeros(robot.n))
        state = state_at(world.q, world.q)
        out = np.zeros((3, count, robot.n))
        for k in range(count * stride):
            t = k * STEP
            if t >= true.change_time and not world.carries:
                world.pick(_picked_up(true))
            state.q[:] = state.angle[:] = world.q
            state.v[:] = state.rate[:] = world.v
            links = after if world.carries else before
            solve_step(believed, links, true.joints, true.force, stiffening, wanted[k], t, STEP, state)
            world.step(state.link_torque + state.vectors[_PUSH])
            if k % stride == 0:
                out[:, k // stride] = state.q, 0.5 * (state.v + world.v), state.command
                if k // stride % 100 == 99:
                    progress(100)
    finally:
        world.close()
    t_rows = np.arange(count, dtype=np.float64) / rate
    check_followed(true, motion, t_rows, out[0])
    return Signals(t_rows, *out)


def _picked_up(true: TrueRobot) -> Payload:
    return _body(next(e for e in true.effects if e.id == "payload_change"))


def _body(effect: HiddenEffect) -> Payload:
    return Payload(float(effect.vector("mass")[0]), effect.vector("com"), np.array(effect.settings["inertia_com"]))


def _true_urdf(true: TrueRobot) -> str:
    """The URDF with what is carried from the start, and with links that weigh what they really weigh."""
    urdf = true.robot.urdf
    for effect in true.effects:
        if effect.id == "payload":
            urdf = urdf_with_payload(urdf, true.robot.default_frame, _body(effect))
        elif effect.id == "link_inertia":
            link = true.robot.body_names[true.index(effect.joints[0])]
            urdf = _with_changed_link(urdf, link, effect.settings["mass_factor"], effect.settings["com_shift"])
    return urdf


def _with_changed_link(urdf: str, link: str, factor: float, shift: list[float]) -> str:
    root = ElementTree.fromstring(urdf)
    inertial = next(element for element in root.findall("link") if element.get("name") == link).find("inertial")
    if inertial is None:
        raise SettingsError(f"link '{link}' has no <inertial> that could be wrong. Hide link_inertia on another joint.")
    for element in inertial:
        if element.tag == "mass":
            element.set("value", repr(float(element.get("value", "0")) * factor))
        elif element.tag == "origin":
            moved = np.array(element.get("xyz", "0 0 0").split(), dtype=float) + shift
            element.set("xyz", " ".join(repr(float(x)) for x in moved))
        elif element.tag == "inertia":
            for name, value in element.attrib.items():
                element.set(name, repr(float(value) * factor))
    return ElementTree.tostring(root, encoding="unicode")
