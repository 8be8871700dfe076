"""LegDrives: rotors and friction of the legs of a robot on a floating base, as free effects beside its payload; LegEfforts: what
their efforts are wrong by."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.effects import CoulombFriction, Effect, RotorInertia, ViscousFriction
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.leg_priors import DRY, OFFSET, ROTOR, VISCOUS, standing_torque
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.torque.torque_model import TorqueModel

_CHANGES, _LEAST = 0.2, 0.05
"""By how much drives that were identified change with temperature and wear, as a part; and at least, of what is usual."""
_UNIFORM = 3.0**-0.5
"""Standard deviation of what lies anywhere between minus and plus one."""


class LegDrives:
    """``tau_j = J_j a_j + Fc_j tanh(v_j / width) + b_j v_j`` of every joint of a leg, measured on the motors' side.

    At rest dry friction holds any torque up to Fc, and legs that sag under a load are all held up by it alike; no row tells that
    from a lighter load. It is considered: a torque of each joint by itself, and one that helps all of them against their load.

    Where they have been identified, what is free is by how much they have changed since.

    Args:
        base: the robot. known: its torques as they were identified, None where they were not.

    Attributes:
        effects: the three, on the floating base. prior_std: of their parameters, shape (3 n,).
        rest: standard deviation of the torque that each joint hides at rest, shape (n,) [N m]; changed in place.
    """

    def __init__(self, base: FloatingBase, known: TorqueModel | None = None) -> None:
        joints = base.legs.joint_names
        self.effects: tuple[Effect, ...] = tuple(
            kind(base.robot, joints) for kind in (RotorInertia, CoulombFriction, ViscousFriction)
        )
        torque = standing_torque(base.mass)
        n = len(joints)
        self.prior_std: FloatArray = np.repeat([ROTOR * torque, DRY * torque, VISCOUS * torque], n)
        self._known: FloatArray = np.zeros(n)
        if known is not None:
            found = np.concatenate([x[FREE:] for x in (known.armature(), known.dry_friction(), known.damping())])
            self.prior_std = np.minimum(np.maximum(_CHANGES * np.abs(found), _LEAST * self.prior_std), self.prior_std)
            self._known = np.abs(found[n : 2 * n])
        self.rest: FloatArray = _UNIFORM * (self._known + self.prior_std[n : 2 * n])
        self.dry = slice(n, 2 * n)

    @property
    def considered(self) -> int:
        """Number of errors that :meth:`fill` writes."""
        return self.rest.size + 1

    def know(self, theta: FloatArray, variance: FloatArray) -> None:
        """Take in what is known of the three effects now, shape (3 n,) each: friction that moving joints do not show is not
        hidden in resting ones either."""
        self.rest[:] = _UNIFORM * np.sqrt((self._known + theta[self.dry]) ** 2 + variance[self.dry])

    def fill(self, v: FloatArray, tau: FloatArray, width: float, out: FloatArray) -> None:
        """Write the considered torques of a sample into the rows (n, c) of the whole robot; ``v``, ``tau``: its joints, (n,)."""
        _hidden_at_rest(v, tau, width, self.rest, out)


class LegEfforts:
    """What the efforts of the legs are wrong by, considered: the gain of each, what all gains have in common (torque constants of
    one make, one temperature), and a constant of each. A robot of 15 kg whose efforts are all 1 % too large weighs 150 g more,
    and no motion tells that from a load.

    Args:
        base: the robot. gain: standard deviation of each effort's gain, and of what all have in common, as a part of the torque.

    Attributes:
        considered: number of errors that :meth:`fill` writes.
    """

    def __init__(self, base: FloatingBase, gain: float) -> None:
        n = len(base.legs.joint_names)
        self._gain, self._offset = gain, OFFSET * standing_torque(base.mass)
        self.considered = 2 * n + 1

    def fill(self, tau: FloatArray, out: FloatArray) -> None:
        """Write the considered torques of a sample into the rows (n, c) of the whole robot; ``tau``: of its joints, (n,)."""
        _wrong_efforts(tau, self._gain, self._offset, out)


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _hidden_at_rest(v: FloatArray, tau: FloatArray, width: float, rest: FloatArray, out: FloatArray) -> None:
    """See :class:`LegDrives`: the torque of each joint by itself, and of all against their load."""
    n = rest.size
    for j in range(n):
        hidden = rest[j] * (1.0 - np.tanh(v[FREE + j] / width) ** 2)
        out[FREE + j, j] = hidden
        out[FREE + j, n] = hidden * np.sign(tau[FREE + j])


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _wrong_efforts(tau: FloatArray, gain: float, offset: float, out: FloatArray) -> None:
    """See :class:`LegEfforts`: each gain, each constant, and what all gains have in common."""
    n = tau.size - FREE
    for j in range(n):
        wrong = gain * tau[FREE + j]
        out[FREE + j, j] = wrong
        out[FREE + j, n + j] = offset
        out[FREE + j, 2 * n] = wrong
