"""The simulators that can hold a motion, and which of them are installed."""

from __future__ import annotations

import importlib
from importlib.util import find_spec

from sysid_ros.exceptions import SettingsError
from sysid_ros.simulation.held_motion import Arm
from sysid_ros.torque.torque_model import TorqueModel

_MODULES = {"mujoco": "mujoco_arm", "pybullet": "bullet_arm"}
NAMES = {"mujoco": "MuJoCo", "pybullet": "PyBullet"}
SIMULATORS = tuple(_MODULES)
"""In the order in which they are preferred."""
MISSING = "Neither MuJoCo nor PyBullet is installed, so nothing was simulated. Install one with: pip install 'sysid_ros[mujoco]'"


def is_installed(simulator: str) -> bool:
    """Whether a simulator can be imported."""
    return find_spec(simulator) is not None


def installed(simulator: str | None = None) -> str | None:
    """The simulator that was asked for, else the first that is installed; None where none is.

    Raises:
        SettingsError: the one that was asked for is not installed, or there is no such simulator.
    """
    if simulator is None:
        return next(filter(is_installed, SIMULATORS), None)
    if simulator not in SIMULATORS:
        raise SettingsError(f"the simulator is {simulator!r}; it must be one of {', '.join(SIMULATORS)}.")
    if not is_installed(simulator):
        extra = "mujoco" if simulator == "mujoco" else "sim"
        raise SettingsError(f"{NAMES[simulator]} is not installed. Install it with: pip install 'sysid_ros[{extra}]'")
    return simulator


def simulated(known: TorqueModel, simulator: str) -> Arm:
    """An arm with the links and rotors of what is known of a robot.

    Raises:
        RobotModelError: the simulator does not take it.
    """
    module = importlib.import_module(f"sysid_ros.simulation.{_MODULES[simulator]}")
    arm: Arm = module.make(known)
    return arm
