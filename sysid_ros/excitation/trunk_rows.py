"""TrunkRows: columns of the free effects of a robot on legs, free of the forces on its feet, along motions of its trunk."""

from __future__ import annotations

import numpy as np

from sysid_ros.excitation.arm_rows import smoothed
from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.excitation.trunk_dynamics import STEPS, TrunkStates
from sysid_ros.excitation.trunk_limits import TrunkLimits
from sysid_ros.floating.leg_priors import standing_torque
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.torque.torque_model import TorqueModel

_STATES, _DRAWN = 500, 3000


class TrunkRows:
    """``N' Y``, the six rows of force and moment on the whole robot by which it is identified; see :class:`.criteria.MotionRows`.

    The torque noise of all joints of the legs is taken to be the same part of what they hold standing, and is in the rows by
    ``A A'``, of which the mean weights each row.

    Args:
        model: whose free effects are to be identified, of the robot on its floating base. limits: the states that it may reach.
        precision: of what is known of their parameters, shape (p, p). duration: of the motion [s].
    """

    def __init__(self, model: TorqueModel, limits: TrunkLimits, precision: FloatArray, duration: float) -> None:
        self._model, self._dynamics, self.names = model, limits.dynamics, tuple(model.parameter_names)
        free = np.full(FREE, np.inf)
        self._smooth = smoothed(model, np.concatenate([free, limits.joints.velocity]))
        states = self._dynamics.of(*_drawn(limits))
        variance = np.einsum("mij,mij->i", states.poses.matrix, states.poses.matrix) / len(states.poses.matrix)
        noise = TOLERANCES.leg_noise * standing_torque(self._dynamics.base.mass)
        self.weight: FloatArray = np.sqrt(TOLERANCES.leg_rate * duration / variance) / noise
        self.precision: FloatArray | None = precision
        self._usual = self._of(states, model)

    def usual(self) -> FloatArray:
        """Columns at random states that keep the limits."""
        return self._usual

    def columns(self, q: FloatArray, v: FloatArray, a: FloatArray, smooth: bool = False) -> FloatArray:
        """Columns at N states of the trunk, shape (N, 6, p)."""
        return self._of(self._dynamics.at(q, v, a), self._smooth if smooth else self._model)

    def gradient(self, q: FloatArray, v: FloatArray, a: FloatArray, columns: FloatArray, direction: FloatArray) -> FloatArray:
        """By differences of the states."""
        out = np.zeros((3, *q.shape))
        before = np.einsum("kia,kia->k", columns, direction)
        for kind, step in enumerate(STEPS):
            for j, states in enumerate(self._dynamics.moved(q, v, a)[kind]):
                after = np.einsum("kia,kia->k", self._of(states, self._smooth), direction)
                out[kind, :, j] = (after - before) / step
        return out

    def _of(self, states: TrunkStates, model: TorqueModel) -> FloatArray:
        q, v, a = states.motion
        motion = Motion(model.robot, np.arange(len(q), dtype=float), q, v, a, np.zeros_like(q))
        out = np.empty((len(q), FREE, model.p))
        for effect, where in zip(model.free, model.slices, strict=True):
            columns = effect.columns_along(motion)
            out[:, :, where] = columns[:, :FREE] + states.poses.matrix @ columns[:, FREE:]
        return out


def _drawn(limits: TrunkLimits) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Random states of the trunk that keep the limits, in the box of the search, shape (N, 6) each."""
    random = np.random.default_rng(0)
    size = random.uniform(0.0, 1.0, (_DRAWN, 1))
    pose, velocity, acceleration = (
        size * random.uniform(-x, x, (_DRAWN, FREE)) for x in (limits.upper, limits.velocity, limits.acceleration)
    )
    joints, feet = limits.of_states(limits.dynamics.of(pose, velocity, acceleration))
    kept = np.flatnonzero((np.abs(joints).max(axis=1) <= 1.0) & (feet.max(axis=1) <= 1.0))[:_STATES]
    return pose[kept], velocity[kept], acceleration[kept]
