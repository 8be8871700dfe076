"""Every cause that can be hidden. A new one is a new file and a line here; the exam's seeds draw in this order."""

from collections.abc import Sequence

from sysid_ros.effects import EFFECTS
from sysid_ros.exceptions import SettingsError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.hidden_effects.cause import CAUSES, HiddenCause
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect
from sysid_ros.simulation.hidden_effects.regressed_cause import RegressedCause
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot

# isort: off
from sysid_ros.simulation.hidden_effects import (  # noqa: F401
    payload,
    link_inertia,
    rotor_inertia,
    viscous_friction,
    coulomb_friction,
    stribeck_friction,
    asymmetric_coulomb_friction,
    load_dependent_friction,
    quadratic_friction,
    presliding_hysteresis,
    torque_offset,
    torque_scale,
    torque_sign,
    torque_unit,
    joint_offset,
    joint_sign,
    joint_order,
    base_tilt,
    gravity_compensated_effort,
    time_delay,
    velocity_lag,
    joint_elasticity,
    backlash,
    spring,
    cogging,
    joint_coupling,
    friction_drift,
    torque_offset_drift,
    torque_saturation,
    torque_quantisation,
    external_force,
    payload_change,
    effort_lag,
    outside,
)
# isort: on


def hideable() -> list[str]:
    """Ids of the library's effects and of the channels' faults, each of which a simulated robot can hide, sorted."""
    return sorted({*EFFECTS, *(id_ for id_, cause in CAUSES.items() if not cause.outside)})


def cause_of(id_: str) -> HiddenCause:
    """The cause with an id; an effect of the library that has no cause of its own is hidden by its columns.

    Raises:
        SettingsError: nothing has this id.
    """
    if id_ in CAUSES:
        return CAUSES[id_]
    if id_ in EFFECTS:
        return RegressedCause(EFFECTS[id_])
    raise SettingsError(f"effect is '{id_}'; it must be one of {', '.join(sorted({*CAUSES, *EFFECTS}))}.")


def realise(robot: RobotModel, effects: Sequence[HiddenEffect] = ()) -> TrueRobot:
    """The robot as it really is, with everything that it hides.

    Raises:
        SettingsError: an effect has an id that nothing has.
    """
    true = TrueRobot(robot)
    true.effects = tuple(effects)
    for effect in effects:
        cause_of(effect.id).realise(effect, true)
    return true
