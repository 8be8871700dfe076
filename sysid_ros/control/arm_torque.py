"""ArmTorque: the torque that a motion costs, in the form that controllers need."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects import Acts, CoulombFriction, LinkInertia, Payload, RotorInertia, ViscousFriction
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel


class ArmTorque:
    """``tau = M(q) a + C(q, v) w + g(q) + J a + f(q, u)``, of links, payload and rotors, and of all else that is known.

    C is the matrix of Christoffel's symbols, for which ``dM/dt - 2 C`` is skew-symmetric (Slotine, Li 1991, section 9.1). The
    product is bilinear, so with h(v) = C(q, v) v it takes inverse dynamics only: ``C(q, v) w = (h(v + w) - h(v - w)) / 4``.
    Where w = v that is h(v), and the whole is inverse dynamics. f, whatever is no rigid body (friction, offsets, springs), is
    taken at a velocity of its own: that of the wanted motion does not chatter where the measured one is about zero.

    Args:
        robot: the arm. known: the identified model; the URDF's links where there is no ``link_inertia`` among it, with the URDF's
            ``<dynamics>``.
        frame: that the payload is fixed to; empty for the robot's default. drives: False where what the drives lose (friction and
            the like) is not to be added, as the robot does that itself.

    Attributes:
        payload: the effect whose ten parameters ``theta`` are.

    Raises:
        RobotModelError: there is no such frame. ModelFileError: a payload is among what is known.
    """

    def __init__(self, robot: RobotModel, known: Sequence[KnownEffect] = (), frame: str = "", drives: bool = True) -> None:
        self.robot = robot
        self.payload = Payload(robot, frame=frame)
        if any(k.effect.carried for k in known):
            raise ModelFileError(
                "the model has a 'payload' among its effects, and a controller adds the payload itself. Give the model of the "
                "empty arm."
            )
        rigid = [k for k in known if k.effect.inertial]
        others = [k for k in known if not k.effect.inertial]
        if not any(k.effect.replaces_links for k in rigid):
            links = LinkInertia(robot)
            rigid += [KnownEffect(links, links.nominal), KnownEffect(RotorInertia(robot), np.array(robot.model.armature))]
            others += [
                KnownEffect(ViscousFriction(robot), np.array(robot.damping)),
                KnownEffect(CoulombFriction(robot), np.array(robot.friction)),
            ]
        if not drives:
            others = [k for k in others if k.effect.acts is not Acts.DRIVE]
        self._rigid = TorqueModel(robot, [self.payload], rigid)
        self._others = TorqueModel(robot, [], others, links=False)
        self._still = np.zeros(robot.n)

    def split(self, q: FloatArray, v: FloatArray, w: FloatArray, a: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Y of the payload, shape (n, 10), and the torque without it, shape (n,) [N m]: ``tau = Y theta + rest``.

        Args:
            q, v: where the arm is and how fast. w: velocity that C is multiplied with; v itself for inverse dynamics.
            a: acceleration. u: velocity that friction is taken at; shape (n,) each.
        """
        if w is v:
            columns, rest = self._at(q, v, a)
        else:
            columns, rest = self._at(q, self._still, a)
            for factor, speed in ((0.25, v + w), (-0.25, v - w)):
                more, torque = self._at(q, speed, self._still)
                columns += factor * more
                rest += factor * torque
        return columns, rest + self._others.known_torque(Sample(0.0, q, u, a, self._still))

    def inertial_torque(self, q: FloatArray, a: FloatArray, theta: FloatArray) -> FloatArray:
        """``M(q) a`` with a payload of parameters theta, shape (n,) [N m]."""
        columns, rest = self._at(q, self._still, a)
        still_columns, still_rest = self._at(q, self._still, self._still)
        return np.asarray(rest - still_rest + (columns - still_columns) @ theta)

    def _at(self, q: FloatArray, v: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        columns, rest = self._rigid.split(Sample(0.0, q, v, a, self._still))
        return columns, -rest
