"""Hoist: four ropes that lift the simulated quadruped off the ground and set it down again."""

from __future__ import annotations

import numpy as np

from sysid_ros.sample import FloatArray
from sysid_ros.simulation.quadruped import QuadrupedWorld

_CORNERS = np.array([[0.15, 0.1, 0.0], [0.15, -0.1, 0.0], [-0.15, 0.1, 0.0], [-0.15, -0.1, 0.0]])
_STIFFNESS, _DAMPING = 1500.0, 120.0
_HEIGHT = 0.14
_RAMP = 0.5


class Hoist:
    """Springs and dampers from the trunk's corners to where they were when it began, raised and lowered::

        f_i = s(t) (k (p_i(t0) + h(t) e_z - p_i) - d v_i)

    with s the tautness and h the height. It takes half a second to become taut, half a second to lift, and as long to undo both.

    Args:
        world: where the robot is. begin, end: when the lifting begins and when the robot is free again [s].
    """

    def __init__(self, world: QuadrupedWorld, begin: float, end: float) -> None:
        self._world, self.begin, self.end = world, begin, end
        self._from: FloatArray | None = None

    def active(self, t: float) -> bool:
        """True between begin and end."""
        return self.begin <= t < self.end

    def pull(self, t: float) -> None:
        """Apply the forces of the step at t [s]."""
        if not self.active(t):
            return
        trunk = self._world.trunk
        points = trunk.position + _CORNERS @ trunk.rotation.T
        if self._from is None:
            self._from = points
        left = min(t - self.begin, self.end - t)
        taut, raised = min(left / _RAMP, 1.0), min(max(left / _RAMP - 1.0, 0.0), 1.0)
        wanted = self._from + np.array([0.0, 0.0, _HEIGHT * raised])
        for corner, point, goal in zip(_CORNERS, points, wanted, strict=True):
            force = taut * (_STIFFNESS * (goal - point) - _DAMPING * trunk.velocity_of(corner))
            self._world.push(point, force)
