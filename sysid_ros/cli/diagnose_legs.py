"""``sysid diagnose`` of a robot on legs: its bags with IMU and contacts, and what is not asked of it."""

from __future__ import annotations

import math
from pathlib import Path

from sysid_ros.cli.progress import stages
from sysid_ros.cli.recordings import TrunkTopics, read_recordings, warn_of
from sysid_ros.diagnosis import Diagnosis, diagnose_on_legs
from sysid_ros.exceptions import DataError, RobotModelError, SettingsError
from sysid_ros.floating.floating_base import FloatingBase, floating_base_of
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import open_source, robot_of_source, urdf_text
from sysid_ros.sources.columns import read_columns

Found = tuple[RobotModel | None, Path | None, Diagnosis]
"""A robot where it is known, its URDF where one was given, and what is wrong with it."""


def legs_of(
    bag: Path, urdfs: tuple[Path, ...], topic: str, settings: OnlineSettings, columns: Path | None
) -> FloatingBase | None:
    """The robot of a bag where it stands on legs; None of an arm, and of a bag that can't be read, which its reader says."""
    try:
        source = open_source(bag, topic, read_columns(columns) if columns else None)
        _, robot = robot_of_source(source, urdf_text(urdfs[0] if urdfs else None, source), settings)
        return floating_base_of(robot, settings)
    except (DataError, RobotModelError):
        return None


def check_of_legs(urdfs: tuple[Path, ...], model: Path | None, simulator: str | None) -> None:
    """Check that nothing is asked for that holds for arms only.

    Raises:
        SettingsError: something is.
    """
    asked = (
        (
            "--urdf is given more than once",
            len(urdfs) > 1,
            "which of several URDFs is the robot's can't be told on legs; give one",
        ),
        ("--model is given", model is not None, "causes are looked for beside the URDF; leave it out"),
        ("--simulator is given", simulator is not None, "the gain in simulation is one of arms; leave it out"),
    )
    for what, given, why in asked:
        if given:
            raise SettingsError(f"{what} of a robot on legs: {why}.")


def diagnosed(
    base: FloatingBase,
    bags: tuple[Path, ...],
    validate: tuple[Path, ...],
    urdfs: tuple[Path, ...],
    settings: OnlineSettings,
    read: tuple[str, Path | None, TrunkTopics],
    origin: dict[str, object],
) -> Found:
    """The robot, its URDF and the diagnosis of bags; "refused" where they can't be judged.

    Args:
        read: topic of the joint states, the mapping of a table's columns, and topics of IMU and contacts.
    """
    topic, columns, topics = read
    urdf = urdfs[0] if urdfs else None
    try:
        _, recordings, problems = read_recordings((*bags, *validate), urdf, topic, settings, columns, topics)
        warn_of(problems)
        with stages() as tell:
            first = len(bags)
            gravity = math.hypot(*settings.gravity)
            result = diagnose_on_legs(base, recordings[:first], recordings[first:], tell, origin, gravity, settings.max_gap)
    except (DataError, RobotModelError) as error:
        result = Diagnosis("refused", base.legs.joint_names, refusal=str(error))
    return base.robot, urdf, result
