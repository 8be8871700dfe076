"""Parameters that only the adaptive controller has."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from sysid_ros.exceptions import SettingsError

LAWS = ("composite", "slotine_li", "certainty_equivalence", "computed_torque")


def _setting(
    default: str | bool | tuple[Any, ...], description: str, unit: str = "", choices: tuple[str, ...] = (), fixed: bool = False
) -> Any:
    numbers = isinstance(default, tuple) and bool(default)
    low, high = (-30.0, 30.0) if numbers else (None, None)
    metadata = {"description": description, "unit": unit, "low": low, "high": high, "choices": choices, "fixed": fixed}
    if isinstance(default, tuple):
        return field(default_factory=lambda: default, metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerSettings:
    """What is controlled and how.

    Raises:
        SettingsError: a value is of the wrong type or not among those allowed.
    """

    urdf_path: str = _setting("", "the robot's URDF; empty: it is taken from the topic robot_description")
    model_path: str = _setting("", "model.yaml of 'sysid identify'; empty: the URDF's links and <dynamics> are what is known")
    joint_names: tuple[str, ...] = _setting((), "joints that are moved, in the order of the commands; empty: all of the URDF")
    frame_id: str = _setting("", "frame that the payload is fixed to; empty: the link that the last joint moves")
    gravity: tuple[float, ...] = _setting((0.0, 0.0, -9.81), "gravity in the base frame", "m/s^2")
    law: str = _setting("composite", "the control law", choices=LAWS)
    autostart: bool = _setting(False, "configure and activate at the start: efforts are sent from the first state on", fixed=True)
    executor: str = _setting("events", "as of the estimator", choices=("single", "events"), fixed=True)

    def __post_init__(self) -> None:
        for f in fields(self):
            value, choices = getattr(self, f.name), f.metadata["choices"]
            if choices and value not in choices:
                raise SettingsError(f"{f.name} is {value!r}; it must be one of {', '.join(choices)}.")
        if len(self.gravity) != 3:
            raise SettingsError(f"gravity has {len(self.gravity)} values; it must have three.")
