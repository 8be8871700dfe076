"""TrueRobot: the robot as it really is, made of its URDF and what is hidden in it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.robot.inertial_parameters import from_com, to_com
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects.channels import Channel
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect
from sysid_ros.simulation.hidden_effects.joint_physics import ideal_joints


class TrueRobot:
    """Links, joints, surroundings and messages of the simulated robot; without hidden effects it is what the URDF says.

    Args:
        robot: the nominal model; damping and friction of its ``<dynamics>`` belong to it.
        effects: what is hidden; each is realised from its own equation by :mod:`.realisation`.

    Attributes:
        pi: true link inertials, shape (n, 10), in the order of ``inertial_parameters``.
        picked_up: inertials that come on at ``change_time`` [s], shape (n, 10). mass_factors: see
            :meth:`scale_masses`, shape (n,). gravity: in the base, shape (3,) [m/s^2].
        joints: see :class:`.joint_physics.Joints`. force: on the tip link's origin, in the world, shape (3,) [N].
        channels: what lies between the robot and its messages, in order.
    """

    def __init__(self, robot: RobotModel, effects: Sequence[HiddenEffect] = ()) -> None:
        from sysid_ros.simulation.hidden_effects.realisation import realise

        self.robot = robot
        self.effects = tuple(effects)
        self.pi: FloatArray = robot.pi.reshape(robot.n, 10).copy()
        self.picked_up: FloatArray = np.zeros_like(self.pi)
        self.change_time = np.inf
        self.mass_factors: FloatArray = np.ones(robot.n)
        self.gravity: FloatArray = robot.gravity.copy()
        self.joints = ideal_joints(robot.n)
        self.joints.viscous[:] = robot.damping
        self.joints.coulomb_forward[:] = self.joints.coulomb_backward[:] = robot.friction
        self.force: FloatArray = np.zeros(3)
        self.channels: list[Channel] = []
        for effect in effects:
            realise(effect, self)

    @property
    def pi_after(self) -> FloatArray:
        """Link inertials from ``change_time`` on, shape (n, 10)."""
        return self.pi + self.picked_up

    def index(self, joint: str) -> int:
        """Position of a joint in the model's order."""
        return self.robot.joint_names.index(joint)

    def add(self, name: str, values: dict[str, float]) -> None:
        """Add values by joint to an array of ``joints``."""
        array = getattr(self.joints, name)
        for joint, value in values.items():
            array[self.index(joint)] += value

    def put(self, name: str, values: dict[str, float]) -> None:
        """Replace values by joint in an array of ``joints``."""
        array = getattr(self.joints, name)
        for joint, value in values.items():
            array[self.index(joint)] = value

    def per_joint(self, values: dict[str, float], elsewhere: float = 0.0) -> FloatArray:
        """Values by joint as an array of shape (n,)."""
        return np.array([values.get(joint, elsewhere) for joint in self.robot.joint_names])

    def body_at_tip(self, mass: float, com: FloatArray, inertia_com: FloatArray) -> FloatArray:
        """Inertials to add to each link, shape (n, 10), for a body that is fixed to the tip link (com in its frame)."""
        model = self.robot.model
        frame = model.frames[self.robot.frame_id(self.robot.default_frame)]
        rotation, offset = np.array(frame.placement.rotation), np.array(frame.placement.translation)
        added = np.zeros_like(self.pi)
        added[frame.parentJoint - 1] = from_com(mass, offset + rotation @ com, rotation @ inertia_com @ rotation.T)
        return added

    def scale_masses(self, factors: FloatArray) -> None:
        """Every link lighter or heavier, of the same shape: factors of shape (n,)."""
        self.pi = self.pi * factors[:, None]
        self.mass_factors = self.mass_factors * factors

    def move_link(self, joint: int, mass_factor: float, com_shift: FloatArray) -> FloatArray:
        """Make a link heavier, of the same shape, and move its centre of mass [m]; what was added to its inertials, (10,)."""
        before = self.pi[joint].copy()
        mass, com, inertia = to_com(before)
        self.pi[joint] = from_com(mass * mass_factor, com + com_shift, inertia * mass_factor)
        return np.asarray(self.pi[joint] - before)
