"""Which columns of a table are time, positions, velocities and efforts of which joints: given, or guessed from their names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from sysid_ros.exceptions import DataError, in_a_line

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""A unit of time in seconds."""
RADIANS = {"rad": 1.0, "deg": 0.017453292519943295}
"""A unit of angles in radians."""
QUANTITIES = ("position", "velocity", "effort")
_TIME = ("time", "t", "timestamp", "stamp", "elapsed", "sec", "seconds", "header_stamp")
_WORDS = {
    "position": ("position", "positions", "pos", "q", "angle", "theta", "actual_q", "joint_position", "joint_positions"),
    "velocity": ("velocity", "velocities", "vel", "qd", "dq", "qdot", "v", "speed", "actual_qd", "joint_velocity"),
    "effort": (
        "effort",
        "efforts",
        "tau",
        "torque",
        "torques",
        "tau_j",
        "tau_m",
        "actual_torque",
        "joint_torque",
        "joint_effort",
    ),
}
_CURRENT = ("actual_current", "current", "currents", "i_m")
"""Read as efforts where a table has no torque, which is said."""
_PREFIXES = ("joint_states", "joint_state", "state", "measured", "data")


@dataclass(frozen=True, slots=True)
class Columns:
    """Where in a table what is.

    Attributes:
        time: name of the column. position, velocity, effort: one name a joint; no velocity where there is none.
        joints: names of the joints; empty where the table does not name them: then they are those of the URDF, in its order.
        time_unit: a key of :data:`SECONDS`. position_unit: of :data:`RADIANS`, of velocities too. guessed: from the names. notes:
            what the user should know.
    """

    time: str
    position: tuple[str, ...]
    velocity: tuple[str, ...]
    effort: tuple[str, ...]
    joints: tuple[str, ...] = ()
    time_unit: str = "s"
    position_unit: str = "rad"
    guessed: bool = False
    notes: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """What was taken for what, in a sentence."""
        parts = [f"time '{self.time}' [{self.time_unit}]"]
        for quantity in QUANTITIES:
            names = getattr(self, quantity)
            shown = f"'{names[0]}' to '{names[-1]}'" if len(names) > 1 else f"'{names[0]}'" if names else "none"
            parts.append(f"{quantity} {shown}")
        joints = ", ".join(self.joints) if self.joints else "those of the URDF, in its order"
        return f"Columns taken for: {'; '.join(parts)}; joints: {joints}."


def read_columns(path: Path) -> dict[str, Any]:
    """The mapping in a YAML file: ``time``, ``position``, ``effort``, and where wanted ``velocity``, ``joints``, ``time_unit``,
    ``position_unit``.

    Raises:
        DataError: the file can't be read or holds something else.
    """
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"mapping '{path}' can't be read: {error.strerror}.") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise DataError(f"mapping '{path}' is not YAML: {in_a_line(error)}.") from None
    if not isinstance(document, dict):
        raise DataError(f"mapping '{path}' must give names of columns: time: t, position: [q1, q2], effort: [tau1, tau2].")
    return document


def columns_of(names: Sequence[str], given: Mapping[str, Any] | None, where: str) -> Columns:
    """The columns that are given, else those that the names tell.

    Raises:
        DataError: a column that is given is not there, or names don't tell.
    """
    return _guessed(names, where) if given is None else _given(names, given, where)


def _given(names: Sequence[str], given: Mapping[str, Any], where: str) -> Columns:
    allowed = {"time", "time_unit", "position_unit", "joints", *QUANTITIES}
    if unknown := sorted(set(given) - allowed):
        raise DataError(f"{where}: the mapping has {', '.join(map(str, unknown))}; it may have {', '.join(sorted(allowed))}.")
    lists: dict[str, tuple[str, ...]] = {}
    for quantity in ("joints", *QUANTITIES):
        value = given.get(quantity, [])
        several = [value] if isinstance(value, str | int) else value
        if not isinstance(several, list | tuple) or not all(isinstance(name, str | int) for name in several):
            raise DataError(f"{where}: {quantity} is {value!r} in the mapping; it must be a name, or a list of names: [a, b].")
        lists[quantity] = tuple(map(str, several))
        if twice := next((name for name in lists[quantity] if lists[quantity].count(name) > 1), None):
            raise DataError(f"{where}: the mapping gives '{twice}' twice for {quantity}. Name each joint's own once.")
    if "time" not in given:
        raise DataError(
            f"{where}: the mapping does not say which column is time. Add to it: time: NAME. There are {_listed(names)}."
        )
    time = str(given["time"])
    wanted = [time, *(name for quantity in QUANTITIES for name in lists[quantity])]
    if missing := [name for name in wanted if name not in names]:
        raise DataError(f"{where}: there is no column '{missing[0]}'. There are {_listed(names)}. Correct the mapping.")
    n = len(lists["position"])
    sizes = {quantity: len(lists[quantity]) for quantity in ("velocity", "joints") if lists[quantity]} | {
        "effort": len(lists["effort"])
    }
    if n == 0 or any(size != n for size in sizes.values()):
        counts = ", ".join(f"{count} of {quantity}" for quantity, count in sizes.items())
        raise DataError(
            f"{where}: the mapping has {n} columns of position and {counts}; it must have one of each for each joint."
        )
    units = str(given.get("time_unit", "s")), str(given.get("position_unit", "rad"))
    for unit, known in zip(units, (SECONDS, RADIANS), strict=True):
        if unit not in known:
            raise DataError(f"{where}: the unit '{unit}' is not known here; it must be one of {', '.join(known)}.")
    return Columns(time, lists["position"], lists["velocity"], lists["effort"], lists["joints"], *units)


def _guessed(names: Sequence[str], where: str) -> Columns:
    time, unit = _time(names)
    found: dict[str, dict[str, str]] = {"position": {}, "velocity": {}, "effort": {}, "current": {}}
    for name in names:
        if name != time and (told := _told(name)) is not None:
            found[told[0]].setdefault(told[1], name)
    notes: tuple[str, ...] = ()
    if not found["effort"] and found["current"]:
        found["effort"] = found["current"]
        notes = (
            "Motor currents are taken for efforts: set effort_scale to N m a unit of current, joint by joint, or an "
            "effort_preset.",
        )
    keys = [key for key in found["position"] if key in found["effort"]]
    if keys and (others := [name for key, name in found["position"].items() if key not in keys]):
        notes += (f"No column holds an effort for {', '.join(others)}: what else is told of them is left out.",)
    if not time or not keys:
        lacking = "time" if not time else "position and effort of any joint"
        raise DataError(
            f"{where}: the names of the columns don't tell {lacking}. There are {_listed(names)}. Say which is which with "
            "--columns: time: t, position: [q1, q2], effort: [tau1, tau2]."
        )
    if all(re.fullmatch(r"\d+", key) for key in keys):
        keys.sort(key=int)
    velocity = tuple(found["velocity"].get(key, "") for key in keys)
    named = not all(re.fullmatch(r"\d*", key) for key in keys)
    return Columns(
        time,
        tuple(found["position"][key] for key in keys),
        velocity if all(velocity) else (),
        tuple(found["effort"][key] for key in keys),
        tuple(keys) if named else (),
        unit,
        guessed=True,
        notes=notes,
    )


def _time(names: Sequence[str]) -> tuple[str, str]:
    """The column of time and its unit; empty where none is."""
    for word in _TIME:
        for name in names:
            plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
            for unit in ("", *SECONDS):
                if plain == (f"{word}_{unit}" if unit else word):
                    return name, unit or "s"
    return "", "s"


def _told(name: str) -> tuple[str, str] | None:
    """Quantity and joint that the name of a column tells; None where it tells neither."""
    plain = re.sub(r"[^\w]+", "_", name).strip("_")
    for prefix in _PREFIXES:
        if plain.lower().startswith(prefix + "_"):
            plain = plain[len(prefix) + 1 :]
    words = [(word, quantity) for quantity, some in {**_WORDS, "current": _CURRENT}.items() for word in some]
    for word, quantity in sorted(words, key=lambda x: -len(x[0])):
        low = plain.lower()
        if re.match(rf"{word}(_|\d|$)", low):
            return quantity, plain[len(word) :].strip("_")
        if low.endswith("_" + word) and not word.startswith("joint_"):  # the joint of elbow_joint_effort is elbow_joint
            return quantity, plain[: -len(word) - 1]
    return None


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(f"'{name}'" for name in names[:12])
    return shown + (f" and {len(names) - 12} more" if len(names) > 12 else "") if names else "none"
