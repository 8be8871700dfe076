"""A joint whose torque holds a part of another joint's."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.effect import Depends, JointCurves
from sysid_ros.effects.searched import Searched
from sysid_ros.effects.traits import Candidate
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class JointCoupling(JointCurves):
    """``tau_j = -c tau_other`` [N m], as from a wrist whose motors share a gear train (Siciliano et al. 2009, section 7.2.1).

    While the other joint stands its torque is the measured one: dry friction holds any there, which no model knows.

    Args:
        robot: the model. joints: joints whose torque holds the other's; empty for all.
        follows: the other joint; empty for the neighbour towards the tip (of the last joint, towards the base).
    """

    id = "joint_coupling"
    label = "coupling of two joints"
    words = "torque of one joint that follows another's, {where} ({c} N m for each N m)"
    setting_names = ("follows",)
    depends_on = frozenset({Depends.DRIVE})
    alone = False
    symbols = ("c",)
    symbol_units = ("1",)
    share = 0.1
    signature = "one joint's residual follows the torque of another"
    look_alikes = ("link_inertia", "torque_scale", "joint_order")
    separated_by = "moves of one of the two joints alone, with the other loaded"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), follows: str = "") -> None:
        super().__init__(robot, joints)
        if follows and follows not in robot.joint_names:
            raise ModelFileError(f"effect '{self.id}' follows '{follows}'; the robot has {', '.join(robot.joint_names)}.")
        self.follows = follows
        neighbour = np.minimum(np.arange(robot.n) + 1, robot.n - 1)
        neighbour[-1] = max(robot.n - 2, 0)
        self._other = np.full(robot.n, robot.joint_names.index(follows)) if follows else neighbour

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        return -load[..., self._other][None]

    def curves_along(self, motion: Motion) -> FloatArray:
        return self.curves(motion, motion.held_torque)

    @property
    def concerned(self) -> tuple[int, ...]:
        return (*super().concerned, *sorted({int(self._other[j]) for j in self.joints} - set(super().concerned)))

    @property
    def apart(self) -> str:
        return " ".join([*self.joint_names, self.follows])

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        return [Candidate({"follows": name}) for k, name in enumerate(motions[0].robot.joint_names) if k != joint]

    def excludes(self, other: Searched) -> bool:
        return isinstance(other, JointCoupling) and self.concerned == other.concerned
