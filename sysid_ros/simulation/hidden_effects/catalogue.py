"""Every effect that can be hidden, by its id."""

from __future__ import annotations

from collections.abc import Callable

from sysid_ros.simulation.hidden_effects import draw_bodies, draw_friction, draw_messages, draw_outside, draw_transmission
from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect

Draw = Callable[[Circumstances], HiddenEffect]

DRAWS: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        draw_bodies.payload,
        draw_bodies.link_inertia,
        draw_friction.rotor_inertia,
        draw_friction.viscous_friction,
        draw_friction.coulomb_friction,
        draw_friction.stribeck_friction,
        draw_friction.asymmetric_coulomb_friction,
        draw_friction.load_dependent_friction,
        draw_friction.quadratic_friction,
        draw_friction.presliding_hysteresis,
        draw_messages.torque_offset,
        draw_messages.torque_scale,
        draw_messages.torque_sign,
        draw_messages.torque_unit,
        draw_messages.joint_offset,
        draw_messages.joint_sign,
        draw_messages.joint_order,
        draw_bodies.base_tilt,
        draw_messages.gravity_compensated_effort,
        draw_messages.time_delay,
        draw_messages.velocity_lag,
        draw_transmission.joint_elasticity,
        draw_transmission.backlash,
        draw_transmission.spring,
        draw_transmission.cogging,
        draw_transmission.joint_coupling,
        draw_friction.friction_drift,
        draw_messages.torque_offset_drift,
        draw_transmission.torque_saturation,
        draw_messages.torque_quantisation,
        draw_bodies.external_force,
        draw_bodies.payload_change,
    )
}
"""Effects that a diagnosis should name."""

OUTSIDE: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        draw_outside.outside_neighbour_friction,
        draw_outside.outside_neighbour_damping,
        draw_outside.outside_hum,
        draw_outside.outside_wobbling_gain,
    )
}
"""Causes that no effect of the library describes."""
