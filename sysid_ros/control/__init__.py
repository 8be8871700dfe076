"""Control laws that use what is known of an arm and of what it carries."""

from sysid_ros.control.arm_torque import ArmTorque
from sysid_ros.control.computed_torque import ComputedTorque
from sysid_ros.control.control_settings import ControlSettings
from sysid_ros.control.controller import Reference, TrackingController, believed_payload
from sysid_ros.control.slotine_li import SlotineLi
from sysid_ros.exceptions import SettingsError

LAWS = ("composite", "slotine_li", "certainty_equivalence", "computed_torque")


def make_law(name: str, arm: ArmTorque, settings: ControlSettings) -> TrackingController:
    """A law that has seen nothing yet.

    Raises:
        SettingsError: there is no such law.
    """
    if name in ("slotine_li", "composite"):
        return SlotineLi(arm, settings, composite=name == "composite")
    if name in ("certainty_equivalence", "computed_torque"):
        return ComputedTorque(arm, settings, listens=name == "certainty_equivalence")
    raise SettingsError(f"the law is {name!r}; it must be one of {', '.join(LAWS)}.")


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
