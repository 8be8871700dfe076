"""Bodies, the base and what pulls at the tip, drawn."""

from __future__ import annotations

import numpy as np

from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect, TrueParameter
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot
from sysid_ros.simulation.payload import box


def _body(c: Circumstances) -> tuple[list[TrueParameter], list[list[float]]]:
    direction = c.rng.normal(size=3)
    com = direction / np.linalg.norm(direction) * c.uniform(0.03, 0.12)
    mass = c.share(0.025, 0.08) * c.mass
    body = box(mass, com.tolist(), rpy=c.rng.uniform(-np.pi, np.pi, 3).tolist())
    parameters = [TrueParameter("mass", None, mass, "kg"), TrueParameter("com", None, tuple(com.tolist()), "m")]
    return parameters, body.inertia_com.tolist()


def payload(c: Circumstances) -> HiddenEffect:
    """A box on the tip link."""
    parameters, inertia = _body(c)
    return c.whole_arm("payload", parameters, inertia_com=inertia)


def payload_change(c: Circumstances) -> HiddenEffect:
    """A box that is picked up during the motion."""
    parameters, inertia = _body(c)
    t0 = TrueParameter("t0", None, c.uniform(0.3, 0.7) * c.motion.duration, "s")
    return c.whole_arm("payload_change", [*parameters, t0], inertia_com=inertia)


def link_inertia(c: Circumstances) -> HiddenEffect:
    """A link that is heavier or lighter than its URDF, or whose centre of mass is elsewhere; not the last one, which would be a
    payload, nor the first, of which only the inertia about a vertical axis shows, as a rotor's would."""
    robot = c.robot
    joint = c.one_joint((np.arange(robot.n) > 0) & (np.arange(robot.n) < robot.n - 1))
    kind = str(c.rng.choice(["mass", "com", "both"]))
    factor = 1.0 if kind == "com" else 1.0 + c.sign() * c.share(0.15, 0.4)
    direction = c.rng.normal(size=3)
    shift = np.zeros(3) if kind == "mass" else direction / np.linalg.norm(direction) * c.share(0.015, 0.05)
    added = TrueRobot(robot).move_link(joint, factor, shift)
    parameters = (
        TrueParameter("dm", robot.joint_names[joint], float(added[0]), "kg"),
        TrueParameter("dmc", robot.joint_names[joint], tuple(added[1:4].tolist()), "kg m"),
    )
    settings = {"mass_factor": factor, "com_shift": shift.tolist()}
    return HiddenEffect("link_inertia", (robot.joint_names[joint],), parameters, kind, settings)


def base_tilt(c: Circumstances) -> HiddenEffect:
    """A base that does not stand upright."""
    roll, pitch = (c.sign() * c.share(0.025, 0.1) for _ in range(2))
    return c.whole_arm("base_tilt", [TrueParameter("roll", None, roll, "rad"), TrueParameter("pitch", None, pitch, "rad")])


def external_force(c: Circumstances) -> HiddenEffect:
    """A constant pull at the tip, mostly sideways: straight down it would weigh like a body."""
    direction = c.rng.normal(size=3) * np.array([1.0, 1.0, 0.5])
    force = direction / np.linalg.norm(direction) * c.share(0.3, 1.2) * c.mass
    return c.whole_arm("external_force", [TrueParameter("force", None, tuple(force.tolist()), "N")])
