"""Recordings of an arm for the commands that work on all of a bag at once."""

from __future__ import annotations

from pathlib import Path

from sysid_ros.cli.inputs import open_bag
from sysid_ros.cli.output import progress_bar
from sysid_ros.exceptions import DataError, RobotModelError
from sysid_ros.identification import Recording
from sysid_ros.identification.result import Problem
from sysid_ros.input_gate import InputGate
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import Measurement

_MOST_REJECTED = 0.5


def read_recording(
    path: Path, urdf: Path | None, topic: str, settings: OnlineSettings, robots: list[RobotModel], problems: list[Problem]
) -> Recording:
    """The recording of a bag, as far as the gate accepts its messages.

    Args:
        robots: of the bags before; this bag's is added. problems: what was found is added.

    Raises:
        RobotModelError: the bag is of another robot than those before. DataError: most of it can't be used.
    """
    source, robot = open_bag(path, topic, urdf, settings)
    if robots and robot.joint_names != robots[0].joint_names:
        raise RobotModelError(
            f"bag '{path}' has joints {', '.join(robot.joint_names)}, the first bag has {', '.join(robots[0].joint_names)}. "
            "Use bags of the same robot."
        )
    robots.append(robot)
    gate = InputGate(robot, settings)
    with progress_bar(path.name, source.message_count) as advance:
        accepted = (m for m in map(gate.accept, source) if isinstance(m, Measurement))
        try:
            recording = Recording.from_measurements(str(path), accepted, advance)
        except DataError:
            _require_accepted(path, gate)
            raise
    _require_accepted(path, gate)
    for key, n in gate.counts.items():
        problems.append(Problem(str(path), "", key, f"{n} of {gate.received} messages rejected: {gate.last_texts[key]}"))
    problems += [Problem(str(path), "", "gate", sentence) for sentence in gate.warnings]
    return recording


def _require_accepted(path: Path, gate: InputGate) -> None:
    rejected = sum(gate.counts.values())
    if rejected > _MOST_REJECTED * gate.received:
        worst = max(gate.counts, key=lambda key: gate.counts[key])
        raise DataError(
            f"{path}: {rejected} of {gate.received} messages were rejected; no more than half of them may be. "
            f"{gate.last_texts[worst]}"
        )
