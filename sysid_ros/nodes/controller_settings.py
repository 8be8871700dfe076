"""Parameters that only the adaptive controller has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from sysid_ros.control import LAWS
from sysid_ros.online_settings import Settings, setting

ROBOT_ADDS: Final = ("nothing", "gravity", "gravity_and_friction")
"""What a robot may add to the efforts that it is sent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerSettings(Settings):
    """What is controlled and how."""

    urdf_path: str = setting("", "the robot's URDF; empty: it is taken from the topic robot_description")
    model_path: str = setting("", "model.yaml of 'sysid identify'; empty: the URDF's links and <dynamics> are what is known")
    joint_names: tuple[str, ...] = setting((), "joints that are moved, in the order of the commands; empty: all of the URDF")
    frame_id: str = setting("", "frame that the payload is fixed to; empty: the arm's flange")
    gravity: tuple[float, ...] = setting((0.0, 0.0, -9.81), "gravity in the base frame", "m/s^2", -30.0, 30.0)
    law: str = setting("composite", "the control law", choices=LAWS)
    payload_from: str = setting(
        "live", "of the estimator's values: each that may be believed, or those it commits", choices=("live", "committed")
    )
    robot_adds: str = setting(
        "nothing", "what the robot adds to the efforts by itself, so that they are sent without it", choices=ROBOT_ADDS
    )
    autostart: bool = setting(False, "configure and activate at the start: efforts are sent from the first state on")
    executor: str = setting("events", "as of the estimator", choices=("single", "events"))
