"""KnownRobot: a robot as it is known before a bag is read, against which the bag is held."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sysid_ros.effects import Curve, Payload
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.urdf_bodies import as_links
from sysid_ros.sample import FloatArray
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.torque_model import TorqueModel


@dataclass(frozen=True)
class KnownRobot:
    """A robot with all that is known of it.

    Attributes:
        robot: the arm. file: its model.yaml; None where only the URDF is known.
        frame: link that carries a payload. payload: ten parameters about the frame's origin of what it always carries, shape
            (10,).
    """

    robot: RobotModel
    file: ModelFile | None
    frame: str
    payload: FloatArray

    @cached_property
    def known(self) -> list[KnownEffect]:
        """The effects whose parameters are known, with what is always carried."""
        effects = [] if self.file is None else self.file.known_effects(self.robot)
        carried = [KnownEffect(Payload(self.robot, frame=self.frame), self.payload)] if np.any(self.payload) else []
        return [*effects, *carried]

    @cached_property
    def model(self) -> TorqueModel:
        """The torque of what is known, with nothing free."""
        return TorqueModel(self.robot, [], self.known)

    def arm(self, carried: FloatArray) -> RobotModel:
        """The arm with its links as they are known, what it always carries, and a body at ``frame`` of ten parameters, shape
        (10,)."""
        links = self.model.links() + as_links(self.robot, self.frame, self.payload + carried)
        return self.robot.with_links(links - self.robot.pi)

    @cached_property
    def offset(self) -> FloatArray:
        """Torque that the model adds whatever the robot does, shape (n,) [N m]."""
        out = np.zeros(self.robot.n)
        for k in self.known:
            curves = k.effect.simple_curves()
            for (kind, _, joint), value in zip([] if curves is None else curves, k.theta, strict=False):
                if kind == Curve.ONE:
                    out[int(joint)] += value
        return out
