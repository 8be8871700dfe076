"""Physical causes of joint torque, one a file. A new one is a new file and a line here."""

from sysid_ros.effects.accelerometer_bias import AccelerometerBias
from sysid_ros.effects.asymmetric_coulomb_friction import AsymmetricCoulombFriction
from sysid_ros.effects.backlash import Backlash
from sysid_ros.effects.base_tilt import BaseTilt
from sysid_ros.effects.channel_effect import ChannelEffect, Channels
from sysid_ros.effects.cogging import Cogging
from sysid_ros.effects.coulomb_friction import CoulombFriction
from sysid_ros.effects.effect import Acts, Depends, Effect, JointCurves, JointEffect, Knob
from sysid_ros.effects.effort_lag import EffortLag
from sysid_ros.effects.external_force import ExternalForce
from sysid_ros.effects.foot_radius import FootRadius
from sysid_ros.effects.friction_drift import FrictionDrift
from sysid_ros.effects.gravity_compensated_effort import GravityCompensatedEffort
from sysid_ros.effects.imu_delay import ImuDelay
from sysid_ros.effects.imu_lever import ImuLever
from sysid_ros.effects.imu_tilt import ImuTilt
from sysid_ros.effects.joint_coupling import JointCoupling
from sysid_ros.effects.joint_elasticity import JointElasticity
from sysid_ros.effects.joint_offset import JointOffset
from sysid_ros.effects.joint_order import JointOrder
from sysid_ros.effects.joint_sign import JointSign
from sysid_ros.effects.link_inertia import LinkInertia
from sysid_ros.effects.load_dependent_friction import LoadDependentFriction
from sysid_ros.effects.other_payload import OtherPayload
from sysid_ros.effects.parameter import Parameter
from sysid_ros.effects.payload import Payload
from sysid_ros.effects.payload_change import PayloadChange
from sysid_ros.effects.presliding_hysteresis import PreslidingHysteresis
from sysid_ros.effects.quadratic_friction import QuadraticFriction
from sysid_ros.effects.rotor_inertia import RotorInertia
from sysid_ros.effects.spring import Spring
from sysid_ros.effects.stribeck_friction import StribeckFriction
from sysid_ros.effects.time_delay import TimeDelay
from sysid_ros.effects.torque_offset import TorqueOffset
from sysid_ros.effects.torque_offset_drift import TorqueOffsetDrift
from sysid_ros.effects.torque_quantisation import TorqueQuantisation
from sysid_ros.effects.torque_saturation import TorqueSaturation
from sysid_ros.effects.torque_scale import TorqueScale
from sysid_ros.effects.torque_sign import TorqueSign
from sysid_ros.effects.torque_unit import TorqueUnit
from sysid_ros.effects.traits import Candidate, Curve, Scope
from sysid_ros.effects.trunk_effect import TrunkEffect
from sysid_ros.effects.velocity_lag import VelocityLag
from sysid_ros.effects.viscous_friction import ViscousFriction
from sysid_ros.exceptions import SettingsError
from sysid_ros.signals.motion import Motion

_CLASSES: tuple[type[Effect], ...] = (
    LinkInertia,
    Payload,
    PayloadChange,
    OtherPayload,
    ViscousFriction,
    CoulombFriction,
    QuadraticFriction,
    AsymmetricCoulombFriction,
    StribeckFriction,
    LoadDependentFriction,
    PreslidingHysteresis,
    FrictionDrift,
    RotorInertia,
    TorqueOffset,
    TorqueOffsetDrift,
    TorqueScale,
    TorqueSaturation,
    GravityCompensatedEffort,
    BaseTilt,
    ExternalForce,
    JointOffset,
    JointElasticity,
    Backlash,
    JointCoupling,
    Spring,
    Cogging,
    TimeDelay,
    EffortLag,
    AccelerometerBias,
)

EFFECTS: dict[str, type[Effect]] = {effect.id: effect for effect in _CLASSES}
"""Every effect by the name it has in ``model.yaml``; of one family the simpler ones first."""

TRUNK_EFFECTS: dict[str, type[TrunkEffect]] = {effect.id: effect for effect in (ImuTilt, ImuLever, ImuDelay, FootRadius)}
"""Every error of IMU and feet by its name: of robots on legs."""

CHANNEL_EFFECTS: dict[str, type[ChannelEffect]] = {
    effect.id: effect for effect in (TorqueUnit, TorqueSign, JointSign, JointOrder, VelocityLag, TorqueQuantisation)
}
"""Every fault of the published channels by its name."""


def named(effect_id: str) -> type[Effect] | None:
    """The effect of that name in ``model.yaml``, of an arm or of a robot on legs; None where there is none."""
    return EFFECTS.get(effect_id) or TRUNK_EFFECTS.get(effect_id)


def forms_of(family: str) -> tuple[type[Effect], ...]:
    """The effects of a family that load one joint, of which a joint has one, the simpler ones first."""
    return tuple(e for e in EFFECTS.values() if family and e.family == family and e.scope is Scope.JOINT)


def register(effect: type[Effect]) -> type[Effect]:
    """Make an effect known to every command by its id; also a decorator. What an extension or a test calls.

    Raises:
        SettingsError: another effect has the id.
    """
    if EFFECTS.get(effect.id, effect) is not effect or effect.id in {**CHANNEL_EFFECTS, **TRUNK_EFFECTS}:
        raise SettingsError(f"an effect '{effect.id}' is registered already. Give the new one another id.")
    EFFECTS[effect.id] = effect
    return effect


__all__ = [
    "CHANNEL_EFFECTS",
    "EFFECTS",
    "TRUNK_EFFECTS",
    "AccelerometerBias",
    "Acts",
    "AsymmetricCoulombFriction",
    "Backlash",
    "BaseTilt",
    "Candidate",
    "ChannelEffect",
    "Channels",
    "Cogging",
    "CoulombFriction",
    "Curve",
    "Depends",
    "Effect",
    "EffortLag",
    "ExternalForce",
    "FootRadius",
    "FrictionDrift",
    "GravityCompensatedEffort",
    "ImuDelay",
    "ImuLever",
    "ImuTilt",
    "JointCoupling",
    "JointCurves",
    "JointEffect",
    "JointElasticity",
    "JointOffset",
    "JointOrder",
    "JointSign",
    "Knob",
    "LinkInertia",
    "LoadDependentFriction",
    "Motion",
    "OtherPayload",
    "Parameter",
    "Payload",
    "PayloadChange",
    "PreslidingHysteresis",
    "QuadraticFriction",
    "RotorInertia",
    "Scope",
    "Spring",
    "StribeckFriction",
    "TimeDelay",
    "TorqueOffset",
    "TorqueOffsetDrift",
    "TorqueQuantisation",
    "TorqueSaturation",
    "TorqueScale",
    "TorqueSign",
    "TorqueUnit",
    "TrunkEffect",
    "VelocityLag",
    "ViscousFriction",
    "forms_of",
    "named",
    "register",
]
