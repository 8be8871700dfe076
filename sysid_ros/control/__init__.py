"""Control laws that use what is known of an arm and of what it carries."""

from sysid_ros.control.arm_torque import ArmTorque
from sysid_ros.control.computed_torque import ComputedTorque
from sysid_ros.control.control_settings import ControlSettings
from sysid_ros.control.controller import Reference, TrackingController, believed_payload
from sysid_ros.control.laws import LAWS, make_law
from sysid_ros.control.slotine_li import SlotineLi

__all__ = [
    "LAWS",
    "ArmTorque",
    "ComputedTorque",
    "ControlSettings",
    "Reference",
    "SlotineLi",
    "TrackingController",
    "believed_payload",
    "make_law",
]
