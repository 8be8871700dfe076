"""MotionLimits: what a motion may use of a robot's position, velocity, acceleration and torque; joint_limits.yaml."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sysid_ros.exceptions import SettingsError, in_a_line
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign_slope
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.torque.torque_model import TorqueModel

KINDS = ("position", "velocity", "acceleration", "torque")
"""The limits, in the order of :meth:`MotionLimits.use`."""


@dataclass(frozen=True, slots=True)
class JointLimit:
    """Limits of a joint that replace the URDF's; None where nothing is said.

    Attributes:
        lower, upper: [rad or m]. velocity: [rad/s or m/s]. acceleration: [rad/s^2 or m/s^2]. effort: [N m or N].
    """

    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    acceleration: float | None = None
    effort: float | None = None


class MotionLimits:
    """What a motion may use: the URDF's limits, or those given instead, less the margins of the settings.

    The torque is nominal: that of the URDF's links and its ``<dynamics>``.

    Args:
        robot: the model. settings: margins, and what holds where the URDF says nothing.
        given: limits of joints that replace the URDF's; the margins of velocity and torque apply to them too.

    Attributes:
        lower, upper: shape (n,) [rad or m]. velocity: shape (n,). acceleration: shape (n,). effort: shape (n,), infinite where
            nothing limits the torque.
        notes: what was assumed, a sentence each.

    Raises:
        SettingsError: a joint has no room left, a limit is not positive, or a joint is not the robot's.
    """

    def __init__(self, robot: RobotModel, settings: ExcitationSettings, given: Mapping[str, JointLimit] | None = None) -> None:
        given = given or {}
        unknown = sorted(set(given) - set(robot.joint_names))
        if unknown:
            raise SettingsError(
                f"limits are given for joints {', '.join(unknown)}; the joints that move are {', '.join(robot.joint_names)}."
            )
        self.robot, self._settings, self._model = robot, settings, TorqueModel(robot, [])
        self.lower, self.upper = self._range(given)
        stated = np.isfinite(robot.velocity_limit)
        own = _replaced(np.where(stated, robot.velocity_limit, np.nan), given, robot, "velocity")
        self.velocity: FloatArray = np.where(np.isnan(own), settings.velocity_default, settings.velocity_scale * own)
        usual = np.where(robot.is_prismatic, settings.slide_acceleration_limit, settings.acceleration_limit)
        self.acceleration: FloatArray = _replaced(usual, given, robot, "acceleration")
        self.effort: FloatArray = settings.effort_scale * _replaced(robot.effort_limit, given, robot, "effort")
        for name in ("velocity", "acceleration", "effort"):
            self._require_positive(name)
        self.notes = self._notes(own, given)

    def _range(self, given: Mapping[str, JointLimit]) -> tuple[FloatArray, FloatArray]:
        robot, part = self.robot, self._settings.position_scale
        low, high = _replaced(robot.position_lower, given, robot, "lower"), _replaced(robot.position_upper, given, robot, "upper")
        # a joint that turns without end needs no more than a turn
        first = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - 2.0 * np.pi, -np.pi))
        last = np.where(np.isfinite(high), high, np.where(np.isfinite(low), low + 2.0 * np.pi, np.pi))
        for name, least, most in zip(robot.joint_names, first, last, strict=True):
            if not most > least:
                raise SettingsError(
                    f"joint {name} can't move: its position limits are {least:g} and {most:g}, and the upper must be above the "
                    "lower. Correct them, or leave the joint out of the joints that move."
                )
        middle, room = 0.5 * (first + last), 0.5 * part * (last - first)
        lower, upper = middle - room, middle + room
        return lower, upper

    def _require_positive(self, what: str) -> None:
        values = getattr(self, what)
        for name, value in zip(self.robot.joint_names, values, strict=True):
            if not value > 0.0:
                raise SettingsError(f"the {what} limit of joint {name} is {value:g}; it must be above 0.")

    def _notes(self, velocity: FloatArray, given: Mapping[str, JointLimit]) -> tuple[str, ...]:
        names, notes = np.array(self.robot.joint_names), []
        if np.any(missing := np.isnan(velocity)):
            notes.append(
                f"No velocity limit is stated for {', '.join(names[missing])}: {self._settings.velocity_default:g} is used."
            )
        assumed = np.array([name not in given or given[name].acceleration is None for name in names])
        if np.any(assumed):
            values = sorted({f"{x:g} m/s²" if p else f"{x:g} rad/s²" for x, p in
                             zip(self.acceleration[assumed], self.robot.is_prismatic[assumed], strict=True)})  # fmt: skip
            notes.append(f"A URDF states no acceleration limits: {' and '.join(values)} is used.")
        if np.any(free := np.isinf(self.effort)):
            notes.append(f"No effort limit is stated for {', '.join(names[free])}: the torque is not limited there.")
        return tuple(notes)

    def torque(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Nominal torques at N states, shape (N, n) [N m]."""
        return self._model.torque_along(Motion(self.robot, np.arange(len(q), dtype=np.float64), q, v, a, np.zeros_like(q)))

    def torque_derivatives(self, q: FloatArray, v: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives of :meth:`torque` by q, v and a, shape (N, n, n) each."""
        robot, each = self.robot, np.arange(self.robot.n)
        by_q, by_v, by_a = robot.rnea_derivatives_along(q, v, a)
        by_v[:, each, each] += self._model.damping() + self._model.dry_friction() * smoothed_sign_slope(v)
        return by_q, by_v, by_a

    def use(self, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
        """Part of each limit that N states use, signed, shape (4, N, n): 1 and -1 are the limits, in the order of ``KINDS``."""
        middle, room = 0.5 * (self.lower + self.upper), 0.5 * (self.upper - self.lower)
        return np.stack([(q - middle) / room, v / self.velocity, a / self.acceleration, tau / self.effort])


def _replaced(values: FloatArray, given: Mapping[str, JointLimit], robot: RobotModel, what: str) -> FloatArray:
    new = np.array(values, dtype=float)
    for i, name in enumerate(robot.joint_names):
        if name in given and (value := getattr(given[name], what)) is not None:
            new[i] = value
    return new


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
        raise SettingsError(f"joint limits '{path}' is not YAML: {in_a_line(error)}.") from None
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
