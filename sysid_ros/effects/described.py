"""Described: what of an effect a robot's description, or what is said of its sensors, can hold."""

from __future__ import annotations

from abc import ABC

import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.trunk_channels import TrunkSetup


class Described(ABC):
    """The questions of whoever writes a URDF, linearises a joint or sets up sensors: asked of every effect, each with the answer
    of one that is none of this."""

    robot: RobotModel

    def as_links(self, theta: FloatArray) -> FloatArray:
        """What it adds to the URDF's link inertials in their joint frames, shape (n, 10)."""
        return np.zeros((self.robot.n, 10))

    def as_armature(self, theta: FloatArray) -> FloatArray:
        """Inertia that turns with each joint alone, shape (n,) [kg m^2]."""
        return np.zeros(self.robot.n)

    def as_damping(self, theta: FloatArray) -> FloatArray:
        """Viscous friction of each joint, shape (n,) [N m s/rad]."""
        return np.zeros(self.robot.n)

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        """Level of the dry friction of each joint at moderate speed without load, shape (n,) [N m]."""
        return np.zeros(self.robot.n)

    def as_delay(self, theta: FloatArray) -> float:
        """By how much it makes the published torque late [s]."""
        return 0.0

    def as_gravity(self, theta: FloatArray) -> FloatArray:
        """What it adds to gravity in the axes of the base, shape (3,) [m/s^2]."""
        return np.zeros(3)

    def as_gain(self, theta: FloatArray) -> FloatArray:
        """Factor by which each joint's effort is published too large, shape (n,)."""
        return np.ones(self.robot.n)

    def as_setup(self, theta: FloatArray) -> TrunkSetup | None:
        """What it says of IMU and feet of a robot on legs, where it is no torque; else None."""
        return None

    def of_setup(self, setup: TrunkSetup) -> FloatArray | None:
        """Its parameters, shape (p,), as IMU and feet have been corrected for already; None of a torque."""
        return None
