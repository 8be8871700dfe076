"""Joint limits from a file: the joint_limits.yaml that MoveIt and the drivers of arms have."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import yaml

from sysid_ros.exceptions import SettingsError
from sysid_ros.excitation.motion_limits import JointLimit

_FIELDS = {
    "lower": ("has_position_limits", "min_position"),
    "upper": ("has_position_limits", "max_position"),
    "velocity": ("has_velocity_limits", "max_velocity"),
    "acceleration": ("has_acceleration_limits", "max_acceleration"),
    "effort": ("has_effort_limits", "max_effort"),
}


class _Loader(yaml.SafeLoader):
    """Knows the tags ``!degrees`` and ``!radians`` that drivers use."""


def _radians(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> float:
    return float(str(loader.construct_scalar(node)))


def _degrees(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> float:
    return math.radians(_radians(loader, node))


_Loader.add_constructor("!degrees", _degrees)
_Loader.add_constructor("!radians", _radians)


def read_joint_limits(path: Path) -> dict[str, JointLimit]:
    """Limits by joint name, from a mapping ``joint_limits: {joint: {has_velocity_limits: true, max_velocity: 2.0, ...}}``.

    A value counts unless its ``has_..._limits`` is false.

    Raises:
        SettingsError: the file can't be read, or is not of that form.
    """
    try:
        document = yaml.load(path.read_text(encoding="utf-8"), Loader=_Loader)
    except OSError as error:
        raise SettingsError(f"joint limits '{path}' can't be read: {error.strerror}.") from None
    except (yaml.YAMLError, UnicodeDecodeError, ValueError) as error:
        raise SettingsError(f"joint limits '{path}' is not YAML: {error}.") from None
    joints = document.get("joint_limits") if isinstance(document, dict) else None
    if not isinstance(joints, dict) or not all(isinstance(entry, dict) for entry in joints.values()):
        raise SettingsError(
            f"joint limits '{path}' have no mapping 'joint_limits' of joints to limits. "
            "See config/joint_limits.yaml for an example."
        )
    return {str(name): _limit(path, str(name), entry) for name, entry in joints.items()}


def _limit(path: Path, name: str, entry: dict[str, Any]) -> JointLimit:
    values: dict[str, float] = {}
    for field, (switch, key) in _FIELDS.items():
        value = entry.get(key)
        if value is None or entry.get(switch, True) is False:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise SettingsError(f"joint limits '{path}': {key} of {name} is {value!r}; it must be a number.")
        values[field] = float(value)
    return JointLimit(**values)
