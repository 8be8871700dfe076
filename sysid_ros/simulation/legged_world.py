"""LeggedWorld: a robot on legs on a plane in MuJoCo, with friction and rotors in its joints and a body on its trunk."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np

from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.mjcf import without_log
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.simulation.legged_ground import LeggedGround
from sysid_ros.simulation.legged_robot import LeggedRobot
from sysid_ros.simulation.payload import Payload
from sysid_ros.simulation.trunk_state import TrunkState

STEP = 1e-3
"""Of the physics [s]."""
_HARD = "0.004 1"
"""Time constant and damping ratio of the contacts [s]: as hard as the step allows, with a margin of two."""

_SOFT = 0.9
"""Impedance of contacts with soft ground."""


class LeggedWorld:
    """A floating trunk on legs, in MuJoCo, driven by torques on the motors' side of the joints.

    ``(M(q) + J) a + C(q, v) v + g(q) = S' (tau - friction(v)) + J_c' f``, ``v+ = v + h a; q+ = q + h v+`` (implicitfast), with
    rotors J, dry friction as a constraint that holds a joint at rest, and contacts that are hard.

    Args:
        robot: what stands there. scale: factor on the mass and inertia of every link, by name.
        drives: of the joints, dry friction [N m], viscous friction [N m s/rad] and inertia of the rotors [kg m^2], shape (n,)
            each, in the order of the model.
        normal: of the ground, shape (3,). ground: what it is like.

    Attributes:
        q, v: of the joints at the begin of the next step, in the order of the model, shape (n,). trunk: the trunk then.
        scale: as given. heavier: by how much all links are, by it [kg].
        acceleration: of the trunk's origin in the last step, in the world, shape (3,) [m/s^2].
        forces: of the ground on the feet in the last step, in the world, shape (k, 3) [N].

    Raises:
        RobotModelError: MuJoCo does not take the robot.
    """

    def __init__(
        self,
        robot: LeggedRobot,
        scale: dict[str, float],
        drives: tuple[FloatArray, ...],
        normal: FloatArray,
        ground: LeggedGround,
    ) -> None:
        without_log(mujoco)
        self.scale = scale
        self._model = model = _compiled(robot, ground)
        described = float(model.body_mass.sum())
        for name, factor in scale.items():
            body = model.body(name).id
            model.body_mass[body] *= factor
            model.body_inertia[body] *= factor
        self.heavier = float(model.body_mass.sum()) - described
        model.opt.gravity[:] = -9.81 * normal
        joints = [model.joint(name).id for name in robot.base.legs.joint_names]
        self._at, self._dofs = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        dry, viscous, rotor = drives
        model.dof_frictionloss[self._dofs], model.dof_damping[self._dofs] = dry, viscous
        model.dof_armature[self._dofs] = rotor
        self._trunk = model.body(robot.base.trunk).id
        self._feet = [model.geom(f"{name} foot").id for name in robot.base.contact_frames]
        self._ground = {model.geom(name).id for name in ("ground", *(f"step {k}" for k in range(len(ground.boxes()))))}
        if ground.sink > 0.0:
            self._soften(robot.base.mass * 9.81 / 4.0, ground)
        self._empty = self._inertial()
        self._data = mujoco.MjData(model)
        mujoco.mj_setConst(model, self._data)
        self.tied = False

    def _inertial(self) -> FloatArray:
        """Ten parameters of the trunk about its origin."""
        m, b, rotation = self._model, self._trunk, np.empty(9)
        mujoco.mju_quat2Mat(rotation, m.body_iquat[b])
        axes = rotation.reshape(3, 3)
        return inertial_parameters.from_com(float(m.body_mass[b]), m.body_ipos[b], axes @ np.diag(m.body_inertia[b]) @ axes.T)

    def _soften(self, force: float, ground: LeggedGround) -> None:
        """Let feet sink in under a force [N], as a spring does, damped without an overshoot.

        With the impedance d of a contact, the inverse inertia A that MuJoCo reckons with there and the grip c, a force f that the
        four edges of the friction pyramid share needs a reference acceleration ``k x = f A (1 - d) / d c^2 (1 + c^2) / 2`` at
        rest (MuJoCo's documentation, Computation, "Constraint model").
        """
        m, grip = self._model, ground.grip**2
        for geom in self._feet:
            inverse = float(m.body_invweight0[m.geom_bodyid[geom], 0]) * 0.5 * grip * (1.0 + grip)
            stiffness = force * inverse * (1.0 - _SOFT) / (_SOFT * ground.sink)
            # given to MuJoCo they are divided by the square of the impedance, and by the impedance
            m.geom_solref[geom] = -stiffness * _SOFT**2, -2.0 * np.sqrt(stiffness) * _SOFT
            m.geom_solimp[geom] = _SOFT, _SOFT, 0.001, 0.5, 2.0
            m.geom_priority[geom] = 1

    def shift_trunk(self, by: FloatArray) -> None:
        """Move the centre of mass of the trunk's own link, shape (3,) [m]."""
        self._model.body_ipos[self._trunk] += by
        self._empty = self._inertial()
        mujoco.mj_setConst(self._model, self._data)

    def tie(self, payload: Payload) -> None:
        """Make a body one with the trunk, without an impact."""
        self._set(self._empty + payload.theta)
        self.tied = True

    def untie(self) -> None:
        """Take it off."""
        self._set(self._empty)
        self.tied = False

    def _set(self, theta: FloatArray) -> None:
        mass, com, inertia = inertial_parameters.to_com(theta)
        principal, axes = np.linalg.eigh(inertia)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        m, b = self._model, self._trunk
        mujoco.mju_mat2Quat(m.body_iquat[b], axes.ravel())
        m.body_mass[b], m.body_inertia[b], m.body_ipos[b] = mass, principal, com
        scratch = mujoco.MjData(m)
        mujoco.mj_setConst(m, scratch)

    def reset(self, height: float, q: FloatArray) -> None:
        """Put the trunk over the middle, level on the ground, with the joints (n,) at rest."""
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:7] = 0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0
        self._data.qpos[self._at] = q
        mujoco.mj_forward(self._model, self._data)
        self._read()

    def step(self, tau: FloatArray) -> None:
        """One step under torques (n,) [N m] of the motors."""
        data = self._data
        before = data.qvel[:3].copy()
        data.qfrc_applied[self._dofs] = tau
        mujoco.mj_step(self._model, data)
        self.acceleration = (data.qvel[:3] - before) / STEP
        self._read_forces()
        self._read()

    def push(self, force: FloatArray) -> None:
        """Apply a force (3,) [N] at the trunk's centre of mass, in the world, until another is applied."""
        self._data.xfrc_applied[self._trunk, :3] = force

    def close(self) -> None:
        """Nothing: MuJoCo frees itself."""

    def _read(self) -> None:
        data, rotation = self._data, np.empty(9)
        mujoco.mju_quat2Mat(rotation, data.qpos[3:7])
        axes = rotation.reshape(3, 3)
        self.trunk = TrunkState(axes, data.qpos[:3].copy(), data.qvel[:3].copy(), axes @ data.qvel[3:FREE])
        self.q, self.v = data.qpos[self._at].copy(), data.qvel[self._dofs].copy()

    def _read_forces(self) -> None:
        self.forces = np.zeros((len(self._feet), 3))
        wrench = np.zeros(6)
        for k in range(self._data.ncon):
            contact = self._data.contact[k]
            pair = (int(contact.geom1), int(contact.geom2))
            if not self._ground.isdisjoint(pair):
                other = pair[0] if pair[1] in self._ground else pair[1]
                mujoco.mj_contactForce(self._model, self._data, k, wrench)
                sign = 1.0 if pair[0] in self._ground else -1.0
                self.forces[self._feet.index(other)] += sign * contact.frame.reshape(3, 3).T @ wrench[:3]


def _compiled(robot: LeggedRobot, ground: LeggedGround) -> mujoco.MjModel:
    root = ElementTree.fromstring(robot.urdf)
    for link in root.findall("link"):
        for shape in link.findall("collision"):
            link.remove(shape)
    options = ElementTree.SubElement(root, "mujoco")
    # inertias that violate the triangle inequality a little are of small parts
    ElementTree.SubElement(options, "compiler", fusestatic="false", balanceinertia="true", boundmass="1e-6", boundinertia="1e-9")
    try:
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
        spec.option.timestep = STEP
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.body(robot.base.trunk).add_freejoint()
        touch = {"solref": [float(x) for x in _HARD.split()], "solimp": [0.95, 0.995, 0.0005, 0.5, 2.0]}
        slippery, box = [ground.grip, 0.0, 0.0], mujoco.mjtGeom.mjGEOM_BOX
        spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], friction=slippery, **touch)
        for k, (centre, half) in enumerate(ground.boxes()):
            spec.worldbody.add_geom(name=f"step {k}", type=box, pos=centre, size=half, friction=slippery, **touch)
        centres = robot.base.contacts.offsets
        for name, radius, centre in zip(robot.base.contact_frames, robot.radius, centres, strict=True):
            spec.body(name).add_geom(
                name=f"{name} foot",
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                size=[float(radius), 0.0, 0.0],
                pos=centre,
                friction=slippery,
                condim=3,
                mass=0.0,
                contype=2,
                conaffinity=1,
                **touch,
            )
        return spec.compile()
    except ValueError as error:
        raise RobotModelError(f"MuJoCo does not take the robot: {' '.join(str(error).split())}.") from error
