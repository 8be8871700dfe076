"""A scenario as a recording: joint states with a description, and the truth in a file beside them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Protocol

from sysid_ros.sample import JointStateRecord
from sysid_ros.simulation.arm_record import ArmRecord

START_TIME = 1_700_000_000.0
"""Stamp of the first message [s]: a date as on a real robot, always the same, so that a scenario gives the same bag again."""


class Recorder(Protocol):
    """What a recording is written to; :class:`sysid_ros.sources.bag_recorder.BagRecorder` is one."""

    def write_robot_description(self, urdf: str, receive_time: float) -> None:
        """The URDF's text."""

    def write_joint_states(self, records: Iterable[JointStateRecord]) -> None:
        """Joint states in the order of time."""


def truth_path(bag: Path) -> Path:
    """Where the truth of a bag is: ``NAME.truth.json`` beside it."""
    return bag.with_name(f"{bag.name}.truth.json")


def joint_state_records(record: ArmRecord) -> Iterator[JointStateRecord]:
    """The messages of a simulated recording; they are received at their stamps."""
    names = tuple(record.truth["joint_names"])
    for k, t in enumerate(record.t.tolist()):
        velocity = () if record.v is None else record.v[k]
        yield JointStateRecord(t, t, names, record.q[k], velocity, record.tau[k])


def write_recording(record: ArmRecord, recorder: Recorder) -> None:
    """Write the description and the messages into an open recorder."""
    recorder.write_robot_description(record.urdf, float(record.t[0]))
    recorder.write_joint_states(joint_state_records(record))


def write_truth(truth: dict[str, Any], path: Path) -> None:
    """Write the truth as JSON."""
    path.write_text(json.dumps(truth, indent=2) + "\n")
