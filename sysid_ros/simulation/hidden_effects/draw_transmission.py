"""Springs, compliance, ripple and limits of the drives, drawn."""

from __future__ import annotations

import numpy as np

from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect

_FLANK_FREQUENCY = 300.0
_REVERSAL = 0.15
_HOLDING = 1.1


def spring(c: Circumstances) -> HiddenEffect:
    """A cable ``k (q - q0)`` or a balancer ``k sin(q - q0)``."""
    j = c.one_joint(np.ptp(c.q, axis=0) > 1.0)
    span, middle = 0.5 * np.ptp(c.q[:, j]), float(c.q[:, j].mean())
    kind = "balancer" if c.uniform(0.0, 1.0) < 0.35 else "cable"
    k = c.share(0.1, 0.5) * c.torque[j] / (1.0 if kind == "balancer" else span)
    unit = "N m" if kind == "balancer" else "N m/rad"
    return c.effect("spring", [j], {"k": ({j: k}, unit), "q0": ({j: middle + c.uniform(-0.5, 0.5)}, "rad")}, kind)


def cogging(c: Circumstances) -> HiddenEffect:
    """``amp sin(harmonic q + phase)``."""
    joints = [c.one_joint()]
    values = {
        "harmonic": ({j: float(c.rng.integers(8, 41)) for j in joints}, "1/rev"),
        "amp": ({j: c.share(0.04, 0.15) * c.torque[j] for j in joints}, "N m"),
    }
    return c.effect("cogging", joints, values, phase=[c.uniform(-np.pi, np.pi) for _ in joints])


def joint_elasticity(c: Circumstances) -> HiddenEffect:
    """A spring between the motor, whose position is measured, and a joint that carries a load."""
    j = c.one_joint(c.torque >= np.median(c.torque))
    stiffness = c.torque[j] / c.share(0.006, 0.02)
    return c.effect("joint_elasticity", [j], {"stiffness": ({j: stiffness}, "N m/rad")}, motor_inertia=[0.15 * c.inertia[j]])


def backlash(c: Circumstances) -> HiddenEffect:
    """A gap between the motor, whose position is measured, and a joint whose load changes its sign."""
    forward = np.mean(c.tau > 0.0, axis=0)
    j = c.one_joint((forward > _REVERSAL) & (forward < 1.0 - _REVERSAL))
    motor = 0.2 * c.inertia[j]
    return c.effect(
        "backlash",
        [j],
        {"gap": ({j: c.share(0.006, 0.03)}, "rad")},
        motor_inertia=[motor],
        stiffness=[motor * _FLANK_FREQUENCY**2],
    )


def joint_coupling(c: Circumstances) -> HiddenEffect:
    """``-c`` times a neighbour's torque."""
    last = c.robot.n - 1
    j = c.one_joint(np.arange(last + 1) > 0)
    other = 1 if j == 0 else j - 1 if j == last or c.uniform(0.0, 1.0) < 0.5 else j + 1
    size = c.sign() * min(c.share(0.1, 0.4) * c.torque[j] / c.torque[other], 0.6)
    names = c.robot.joint_names
    effect = c.effect("joint_coupling", [j], {"c": ({j: size}, "")})
    return HiddenEffect(effect.id, (names[j], names[other]), effect.parameters)


def torque_saturation(c: Circumstances) -> HiddenEffect:
    """A motor, or the sensor of one, that can do no more; the published effort is what was asked for, or ends at the limit.

    A motor's limit holds the arm against gravity with some room: else the arm would fall, and not only lag behind.
    """
    motor = c.uniform(0.0, 1.0) > 0.35
    low = np.abs(c.tau).max(axis=0) * (1.0 - c.uniform(0.15, 0.45) * c.scale)
    held = _HOLDING * np.abs(c.gravity).max(axis=0) < low
    j = c.one_joint(held if motor else None)
    if motor and held[j]:
        return c.effect("torque_saturation", [j], {"limit": ({j: float(low[j])}, "N m")}, "motor")
    limit = float(np.quantile(np.abs(c.tau[:, j]), 1.0 - c.uniform(0.05, 0.15) * c.scale))
    return c.effect("torque_saturation", [j], {"limit": ({j: limit}, "N m")}, "sensor")
