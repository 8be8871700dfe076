"""simulate_quadruped: a whole scenario as arrays in memory, and as a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

from sysid_ros.sample import ContactRecord, ImuRecord, JointStateRecord
from sysid_ros.simulation.arm_record import Recorder
from sysid_ros.simulation.description import IMU_LINK
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario
from sysid_ros.simulation.quadruped_simulation import QuadrupedSimulation
from sysid_ros.simulation.quadruped_state import QuadrupedState


class QuadrupedRecorder(Recorder, Protocol):
    """What a recording with an IMU and feet is written to."""

    def write_imu(self, record: ImuRecord) -> None:
        """One message of the IMU."""

    def write_contacts(self, record: ContactRecord) -> None:
        """One message of the feet."""


@dataclass(frozen=True, slots=True)
class QuadrupedRecord:
    """A simulated recording in memory.

    Attributes:
        measured: what the sensors report, in the order of time. exact: the same without noise.
        start_time: stamp of the first message [s].
        truth: as in the truth file. urdf: the robot's description.
    """

    measured: list[QuadrupedState]
    exact: list[QuadrupedState]
    start_time: float
    truth: dict[str, Any]
    urdf: str

    def records(self, imu: bool = True, contacts: bool = True) -> Iterator[JointStateRecord | ImuRecord | ContactRecord]:
        """The messages in the order in which they are received: contacts, IMU, joints of each instant.

        Args:
            imu, contacts: False leaves these messages out.
        """
        names = tuple(self.truth["joint_names"])
        for state in self.measured:
            yield from state_records(state, self.start_time, names, imu, contacts)


def state_records(
    state: QuadrupedState, start_time: float, names: tuple[str, ...], imu: bool = True, contacts: bool = True
) -> Iterator[JointStateRecord | ImuRecord | ContactRecord]:
    """The messages of one instant, all received at their stamp."""
    t = start_time + state.t
    if contacts:
        yield ContactRecord(t, state.contacts)
    if imu:
        yield ImuRecord(t, t, IMU_LINK, state.orientation, state.omega, state.specific_force)
    yield JointStateRecord(t, t, names, state.q, state.v, state.tau)


def simulate_quadruped(
    scenario: QuadrupedScenario, progress: Callable[[int], None] | None = None, start_time: float = 0.0
) -> QuadrupedRecord:
    """Run a scenario to its end.

    Args:
        scenario: what is simulated; of finite duration.
        progress: called with the number of new messages now and then.
        start_time: t of the first message [s].

    Raises:
        SettingsError: the robot falls with what it has to carry.
    """
    simulation = QuadrupedSimulation(scenario)
    try:
        exact, measured = map(list, zip(*simulation.run(progress), strict=True))
        truth = simulation.truth(start_time)
    finally:
        simulation.close()
    return QuadrupedRecord(measured, exact, start_time, truth, simulation.urdf)


class Recorded(Protocol):
    """A simulated recording of a robot on legs, in memory."""

    @property
    def urdf(self) -> str: ...

    @property
    def start_time(self) -> float: ...

    def records(self, imu: bool = True, contacts: bool = True) -> Iterator[JointStateRecord | ImuRecord | ContactRecord]: ...


def write_quadruped(record: Recorded, recorder: QuadrupedRecorder, imu: bool = True, contacts: bool = True) -> None:
    """Write the description and the messages into an open recorder."""
    recorder.write_robot_description(record.urdf, record.start_time)
    for message in record.records(imu, contacts):
        if isinstance(message, ImuRecord):
            recorder.write_imu(message)
        elif isinstance(message, ContactRecord):
            recorder.write_contacts(message)
        else:
            recorder.write_joint_states([message])
