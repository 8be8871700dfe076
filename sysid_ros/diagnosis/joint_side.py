"""What a model says of the motor side of the joints: the part of it that a simulation must take at the state that it reaches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.robot.drive import Drive
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.known_effect import KnownEffect

_SIGN = 0.02
"""Width of the sign of a velocity in the models' torque [rad/s]."""


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
        replaced = any(k.effect.replaces_links for k in known)
        viscous, coulomb = (np.zeros(robot.n) if replaced else x.copy() for x in (robot.damping, robot.friction))
        rotor = np.zeros(robot.n)
        for k in known:
            viscous += k.effect.as_damping(k.theta)
            coulomb += k.effect.as_dry_friction(k.theta)
            rotor += k.effect.as_armature(k.theta)
        return cls(*(np.maximum(x, 0.0) for x in (viscous, coulomb, rotor)))

    def torque(self, v: FloatArray, a: FloatArray) -> FloatArray:
        """What the model says of it along a motion, shape (N, n) [N m]."""
        along: FloatArray = self.viscous * v + self.coulomb * np.tanh(v / _SIGN) + self.rotor * a
        return along

    def drive(self, step: float) -> Drive:
        """It at each step of a simulation."""
        return Drive(self.viscous, self.coulomb, self.rotor, step)
