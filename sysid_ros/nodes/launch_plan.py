"""What the launch files start: nodes, their arguments and their topics, free of ``launch`` and of all that calculates.

The parameters stand in the table ``config/launch_arguments.json``, which is made from the settings; every launch file has each of
them as an argument.
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from sysid_ros.exceptions import SettingsError
from sysid_ros.nodes import ros2_control, viewers

_TRUE, _FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")
_COMMON = {
    "namespace": ("", "namespace of the nodes and of their topics, such as left"),
    "use_sim_time": ("false", "time from /clock, in all nodes"),
    **viewers.ARGUMENTS,
}
_TOPICS = {
    "joint_states": "topic of the joint states",
    "robot_description": "topic of the URDF",
    "imu": "topic of the IMU, of a robot on legs",
    "contacts": "topic of the foot contacts, of a robot on legs",
    "effort_commands": "topic that the robot takes its efforts from, such as effort_controller/commands",
    "payload_committed": "topic of the payload that the controller takes over",
}
_LONG_NAMES = {"payload_committed": "online_payload_estimator/payload_committed"}


@dataclass(frozen=True, slots=True)
class Argument:
    """A launch argument; an empty default leaves to the configuration file what it is."""

    name: str
    default: str
    description: str


@dataclass(frozen=True, slots=True)
class NodePlan:
    """A node as it is to be started.

    Attributes:
        executable, namespace: of it. config: its YAML file. lifecycle: whether it has a life cycle.
        parameters: what overrides the file. remappings: of topics, from and to.
    """

    executable: str
    namespace: str
    config: str
    lifecycle: bool
    parameters: dict[str, Any]
    remappings: dict[str, str]

    def command_line(self) -> list[str]:
        """Arguments that start the node the same way without ``launch``."""
        words = ["--ros-args", "-r", f"__node:={self.executable}"]
        words += ["-r", f"__ns:=/{self.namespace.strip('/')}"] if self.namespace.strip("/") else []
        for old, new in self.remappings.items():
            words += ["-r", f"{old}:={new}"]
        words += ["--params-file", self.config]
        for name, value in self.parameters.items():
            words += ["-p", f"{name}:={_in_yaml(value)}"]
        return words


@dataclass(frozen=True, slots=True)
class Node:
    """A node that launch files may start.

    Attributes:
        executable: its name. config: the argument that names its YAML file where it is not the file's first node.
        topics: that an argument may remap. lifecycle: whether it has a life cycle.
    """

    executable: str
    config: str
    topics: tuple[str, ...]
    lifecycle: bool = True


ESTIMATOR = Node("online_payload_estimator", "estimator_config", ("joint_states", "robot_description", "imu", "contacts"))
CONTROLLER = Node(
    "adaptive_controller", "controller_config", ("joint_states", "robot_description", "effort_commands", "payload_committed")
)
ROBOT = Node(
    "simulated_robot",
    "robot_config",
    ("joint_states", "robot_description", "effort_commands", "imu", "contacts"),
    lifecycle=False,
)


@cache
def parameters_of(config: Path) -> dict[str, dict[str, dict[str, Any]]]:
    """The table in the folder of the configuration files: by node and parameter, what it may be."""
    read: dict[str, dict[str, dict[str, Any]]] = json.loads((config / "launch_arguments.json").read_text(encoding="utf-8"))
    return read


@dataclass(frozen=True, slots=True)
class LaunchFile:
    """One of the launch files.

    Attributes:
        name: of the file. nodes: that it starts; an argument goes to every one that has such a parameter, ``autostart`` and
            ``config`` to the first alone. defaults: that differ from the nodes' own.
        optional: an argument and the node that it starts where it is true, with what that node is then told.
        around: True of a file that starts ros2_control around the nodes.
    """

    name: str
    nodes: tuple[Node, ...]
    defaults: Mapping[str, str] = field(default_factory=dict)
    optional: tuple[str, Node, Mapping[str, Any]] | None = None
    around: bool = False

    @property
    def _all(self) -> tuple[Node, ...]:
        return (*self.nodes, self.optional[1]) if self.optional else self.nodes

    def arguments(self, config: Path) -> list[Argument]:
        """Every argument once; ``config`` is the folder of the YAML files."""
        found: dict[str, tuple[str, str]] = _COMMON | (ros2_control.ARGUMENTS if self.around else {})
        for node in self._all:
            name = "config" if node is self.nodes[0] else node.config
            found[name] = (str(config / f"{node.executable}.yaml"), f"parameters of {node.executable}, a YAML file")
        if self.optional:
            found[self.optional[0]] = ("false", f"start {self.optional[1].executable} too")
        for node in self._all:
            rows = parameters_of(config)[node.executable]
            found |= {name: ("", row["description"]) for name, row in rows.items() if name not in found}
            found |= {topic: (_LONG_NAMES.get(topic, topic), _TOPICS[topic]) for topic in node.topics}
        defaults = {
            name: self.defaults.get(name, default).replace("{config}", str(config)) for name, (default, _) in found.items()
        }
        return [Argument(name, defaults[name], text) for name, (_, text) in found.items()]

    def plan(self, values: Mapping[str, str], config: Path) -> list[NodePlan]:
        """The nodes to start with these values of the arguments, all of them; ``config`` as of :meth:`arguments`.

        Raises:
            SettingsError: a value is not one that the argument may have, or a file is not there.
        """
        nodes = list(self.nodes)
        values = ros2_control.completed(values) if self.around else values
        told: dict[str, Mapping[str, Any]] = {}
        if self.optional and flag(self.optional[0], values[self.optional[0]]):
            nodes.append(self.optional[1])
            told[self.optional[1].executable] = self.optional[2]
        plans = []
        for node in nodes:
            first = node is nodes[0]
            name = "config" if first else node.config
            if not Path(values[name]).is_file():
                raise SettingsError(f"the launch argument {name}:={values[name]}: there is no such file.")
            rows = parameters_of(config)[node.executable]
            parameters = {p: value_of(p, values[p], rows[p]) for p in rows if values[p] and (first or p != "autostart")}
            parameters |= {"use_sim_time": flag("use_sim_time", values["use_sim_time"])} | dict(told.get(node.executable, {}))
            longs = {topic: _LONG_NAMES.get(topic, topic) for topic in node.topics}
            remappings = {long: values[topic] for topic, long in longs.items() if values[topic] != long}
            plans.append(NodePlan(node.executable, values["namespace"], values[name], node.lifecycle, parameters, remappings))
        return plans

    def programs(self, values: Mapping[str, str], config: Path) -> list[viewers.Program]:
        """What is started of other packages, with the layouts in the folder ``config``.

        Raises:
            SysidError: a value is not one that the argument may have, or the URDF can't be read.
        """
        wanted = {name: flag(name, values[name]) for name, (default, _) in viewers.ARGUMENTS.items() if default}
        robots = [plan for plan in self.plan(values, config) if plan.executable == ROBOT.executable]
        arm = bool(robots) and values.get("robot", "") in ("", "arm")
        found = [*(ros2_control.programs(values) if self.around else ()), *viewers.viewers(wanted, values, config, arm)]
        clock = {"use_sim_time": flag("use_sim_time", values["use_sim_time"])}
        return [replace(program, parameters=program.parameters | clock) for program in found]

    def refuse_unknown(self, words: Sequence[str], names: Iterable[str]) -> None:
        """Check the words of a command line that launches this file; of another command nothing is known.

        ``ros2 launch`` itself takes over every name, also one that nobody reads.

        Raises:
            SettingsError: an argument is not one of ``names``.
        """
        if self.name not in (Path(word).name for word in words):
            return
        known = list(names)
        for word in words:
            given, assigns, _ = word.partition(":=")
            if not assigns or given in known:
                continue
            close = difflib.get_close_matches(given, known, 1)
            hint = f"Did you mean '{close[0]}'? " if close else ""
            raise SettingsError(
                f"{self.name} has no argument '{given}'. {hint}'ros2 launch sysid_ros {self.name} --show-args' tells them all."
            )


LAUNCH_FILES = {
    file.name: file
    for file in (
        LaunchFile("online_payload_estimator.launch.py", (ESTIMATOR,)),
        LaunchFile("adaptive_controller.launch.py", (CONTROLLER, ESTIMATOR), {}, ("simulated", ROBOT, {"commanded": True})),
        LaunchFile("ros2_control_arm.launch.py", (CONTROLLER, ESTIMATOR), ros2_control.DEFAULTS, around=True),
        LaunchFile("simulated_arm.launch.py", (ROBOT, ESTIMATOR), {"pick_time": "10.0"}),
    )
}


def flag(name: str, text: str) -> bool:
    """True or false.

    Raises:
        SettingsError: neither.
    """
    if text.lower() not in (*_TRUE, *_FALSE):
        raise SettingsError(f"the launch argument {name}:={text}: write true or false.")
    return text.lower() in _TRUE


def value_of(name: str, text: str, row: Mapping[str, Any]) -> Any:
    """The value of an argument as its row of the table says; lists are written [a, b] or a,b.

    Raises:
        SettingsError: it is not one that the parameter may have.
    """
    kind, where = row["kind"], f"the launch argument {name}:={text}"
    if kind == "string":
        if text not in row.get("choices", (text,)):
            raise SettingsError(f"{where}: it must be one of {', '.join(row['choices'])}.")
        return text
    if kind == "bool":
        return flag(name, text)
    items = [item.strip().strip("\"'") for item in text.strip().removeprefix("[").removesuffix("]").split(",")]
    if kind in ("numbers", "strings") and items == [""]:
        raise SettingsError(f"{where}: an empty list is what the configuration says; leave it out.")
    if kind == "strings":
        return items
    numbers = [_number(name, item) for item in (items if kind == "numbers" else [text])]
    if any(not row.get("low", -math.inf) <= x <= row.get("high", math.inf) for x in numbers):
        raise SettingsError(f"{where}: it must be {row['low']:g} to {row['high']:g}.")
    if kind == "whole" and numbers[0] != int(numbers[0]):
        raise SettingsError(f"{where}: it must be a whole number.")
    return numbers if kind == "numbers" else int(numbers[0]) if kind == "whole" else numbers[0]


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SettingsError(f"the launch argument {name}:={text}: it must be a number such as 0.5, or numbers such as [0, 0.5].")
    return value


def _in_yaml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(_in_yaml, value)) + "]"
    if isinstance(value, float):
        # without a point YAML takes 1e-05 for a text
        return yaml.safe_dump(value).split()[0]
    return f'"{value}"' if isinstance(value, str) else str(value)
