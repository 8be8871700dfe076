"""FleetScenario: how many robots for how long, and what happens to them; no physics here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any

from sysid_ros.exceptions import SettingsError

CAUSES = ("wear", "torque_offset", "zero_slip", "torque_gain", "tool")
"""What can happen to a robot: the kinds of change."""

SIZES: Mapping[str, float] = {"wear": 1.0, "torque_offset": 0.02, "zero_slip": 0.008726646, "torque_gain": 0.05, "tool": 0.3}
"""Usual size of each: Coulomb friction more by so much of itself [1]; offset as a part of the effort limit [1]; zero of a joint
after a crash [rad]; gain [1]; mass [kg]."""

WEAR = 60.0
"""Time over which a gear wears to its new friction [days]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetScenario:
    """A fleet over months.

    Attributes:
        robots, weeks, bags_per_week: how many. duration: of a bag [s]. rate: of its joint states [Hz].
        changes: number of robots to which each of :data:`CAUSES` happens, once; the others stay as they are but for seasons,
            loads and slow drift.
        sizes: of the changes, as :data:`SIZES`. seed: of all that is drawn. start: of the first week.
        temperature_known: the bags tell the temperature of the joints. seasons: amplitude of the year's temperature [K].

    Raises:
        SettingsError: a number is out of range, or more changes are asked for than there are robots.
    """

    robots: int = 40
    weeks: int = 50
    bags_per_week: int = 1
    duration: float = 20.0
    rate: int = 250
    changes: Mapping[str, int] = field(default_factory=lambda: dict.fromkeys(CAUSES, 4))
    sizes: Mapping[str, float] = field(default_factory=lambda: dict(SIZES))
    seed: int = 0
    start: datetime = datetime(2025, 1, 6, 6, tzinfo=UTC)
    temperature_known: bool = True
    seasons: float = 8.0

    def __post_init__(self) -> None:
        for name, least in (("robots", 1), ("weeks", 1), ("bags_per_week", 1), ("seed", 0), ("rate", 20)):
            if not getattr(self, name) >= least:
                raise SettingsError(f"{name} is {getattr(self, name)}; it must be {least} or more.")
        if not 4.0 <= self.duration < 3600.0:
            raise SettingsError(f"duration is {self.duration} s; it must be from 4 s to an hour.")
        if not 0.0 <= self.seasons < 50.0:
            raise SettingsError(f"seasons is {self.seasons} K; it must be from 0 to 50.")
        if unknown := sorted({*self.changes, *self.sizes} - set(CAUSES)):
            raise SettingsError(f"changes name {', '.join(unknown)}; what can happen is {', '.join(CAUSES)}.")
        if min(self.changes.values(), default=0) < 0 or sum(self.changes.values()) > self.robots:
            raise SettingsError(
                f"changes ask for {sum(self.changes.values())} robots of {self.robots}; each robot changes at most once. "
                "Ask for more robots or for fewer changes."
            )

    @property
    def days(self) -> float:
        """Length of all [days]."""
        return 7.0 * self.weeks

    def date(self, day: float) -> datetime:
        """The date so many days after the start."""
        return self.start + timedelta(days=day)


@dataclass(frozen=True, slots=True)
class Change:
    """What happened to a robot.

    Attributes:
        robot: its name. cause: one of :data:`CAUSES`. joint: name, "" for what is at the tip. parameter: of the joint's table.
        day: since the start. until: when it is complete [days]; the same for what happens at once. size: [unit].
    """

    robot: str
    cause: str
    joint: str
    parameter: str
    day: float
    until: float
    size: float
    unit: str

    def share(self, day: float) -> float:
        """How much of it is there at a day, from 0 to 1."""
        if day < self.day:
            return 0.0
        return 1.0 if day >= self.until else (day - self.day) / (self.until - self.day)

    def as_dict(self, scenario: FleetScenario) -> dict[str, Any]:
        """In plain types, with dates."""
        return {
            "robot": self.robot,
            "cause": self.cause,
            "joint": self.joint or None,
            "parameter": self.parameter,
            "date": scenario.date(self.day).isoformat(),
            "complete": scenario.date(self.until).isoformat(),
            "size": self.size,
            "unit": self.unit,
        }
