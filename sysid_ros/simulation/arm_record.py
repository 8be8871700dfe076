"""simulate_arm: a whole scenario as arrays in memory, and as a recording with the truth in a file beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.files import write_text
from sysid_ros.sample import FloatArray, JointStateRecord, Measurement
from sysid_ros.simulation.arm_simulation import ArmSimulation
from sysid_ros.simulation.scenario import ArmScenario

_LOST = 0.5
_BLOCK = 10_000


@dataclass(frozen=True, slots=True)
class ArmRecord:
    """A simulated recording in memory.

    Attributes:
        t: shape (N,) [s].
        q, v, tau: as the sensors tell them, shape (N, n); v is None where the messages hold none.
        exact_q, exact_v, exact_tau: without noise, shape (N, n).
        truth: as in the truth file.
        urdf: the arm's description.
    """

    t: FloatArray
    q: FloatArray
    v: FloatArray | None
    tau: FloatArray
    exact_q: FloatArray
    exact_v: FloatArray
    exact_tau: FloatArray
    truth: dict[str, Any]
    urdf: str

    def measurements(self) -> list[Measurement]:
        """The recording as the estimation takes it."""
        return [
            Measurement(float(self.t[k]), self.q[k].copy(), None if self.v is None else self.v[k].copy(), self.tau[k].copy())
            for k in range(len(self.t))
        ]


def simulate_arm(scenario: ArmScenario, progress: Callable[[int], None] | None = None, start_time: float = 0.0) -> ArmRecord:
    """Run a scenario to its end.

    Args:
        scenario: what is simulated; of finite duration.
        progress: called with the number of new messages now and then.
        start_time: t of the first message [s].

    Raises:
        SettingsError: a setting does not fit the arm, or the arm does not follow the motion with what it has to carry or
            overcome.
    """
    simulation = ArmSimulation(scenario)
    n = simulation.robot.n
    t = np.empty(simulation.count)
    # arrays from the start: a million messages as objects would take many times their memory
    exact_q, exact_v, exact_tau, q, v, tau = (np.empty((simulation.count, n)) for _ in range(6))
    try:
        for k, (exact, measured) in enumerate(simulation.run(progress)):
            t[k], exact_q[k], exact_v[k], exact_tau[k] = exact.t, exact.q, exact.v, exact.tau
            q[k], tau[k] = measured.q, measured.tau
            if measured.v is not None:
                v[k] = measured.v
        truth = simulation.truth(start_time)
        _check_followed(simulation, t, exact_q)
    finally:
        simulation.close()
    velocity = v if scenario.velocity else None
    return ArmRecord(start_time + t, q, velocity, tau, exact_q, exact_v, exact_tau, truth, simulation.urdf)


def _check_followed(simulation: ArmSimulation, t: FloatArray, q: FloatArray) -> None:
    error = np.zeros(simulation.robot.n)
    for first in range(0, len(t), _BLOCK):
        wanted, _, _ = simulation.trajectory.sample(t[first : first + _BLOCK])
        error = np.maximum(error, np.abs(q[first : first + _BLOCK] - wanted).max(axis=0))
    # not <=, so that NaN does not pass
    if not np.all(error <= _LOST):
        worst = int(np.argmax(error))
        raise SettingsError(
            f"payload_mass is {simulation.scenario.payload_mass}, and joint {simulation.robot.joint_names[worst]} is up to "
            f"{error[worst]:.2f} rad away from the motion; {_LOST} rad is allowed. Take a lighter payload nearer to the flange "
            "or less friction, or let the controller know the payload."
        )


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
    write_text(path, json.dumps(truth, indent=2) + "\n")
