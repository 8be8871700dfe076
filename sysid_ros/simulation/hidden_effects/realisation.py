"""How each hidden effect is built into the true robot, from its own equation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.simulation.hidden_effects import channels
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot

Realise = Callable[[HiddenEffect, TrueRobot], None]
_REALISE: dict[str, Realise] = {}


def realise(effect: HiddenEffect, true: TrueRobot) -> None:
    """Build an effect in.

    Raises:
        SettingsError: no effect has this id.
    """
    if effect.id not in _REALISE:
        raise SettingsError(f"effect is '{effect.id}'; it must be one of {', '.join(sorted(_REALISE))}.")
    _REALISE[effect.id](effect, true)


def _of(*ids: str) -> Callable[[Realise], Realise]:
    def register(function: Realise) -> Realise:
        for id_ in ids:
            _REALISE[id_] = function
        return function

    return register


@_of("payload")
def _payload(effect: HiddenEffect, true: TrueRobot) -> None:
    inertia = np.array(effect.settings["inertia_com"])
    true.pi = true.pi + true.body_at_tip(float(effect.vector("mass")[0]), effect.vector("com"), inertia)


@_of("payload_change")
def _payload_change(effect: HiddenEffect, true: TrueRobot) -> None:
    inertia = np.array(effect.settings["inertia_com"])
    true.picked_up = true.body_at_tip(float(effect.vector("mass")[0]), effect.vector("com"), inertia)
    true.change_time = float(effect.vector("t0")[0])


@_of("link_inertia")
def _link_inertia(effect: HiddenEffect, true: TrueRobot) -> None:
    true.move_link(true.index(effect.joints[0]), effect.settings["mass_factor"], np.array(effect.settings["com_shift"]))


@_of("base_tilt")
def _base_tilt(effect: HiddenEffect, true: TrueRobot) -> None:
    roll, pitch = float(effect.vector("roll")[0]), float(effect.vector("pitch")[0])
    # R = R_y(pitch) R_x(roll) turns the base's axes into the world's
    g = -true.gravity[2]
    true.gravity = -g * np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])


@_of("external_force")
def _external_force(effect: HiddenEffect, true: TrueRobot) -> None:
    true.force = true.force + effect.vector("force")


@_of("rotor_inertia", "viscous_friction", "quadratic_friction")
def _one_coefficient(effect: HiddenEffect, true: TrueRobot) -> None:
    array, name = {
        "rotor_inertia": ("rotor", "J"),
        "viscous_friction": ("viscous", "b"),
        "quadratic_friction": ("quadratic", "c"),
    }[effect.id]
    true.add(array, effect.per_joint(name))


@_of("coulomb_friction", "stribeck_friction", "load_dependent_friction", "presliding_hysteresis", "friction_drift")
def _dry_friction(effect: HiddenEffect, true: TrueRobot) -> None:
    level = effect.per_joint("Fc")
    true.add("coulomb_forward", level)
    true.add("coulomb_backward", level)
    if effect.id == "stribeck_friction":
        true.add("breakaway", {j: fs - level[j] for j, fs in effect.per_joint("Fs").items()})
        true.put("stribeck_speed", effect.per_joint("vs"))
    true.add("load_factor", effect.per_joint("mu"))
    true.put("presliding", effect.per_joint("z_s"))
    true.add("viscous", effect.per_joint("b"))
    true.add("dry_rate", effect.per_joint("rate_Fc"))
    true.add("viscous_rate", effect.per_joint("rate_b"))


@_of("asymmetric_coulomb_friction")
def _asymmetric(effect: HiddenEffect, true: TrueRobot) -> None:
    true.add("coulomb_forward", effect.per_joint("F_pos"))
    true.add("coulomb_backward", effect.per_joint("F_neg"))


@_of("spring")
def _spring(effect: HiddenEffect, true: TrueRobot) -> None:
    array = "balancer" if effect.kind == "balancer" else "spring"
    true.add(array, effect.per_joint("k"))
    true.put(f"{array}_origin", effect.per_joint("q0"))


@_of("cogging")
def _cogging(effect: HiddenEffect, true: TrueRobot) -> None:
    true.add("ripple", effect.per_joint("amp"))
    true.put("ripple_harmonic", effect.per_joint("harmonic"))
    true.put("ripple_phase", dict(zip(effect.joints, effect.settings["phase"], strict=True)))


@_of("joint_elasticity", "backlash")
def _compliance(effect: HiddenEffect, true: TrueRobot) -> None:
    stiffness = effect.per_joint("stiffness") or dict(zip(effect.joints, effect.settings["stiffness"], strict=True))
    motor = dict(zip(effect.joints, effect.settings["motor_inertia"], strict=True))
    ratio = 0.3 if effect.id == "backlash" else 0.03
    true.put("stiffness", stiffness)
    true.put("gap", effect.per_joint("gap"))
    true.put("motor_inertia", motor)
    true.put("compliance_damping", {j: 2.0 * ratio * np.sqrt(k * motor[j]) for j, k in stiffness.items()})


@_of("torque_saturation")
def _saturation(effect: HiddenEffect, true: TrueRobot) -> None:
    limit = effect.per_joint("limit")
    if effect.kind == "sensor":
        true.channels.append(channels.Clipped(true.per_joint(limit, np.inf)))
    else:
        true.put("limit", limit)


@_of("joint_coupling")
def _coupling(effect: HiddenEffect, true: TrueRobot) -> None:
    joint, other = (true.index(j) for j in effect.joints)
    true.channels.append(channels.Coupled(joint, other, effect.per_joint("c")[effect.joints[0]]))


@_of("torque_offset", "torque_offset_drift")
def _offset(effect: HiddenEffect, true: TrueRobot) -> None:
    offset, rate = true.per_joint(effect.per_joint("offset")), true.per_joint(effect.per_joint("rate"))
    true.channels.append(channels.Offset(offset, rate))


@_of("torque_scale", "torque_sign")
def _gain(effect: HiddenEffect, true: TrueRobot) -> None:
    true.channels.append(channels.Gained(true.per_joint(effect.per_joint("gain"), 1.0)))


@_of("torque_unit")
def _unit(effect: HiddenEffect, true: TrueRobot) -> None:
    true.channels.append(channels.Gained(true.per_joint(effect.per_joint("factor"), 1.0)))


@_of("joint_offset")
def _joint_offset(effect: HiddenEffect, true: TrueRobot) -> None:
    true.channels.append(channels.Misaligned(true.per_joint(effect.per_joint("delta"))))


@_of("joint_sign")
def _joint_sign(effect: HiddenEffect, true: TrueRobot) -> None:
    true.channels.append(channels.Mirrored(true.per_joint(effect.per_joint("sign"), 1.0)))


@_of("joint_order")
def _joint_order(effect: HiddenEffect, true: TrueRobot) -> None:
    source = {p.joint: str(p.value) for p in effect.parameters if p.name == "takes_from"}
    order = tuple(true.index(source.get(joint, joint)) for joint in true.robot.joint_names)
    true.channels.append(channels.Exchanged(order, effect.kind == "effort"))


@_of("gravity_compensated_effort")
def _gravity(effect: HiddenEffect, true: TrueRobot) -> None:
    true.channels.append(channels.WithGravity(true.robot, float(effect.vector("coef")[0])))


@_of("time_delay")
def _delay(effect: HiddenEffect, true: TrueRobot) -> None:
    true.channels.append(channels.Delayed(float(effect.vector("delay")[0])))


@_of("velocity_lag")
def _lag(effect: HiddenEffect, true: TrueRobot) -> None:
    true.channels.append(channels.Lagging(float(effect.vector("cutoff")[0])))


@_of("torque_quantisation")
def _quantisation(effect: HiddenEffect, true: TrueRobot) -> None:
    true.channels.append(channels.Quantised(true.per_joint(effect.per_joint("step"))))


@_of("outside_neighbour_friction", "outside_neighbour_damping", "outside_hum")
def _outside_torque(effect: HiddenEffect, true: TrueRobot) -> None:
    joint = effect.joints[0]
    if effect.id == "outside_hum":
        true.add("hum", {joint: effect.settings["amplitude"]})
        true.put("hum_frequency", {joint: effect.settings["frequency"]})
        return
    true.put("neighbour", {joint: float(true.index(effect.settings["neighbour"]))})
    if effect.id == "outside_neighbour_friction":
        true.add("coulomb_forward", {joint: effect.settings["level"]})
        true.add("coulomb_backward", {joint: effect.settings["level"]})
        true.put("neighbour_friction", {joint: effect.settings["share"]})
    else:
        true.put("neighbour_damping", {joint: effect.settings["damping"]})


@_of("outside_wobbling_gain")
def _wobble(effect: HiddenEffect, true: TrueRobot) -> None:
    true.channels.append(channels.Wobbling(true.index(effect.joints[0]), effect.settings["size"], effect.settings["period"]))
