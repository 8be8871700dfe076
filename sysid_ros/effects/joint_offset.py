"""A wrong zero of a joint's encoder."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from sysid_ros.effects.backlash import ONE_SIDED, WIDEST
from sysid_ros.effects.effect import Acts, Depends, Effect, carrying
from sysid_ros.effects.traits import Scope
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_FARTHEST = 0.7
"""No encoder is mounted wrong by more [rad]."""


class JointOffset(Effect):
    """``tau = -d ID(q, v, a) / dq_j delta_j``, delta = measured - true position [rad], ID the inverse dynamics, to first order.

    Args:
        robot: the model. joints: joints whose zero is wrong; empty for all.
        around: offset at which the columns are exact, ``(ID(q - around) - ID(q)) / around`` [rad].
        links: what the links' inertials, with all that they carry, differ by from the URDF's, shape (10 n,); empty for nothing.
    """

    id = "joint_offset"
    label = "wrong zero of a joint"
    words = "a wrong zero of {where} ({delta})"
    acts = Acts.LINK
    depends_on = frozenset({Depends.LINKS})
    scope = Scope.LINK
    size = 0.1
    """Of an encoder that was mounted or homed some degrees off [rad]."""
    between = (-_FARTHEST, _FARTHEST)
    signature = "the gradient of gravity along the joint's position, in all joints around it"
    look_alikes = ("base_tilt", "backlash", "link_inertia", "joint_elasticity")
    separated_by = "motion of the other joints over 60 degrees or more; on a vertical first joint nothing shows it"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), around: float = 0.0, links: Sequence[float] = ()) -> None:
        super().__init__(robot, joints)
        self.links = [float(x) for x in links]
        self._arm = carrying(robot, self.links, self.id)
        self.around = float(around)
        self.name_joints(("delta",), ("rad",))

    @property
    def settings(self) -> dict[str, Any]:
        return {"around": self.around, **({"links": self.links} if self.links else {})}

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[:] = self._columns(sample.q[None], sample.v[None], sample.a[None])[0]

    def columns_along(self, motion: Motion) -> FloatArray:
        if not self.around and not self.links:
            return np.asarray(-motion.sensitivity[0][:, :, self.joints])
        return self._columns(motion.q, motion.v, motion.a)

    def _columns(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        if not self.around:
            return np.asarray(-self._arm.rnea_derivatives_along(q, v, a)[0][:, :, self.joints])
        here = self._arm.rnea_along(q, v, a)
        moved = self.around * np.eye(self.robot.n)[self.joints]
        return np.stack([(self._arm.rnea_along(q - d, v, a) - here) / self.around for d in moved], axis=-1)

    def same_torque(self, theta: FloatArray, motions: Sequence[Motion]) -> tuple[str, ...]:
        """A play on one flank all the time is a wrong zero by half the gap, the motor ahead of the link under the load."""
        load = np.concatenate([m.link_torque[:, self.joints[0]] for m in motions])
        ahead = float(np.mean(load * theta[0] > 0.0))
        return ("backlash",) if ahead > 1.0 - ONE_SIDED and abs(float(theta[0])) <= 0.5 * WIDEST else ()
