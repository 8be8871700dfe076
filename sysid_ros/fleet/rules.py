"""robots.yaml: which robot a bag is of, and what is known of it."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sysid_ros.exceptions import SettingsError, in_a_line
from sysid_ros.fleet.dates import KEYS as DATE_KEYS
from sysid_ros.fleet.dates import DateRule, Told
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray
from sysid_ros.sources import urdf_text

_KEYS = {
    "robot",
    "kind",
    "paths",
    "description",
    "urdf",
    "model",
    "payload",
    "frame",
    "temperature",
    "topic",
    "settings",
} | DATE_KEYS
_TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, slots=True)
class Entry:
    """What is known of the robot of a bag: plain values, which go to another machine as they are.

    Attributes:
        robot, kind: names. urdf: its text; empty for that recorded in the bag. model: text of its model.yaml, or empty.
        model_name: where that came from, for messages. payload: ten parameters of what it always carries about the origin of
            ``frame`` (the robot's default where empty).
        temperature: topic of the joints' temperatures; all that a bag has where empty. topic: of the joint states.
        settings: of the node, such as effort_scale. description: glob on the name of the robot in the bag's own URDF; empty: any.
    """

    robot: str
    kind: str
    urdf: str = ""
    model: str = ""
    model_name: str = ""
    frame: str = ""
    payload: tuple[float, ...] = (0.0,) * 10
    temperature: str = ""
    topic: str = "/joint_states"
    settings: dict[str, Any] = field(default_factory=dict)
    description: str = ""

    @property
    def digest(self) -> str:
        """SHA-256 of all that decides a result beside the bag, hexadecimal."""
        known = (self.urdf, self.model, self.frame, self.payload, self.temperature, self.topic, self.settings)
        return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class _Rule:
    paths: tuple[re.Pattern[str], ...]
    values: dict[str, Any]
    dates: DateRule

    def stars(self, bag: str) -> tuple[str | None, ...] | None:
        """What the stars of the first path that a bag fits stand for; None where it fits none."""
        return next((found.groups() for path in self.paths if (found := path.fullmatch(bag))), None if self.paths else ())


class Rules:
    """The rules of a robots.yaml, the first that fits a bag counts::

        robots:
          - paths: ["cell_*/**"]      # glob on the path; what the first * stands for is {1} in robot, kind, urdf, model
            description: "ur10e*"     # glob on the robot's name in the bag's own URDF
            robot: "cell_{1}"
            kind: ur10e
            urdf: ur10e.urdf          # without it, that of the bag's /robot_description
            model: "cell_{1}/model.yaml"
            payload: {mass: 1.2, com: [0, 0, 0.08], inertia: [0.002, 0.002, 0.001, 0, 0, 0]}
            frame: tool0
            temperature: /motor_temperatures
            topic: /joint_states
            settings: {effort_scale: [1, 1, 1, 1, 1, 1]}

    A rule may also tell when its bags were recorded: :class:`.dates.DateRule`.

    Args:
        document: what the file holds. folder: that its paths count from.

    Raises:
        SettingsError: it is no such document.
    """

    def __init__(self, document: Any, folder: Path, name: str = "robots.yaml") -> None:
        self._folder, self._name = folder, name
        given = document.get("robots") if isinstance(document, dict) else None
        if not isinstance(given, list) or not given:
            raise SettingsError(f"{name} must hold a list 'robots:' of one rule or more. See docs/fleet.md for an example.")
        self._rules = [self._rule(k, rule) for k, rule in enumerate(given, 1)]

    @classmethod
    def read(cls, path: Path) -> Rules:
        """The rules of a file.

        Raises:
            SettingsError: it can't be read or is not right.
        """
        try:
            document = yaml.safe_load(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise SettingsError(f"--robots: '{path}' can't be read: {error.strerror}.") from None
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            raise SettingsError(f"--robots: '{path}' is not YAML: {in_a_line(error)}.") from None
        return cls(document, path.resolve().parent, str(path))

    def entries(self, bag: str) -> list[Entry]:
        """What the robot of a bag may be: the rules that its path fits, up to the first that asks for nothing more.

        Args:
            bag: its path or URL.

        Raises:
            SettingsError: a URDF, a model or settings that a rule names can't be read.
        """
        return [self._entry(rule.values, stars) for rule, stars in self._fitting(bag)]

    def told(self, bag: str) -> list[Told]:
        """What each of :meth:`entries` tells of when the bag was recorded.

        Raises:
            SettingsError: a rule that tells dates has none for it.
        """
        return [rule.dates.of(bag, _filled(rule.dates.campaign, stars)) for rule, stars in self._fitting(bag)]

    def _fitting(self, bag: str) -> Iterator[tuple[_Rule, tuple[str | None, ...]]]:
        for rule in self._rules:
            stars = rule.stars(bag)
            if stars is not None:
                yield rule, stars
                if not rule.values.get("description"):
                    return

    def _rule(self, k: int, rule: Any) -> _Rule:
        where = f"{self._name}, rule {k}"
        if not isinstance(rule, dict) or not rule.get("robot"):
            raise SettingsError(f"{where}: it must be a mapping with at least 'robot:', the robot's name.")
        if unknown := sorted(map(str, set(rule) - _KEYS)):
            raise SettingsError(f"{where} has {', '.join(unknown)}; allowed are {', '.join(sorted(_KEYS))}.")
        paths = rule.get("paths", [])
        globs = [paths] if isinstance(paths, str) else paths
        if not isinstance(globs, list) or not all(isinstance(x, str) for x in globs):
            raise SettingsError(f"{where}: 'paths' is {paths!r}; it must be a glob or a list of globs, such as cell_3/**.")
        settings = rule.get("settings") or {}
        if not isinstance(settings, dict):
            raise SettingsError(f"{where}: 'settings' is {settings!r}; it must be a mapping, such as {{effort_scale: [1.0]}}.")
        try:
            OnlineSettings.from_mapping(settings, where)
        except SettingsError as error:
            raise SettingsError(f"{where}: {error}") from None
        values = {**rule, "payload": _payload(rule.get("payload"), where), "settings": settings}
        return _Rule(tuple(_pattern(glob) for glob in globs), values, DateRule(rule, self._folder, where))

    def _entry(self, values: Mapping[str, Any], stars: Sequence[str | None]) -> Entry:
        def text(key: str) -> str:
            return _filled(str(values.get(key) or ""), stars)

        urdf, model = text("urdf"), text("model")
        return Entry(
            robot=text("robot"),
            kind=text("kind") or text("robot"),
            urdf=_urdf(str(self._folder / urdf)) if urdf else "",
            model=_text(self._folder / model) if model else "",
            model_name=str(self._folder / model) if model else "",
            frame=text("frame"),
            payload=values["payload"],
            temperature=text("temperature"),
            topic=text("topic") or "/joint_states",
            settings=dict(values["settings"]),
            description=text("description"),
        )


def _payload(given: Any, where: str) -> tuple[float, ...]:
    """Ten parameters about the frame's origin."""
    if given is None:
        return (0.0,) * 10
    try:
        mass, com = float(given["mass"]), _numbers(given.get("com", [0.0] * 3), 3)
        inertia = np.zeros((3, 3))
        for (i, j), value in zip(_TENSOR, _numbers(given.get("inertia", [0.0] * 6), 6), strict=True):
            inertia[i, j] = inertia[j, i] = value
        if not 0.0 <= mass < np.inf or set(given) - {"mass", "com", "inertia"}:
            raise ValueError
    except (TypeError, ValueError, KeyError, AttributeError):
        raise SettingsError(
            f"{where}: 'payload' is {given!r}; it must be {{mass: KG, com: [x, y, z], inertia: [xx, yy, zz, xy, xz, yz]}}, the "
            "inertia about the centre of mass."
        ) from None
    return tuple(inertial_parameters.from_com(mass, com, inertia).tolist())


def _numbers(given: Any, count: int) -> FloatArray:
    values = np.asarray(given, dtype=float)
    if values.shape != (count,) or not np.isfinite(values).all():
        raise ValueError
    return values


def _pattern(glob: str) -> re.Pattern[str]:
    """A glob that may begin anywhere below a folder; each star is a group."""
    parts = {"**/": "(?:(.*)/)?", "**": "(.*)", "*": "([^/]*)", "?": "[^/]"}
    tokens = re.split(r"(\*\*/|\*\*|\*|\?)", glob)
    inner = "".join(parts.get(token, re.escape(token)) for token in tokens)
    return re.compile(inner if glob.startswith("/") or "://" in glob else f"(?:.*/)?{inner}")


def _filled(text: str, stars: Sequence[str | None]) -> str:
    for k, star in enumerate(stars, 1):
        text = text.replace(f"{{{k}}}", star or "")
    return text


@cache
def _urdf(path: str) -> str:
    return urdf_text(path)


@cache
def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"--robots names the model '{path}', which can't be read: {in_a_line(error)}.") from None
