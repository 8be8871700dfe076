"""move_in_mujoco: the second simulator, so that nothing is found only because it was hidden by the finder's own equations."""

from __future__ import annotations

import mujoco
import numpy as np

from exam.mujoco_model import STEP, build, values
from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects import DiagnosisMotion, HiddenEffect, TrueRobot
from sysid_ros.simulation.hidden_effects.channels import Signals

_FREQUENCY = 25.0
_DAMPING = 0.8
_COMMAND_MARGIN = 2.0
_LOST = 0.5


class _Friction:
    """Level of dry friction and viscous coefficient of every joint, at each step."""

    def __init__(self, true: TrueRobot) -> None:
        self._robot, self._effects = true.robot, true.effects
        n = true.robot.n

        def array(name: str, *ids: str) -> FloatArray:
            return _array(true, values(true.effects, name, *ids))

        level = (
            array("Fc", "coulomb_friction", "stribeck_friction", "load_dependent_friction", "friction_drift")
            + true.robot.friction
        )
        self._forward = level + array("F_pos")
        self._backward = level + array("F_neg")
        self._rise = array("Fs") - array("Fc", "stribeck_friction")
        self._stribeck_speed = np.where(self._rise > 0.0, array("vs"), 1.0)
        self._mu = array("mu")
        self._viscous = array("b") + true.robot.damping
        self._level_rate, self._viscous_rate = array("rate_Fc"), array("rate_b")
        self._quadratic = array("c", "quadratic_friction")
        self._neighbour = np.full(n, -1)
        self._share, self._damping = np.zeros(n), np.zeros(n)
        for e in self._effects:
            if e.id.startswith("outside_neighbour"):
                j = true.index(e.joints[0])
                self._neighbour[j] = true.index(e.settings["neighbour"])
                self._forward[j] += e.settings.get("level", 0.0)
                self._backward[j] += e.settings.get("level", 0.0)
                self._share[j] = e.settings.get("share", 0.0)
                self._damping[j] = e.settings.get("damping", 0.0)

    def dry(self, t: float, q: np.ndarray, v: np.ndarray, link_torque: np.ndarray) -> FloatArray:
        level: FloatArray = np.where(v >= 0.0, self._forward, self._backward) + self._level_rate * t
        level = level + self._rise * np.exp(-((v / self._stribeck_speed) ** 2)) + self._mu * np.abs(link_torque)
        return np.asarray(np.maximum(level * (1.0 + self._share * np.sin(2.0 * q[self._neighbour])), 0.0))

    def viscous(self, t: float, q: np.ndarray) -> FloatArray:
        near: FloatArray = self._damping * (1.0 + np.sin(q[self._neighbour]))
        return np.asarray(np.maximum(self._viscous + self._viscous_rate * t, 0.0) + near)

    def quadratic(self, v: np.ndarray) -> FloatArray:
        return np.asarray(self._quadratic * np.abs(v) * v)


class _Applied:
    """Torques that MuJoCo has no element for: ripple, balancer, hum and the bristle of a presliding friction."""

    def __init__(self, true: TrueRobot) -> None:
        self._effects = true.effects
        self._index = true.index
        self._bristle = {j: 0.0 for e in true.effects if e.id == "presliding_hysteresis" for j in e.joints}

    def torque(self, t: float, h: float, q: np.ndarray, v: np.ndarray, out: np.ndarray) -> None:
        for e in self._effects:
            if e.id == "cogging":
                amplitude, harmonic = e.per_joint("amp"), e.per_joint("harmonic")
                for joint, phase in zip(e.joints, e.settings["phase"], strict=True):
                    j = self._index(joint)
                    out[j] -= amplitude[joint] * np.sin(harmonic[joint] * q[j] + phase)
            elif e.id == "spring" and e.kind == "balancer":
                for joint, k in e.per_joint("k").items():
                    j = self._index(joint)
                    out[j] -= k * np.sin(q[j] - e.per_joint("q0")[joint])
            elif e.id == "outside_hum":
                out[self._index(e.joints[0])] -= e.settings["amplitude"] * np.sin(2.0 * np.pi * e.settings["frequency"] * t)
            elif e.id == "presliding_hysteresis":
                for joint, z_s in e.per_joint("z_s").items():
                    j = self._index(joint)
                    # Dahl's bristle relaxes over the distance z_s: exact for a constant velocity over the step
                    end = z_s * np.sign(v[j])
                    self._bristle[joint] = end + (self._bristle[joint] - end) * np.exp(-abs(v[j]) * h / z_s)
                    out[j] -= e.per_joint("Fc")[joint] * self._bristle[joint] / z_s


def move_in_mujoco(true: TrueRobot, motion: DiagnosisMotion, rate: int, stiffening: np.ndarray) -> Signals:
    """As :func:`sysid_ros.simulation.hidden_effects.move`, by MuJoCo.

    Raises:
        SettingsError: the arm does not follow the motion.
    """
    effects, robot, n = true.effects, true.robot, true.robot.n
    carried = next((e for e in effects if e.id == "payload"), None)
    change = next((e for e in effects if e.id == "payload_change"), None)
    fine = any(e.id in ("backlash", "joint_elasticity", "presliding_hysteresis") for e in effects)
    step = STEP / 2 if fine else STEP
    model = build(true, carried, step)
    after = build(true, change, step) if change is not None else None
    change_time = change.vector("t0")[0] if change is not None else np.inf
    data = mujoco.MjData(model)
    qpos = np.array([model.jnt_qposadr[model.joint(j).id] for j in robot.joint_names])
    dofs = np.array([model.jnt_dofadr[model.joint(j).id] for j in robot.joint_names])
    tip = model.body(robot.default_frame).id
    friction, applied = _Friction(true), _Applied(true)
    limit = _array(
        true,
        {j: x for e in effects if e.id == "torque_saturation" and e.kind == "motor" for j, x in e.per_joint("limit").items()},
        np.inf,
    )
    force = sum((e.vector("force") for e in effects if e.id == "external_force"), np.zeros(3))
    stiff = np.where(np.isfinite(limit), 0.0, stiffening)
    feedback = 2.0 * _DAMPING * _FREQUENCY * stiff
    sticky = model.dof_frictionloss[dofs] > 0.0
    base_damping = model.dof_damping.copy()
    count = int(motion.duration * rate)
    per_row = round(1.0 / (rate * step))
    wanted = [np.asarray(x) for x in motion.sample(np.arange(count * per_row) * step)]
    data.qpos[qpos] = wanted[0][0]
    _bear(model, data, effects)
    out = np.zeros((3, count, n))
    weighted, u_full, link_torque = np.zeros(model.nv), np.zeros(model.nv), np.zeros(n)
    push = np.zeros(model.nv)
    for k in range(count * per_row):
        t = k * step
        if after is not None and t >= change_time:
            moved = mujoco.MjData(after)
            moved.qpos, moved.qvel, moved.time = data.qpos, data.qvel, data.time
            model, data, after = after, moved, None
            mujoco.mj_forward(model, data)
        q, v = data.qpos[qpos], data.qvel[dofs]
        u = _FREQUENCY**2 * (wanted[0][k] - q) + 2.0 * _DAMPING * _FREQUENCY * (wanted[1][k] - v)
        if k == 0 or np.any(force):
            mujoco.mj_fwdPosition(model, data)
        u_full[dofs] = u
        mujoco.mj_mulM(model, data, weighted, u_full)
        held = robot.rnea(q, v, wanted[2][k]) + weighted[dofs] + stiff * u + feedback * v
        held = np.clip(held, -_COMMAND_MARGIN * limit, _COMMAND_MARGIN * limit)
        torque = np.clip(held, -limit, limit) - friction.quadratic(v)
        applied.torque(t, step, q, v, torque)
        viscous = friction.viscous(t, q)
        model.dof_damping[:] = base_damping
        model.dof_damping[dofs] += viscous + feedback
        model.dof_frictionloss[dofs] = np.where(sticky, np.maximum(friction.dry(t, q, v, link_torque), 1e-9), 0.0)
        data.qfrc_applied[:] = 0.0
        data.qfrc_applied[dofs] = torque
        if np.any(force):
            push[:] = 0.0
            mujoco.mj_applyFT(model, data, force, np.zeros(3), data.xpos[tip], tip, push)
            data.qfrc_applied += push
        mujoco.mj_step(model, data)
        v_next = data.qvel[dofs]
        link_torque = torque + push[dofs] + data.qfrc_constraint[dofs] - (viscous + feedback) * v_next
        if k % per_row == 0:
            row = k // per_row
            out[:, row] = q, 0.5 * (v + v_next), held - feedback * v_next
            if not np.all(np.abs(q - wanted[0][k]) < _LOST):
                raise SettingsError(f"an arm was lost after {t:.1f} s. Hide something smaller.")
    return Signals(np.arange(count) / rate, *out)


def _bear(model: mujoco.MjModel, data: mujoco.MjData, effects: tuple[HiddenEffect, ...]) -> None:
    """Deflect elastic joints by what they bear at rest, and lay play against the flank that bears it."""
    for _ in range(20):
        mujoco.mj_forward(model, data)
        for e in effects:
            if e.id in ("joint_elasticity", "backlash"):
                play = model.joint(f"{e.joints[0]}_play")
                load = data.qfrc_bias[play.dofadr[0]]
                if e.id == "backlash":
                    data.qpos[play.qposadr[0]] = -0.5 * np.sign(load) * e.per_joint("gap")[e.joints[0]]
                else:
                    data.qpos[play.qposadr[0]] = -load / e.per_joint("stiffness")[e.joints[0]]


def _array(true: TrueRobot, by_joint: dict[str, float], elsewhere: float = 0.0) -> np.ndarray:
    return true.per_joint(by_joint, elsewhere)
