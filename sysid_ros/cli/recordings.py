"""Recordings of an arm for the commands that work on all of a bag at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sysid_ros.cli.inputs import open_bag, require_same_robot
from sysid_ros.cli.output import note, warn
from sysid_ros.cli.progress import progress_bar
from sysid_ros.exceptions import DataError
from sysid_ros.identification import Recording
from sysid_ros.identification.result import Problem
from sysid_ros.input_gate import InputGate
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel

_MOST_REJECTED = 0.5


def read_recordings(
    bags: Sequence[Path], urdf: Path | None, topic: str, settings: OnlineSettings, columns: Path | None = None
) -> tuple[RobotModel, list[Recording], list[Problem]]:
    """The robot of the first bag, the recordings of all as far as the gate accepts their messages, and what was found in them.

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
        gate = InputGate(robot, settings)
        with progress_bar(path.name, source.message_count) as advance:
            try:
                recordings.append(Recording.from_measurements(str(path), gate.measurements(source), advance))
            except DataError:
                _require_accepted(path, gate)
                raise
        _require_accepted(path, gate)
        for sentence in gate.notes:
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


def _require_accepted(path: Path, gate: InputGate) -> None:
    rejected = sum(gate.counts.values())
    if rejected > _MOST_REJECTED * gate.received:
        worst = max(gate.counts, key=lambda key: gate.counts[key])
        raise DataError(
            f"{path}: {rejected} of {gate.received} messages were rejected; no more than half of them may be. "
            f"{gate.last_texts[worst]}"
        )
