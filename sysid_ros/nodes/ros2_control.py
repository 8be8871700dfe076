"""What of ros2_control is started with ``ros2_control_arm.launch.py``, and the order in which it takes efforts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from sysid_ros.exceptions import SettingsError
from sysid_ros.nodes.viewers import Program, read_urdf

CONTROLLER = "effort_controller"
BROADCASTER = "joint_state_broadcaster"
ARGUMENTS = {"controllers": ("{config}/ros2_control/controllers.yaml", "controllers of ros2_control, a YAML file")}
DEFAULTS = {"urdf_path": "{config}/ros2_control/example_arm.urdf", "effort_commands": f"{CONTROLLER}/commands"}


def completed(values: Mapping[str, str]) -> Mapping[str, str]:
    """The arguments with ``joint_names`` as the effort controller has them, where they were not given: its commands have no
    names, so both must have one order.

    Raises:
        SettingsError: the controllers can't be read, or have no effort controller with joints.
    """
    return values if values["joint_names"] else {**values, "joint_names": ",".join(command_order(Path(values["controllers"])))}


def command_order(controllers: Path) -> list[str]:
    """Joints of the effort controller, in the order of its commands; errors as of :func:`completed`."""
    where = f"the launch argument controllers:={controllers}"
    try:
        read: Any = yaml.safe_load(controllers.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise SettingsError(f"{where}: it can't be read as YAML ({str(error).splitlines()[0]}).") from None
    for name, settings in read.items() if isinstance(read, dict) else ():
        if str(name).rpartition("/")[2] == CONTROLLER and isinstance(settings, dict):
            joints = settings.get("ros__parameters", {}).get("joints")
            if isinstance(joints, list) and joints:
                return [str(joint) for joint in joints]
    raise SettingsError(f"{where}: there is no '{CONTROLLER}' with 'joints' in it; give joint_names:=[...] in its order.")


def programs(values: Mapping[str, str]) -> list[Program]:
    """robot_state_publisher, the controller manager, and the spawner of its two controllers.

    Raises:
        SysidError: the URDF can't be read.
    """
    namespace, controllers = values["namespace"], values["controllers"]
    description = {"robot_description": read_urdf(values["urdf_path"])}
    # an absolute remapping would leave the namespace
    return [
        Program("robot_state_publisher", "robot_state_publisher", namespace, parameters=description),
        Program("controller_manager", "ros2_control_node", namespace, config=controllers),
        Program("controller_manager", "spawner", namespace, [BROADCASTER, CONTROLLER, "--param-file", controllers]),
    ]
