"""TrunkLimits: how much a motion of the trunk over its feet uses of joints, torques and friction cones."""

from __future__ import annotations

import numpy as np

from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.feasibility import Sampled, Use
from sysid_ros.excitation.fourier_trajectory import FourierBasis
from sysid_ros.excitation.motion_limits import KINDS, MotionLimits
from sysid_ros.excitation.optimiser import smooth_max
from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.excitation.trunk_dynamics import STEPS, TrunkDynamics, TrunkStates
from sysid_ros.sample import FREE, FloatArray

_G = 9.81
_LIFT = 0.3
"""Part of its even share of the weight that a foot presses on the ground with at least: a foot is counted as standing from a
fifteenth of the weight on, and four share it."""
_BENT = 1.0 / 3.0
"""Lever of a leg over that of standing, at least: a leg that is stretched shows no force."""
_STEP = 0.01
"""Every limit of a trunk's motion is checked this often [s]."""
_SHIFT, _TURN = 0.25, 0.4
"""Box of the pose: moves over the height, and turns [rad], in which the belly stays clear of the ground."""


class TrunkLimits:
    """Limits of the trunk's six, of its legs' joints and of its feet.

    The feet's are ``1 - (f_n - f_t / mu - f_least) / (m g / k) <= 1``, k of them: unilateral and within the friction cones, by
    the least forces that carry the robot (:class:`.TrunkDynamics`).

    Args:
        dynamics: of the robot. joints: limits of the legs' joints. settings: of the friction of the feet.

    Attributes:
        lower, upper: of the pose, shape (6,). velocity, acceleration: about how large the search makes them, shape (6,).
        joints: as given. names: of the limits in the order of :meth:`of_states`.
    """

    def __init__(self, dynamics: TrunkDynamics, joints: MotionLimits, settings: ExcitationSettings) -> None:
        self.dynamics, self.joints, self.friction = dynamics, joints, settings.foot_friction
        feet = dynamics.feet
        self._share = dynamics.base.mass * _G / len(feet.legs)
        still = np.zeros((1, FREE))
        self._standing = dynamics.poses(still).placed.lever[0]
        swing = np.concatenate([np.full(3, _SHIFT * feet.height), np.full(3, _TURN)])
        self.lower, self.upper = -swing, swing
        push = self.friction * _G
        self.acceleration: FloatArray = np.concatenate([np.full(3, push), np.full(3, push / feet.height)])
        self.velocity: FloatArray = np.sqrt(swing * self.acceleration)
        frames = dynamics.base.contact_frames
        self.names = tuple(
            [f"{kind} of {name}" for kind in KINDS for name in joints.robot.joint_names]
            + [f"{part} of the trunk" for part in ("x", "y", "z", "turn about x", "turn about y", "turn about z")]
            + [f"friction cone of {name}" for name in frames]
            + [f"lever of the leg of {name}" for name in frames]
        )

    def of_states(self, states: TrunkStates) -> tuple[FloatArray, FloatArray]:
        """Part of each limit that N states use: signed of joints and pose, (N, 4 (n - 6) + 6), and of feet, (N, 2 k)."""
        q, v, a = (x[:, FREE:] for x in states.motion)
        joints = np.swapaxes(self.joints.use(q, v, a, states.torque), 0, 1).reshape(len(q), -1)
        joints = np.hstack([joints, states.poses.placed.over_ground[:, :FREE] / self.upper])
        cones = 1.0 - (states.up - states.side / self.friction) / self._share + _LIFT
        reach = states.poses.placed.miss / self.dynamics.feet.height
        levers = 1.0 + (_BENT * self._standing - states.poses.placed.lever) / self._standing + 10.0 * reach
        return joints, np.hstack([cones, levers])

    def most(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """The largest part of each limit over N states of the trunk, shape (m,)."""
        joints, feet = self.of_states(self.dynamics.of(q, v, a))
        return np.concatenate([np.abs(joints).max(axis=0), feet.max(axis=0)])


class TrunkFeasibility:
    """Checks motions of the trunk; see :class:`.feasibility.Feasibility`.

    Args:
        limits: of trunk, joints and feet.
    """

    def __init__(self, limits: TrunkLimits) -> None:
        self.limits = limits

    def use(self, trajectory: Sampled, step: float = _STEP) -> Use:
        """What a motion uses of each limit, in the order of ``limits.names``, at times ``step`` [s] apart over one period."""
        return Use(self.limits.most(*trajectory.sample(trajectory.grid(step, one_period=True))), np.zeros(0))

    def keeps(self, trajectory: Sampled) -> bool:
        """All limits are kept, with a margin for what lies between the times that are looked at; fast where they are not."""
        q, v, a = trajectory.sample(trajectory.grid(_STEP, one_period=True))
        few = slice(None, None, 10)
        return all(float(self.limits.most(q[some], v[some], a[some]).max()) <= TOLERANCES.under for some in (few, slice(None)))


class TrunkConstraints:
    """``g_i(C) = smooth max over time of the use of limit i``, as :class:`.optimiser.MotionConstraints`.

    Args:
        feasibility: the limits. basis: of the trunk's motion. samples: instants in a period at which the limits are looked at.

    Attributes:
        functions: the basis and its derivatives at those instants, shape (N, K) each.
    """

    def __init__(self, feasibility: TrunkFeasibility, basis: FourierBasis, samples: int) -> None:
        self._limits = feasibility.limits
        self.functions = basis.functions(np.arange(samples) * basis.period / samples)

    def motion(self, coefficients: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pose and derivatives at the instants, shape (N, 6) each."""
        value, first, second = self.functions
        return value @ coefficients, first @ coefficients, second @ coefficients

    def evaluate(self, coefficients: FloatArray, sharpness: float) -> tuple[FloatArray, FloatArray]:
        """g, shape (m,), and its derivative by the coefficients, shape (m, K, 6)."""
        state = self.motion(coefficients)
        dynamics, limits = self._limits.dynamics, self._limits
        joints, feet = limits.of_states(dynamics.at(*state))
        both, both_weight = smooth_max(np.concatenate([joints, -joints])[None], sharpness)
        one, one_weight = smooth_max(feet[None], sharpness)
        signed = both_weight[0, : len(joints)] - both_weight[0, len(joints) :]
        weight = np.hstack([signed, one_weight[0]])
        here = np.hstack([joints, feet])
        gradient = np.zeros((here.shape[1], *coefficients.shape))
        for kind, (step, function) in enumerate(zip(STEPS, self.functions, strict=True)):
            for j, states in enumerate(dynamics.moved(*state)[kind]):
                change = (np.hstack(limits.of_states(states)) - here) / step
                gradient[:, :, j] += (weight * change).T @ function
        return np.concatenate([both[0], one[0]]), gradient

    @staticmethod
    def exact(use: Use) -> FloatArray:
        """g without smoothing, from what a motion uses, shape (m,)."""
        return use.limits
