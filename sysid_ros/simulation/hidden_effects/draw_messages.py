"""Faults of the messages, drawn."""

from __future__ import annotations

import numpy as np

from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect, TrueParameter

_LEAST_STEP, _LEVELS = 3.0, 6.0
_UNITS = {"mN m": 1000.0, "N cm": 100.0, "lbf ft": 0.737562, "lbf in": 8.850746}


def torque_offset(c: Circumstances) -> HiddenEffect:
    """A constant."""
    joints = c.some_joints()
    return c.effect(
        "torque_offset", joints, {"offset": ({j: c.sign() * c.share(0.04, 0.3) * c.torque[j] for j in joints}, "N m")}
    )


def torque_offset_drift(c: Circumstances) -> HiddenEffect:
    """A ramp in time."""
    joints = c.some_joints()
    values = {j: c.sign() * c.share(0.1, 0.5) * c.torque[j] / c.motion.duration for j in joints}
    return c.effect("torque_offset_drift", joints, {"rate": (values, "N m/s")})


def torque_scale(c: Circumstances) -> HiddenEffect:
    """A wrong torque constant of one joint."""
    j = c.one_joint()
    return c.effect("torque_scale", [j], {"gain": ({j: 1.0 + c.sign() * c.share(0.08, 0.3)}, "")})


def torque_sign(c: Circumstances) -> HiddenEffect:
    """Effort of one joint counted the other way."""
    return c.effect("torque_sign", [j := c.one_joint()], {"gain": ({j: -1.0}, "")})


def torque_unit(c: Circumstances) -> HiddenEffect:
    """All efforts in another unit, or motor currents."""
    n = c.robot.n
    if c.uniform(0.0, 1.0) < 0.5:
        kind = str(c.rng.choice(list(_UNITS)))
        factor = dict.fromkeys(range(n), _UNITS[kind])
    else:
        kind = "A"
        strong = c.torque / c.torque.max()
        factor = {j: 1.0 / (c.uniform(6.0, 14.0) if strong[j] > 0.2 else c.uniform(3.0, 11.0)) for j in range(n)}
    return c.effect("torque_unit", list(range(n)), {"factor": (factor, f"{kind} / (N m)")}, kind)


def joint_offset(c: Circumstances) -> HiddenEffect:
    """An encoder with its zero elsewhere."""
    j = c.one_joint()
    return c.effect("joint_offset", [j], {"delta": ({j: c.sign() * c.share(0.02, 0.12)}, "rad")})


def joint_sign(c: Circumstances) -> HiddenEffect:
    """A joint counted the other way, in position, velocity and effort."""
    return c.effect("joint_sign", [j := c.one_joint()], {"sign": ({j: -1.0}, "")})


def joint_order(c: Circumstances) -> HiddenEffect:
    """Two joints under each other's names, in the efforts alone or in all channels."""
    one = c.one_joint()
    other = int(c.rng.choice([j for j in range(c.robot.n) if j != one]))
    first, second = sorted((one, other))
    names = c.robot.joint_names
    parameters = (
        TrueParameter("takes_from", names[first], names[second], ""),
        TrueParameter("takes_from", names[second], names[first], ""),
    )
    kind = "effort" if c.uniform(0.0, 1.0) < 0.5 else "all"
    return HiddenEffect("joint_order", (names[first], names[second]), parameters, kind)


def gravity_compensated_effort(c: Circumstances) -> HiddenEffect:
    """Effort without the torque of gravity, or with it twice."""
    return c.whole_arm("gravity_compensated_effort", [TrueParameter("coef", None, c.sign(), "")])


def time_delay(c: Circumstances) -> HiddenEffect:
    """Efforts that come late."""
    return c.whole_arm("time_delay", [TrueParameter("delay", None, max(c.share(0.006, 0.02), 0.004), "s")])


def velocity_lag(c: Circumstances) -> HiddenEffect:
    """Velocities behind a low-pass in the drive."""
    return c.whole_arm("velocity_lag", [TrueParameter("cutoff", None, c.uniform(3.0, 12.0), "Hz")])


def torque_quantisation(c: Circumstances) -> HiddenEffect:
    """Efforts in steps, of one joint or of all."""
    span = np.ptp(c.tau, axis=0)
    wide = span > _LEVELS * _LEAST_STEP * c.torque_noise
    joints = (
        np.flatnonzero(wide).tolist() if c.only is None and c.uniform(0.0, 1.0) < 0.5 and np.any(wide) else [c.one_joint(wide)]
    )
    steps = {j: min(max(c.share(6.0, 20.0), _LEAST_STEP) * float(c.torque_noise[j]), span[j] / _LEVELS) for j in joints}
    return c.effect("torque_quantisation", joints, {"step": (steps, "N m")})
