"""As much of ``launch`` and ``launch_ros`` as the launch files use, for where they are not installed.

Declared arguments are taken over as ``launch`` does: a given value, else the default; performed actions are listed.
"""

from __future__ import annotations

import sys
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

MODULES = (
    "launch",
    "launch.actions",
    "launch.substitutions",
    "launch_ros",
    "launch_ros.actions",
    "launch_ros.parameter_descriptions",
)


@dataclass
class Context:
    launch_configurations: dict[str, str] = field(default_factory=dict)
    started: list[Any] = field(default_factory=list)


@dataclass
class LaunchDescription:
    entities: list[Any]

    def run(self, context: Context) -> None:
        for entity in self.entities:
            entity.execute(context)


@dataclass
class DeclareLaunchArgument:
    name: str
    default_value: str
    description: str

    def execute(self, context: Context) -> None:
        context.launch_configurations.setdefault(self.name, self.default_value)


@dataclass
class LaunchConfiguration:
    name: str

    def perform(self, context: Context) -> str:
        return context.launch_configurations[self.name]


@dataclass
class OpaqueFunction:
    function: Callable[[Context], list[Any]]

    def execute(self, context: Context) -> None:
        context.started += self.function(context)


@dataclass
class LogInfo:
    msg: str


@dataclass
class ParameterValue:
    value: Any
    value_type: type


class Node:
    lifecycle = False

    def __init__(self, **given: Any) -> None:
        self.given = given


class LifecycleNode(Node):
    lifecycle = True


@contextmanager
def standing_in() -> Iterator[None]:
    """Within it the launch files can be run."""
    modules = {name: types.ModuleType(name) for name in MODULES}
    for name, things in {
        "launch": (LaunchDescription,),
        "launch.actions": (DeclareLaunchArgument, LogInfo, OpaqueFunction),
        "launch.substitutions": (LaunchConfiguration,),
        "launch_ros.actions": (LifecycleNode, Node),
        "launch_ros.parameter_descriptions": (ParameterValue,),
    }.items():
        modules[name].__dict__.update({thing.__name__: thing for thing in things})
    kept = {name: sys.modules.pop(name, None) for name in (*MODULES, "sysid_ros.nodes.launching")}
    sys.modules.update(modules)
    try:
        yield
    finally:
        for name, module in kept.items():
            sys.modules.pop(name, None)
            if module is not None:
                sys.modules[name] = module
