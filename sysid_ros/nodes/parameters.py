"""ROS parameters from the settings' dataclasses: each is written down once, there."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import Field, dataclass, fields
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from sysid_ros.exceptions import SettingsError
from sysid_ros.online_settings import CommitSettings, OnlineSettings, Settings, setting


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeSettings(Settings):
    """What only the node needs."""

    urdf_path: str = setting("", "the robot's URDF; empty: it is taken from the topic robot_description")
    model_path: str = setting("", "model.yaml of 'sysid identify'; empty: the URDF's links and <dynamics> are what is known")
    autostart: bool = setting(True, "configure and activate at the start, without a lifecycle manager", fixed=True)
    executor: str = setting(
        "events",
        "rclpy's EventsExecutor, where this rclpy has it, or its SingleThreadedExecutor, which takes more than twice the load",
        choices=("single", "events"),
        fixed=True,
    )
    disabled_at_startup: bool = setting(False, "start frozen, until the service ~/enable")
    publish_markers: bool = setting(True, "publish ~/markers while somebody subscribes")
    publish_tf: bool = setting(False, "publish the payload's frame, FRAME_payload at its centre of mass, on /tf")


Group = TypeVar("Group", bound=Settings)
ESTIMATOR_GROUPS: tuple[type[Settings], ...] = (NodeSettings, OnlineSettings, CommitSettings)
ESTIMATOR_LIVE = frozenset(["publish_markers", *(CommitSettings.prefix + f.name for f in fields(CommitSettings))])
"""Parameters of the estimator that may be set while it runs."""
_ARRAYS = (Parameter.Type.DOUBLE_ARRAY, Parameter.Type.STRING_ARRAY)


class NodeParameters:
    """Declares the parameters of the node and reads the settings from them.

    A value that is not allowed does not stop the node: it is kept as a problem, which the transition ``configure`` reports.

    Args:
        node: whose parameters they are.
        is_configured: whether the node has left the state unconfigured.
        on_change: called when one was set.
        groups: of settings, whose fields tell description, unit and range.
        live: names that may be set at any time, the others while the node is unconfigured.
    """

    def __init__(
        self,
        node: Node,
        is_configured: Callable[[], bool],
        on_change: Callable[[], None],
        groups: Sequence[type[Settings]] = ESTIMATOR_GROUPS,
        live: Collection[str] = ESTIMATOR_LIVE,
    ) -> None:
        self._node, self._is_configured, self._on_change, self._live = node, is_configured, on_change, live
        self._problems: dict[str, str] = {}
        self._fields = {cls.prefix + f.name: (cls, f) for cls in groups for f in fields(cls)}
        for name, (cls, f) in self._fields.items():
            self._declare(name, cls, f)
        self._warn_of_unknown()
        node.add_pre_set_parameters_callback(self._convert_all)
        node.add_on_set_parameters_callback(self._check_all)
        node.add_post_set_parameters_callback(self._note_all)

    @property
    def problems(self) -> list[str]:
        """One sentence for each value that was given and is not allowed."""
        return list(self._problems.values())

    def read(self, group: type[Group]) -> Group:
        """The settings of one of the groups."""
        values = {f.name: self._node.get_parameter(name).value for name, (cls, f) in self._fields.items() if cls is group}
        return group(**{name: _plain(value) for name, value in values.items()})

    def _declare(self, name: str, cls: type[Settings], f: Field[Any]) -> None:
        kind, meta = type_of(f), f.metadata
        descriptor = ParameterDescriptor(description=described(f), read_only=meta["fixed"])
        if kind == Parameter.Type.DOUBLE:
            descriptor.floating_point_range = [FloatingPointRange(from_value=float(meta["low"]), to_value=float(meta["high"]))]
        overrides = self._node._parameter_overrides
        given = overrides.pop(name, None)
        value: Any = list(_default(f)) if isinstance(_default(f), tuple) else _default(f)
        if given is not None and given.type_ != Parameter.Type.NOT_SET:
            # a whole number in a YAML file is an integer to ROS, and an empty list has no type
            given = _converted(given, kind)
            if problem := _problem(name, cls, f, given):
                self._problems[name] = problem
            else:
                value = given.value
        if kind in _ARRAYS and len(value) == 0:
            # rclpy takes an empty list for bytes when it is declared, but not when it is set
            self._node.declare_parameter(name, kind, descriptor)
            self._node.set_parameters([Parameter(name, kind, [])])
        else:
            self._node.declare_parameter(name, value, descriptor)

    def _warn_of_unknown(self) -> None:
        for name in sorted(set(self._node._parameter_overrides) - set(self._fields)):
            if self._node.has_parameter(name) or name.startswith("qos_overrides."):
                continue
            close = difflib.get_close_matches(name, self._fields, 1)
            hint = f" Did you mean '{close[0]}'?" if close else " 'ros2 param list' shows those that there are."
            self._node.get_logger().warning(f"There is no parameter '{name}'; its value is not used.{hint}")

    def _convert_all(self, parameters: list[Parameter]) -> list[Parameter]:
        return [_converted(p, type_of(self._fields[p.name][1])) if p.name in self._fields else p for p in parameters]

    def _check_all(self, parameters: Iterable[Parameter]) -> SetParametersResult:
        for p in (p for p in parameters if p.name in self._fields):
            cls, f = self._fields[p.name]
            if problem := _problem(p.name, cls, f, p):
                return SetParametersResult(successful=False, reason=problem)
            if self._is_configured() and p.name not in self._live:
                reason = (
                    f"{p.name} can be set only while the node is unconfigured. Run 'ros2 lifecycle set "
                    f"{self._node.get_fully_qualified_name()}' with deactivate and cleanup, set it, then configure and activate."
                )
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def _note_all(self, parameters: Iterable[Parameter]) -> None:
        for p in parameters:
            self._problems.pop(p.name, None)
        self._on_change()


def _default(f: Field[Any]) -> Any:
    return f.default_factory() if callable(f.default_factory) else f.default


def described(f: Field[Any]) -> str:
    """Description of a setting with its unit and what it may be."""
    meta = f.metadata
    notes = [meta["description"]]
    if meta["unit"]:
        notes.append(f"[{meta['unit']}]")
    if meta["choices"]:
        notes.append(f"(one of {', '.join(meta['choices'])})")
    elif meta["low"] is not None:
        notes.append(f"({meta['low']:g} to {meta['high']:g})")
    return " ".join(notes)


def type_of(f: Field[Any]) -> Parameter.Type:
    """The type that a setting has as a parameter."""
    default = _default(f)
    if isinstance(default, bool):
        return Parameter.Type.BOOL
    if isinstance(default, str):
        return Parameter.Type.STRING
    if isinstance(default, float):
        return Parameter.Type.DOUBLE
    return Parameter.Type.STRING_ARRAY if f.metadata["low"] is None else Parameter.Type.DOUBLE_ARRAY


def _converted(p: Parameter, kind: Parameter.Type) -> Parameter:
    """The parameter in the type that is declared, where nothing is lost by it."""
    if p.type_ == Parameter.Type.INTEGER and kind == Parameter.Type.DOUBLE:
        return Parameter(p.name, kind, float(p.value))
    if p.type_ == Parameter.Type.INTEGER_ARRAY and kind == Parameter.Type.DOUBLE_ARRAY:
        return Parameter(p.name, kind, [float(x) for x in p.value])
    if kind in _ARRAYS and p.type_.name.endswith("_ARRAY") and len(p.value) == 0:
        return Parameter(p.name, kind, [])
    return p


def _plain(value: Any) -> Any:
    return tuple(value) if not isinstance(value, str | bool | float) else value


def _problem(name: str, cls: type[Settings], f: Field[Any], p: Parameter) -> str:
    kind = type_of(f)
    if p.type_ != kind:
        found, wanted = (k.name.lower().replace("_", " ") for k in (p.type_, kind))
        return f"{name} is {p.value!r}, of type {found}; it must be of type {wanted}. {_EXAMPLES[kind]}"
    try:
        cls(**{f.name: _plain(p.value)})
    except SettingsError as error:
        return str(error)
    return ""


_EXAMPLES = {
    Parameter.Type.BOOL: "Write true or false.",
    Parameter.Type.STRING: "Write it in quotes.",
    Parameter.Type.DOUBLE: "Write a number such as 50.0.",
    Parameter.Type.DOUBLE_ARRAY: "Write a list of numbers such as [1.0, 2.5].",
    Parameter.Type.STRING_ARRAY: "Write a list of names such as [joint_1, joint_2].",
}
