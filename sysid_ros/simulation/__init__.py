"""PyBullet simulation of an arm that picks up and drops a body: recordings whose truth is known."""

from sysid_ros.simulation.arm_record import ArmRecord, simulate_arm
from sysid_ros.simulation.arm_simulation import ArmSimulation
from sysid_ros.simulation.payload import Payload
from sysid_ros.simulation.scenario import ArmScenario
from sysid_ros.simulation.trajectory import ExcitingTrajectory

__all__ = ["ArmRecord", "ArmScenario", "ArmSimulation", "ExcitingTrajectory", "Payload", "simulate_arm"]
