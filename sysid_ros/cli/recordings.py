"""Recordings for the commands that work on all of a bag at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sysid_ros.cli.inputs import open_bag, require_same_robot
from sysid_ros.cli.output import note, warn
from sysid_ros.cli.progress import progress_bar
from sysid_ros.exceptions import DataError
from sysid_ros.floating.floating_base import floating_base_of
from sysid_ros.identification import Recording
from sysid_ros.identification.result import Problem
from sysid_ros.input_gate import Gate, gate_for
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import FloatingBagSource, TableSource

_MOST_REJECTED = 0.5


@dataclass(frozen=True, slots=True)
class TrunkTopics:
    """Where IMU and contacts of a robot on legs are; empty where the bag is to tell."""

    imu: str = ""
    contacts: str = ""


def read_recordings(
    bags: Sequence[Path],
    urdf: Path | None,
    topic: str,
    settings: OnlineSettings,
    columns: Path | None = None,
    trunk: TrunkTopics | None = None,
) -> tuple[RobotModel, list[Recording], list[Problem]]:
    """The robot of the first bag, the recordings of all as far as the gate accepts their messages, and what was found in them.

    Args:
        trunk: where what a robot on legs has beside its joints is; None: every robot is an arm.

    Raises:
        RobotModelError: a bag is of another robot than the first. DataError: most of one can't be used.
    """
    first: RobotModel | None = None
    recordings: list[Recording] = []
    problems: list[Problem] = []
    for path in bags:
        source, robot = open_bag(path, topic, urdf, settings, columns)
        first = first or robot
        require_same_robot(path, robot, first)
        base = floating_base_of(robot, settings) if trunk else None
        gate = gate_for(robot, base, settings)
        records: Iterable[Any] = source
        if base is not None and trunk is not None:
            if isinstance(source, TableSource):
                raise DataError(f"table '{path}' holds no IMU, which a robot on legs needs. Give a bag.")
            records = FloatingBagSource(source, trunk.imu, trunk.contacts)
        with progress_bar(path.name, source.message_count) as advance:
            try:
                measurements = (m for record in records for m in gate.take(record))
                recordings.append(Recording.from_measurements(str(path), measurements, advance))
            except DataError:
                _require_accepted(path, gate)
                raise
        _require_accepted(path, gate)
        for sentence in (*gate.notes, *(base.notes if base else ())):
            note(f"{path.name}: {sentence}")
        for key, n in gate.counts.items():
            problems.append(Problem(str(path), "", key, f"{n} of {gate.received} messages rejected: {gate.last_texts[key]}"))
        problems += [Problem(str(path), "", "gate", sentence) for sentence in gate.warnings]
    assert first is not None
    return first, recordings, problems


def warn_of(problems: Sequence[Problem]) -> None:
    """A warning on stderr for each."""
    for problem in problems:
        warn(f"{Path(problem.bag).name}: {problem.text}" if problem.bag else problem.text)


def _require_accepted(path: Path, gate: Gate) -> None:
    rejected = sum(gate.counts.values())
    if rejected > _MOST_REJECTED * gate.received:
        worst = max(gate.counts, key=lambda key: gate.counts[key])
        raise DataError(
            f"{path}: {rejected} of {gate.received} messages were rejected; no more than half of them may be. "
            f"{gate.last_texts[worst]}"
        )
