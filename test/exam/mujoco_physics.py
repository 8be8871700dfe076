"""move_in_mujoco: the second simulator, so that nothing is found only because it was hidden by the finder's own equations."""

from __future__ import annotations

import mujoco
import numpy as np

from exam.mujoco_model import STEP, build
from sysid_ros.exceptions import SettingsError
from sysid_ros.simulation.hidden_effects import PlannedMotion, TrueRobot
from sysid_ros.simulation.hidden_effects.channels import Signals
from sysid_ros.simulation.hidden_effects.joint_physics import Joints

_FREQUENCY = 25.0
_DAMPING = 0.8
_COMMAND_MARGIN = 2.0
_LOST = 0.5


class _Friction:
    """Level of dry friction and viscous coefficient of every joint, at each step."""

    def __init__(self, hidden: Joints) -> None:
        self._hidden, self._neighbour = hidden, hidden.neighbour.astype(int)

    def dry(self, t: float, q: np.ndarray, v: np.ndarray, link_torque: np.ndarray) -> np.ndarray:
        h = self._hidden
        level = np.where(v >= 0.0, h.coulomb_forward, h.coulomb_backward) + h.dry_rate * t
        level = level + h.breakaway * np.exp(-((v / h.stribeck_speed) ** 2)) + h.load_factor * np.abs(link_torque)
        return np.asarray(np.maximum(level * (1.0 + h.neighbour_friction * np.sin(2.0 * q[self._neighbour])), 0.0))

    def viscous(self, t: float, q: np.ndarray) -> np.ndarray:
        h = self._hidden
        near = h.neighbour_damping * (1.0 + np.sin(q[self._neighbour]))
        return np.asarray(np.maximum(h.viscous + h.viscous_rate * t, 0.0) + near)

    def quadratic(self, v: np.ndarray) -> np.ndarray:
        return np.asarray(self._hidden.quadratic * np.abs(v) * v)


class _Applied:
    """Torques that MuJoCo has no element for: ripple, balancer, hum and the bristle of a presliding friction."""

    def __init__(self, hidden: Joints) -> None:
        self._hidden = hidden
        self._ripple, self._balancer, self._hum, self._bristled = (
            np.flatnonzero(x) for x in (hidden.ripple, hidden.balancer, hidden.hum, hidden.presliding)
        )
        self._bristle = np.zeros(hidden.rotor.size)

    def torque(self, t: float, step: float, q: np.ndarray, v: np.ndarray, level: np.ndarray, out: np.ndarray) -> None:
        h, bristle = self._hidden, self._bristle
        for j in self._ripple:
            out[j] -= h.ripple[j] * np.sin(h.ripple_harmonic[j] * q[j] + h.ripple_phase[j])
        for j in self._balancer:
            out[j] -= h.balancer[j] * np.sin(q[j] - h.balancer_origin[j])
        for j in self._hum:
            out[j] -= h.hum[j] * np.sin(2.0 * np.pi * h.hum_frequency[j] * t)
        for j in self._bristled:
            # Dahl's bristle relaxes over the distance z_s: exact for a constant velocity over the step
            z_s = h.presliding[j]
            end = z_s * np.sign(v[j])
            bristle[j] = end + (bristle[j] - end) * np.exp(-abs(v[j]) * step / z_s)
            out[j] -= level[j] * bristle[j] / z_s


class _World:
    """MuJoCo's model and state of a true robot, and one step of it."""

    def __init__(self, true: TrueRobot, stiffening: np.ndarray, step: float, start: np.ndarray) -> None:
        self.true, self.robot, self.step = true, true.robot, step
        self.model = build(true, true.carried, step)
        self._after = None if true.picked_up is None else build(true, [*true.carried, true.picked_up], step)
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(j).id for j in self.robot.joint_names]
        self._qpos, self._dofs = self.model.jnt_qposadr[joints], self.model.jnt_dofadr[joints]
        self._friction, self._applied, self._limit = _Friction(true.joints), _Applied(true.joints), true.joints.limit
        self._stiff = np.where(np.isfinite(self._limit), 0.0, stiffening)
        self._feedback = 2.0 * _DAMPING * _FREQUENCY * self._stiff
        self._sticky = self.model.dof_frictionloss[self._dofs] > 0.0
        self._base_damping = self.model.dof_damping.copy()
        self._weighted, self._u, self._push = (np.zeros(self.model.nv) for _ in range(3))
        self._link_torque = np.zeros(self.robot.n)
        self._started = False
        self.data.qpos[self._qpos] = start
        self._bear()

    def _bear(self) -> None:
        """Deflect elastic joints by what they bear at rest, and lay play against the flank that bears it."""
        hidden, data = self.true.joints, self.data
        for _ in range(20):
            mujoco.mj_forward(self.model, data)
            for j in np.flatnonzero(hidden.stiffness):
                play = self.model.joint(f"{self.robot.joint_names[j]}_play")
                load = data.qfrc_bias[play.dofadr[0]]
                flank = -0.5 * np.sign(load) * hidden.gap[j]
                data.qpos[play.qposadr[0]] = flank if hidden.gap[j] else -load / hidden.stiffness[j]

    def pick_up(self, t: float) -> None:
        """Go on with the body that comes at ``t``."""
        if self._after is None or t < self.true.change_time:
            return
        moved = mujoco.MjData(self._after)
        moved.qpos, moved.qvel, moved.time = self.data.qpos, self.data.qvel, self.data.time
        self.model, self.data, self._after = self._after, moved, None
        mujoco.mj_forward(self.model, self.data)

    def _held(self, q: np.ndarray, v: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Torque that the controller asks for, but for the feedback's damping."""
        u = _FREQUENCY**2 * (wanted[0] - q) + 2.0 * _DAMPING * _FREQUENCY * (wanted[1] - v)
        if not self._started or np.any(self.true.force):
            mujoco.mj_fwdPosition(self.model, self.data)
        self._started = True
        self._u[self._dofs] = u
        mujoco.mj_mulM(self.model, self.data, self._weighted, self._u)
        held = self.robot.rnea(q, v, wanted[2]) + self._weighted[self._dofs] + self._stiff * u + self._feedback * v
        return np.asarray(np.clip(held, -_COMMAND_MARGIN * self._limit, _COMMAND_MARGIN * self._limit))

    def advance(self, t: float, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """One step towards q, v, a wanted, shape (3, n): position, mean velocity and the torque that was asked for."""
        model, data, dofs = self.model, self.data, self._dofs
        q, v = data.qpos[self._qpos], data.qvel[dofs]
        held = self._held(q, v, wanted)
        torque = np.clip(held, -self._limit, self._limit) - self._friction.quadratic(v)
        level = self._friction.dry(t, q, v, self._link_torque)
        self._applied.torque(t, self.step, q, v, level, torque)
        viscous = self._friction.viscous(t, q)
        model.dof_damping[:] = self._base_damping
        model.dof_damping[dofs] += viscous + self._feedback
        model.dof_frictionloss[dofs] = np.where(self._sticky, np.maximum(level, 1e-9), 0.0)
        data.qfrc_applied[:] = 0.0
        data.qfrc_applied[dofs] = torque
        if np.any(self.true.force):
            self._push[:] = 0.0
            tip = model.body(self.robot.default_frame).id
            mujoco.mj_applyFT(model, data, self.true.force, np.zeros(3), data.xpos[tip], tip, self._push)
            data.qfrc_applied += self._push
        mujoco.mj_step(model, data)
        v_next = data.qvel[dofs]
        self._link_torque = torque + self._push[dofs] + data.qfrc_constraint[dofs] - (viscous + self._feedback) * v_next
        return q, 0.5 * (v + v_next), held - self._feedback * v_next


def move_in_mujoco(true: TrueRobot, motion: PlannedMotion, rate: int, stiffening: np.ndarray) -> Signals:
    """As :func:`sysid_ros.simulation.hidden_effects.move`, by MuJoCo.

    Raises:
        SettingsError: the arm does not follow the motion.
    """
    step = STEP / 2 if true.needs_short_steps else STEP
    count, per_row = int(motion.duration * rate), round(1.0 / (rate * step))
    wanted = np.stack(motion.sample(np.arange(count * per_row) * step), axis=1)
    world = _World(true, stiffening, step, wanted[0, 0])
    out = np.zeros((3, count, true.robot.n))
    for k in range(count * per_row):
        t = k * step
        world.pick_up(t)
        row = world.advance(t, wanted[k])
        if k % per_row == 0:
            out[:, k // per_row] = row
            if not np.all(np.abs(row[0] - wanted[k, 0]) < _LOST):
                raise SettingsError(f"an arm was lost after {t:.1f} s. Hide something smaller.")
    return Signals(np.arange(count) / rate, *out)
