"""A recorded motion held by a controller in a simulation: what the controller must add, and how far the arm strays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import interpolate

from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel

STEP = 2e-3
"""Step of the simulators [s]."""
_BENDS = 0.1
"""By how much the largest torque of a joint may bend its controller [rad], [m]."""
_WEAKEST = 1e-9
_LOST = 3.0
"""Joints this far from the recorded motion are lost [rad], [m]."""


class Arm(Protocol):
    """An arm in a simulator, whose step of length h is ``v+ = v + h a; q+ = q + h v+`` with
    ``(M(q) + J) a + C(q, v) v + g(q) = tau - d v+``: links M and rotors J of the simulator's own, a damping that is implicit.

    Attributes:
        q, v: the state, shape (n,), in the robot's joint order; v is the velocity that led to q.
    """

    q: FloatArray
    v: FloatArray

    def reset(self, q: FloatArray, v: FloatArray) -> None:
        """Put the joints into a state, shape (n,) each."""

    def step(self, tau: FloatArray, damping: FloatArray) -> None:
        """One step under joint torques tau [N m] and damping d [N m s/rad], shape (n,) each."""

    def close(self) -> None:
        """Free the simulator."""


@dataclass(frozen=True, eq=False)
class Reference:
    """A motion in a simulator's own steps.

    Attributes:
        t: shape (K,) [s]. q, v: shape (K + 1, n): positions, and the velocity that led to each. a: of each step, shape (K, n).
    """

    t: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray

    @classmethod
    def of(cls, t: FloatArray, q: FloatArray) -> Reference:
        """Through positions q (N, n) at times t (N,), by a quintic spline."""
        fine = t[0] + STEP * np.arange(int((t[-1] - t[0]) / STEP))
        at = np.asarray(interpolate.make_interp_spline(t, q, k=5)(fine))
        v = np.diff(at, axis=0) / STEP
        return cls(fine[1:-1], at[1:], v, np.diff(v, axis=0) / STEP)

    def needed(self, known: TorqueModel) -> FloatArray:
        """Torque that moves a robot's links and rotors along it, step by step, shape (K, n) [N m]."""
        robot = known.robot.with_links(known.links() - known.robot.pi)
        beside: FloatArray = np.maximum(known.armature(), 0.0) - np.array(robot.model.armature)  # rnea has the description's
        return robot.rnea_along(self.q[:-1], self.v[:-1], self.a) + beside * self.a


@dataclass(frozen=True, eq=False)
class Controller:
    """PD on each joint, ``K (q_d - q) + D (v_d - v)``, shape (n,) each [N m/rad], [N m s/rad].

    ``K = w^2 M + tau_max / 0.1 rad`` and ``D = 2 sqrt(K M)``: critically damped at the frequency w at least, with M the mean of
    the joint's own inertia along the motion, and so stiff that not even the joint's largest torque bends it by more than 0.1 rad:
    many a URDF knows of next to no inertia in a wrist.
    """

    stiffness: FloatArray
    damping: FloatArray

    @classmethod
    def of(cls, models: Sequence[TorqueModel], q: FloatArray, largest: FloatArray, frequency: float) -> Controller:
        """One and the same for several models of a robot, each held along positions q (N, n): for the heaviest of them.

        Args:
            largest: torque of each joint where the URDF states no effort limit, shape (n,) [N m]. frequency: w / 2 pi [Hz].
        """
        own = [np.mean(np.diagonal(m.mass_along(q), axis1=1, axis2=2), axis=0) + m.armature() for m in models]
        mass = np.maximum(np.max(own, axis=0), 0.0)
        stated = models[0].robot.effort_limit
        limit = np.where(np.isfinite(stated), stated, largest)
        stiffness = (2.0 * np.pi * frequency) ** 2 * mass + limit / _BENDS
        return cls(stiffness, 2.0 * np.sqrt(stiffness * mass))


@dataclass(frozen=True, eq=False)
class Held:
    """A simulation of a held motion, shape (K, n) each: at the times of the reference.

    Attributes:
        position, velocity: simulated less recorded [rad], [rad/s]. added: torque of the feedback [N m].
    """

    position: FloatArray
    velocity: FloatArray
    added: FloatArray

    @property
    def lost(self) -> bool:
        """Whether the arm went away."""
        return not np.isfinite(self.position).all()


def hold(
    arm: Arm, reference: Reference, needed: FloatArray, drive: FloatArray, damping: FloatArray, controller: Controller
) -> Held:
    """Let a controller hold a motion.

    Each step the joints get ``needed + drive`` and the controller's feedback. ``needed`` moves the simulated links along the
    reference, so all other torques of the model (friction, offsets, springs) are those that it has along the recorded motion:
    a joint that is held within milliradians rubs as the recorded one did, at rest too. With no drive an arm whose simulator
    agrees with the model follows the reference to rounding.

    Args:
        needed: as :meth:`Reference.needed`. drive: feed-forward torque beyond the model's torque along the motion; shape (K, n)
            each [N m].
        damping: viscous friction of the simulated joints, shape (n,) [N m s/rad].
    """
    damping = np.maximum(damping, 0.0)
    implicit = STEP * controller.stiffness + controller.damping + damping
    applied = needed + drive + (controller.damping + damping) * reference.v[1:]
    out = np.full((3, *needed.shape), np.nan)
    # bent as if it had been held before
    arm.reset(reference.q[0] + drive[0] / np.maximum(controller.stiffness, _WEAKEST), reference.v[0])
    for k, (tau, q, v) in enumerate(zip(applied, reference.q[1:], reference.v[1:], strict=True)):
        arm.step(tau + controller.stiffness * (q - arm.q), implicit)
        out[0, k], out[1, k] = arm.q - q, arm.v - v
        if not np.abs(out[0, k]).max() < _LOST:
            out[:, k:] = np.nan
            break
    out[2] = -controller.stiffness * out[0] - controller.damping * out[1]
    return Held(*out)
