"""ComputedTorque: makes the simulated arm follow a motion whatever it carries."""

from __future__ import annotations

import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_FREQUENCY = 50.0
_DAMPING = 0.7
_STIFFENING = 0.02


class ComputedTorque:
    """Computed torque with a feedback that is weighted by the inertia and stiffened where the arm alone weighs next to nothing::

        u   = w^2 (q_d - q) + 2 zeta w (v_d - v)
        tau = M(q) (a_d + u) + C(q, v) v + g(q) + J a_d + (J + D) u

    J are the rotor inertias. D stands for the inertia that an unknown payload may add: an iiwa's last joint alone turns 0.001 kg
    m^2, and gains weighted by that would let any payload hang down. With w = 50 rad/s and zeta = 0.7 the sampled loop is well
    damped with 0 to 5 kg at the flange (damping ratio 0.7 down to 0.2), and an unknown payload of 3 kg bends the wrist by some
    hundredths of a radian.

    Reference: Siciliano et al. 2009, "Robotics", section 8.5.2.

    Args:
        robot: the model that the controller believes, with or without the payload.
        rotor_inertia: shape (n,) [kg m^2].
    """

    def __init__(self, robot: RobotModel, rotor_inertia: FloatArray) -> None:
        self._robot = robot
        self._rotor = rotor_inertia
        # from the flange backwards: the last joint 0.01, the two before 0.02, the next two 0.05 kg m^2
        steps = np.array([0.5, 1.0, 1.0, 2.5, 2.5])[: robot.n]
        self._stiffening = np.zeros(robot.n)
        self._stiffening[robot.n - len(steps) :] = _STIFFENING * steps[::-1]

    def torque(self, q: FloatArray, v: FloatArray, q_d: FloatArray, v_d: FloatArray, a_d: FloatArray) -> FloatArray:
        """Joint torques (n,) [N m] at the state q, v for the wanted q_d, v_d, a_d, each of shape (n,)."""
        u = _FREQUENCY**2 * (q_d - q) + 2.0 * _DAMPING * _FREQUENCY * (v_d - v)
        return self._robot.rnea(q, v, a_d + u) + self._rotor * a_d + (self._rotor + self._stiffening) * u
