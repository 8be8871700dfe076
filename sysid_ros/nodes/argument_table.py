"""Every parameter of the nodes as a table, ``config/launch_arguments.json``, for the launch files.

``ros2 launch`` runs in the interpreter of ROS, which need not have what the nodes calculate with; so the launch files read a
table and not the settings. Made anew by ``python -m sysid_ros.nodes.argument_table > config/launch_arguments.json``; a test
compares.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from rclpy.parameter import Parameter

from sysid_ros.control.control_settings import ControlSettings, SafetySettings
from sysid_ros.nodes.controller_settings import ControllerSettings
from sysid_ros.nodes.parameters import ESTIMATOR_GROUPS, described, type_of
from sysid_ros.nodes.simulation_parameters import PARAMETERS
from sysid_ros.online_settings import Settings

GROUPS: dict[str, Sequence[type[Settings]]] = {
    "online_payload_estimator": ESTIMATOR_GROUPS,
    "adaptive_controller": (ControllerSettings, ControlSettings, SafetySettings),
}
_KINDS = {
    Parameter.Type.BOOL: "bool",
    Parameter.Type.STRING: "string",
    Parameter.Type.DOUBLE: "number",
    Parameter.Type.DOUBLE_ARRAY: "numbers",
    Parameter.Type.STRING_ARRAY: "strings",
}


def table() -> dict[str, dict[str, dict[str, Any]]]:
    """By node and parameter: kind, description, and the range or the choices where there are some."""
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for node, groups in GROUPS.items():
        rows = found[node] = {}
        for cls, f in ((group, f) for group in groups for f in fields(group)):
            row: dict[str, Any] = {"kind": _KINDS[type_of(f)], "description": described(f)}
            if f.metadata["low"] is not None:
                row |= {"low": float(f.metadata["low"]), "high": float(f.metadata["high"])}
            if f.metadata["choices"]:
                row["choices"] = list(f.metadata["choices"])
            rows[cls.prefix + f.name] = row
    kinds = {bool: "bool", str: "string", list: "numbers", int: "whole"}
    found["simulated_robot"] = {
        name: {"kind": kinds.get(type(default), "number"), "description": text} for name, default, text in PARAMETERS
    }
    return found


def text() -> str:
    """The file."""
    return json.dumps(table(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    print(text(), end="")
