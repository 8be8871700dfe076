"""A base that does not stand level."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from sysid_ros.effects.effect import Acts, Depends, Effect, carrying
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_STEEPEST = 0.6
"""Nobody takes a base that stands askew by more for a level one [rad]."""


def tilted_gravity(gravity: FloatArray, roll: float, pitch: float) -> FloatArray:
    """Gravity in the axes of a base that is turned by roll about x, then by pitch about y of the world, shape (3,) [m/s^2].

    Where ``gravity`` is not along -z, as of a robot on a wall, these are the axes of :func:`axes_below`.
    """
    c, s, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    turn_x = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    turn_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    axes = axes_below(gravity)
    turned: FloatArray = axes @ (turn_y @ turn_x).T @ axes.T @ gravity
    return turned


def tilt_of(gravity: FloatArray, tilted: FloatArray) -> FloatArray:
    """Roll and pitch that :func:`tilted_gravity` makes ``tilted`` of ``gravity`` with, shape (2,) [rad]."""
    x, y, z = axes_below(gravity).T @ tilted / max(float(np.linalg.norm(tilted)), 1e-12)
    return np.array([np.arctan2(-y, -z), np.arcsin(np.clip(x, -1.0, 1.0))])


def axes_below(gravity: FloatArray) -> FloatArray:
    """Axes in which gravity is along -z, by the shortest turn, shape (3, 3), each a column in the axes of the base."""
    size = float(np.linalg.norm(gravity))
    down = np.asarray(gravity) / size if size > 0.0 else np.array([0.0, 0.0, -1.0])
    about, along = np.cross([0.0, 0.0, -1.0], down), -float(down[2])
    across = float(np.linalg.norm(about))
    if across < 1e-9:
        return np.diag([1.0, np.sign(along), np.sign(along)])
    return np.asarray(Rotation.from_rotvec(about / across * np.arctan2(across, along)).as_matrix())


class BaseTilt(Effect):
    """``tau = G(q) (dg/droll roll + dg/dpitch pitch)``: gravity comes from another direction, at its right size [rad].

    Args:
        robot: the model. joints: unused, the whole arm is concerned.
        around: roll and pitch at which the columns are exact [rad].
        links: what the links' inertials, with all that they carry, differ by from the URDF's, shape (10 n,); empty for nothing.
    """

    id = "base_tilt"
    label = "tilted base"
    words = "a base that does not stand level (roll {roll}, pitch {pitch})"
    acts = Acts.LINK
    size = 0.1
    """Of a base on feet that nobody levelled, and more of one that was built askew [rad]."""
    depends_on = frozenset({Depends.LINKS})
    leans = True
    between = (-_STEEPEST, _STEEPEST)
    signature = "like gravity on all joints, and on a vertical first joint too"
    look_alikes = ("joint_offset", "external_force", "link_inertia")
    separated_by = "a sweep of the first joint over 90 degrees or more with the arm stretched out"

    def __init__(
        self, robot: RobotModel, joints: Sequence[str] = (), around: Sequence[float] = (0.0, 0.0), links: Sequence[float] = ()
    ) -> None:
        super().__init__(robot, joints)
        self.links = [float(x) for x in links]
        self._arm = carrying(robot, self.links, self.id)
        self.around = [float(x) for x in around]
        self.parameter_names, self.units = ("roll", "pitch"), ("rad", "rad")

    @property
    def settings(self) -> dict[str, Any]:
        return {"around": self.around, **({"links": self.links} if self.links else {})}

    def _directions(self) -> FloatArray:
        gravity = self.robot.gravity
        roll, pitch = (x if abs(x) > 1e-6 else 1e-6 for x in self.around)
        by_pitch = (tilted_gravity(gravity, 0.0, pitch) - gravity) / pitch
        by_roll = (tilted_gravity(gravity, roll, pitch) - tilted_gravity(gravity, 0.0, pitch)) / roll
        return np.stack([by_roll, by_pitch])

    def as_gravity(self, theta: FloatArray) -> FloatArray:
        return np.asarray(theta @ self._directions())

    def _columns(self, q: FloatArray) -> FloatArray:
        still = np.zeros_like(q)
        return np.stack([self._arm.rnea_along(q, still, still, g) for g in self._directions()], axis=-1)

    def links_along(self, motion: Motion, theta: FloatArray) -> FloatArray:
        return self.robot.gravity_regressor_along(motion.q, theta @ self._directions())

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[:] = self._columns(sample.q[None])[0]

    def columns_along(self, motion: Motion) -> FloatArray:
        return self._columns(motion.q)
