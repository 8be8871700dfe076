"""What a model says of the motor side of the joints: the part of it that a simulation must take at the state that it reaches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.robot.drive import Drive
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel


@dataclass(frozen=True, eq=False)
class JointSide:
    """Viscous friction b [N m s/rad], dry friction Fc [N m] and rotor inertia J [kg m^2] of each joint, shape (n,) each.

    They are taken out of a model's torque along the measured motion and put in at each step of the simulation, implicitly, so
    that a joint can stick: at rest the torque along the measured motion does not tell what dry friction holds.
    """

    viscous: FloatArray
    coulomb: FloatArray
    rotor: FloatArray

    @classmethod
    def of(cls, robot: RobotModel, known: Sequence[KnownEffect]) -> JointSide:
        """Of known effects, or of the URDF's ``<dynamics>`` where they do not replace it."""
        model = TorqueModel(robot, [], known)
        return cls(*(np.maximum(x, 0.0) for x in (model.damping(), model.dry_friction(), model.armature())))

    def torque(self, v: FloatArray, a: FloatArray) -> FloatArray:
        """What the model says of it along a motion, shape (N, n) [N m]."""
        along: FloatArray = self.viscous * v + self.coulomb * smoothed_sign(v) + self.rotor * a
        return along

    def drive(self, step: float) -> Drive:
        """It at each step of a simulation."""
        return Drive(self.viscous, self.coulomb, self.rotor, step)
