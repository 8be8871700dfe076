"""Frictions and rotor inertias, drawn."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect


def viscous_friction(c: Circumstances) -> HiddenEffect:
    """``b v``."""
    joints = c.some_joints()
    return c.effect(
        "viscous_friction", joints, {"b": ({j: c.share(0.05, 0.3) * c.torque[j] / c.speed[j] for j in joints}, "N m s/rad")}
    )


def coulomb_friction(c: Circumstances) -> HiddenEffect:
    """``Fc sign(v)``."""
    joints = c.some_joints()
    return c.effect("coulomb_friction", joints, {"Fc": (_levels(c, joints), "N m")})


def quadratic_friction(c: Circumstances) -> HiddenEffect:
    """``c abs(v) v``."""
    joints = c.some_joints()
    values = {j: c.share(0.06, 0.3) * c.torque[j] / c.speed[j] ** 2 for j in joints}
    return c.effect("quadratic_friction", joints, {"c": (values, "N m s^2/rad^2")})


def stribeck_friction(c: Circumstances) -> HiddenEffect:
    """``sign(v) (Fc + (Fs - Fc) exp(-(v / vs)^2))``."""
    joints = c.some_joints()
    level = _levels(c, joints)
    breakaway = {j: level[j] * c.uniform(1.4, 2.2) for j in joints}
    speed = {j: c.uniform(0.05, 0.15) for j in joints}
    values = {"Fc": (level, "N m"), "Fs": (breakaway, "N m"), "vs": (speed, "rad/s")}
    return c.effect("stribeck_friction", joints, values)


def asymmetric_coulomb_friction(c: Circumstances) -> HiddenEffect:
    """``F_pos`` forward, ``F_neg`` backward."""
    joints = c.some_joints()
    one = _levels(c, joints)
    other = {j: one[j] * c.uniform(0.35, 0.7) for j in joints}
    forward, backward = (one, other) if c.sign() > 0.0 else (other, one)
    return c.effect("asymmetric_coulomb_friction", joints, {"F_pos": (forward, "N m"), "F_neg": (backward, "N m")})


def load_dependent_friction(c: Circumstances) -> HiddenEffect:
    """``sign(v) (Fc + mu abs(link torque))``, of joints whose load changes."""
    joints = [c.one_joint(c.tau.std(axis=0) > 0.3 * c.torque)]
    values = {
        "Fc": ({j: c.share(0.03, 0.12) * c.torque[j] for j in joints}, "N m"),
        "mu": ({j: c.share(0.08, 0.3) for j in joints}, ""),
    }
    return c.effect("load_dependent_friction", joints, values)


def presliding_hysteresis(c: Circumstances) -> HiddenEffect:
    """A bristle that bends by ``z_s`` before it slides."""
    joints = c.some_joints()
    return c.effect(
        "presliding_hysteresis",
        joints,
        {"Fc": (_levels(c, joints), "N m"), "z_s": ({j: c.uniform(0.02, 0.08) for j in joints}, "rad")},
    )


def friction_drift(c: Circumstances) -> HiddenEffect:
    """Coulomb and viscous friction that fade as the joint warms up."""
    joints = c.some_joints()
    level = _levels(c, joints)
    viscous = {j: c.uniform(0.2, 0.6) * level[j] / c.speed[j] for j in joints}
    rate = {j: -c.uniform(0.4, 0.8) / c.motion.duration for j in joints}
    return c.effect(
        "friction_drift",
        joints,
        {
            "Fc": (level, "N m"),
            "b": (viscous, "N m s/rad"),
            "rate_Fc": ({j: rate[j] * level[j] for j in joints}, "N m/s"),
            "rate_b": ({j: rate[j] * viscous[j] for j in joints}, "N m/rad"),
        },
    )


def rotor_inertia(c: Circumstances) -> HiddenEffect:
    """``J a``."""
    joints = c.some_joints()
    values = {j: c.share(0.05, 0.3) * c.torque[j] / c.acceleration[j] for j in joints}
    return c.effect("rotor_inertia", joints, {"J": (values, "kg m^2")})


def _levels(c: Circumstances, joints: list[int]) -> dict[int, float]:
    return {j: c.share(0.06, 0.35) * c.torque[j] for j in joints}
