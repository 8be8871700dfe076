"""What the launch files start: nodes, their arguments and their topics, made from the settings and free of ``launch``.

A parameter is written down once, in its settings; every launch file has each of them as an argument.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import yaml
from rclpy.parameter import Parameter

from sysid_ros.control.control_settings import ControlSettings, SafetySettings
from sysid_ros.exceptions import SettingsError
from sysid_ros.nodes import ros2_control, viewers
from sysid_ros.nodes.controller_settings import ControllerSettings
from sysid_ros.nodes.parameters import ESTIMATOR_GROUPS, described, type_of
from sysid_ros.nodes.simulation_parameters import PARAMETERS
from sysid_ros.online_settings import Settings

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
        executable: its name. topics: that an argument may remap. readers: from the text of an argument to the parameter's value.
        descriptions: of the parameters. config: the argument that names its YAML file where it is not the file's first node.
    """

    executable: str
    config: str
    topics: tuple[str, ...]
    lifecycle: bool
    readers: Mapping[str, Callable[[str], Any]]
    descriptions: Mapping[str, str]


def _of_settings(executable: str, config: str, topics: tuple[str, ...], groups: Sequence[type[Settings]]) -> Node:
    found = {cls.prefix + f.name: (cls, f) for cls in groups for f in fields(cls)}
    readers = {name: _reader(name, cls, f) for name, (cls, f) in found.items()}
    return Node(executable, config, topics, True, readers, {name: described(f) for name, (_, f) in found.items()})


def _reader(name: str, cls: type[Settings], f: Field[Any]) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        value = _typed(name, text, type_of(f))
        try:
            cls(**{f.name: value})
        except SettingsError as error:
            raise SettingsError(f"the launch argument {name}:={text}: {error}") from None
        return list(value) if isinstance(value, tuple) else value

    return read


def _simulated_robot() -> Node:
    kinds = {bool: Parameter.Type.BOOL, str: Parameter.Type.STRING, list: Parameter.Type.DOUBLE_ARRAY}

    def reader(name: str, default: Any) -> Callable[[str], Any]:
        def read(text: str) -> Any:
            value = _typed(name, text, kinds.get(type(default), Parameter.Type.DOUBLE))
            return list(value) if isinstance(value, tuple) else int(value) if type(default) is int else value

        return read

    readers = {name: reader(name, default) for name, default, _ in PARAMETERS}
    topics = ("joint_states", "robot_description", "effort_commands", "imu", "contacts")
    return Node("simulated_robot", "robot_config", topics, False, readers, {name: text for name, _, text in PARAMETERS})


ESTIMATOR = _of_settings(
    "online_payload_estimator", "estimator_config", ("joint_states", "robot_description", "imu", "contacts"), ESTIMATOR_GROUPS
)
CONTROLLER = _of_settings(
    "adaptive_controller",
    "controller_config",
    ("joint_states", "robot_description", "effort_commands", "payload_committed"),
    (ControllerSettings, ControlSettings, SafetySettings),
)
ROBOT = _simulated_robot()


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
            found |= {name: ("", text) for name, text in node.descriptions.items() if name not in found}
            found |= {topic: (_LONG_NAMES.get(topic, topic), _TOPICS[topic]) for topic in node.topics}
        defaults = {
            name: self.defaults.get(name, default).replace("{config}", str(config)) for name, (default, _) in found.items()
        }
        return [Argument(name, defaults[name], text) for name, (_, text) in found.items()]

    def plan(self, values: Mapping[str, str]) -> list[NodePlan]:
        """The nodes to start with these values of the arguments, all of them.

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
            given = [p for p in node.readers if values[p] and (first or p != "autostart")]
            parameters = {p: node.readers[p](values[p]) for p in given}
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
        robots = [plan for plan in self.plan(values) if plan.executable == ROBOT.executable]
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


def _typed(name: str, text: str, kind: Parameter.Type) -> Any:
    """The value of an argument; lists are written [a, b] or a,b."""
    if kind == Parameter.Type.STRING:
        return text
    if kind == Parameter.Type.BOOL:
        return flag(name, text)
    if kind == Parameter.Type.DOUBLE:
        return _number(name, text)
    items = [item.strip().strip("\"'") for item in text.strip().removeprefix("[").removesuffix("]").split(",")]
    if items == [""]:
        raise SettingsError(f"the launch argument {name}:={text}: an empty list is what the configuration says; leave it out.")
    return tuple(items) if kind == Parameter.Type.STRING_ARRAY else tuple(_number(name, item) for item in items)


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
