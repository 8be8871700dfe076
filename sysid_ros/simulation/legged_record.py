"""simulate_legged: a whole scenario of a robot on legs in MuJoCo as arrays in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from sysid_ros.sample import ContactRecord, ImuRecord, JointStateRecord
from sysid_ros.simulation.legged_scenario import LeggedScenario
from sysid_ros.simulation.legged_simulation import LeggedSimulation
from sysid_ros.simulation.quadruped_state import QuadrupedState


@dataclass(frozen=True, slots=True)
class LeggedRecord:
    """A simulated recording in memory.

    Attributes:
        measured: what joints and feet report, in the order of time. exact: the same without noise; neither has an IMU.
        imu: its messages. start_time: stamp of the first message of the joints [s].
        truth: as in the truth file. urdf: the robot's description.
    """

    measured: list[QuadrupedState]
    exact: list[QuadrupedState]
    imu: list[ImuRecord]
    start_time: float
    truth: dict[str, Any]
    urdf: str

    def records(self, imu: bool = True, contacts: bool = True) -> Iterator[JointStateRecord | ImuRecord | ContactRecord]:
        """The messages in the order in which they are received: contacts, IMU, joints of each instant.

        Args:
            imu, contacts: False leaves these messages out.
        """
        names, start = tuple(self.truth["joint_names"]), self.start_time
        readings = iter(self.imu if imu else ())
        reading = next(readings, None)
        for state in self.measured:
            t = start + state.t
            if contacts:
                yield ContactRecord(t, state.contacts)
            while reading is not None and reading.receive_time <= t:
                yield reading
                reading = next(readings, None)
            yield JointStateRecord(t, t, names, state.q, state.v, state.tau)


def simulate_legged(
    scenario: LeggedScenario, progress: Callable[[int], None] | None = None, start_time: float = 0.0
) -> LeggedRecord:
    """Run a scenario to its end.

    Args:
        scenario: what is simulated; of finite duration.
        progress: called with the number of new messages now and then.
        start_time: t of the first message [s].

    Raises:
        SettingsError: there is no such robot, or it falls with what it has to carry.
    """
    simulation = LeggedSimulation(scenario)
    exact, measured, imu = [], [], []
    for state, noisy in simulation.run(progress):
        exact.append(state)
        measured.append(noisy)
        while simulation.imu:
            imu.append(_moved(simulation.noisy_imu(simulation.imu.popleft()), start_time))
    return LeggedRecord(measured, exact, imu, start_time, simulation.truth(start_time), simulation.urdf)


def _moved(reading: ImuRecord, start: float) -> ImuRecord:
    return ImuRecord(
        start + reading.stamp, start + reading.receive_time, reading.frame_id, reading.orientation, reading.omega,
        reading.specific_force,
    )  # fmt: skip
