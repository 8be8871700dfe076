"""Physical causes of joint torque, one a file. A new one is a new file and a line here."""

from sysid_ros.effects.coulomb_friction import CoulombFriction
from sysid_ros.effects.effect import Effect, JointEffect
from sysid_ros.effects.link_inertia import LinkInertia
from sysid_ros.effects.payload import Payload
from sysid_ros.effects.rotor_inertia import RotorInertia
from sysid_ros.effects.torque_offset import TorqueOffset
from sysid_ros.effects.viscous_friction import ViscousFriction

EFFECTS: dict[str, type[Effect]] = {
    effect.id: effect for effect in (LinkInertia, Payload, ViscousFriction, CoulombFriction, RotorInertia, TorqueOffset)
}
"""Every effect by the name it has in ``model.yaml``."""

__all__ = [
    "EFFECTS",
    "CoulombFriction",
    "Effect",
    "JointEffect",
    "LinkInertia",
    "Payload",
    "RotorInertia",
    "TorqueOffset",
    "ViscousFriction",
]
