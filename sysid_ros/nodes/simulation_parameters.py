"""Parameters of the simulated robot, and how their values are read."""

from __future__ import annotations

from typing import Any

from rclpy.parameter import Parameter

from sysid_ros.exceptions import SettingsError

PARAMETERS: tuple[tuple[str, Any, str], ...] = (
    ("robot", "arm", "arm or quadruped"),
    ("gait", "sway", "of the quadruped: stand, sway or trot"),
    ("slope", 0.0, "of the ground under the quadruped, up to 10 [deg]"),
    ("seed", 0, "seed of the motion and of the noise"),
    ("rate", 1000, "messages a second, a divisor of 1000 [Hz]"),
    ("duration", 0.0, "the motion ends at rest after this time [s]; 0: it never ends"),
    ("payload_mass", 1.5, "[kg]; 0: there is no payload"),
    ("payload_com", [0.03, -0.02, 0.08], "centre of mass in the tip link's frame [m]"),
    ("pick_time", 5.0, "the payload is picked up so long after the start [s]; -1: only by ~/pick"),
    ("drop_time", -1.0, "and dropped [s]; -1: only by ~/drop"),
    ("encoder_noise", 1e-5, "standard deviation of the positions [rad]"),
    ("torque_noise", 0.1, "standard deviation of the efforts [N m]"),
    ("velocity", True, "the messages hold velocities"),
    ("velocity_noise", 1e-3, "standard deviation of the velocities [rad/s]"),
    ("viscous_friction", [0.0], "one value for all joints or one a joint [N m s/rad]"),
    ("coulomb_friction", [0.0], "one value for all joints or one a joint [N m]"),
    ("rotor_inertia", [0.0], "one value for all joints or one a joint [kg m^2]"),
    ("torque_offset", [0.0], "what the torque sensors show too much: one value for all joints or one a joint [N m]"),
    ("controller_knows_payload", False, "the controller's model has the payload while it is carried"),
    ("command_timeout", 0.05, "without a command for so long the drives of a commanded arm bring it to rest and hold it [s]"),
    ("adds_gravity", False, "the arm adds the weight of its links to the commands by itself, as some makers' do"),
    ("commanded", False, "the arm obeys what comes on effort_commands; until then it holds its first posture"),
)


ARM_ONLY = (
    "velocity",
    "viscous_friction",
    "coulomb_friction",
    "rotor_inertia",
    "torque_offset",
    "controller_knows_payload",
    "adds_gravity",
    "commanded",
)
"""Parameters that the quadruped does not have."""


def typed(name: str, parameter: Parameter, default: Any) -> Any:
    """The parameter's value in the type of its default.

    Raises:
        SettingsError: it has another one.
    """
    value = parameter.value
    if isinstance(default, str):
        if not isinstance(value, str):
            raise SettingsError(f"{name} is {value!r}; it must be a string.")
        return value
    if isinstance(default, list):
        items = list(value) if not isinstance(value, int | float | str) and value is not None else [value]
        return tuple(_number(name, x) for x in items)
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise SettingsError(f"{name} is {value!r}; it must be true or false.")
        return value
    number = _number(name, value)
    if isinstance(default, int):
        if number != int(number):
            raise SettingsError(f"{name} is {value!r}; it must be a whole number.")
        return int(number)
    return number


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SettingsError(f"{name} is {value!r}; it must be a number.")
    return float(value)
