"""TrueRobot: the robot as it really is, in values that every simulator can take."""

from dataclasses import dataclass

import numpy as np

from sysid_ros.robot.inertial_parameters import from_com, to_com
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.simulation.hidden_effects.channels import Channel, Signals
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect
from sysid_ros.simulation.hidden_effects.joint_physics import ideal_joints
from sysid_ros.simulation.payload import Payload


@dataclass(frozen=True, slots=True)
class LinkChange:
    """A link, by its joint, that is heavier by a factor and of the same shape, with its centre of mass moved, shape (3,) [m]."""

    joint: int
    mass_factor: float
    com_shift: FloatArray


class TrueRobot:
    """Links, joints, surroundings and messages of the simulated robot, at first what the URDF says; each hidden cause changes it.

    Args:
        robot: the nominal model; damping and friction of its ``<dynamics>`` belong to it.

    Attributes:
        effects: what is hidden in it.
        pi: true link inertials, shape (n, 10), in the order of ``inertial_parameters``.
        carried: bodies on the tip link from the start. picked_up: the one that comes at ``change_time`` [s]; None: none.
        link_changes: links that are not those of the URDF. mass_factors: see :meth:`scale_masses`, shape (n,).
        tilt: roll and pitch of the base [rad]. gravity: in the base, shape (3,) [m/s^2].
        joints: see :class:`.joint_physics.Joints`. force: on the tip link's origin, in the world, shape (3,) [N].
        channels: what lies between the robot and its messages, in order.
    """

    def __init__(self, robot: RobotModel) -> None:
        self.robot = robot
        self.effects: tuple[HiddenEffect, ...] = ()
        self.pi: FloatArray = robot.pi.reshape(robot.n, 10).copy()
        self.carried: list[Payload] = []
        self.picked_up: Payload | None = None
        self.change_time = np.inf
        self.link_changes: list[LinkChange] = []
        self.mass_factors: FloatArray = np.ones(robot.n)
        self.tilt = (0.0, 0.0)
        self.gravity: FloatArray = robot.gravity.copy()
        self.joints = ideal_joints(robot.n)
        self.joints.viscous[:] = robot.damping
        self.joints.coulomb_forward[:] = self.joints.coulomb_backward[:] = robot.friction
        self.force: FloatArray = np.zeros(3)
        self.channels: list[Channel] = []

    @property
    def pi_after(self) -> FloatArray:
        """Link inertials from ``change_time`` on, shape (n, 10)."""
        return self.pi if self.picked_up is None else self.pi + self._at_tip(self.picked_up)

    @property
    def needs_short_steps(self) -> bool:
        """True where a step of a millisecond is too long: bristles, elastic joints, play."""
        return bool(np.any(self.joints.stiffness) or np.any(self.joints.presliding))

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

    def carry(self, body: Payload) -> None:
        """Put a body on the tip link."""
        self.carried.append(body)
        self.pi = self.pi + self._at_tip(body)

    def move_link(self, joint: int, mass_factor: float, com_shift: FloatArray) -> FloatArray:
        """Make a link heavier, of the same shape, and move its centre of mass [m]; what was added to its inertials, (10,)."""
        self.link_changes.append(LinkChange(joint, mass_factor, com_shift))
        link = self.pi[joint] - self._carried[joint]
        mass, com, inertia = to_com(link)
        change = np.asarray(from_com(mass * mass_factor, com + com_shift, inertia * mass_factor) - link)
        self.pi[joint] += change
        return change

    @property
    def _carried(self) -> FloatArray:
        """Inertials of the bodies on the tip link, by links, shape (n, 10)."""
        return np.asarray(sum((self._at_tip(body) for body in self.carried), np.zeros_like(self.pi)))

    def scale_masses(self, factors: FloatArray) -> None:
        """Every link lighter or heavier, of the same shape: factors of shape (n,). What is carried weighs what it weighed."""
        self.pi = (self.pi - self._carried) * factors[:, None] + self._carried
        self.mass_factors = self.mass_factors * factors

    def tilt_base(self, roll: float, pitch: float) -> None:
        """Roll the base about its x axis, then pitch it about the world's y axis [rad]."""
        self.tilt = (self.tilt[0] + roll, self.tilt[1] + pitch)
        (roll, pitch), g = self.tilt, -self.robot.gravity[2]
        # R = R_y(pitch) R_x(roll) turns the base's axes into the world's
        self.gravity = -g * np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])

    def motion_of(self, signals: Signals) -> Motion:
        """What the robot really did, for an effect's columns: accelerations, the links' torque and the drives'."""
        q, v = signals.q, signals.v
        a = np.gradient(v, signals.t, axis=0)
        links = np.empty_like(q)
        picked = signals.t >= self.change_time
        for rows, pi in ((~picked, self.pi), (picked, self.pi_after)):
            robot = self.robot.with_links((pi - self.robot.pi.reshape(pi.shape)).ravel())
            links[rows] = robot.rnea_along(q[rows], v[rows], a[rows], self.gravity)
        if np.any(self.force):
            links -= self.tip_columns(q) @ self.force
        return Motion(self.robot, signals.t, q, v, a, signals.tau, links, signals.tau)

    def tip_columns(self, q: FloatArray) -> FloatArray:
        """Joint torque of a unit force on the tip link's origin along each axis of the world, shape (K, n, 3) for q (K, n)."""
        robot = self.robot
        return np.swapaxes(robot.frame_jacobian_along(q, robot.frame_id(robot.default_frame)), 1, 2)

    def _at_tip(self, body: Payload) -> FloatArray:
        """Inertials to add to each link, shape (n, 10), for a body that is fixed to the tip link."""
        model = self.robot.model
        frame = model.frames[self.robot.frame_id(self.robot.default_frame)]
        rotation, offset = np.array(frame.placement.rotation), np.array(frame.placement.translation)
        added = np.zeros_like(self.pi)
        added[frame.parentJoint - 1] = from_com(body.mass, offset + rotation @ body.com, rotation @ body.inertia_com @ rotation.T)
        return added
