"""The same true robot with PyBullet moving the links."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.arm import STEP, ArmWorld
from sysid_ros.simulation.hidden_effects.chain import chain_of
from sysid_ros.simulation.hidden_effects.channels import Signals
from sysid_ros.simulation.hidden_effects.integrator import solve_step, state_at
from sysid_ros.simulation.hidden_effects.motion import PlannedMotion
from sysid_ros.simulation.hidden_effects.run import check_followed
from sysid_ros.simulation.hidden_effects.true_robot import LinkChange, TrueRobot
from sysid_ros.simulation.payload import urdf_with_payload

_PUSH = 2


def move_in_pybullet(
    true: TrueRobot, motion: PlannedMotion, rate: int, stiffening: FloatArray, progress: Callable[[int], None] = lambda n: None
) -> Signals:
    """As :func:`.run.move`: PyBullet moves the links, a body that is picked up is tied to the tip, and what the joints hide is in
    the torque that the links get at each step.

    Raises:
        SettingsError: the arm does not follow the motion, or something is hidden that needs shorter steps.
    """
    if true.needs_short_steps:
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
            if true.picked_up is not None and t >= true.change_time and not world.body.tied:
                world.pick(true.picked_up)
            state.q[:] = state.angle[:] = world.q
            state.v[:] = state.rate[:] = world.v
            links = after if world.body.tied else before
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


def _true_urdf(true: TrueRobot) -> str:
    """The URDF with what is carried from the start, and with links that weigh what they really weigh."""
    urdf = true.robot.urdf
    for body in true.carried:
        urdf = urdf_with_payload(urdf, true.robot.default_frame, body)
    for change in true.link_changes:
        urdf = _with_changed_link(urdf, true.robot.body_names[change.joint], change)
    return urdf


def _with_changed_link(urdf: str, link: str, change: LinkChange) -> str:
    root = ElementTree.fromstring(urdf)
    inertial = next(element for element in root.findall("link") if element.get("name") == link).find("inertial")
    if inertial is None:
        raise SettingsError(f"link '{link}' has no <inertial> that could be wrong. Hide link_inertia on another joint.")
    for element in inertial:
        if element.tag == "mass":
            element.set("value", repr(float(element.get("value", "0")) * change.mass_factor))
        elif element.tag == "origin":
            moved = np.array(element.get("xyz", "0 0 0").split(), dtype=float) + change.com_shift
            element.set("xyz", " ".join(repr(float(x)) for x in moved))
        elif element.tag == "inertia":
            for name, value in element.attrib.items():
                element.set(name, repr(float(value) * change.mass_factor))
    return ElementTree.tostring(root, encoding="unicode")
