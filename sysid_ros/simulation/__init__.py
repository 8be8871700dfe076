"""Simulated robots: recordings whose truth is known, and recorded motions that a controller holds."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sysid_ros.simulation.arm_record import ArmRecord, simulate_arm
    from sysid_ros.simulation.arm_simulation import ArmSimulation
    from sysid_ros.simulation.payload import Payload
    from sysid_ros.simulation.scenario import ArmScenario
    from sysid_ros.simulation.trajectory import ExcitingTrajectory

_WHERE = {
    "ArmRecord": "arm_record",
    "ArmScenario": "scenario",
    "ArmSimulation": "arm_simulation",
    "ExcitingTrajectory": "trajectory",
    "Payload": "payload",
    "simulate_arm": "arm_record",
}

__all__ = ["ArmRecord", "ArmScenario", "ArmSimulation", "ExcitingTrajectory", "Payload", "simulate_arm"]


def __getattr__(name: str) -> Any:
    # PyBullet need not be there for the rest
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_WHERE[name]}"), name)
