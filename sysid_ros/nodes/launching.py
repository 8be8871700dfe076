"""From a plan of nodes to what ``ros2 launch`` runs; the only imports of ``launch``."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription
from sysid_ros.nodes.launch_plan import LAUNCH_FILES, NodePlan
from sysid_ros.nodes.viewers import Program


def describe(path: str) -> LaunchDescription:
    """What the launch file at ``path`` starts, see :data:`.launch_plan.LAUNCH_FILES`; its configuration files lie in the folder
    ``config`` beside its own."""
    file = LAUNCH_FILES[Path(path).name]
    config = Path(path).resolve().parents[1] / "config"
    arguments = file.arguments(config)

    def start(context: Any) -> list[Any]:
        file.refuse_unknown(sys.argv, (a.name for a in arguments))
        values = {a.name: LaunchConfiguration(a.name).perform(context) for a in arguments}
        views = file.programs(values, config)
        notes = [LogInfo(msg=view.note) for view in views if view.note]
        return [*(action(plan) for plan in file.plan(values, config)), *map(program_action, views), *notes]

    declared = [DeclareLaunchArgument(a.name, default_value=a.default, description=a.description) for a in arguments]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])


def program_action(program: Program) -> Any:
    """The launch action that starts a program of another package."""
    return Node(
        package=program.package,
        executable=program.executable,
        namespace=program.namespace,
        arguments=program.arguments,
        parameters=[*([program.config] if program.config else []), _typed(program.parameters)],
    )


def action(plan: NodePlan) -> Any:
    """The launch action that starts a node."""
    kind = LifecycleNode if plan.lifecycle else Node
    return kind(
        package="sysid_ros",
        executable=plan.executable,
        name=plan.executable,
        namespace=plan.namespace,
        parameters=[plan.config, _typed(plan.parameters)],
        remappings=list(plan.remappings.items()),
        output="screen",
    )


def _typed(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of which a text that looks like a number or like true stays a text."""
    return {name: ParameterValue(x, value_type=str) if isinstance(x, str) else x for name, x in parameters.items()}
