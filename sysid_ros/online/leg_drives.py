"""LegDrives: rotors and friction of the legs of a robot on a floating base, as free effects beside its payload."""

from __future__ import annotations

import numpy as np

from sysid_ros.effects import CoulombFriction, Effect, RotorInertia, ViscousFriction
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.sample import FREE, FloatArray

_TORQUE = 0.06
"""What a leg's joint holds while the robot stands, over a quarter of the weight and the cube root of the mass [m/kg^(1/3)]: bent
knees have a lever of 0.15 m on 16 kg."""
_ROTOR, _DRY, _VISCOUS = 2e-3, 0.03, 0.01
"""Prior standard deviations over that torque: of the rotors' inertia [s^2], of dry friction, and of viscous friction [s].
That is 0.012 kg m^2, 0.18 N m and 0.06 N m s/rad on 16 kg; supposed, not measured on robots."""
_UNIFORM = 3.0**-0.5
"""Standard deviation of what lies anywhere between minus and plus one."""


class LegDrives:
    """``tau_j = J_j a_j + Fc_j tanh(v_j / width) + b_j v_j`` of every joint of a leg, measured on the motors' side.

    At rest dry friction holds any torque up to Fc, and legs that sag under a load are all held up by it alike; no row tells that
    from a lighter load. It is considered: a torque of each joint by itself, and one that helps all of them against their load.

    Args:
        base: the robot.

    Attributes:
        effects: the three, on the floating base. prior_std: of their parameters, shape (3 n,).
        rest: standard deviation of the torque that each joint hides at rest, shape (n,) [N m]; changed in place.
    """

    def __init__(self, base: FloatingBase) -> None:
        joints = base.legs.joint_names
        self.effects: tuple[Effect, ...] = tuple(
            kind(base.robot, joints) for kind in (RotorInertia, CoulombFriction, ViscousFriction)
        )
        torque = base.mass * 9.81 / 4.0 * _TORQUE * base.mass ** (1.0 / 3.0)
        n = len(joints)
        self.prior_std: FloatArray = np.repeat([_ROTOR * torque, _DRY * torque, _VISCOUS * torque], n)
        self.rest: FloatArray = np.full(n, _UNIFORM * _DRY * torque)
        self.dry = slice(n, 2 * n)

    @property
    def considered(self) -> int:
        """Number of errors that :meth:`fill` writes."""
        return self.rest.size + 1

    def know(self, theta: FloatArray, variance: FloatArray) -> None:
        """Take in what is known of the three effects now, shape (3 n,) each: friction that moving joints do not show is not
        hidden in resting ones either."""
        self.rest[:] = _UNIFORM * np.sqrt(theta[self.dry] ** 2 + variance[self.dry])

    def fill(self, v: FloatArray, tau: FloatArray, width: float, out: FloatArray) -> None:
        """Write the considered torques of a sample into the rows (n, c) of the whole robot; ``v``, ``tau``: its joints, (n,)."""
        slow = 1.0 - np.tanh(v[FREE:] / width) ** 2
        n = self.rest.size
        hidden = slow * self.rest
        out[FREE + np.arange(n), np.arange(n)] = hidden
        out[FREE:, n] = hidden * np.sign(tau[FREE:])
