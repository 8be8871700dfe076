"""Arms in MuJoCo, simulated without a line of the package: MuJoCo reads the URDF, moves the arm and knows the truth.

The arm follows its path by computed torque of the nominal model, so that with a wrong model it does not follow well. Beside what
is hidden everything is a little wrong: masses 3 %, centres of mass 3 mm, principal moments of inertia 5 %, dry friction that is
higher at low speed, viscous friction, rotors, torque constants 1 %, offsets of 0.5 % of each joint's usual torque, 0.5 to 2 ms of
delay.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
KINDS = (
    "none",
    "payload",
    "torque_scale",
    "torque_offset",
    "joint_offset",
    "time_delay",
    "base_tilt",
    "spring",
    "cogging",
    "coulomb_friction",
    "viscous_friction",
    "payload_change",
    "external_force",
)
STYLES = ("sines", "points", "ramps")
STEP, STEPS, PICK, BANDWIDTH = 1e-3, 2, 12.0, 25.0
"""Of the controller [s], of the simulation in one of those, when a payload is taken up [s], of the controller [rad/s]."""


@dataclass
class Truth:
    """What is wrong with an arm: of one kind more than of the others. Arrays have one value a joint."""

    kind: str
    joint: int
    size: dict[str, list[float]] = field(default_factory=dict)
    gain: FloatArray = field(default_factory=lambda: np.ones(0))
    offset: FloatArray = field(default_factory=lambda: np.zeros(0))
    zero: FloatArray = field(default_factory=lambda: np.zeros(0))
    dry: FloatArray = field(default_factory=lambda: np.zeros(0))
    viscous: FloatArray = field(default_factory=lambda: np.zeros(0))
    delay: float = 0.0
    spring: tuple[float, float] = (0.0, 0.0)
    ripple: tuple[float, int, float] = (0.0, 0, 0.0)
    force: FloatArray = field(default_factory=lambda: np.zeros(3))


def bare(urdf: str) -> str:
    """The links and joints of a URDF, without meshes, declared friction, transmissions, and fingers that move."""
    root = ET.fromstring(urdf)
    for link in root.iter("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    for tag in ("transmission", "gazebo"):
        for element in root.findall(tag):
            root.remove(element)
    for joint in root.findall("joint"):
        for element in (*joint.findall("dynamics"), *joint.findall("mimic")):
            joint.remove(element)
        if "finger" in joint.get("name", "").lower() or "gripper" in joint.get("name", "").lower():
            joint.set("type", "fixed")
    return ET.tostring(root, encoding="unicode")


class Arm:
    """A nominal arm, and one with everything a little wrong and one thing more.

    Args:
        urdf: as :func:`bare` gives it. kind: of :data:`KINDS`. rng: of everything that is drawn.
    """

    def __init__(self, urdf: str, kind: str, rng: np.random.Generator) -> None:
        self._rng = rng
        self.nominal: Any = mujoco.MjSpec.from_string(urdf).compile()
        self.names = [self.nominal.joint(i).name for i in range(self.nominal.njnt)]
        limits = {j.get("name"): j.find("limit") for j in ET.fromstring(urdf).findall("joint")}
        said = [{k: float(x) for k, x in (limits[n].attrib if limits[n] is not None else {}).items()} for n in self.names]  # type: ignore[union-attr]
        self.lower = np.maximum([x.get("lower", -3.0) for x in said], -2.8)
        self.upper = np.minimum([x.get("upper", 3.0) for x in said], 2.8)
        self.fastest = 0.7 * np.minimum([x.get("velocity", 2.0) or 2.0 for x in said], 2.5)
        self.usual = np.minimum(np.maximum(2.0 * self._gravity(), 0.5), [x.get("effort", 0.0) or 50.0 for x in said])
        self.loaded, self.real = self.nominal.__copy__(), self.nominal.__copy__()
        self.truth = self._draw(kind)

    def _gravity(self) -> FloatArray:
        """Largest torque of gravity on each joint, shape (n,) [N m]."""
        data, most = mujoco.MjData(self.nominal), np.zeros(self.nominal.nv)
        for _ in range(200):
            data.qpos[:] = self._rng.uniform(self.lower, self.upper)
            mujoco.mj_forward(self.nominal, data)
            most = np.maximum(most, np.abs(data.qfrc_bias))
        return most

    def _draw(self, kind: str) -> Truth:
        rng, n, real = self._rng, len(self.names), self.real
        links = real.body_mass > 0.0
        real.body_mass[links] *= 1.0 + 0.03 * rng.normal(size=int(links.sum()))
        real.body_ipos[links] += 0.003 * rng.normal(size=(int(links.sum()), 3))
        real.body_inertia[links] *= 1.0 + 0.05 * rng.normal(size=(int(links.sum()), 3))
        real.dof_armature[:] = self.usual * rng.uniform(0.002, 0.01, n)
        heavy = int(np.argsort(-self._gravity())[rng.integers(0, 3)])
        light = int(rng.integers(0, n))
        sign = float(rng.choice([-1.0, 1.0]))
        truth = Truth(kind, light if kind in ("torque_offset", "cogging", "coulomb_friction", "viscous_friction") else heavy)
        j, usual = truth.joint, float(self.usual[truth.joint])
        truth.gain, truth.offset = 1.0 + 0.01 * rng.normal(size=n), 0.005 * self.usual * rng.normal(size=n)
        truth.zero, truth.delay = np.zeros(n), float(rng.uniform(0.0005, 0.002))
        truth.dry, truth.viscous = self.usual * rng.uniform(0.02, 0.07, n), self.usual * rng.uniform(0.01, 0.05, n) / self.fastest
        if kind in ("payload", "payload_change"):
            mass, com = float(np.clip(0.03 * usual, 0.2, 6.0)), rng.uniform([-0.04, -0.04, 0.03], [0.04, 0.04, 0.12])
            if kind == "payload":
                _weld(real, mass, com)
            self.loaded = real.__copy__()
            if kind == "payload_change":
                _weld(self.loaded, mass, com)
            truth.size = {"mass": [mass], "com": com.tolist()}
        elif kind == "torque_scale":
            truth.gain[j] *= float(rng.choice([0.82, 0.88, 1.12, 1.2]))
            truth.size = {"gain": [float(truth.gain[j])]}
        elif kind == "torque_offset":
            truth.offset[j] += 0.08 * sign * usual
            truth.size = {"offset": [float(truth.offset[j])]}
        elif kind == "joint_offset":
            truth.zero[j] = sign * float(rng.uniform(0.05, 0.1))
            truth.size = {"delta": [float(truth.zero[j])]}
        elif kind == "time_delay":
            truth.delay = float(rng.uniform(0.008, 0.015))
            truth.size = {"delay": [truth.delay]}
        elif kind == "base_tilt":
            roll, pitch = np.deg2rad(rng.choice([-1.0, 1.0], 2) * rng.uniform(2.5, 5.0, 2))
            about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
            about_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
            real.opt.gravity[:] = (about_y @ about_x).T @ real.opt.gravity
            truth.size = {"roll": [float(roll)], "pitch": [float(pitch)]}
        elif kind == "spring":
            truth.spring = 0.15 * usual, float(0.5 * (self.lower + self.upper)[j] + rng.uniform(-0.5, 0.5))
            truth.size = {"k": [truth.spring[0]]}
        elif kind == "cogging":
            truth.ripple = 0.05 * usual, int(rng.choice([12, 20, 32])), float(rng.uniform(0.0, 6.0))
            truth.size = {"amp": [truth.ripple[0]]}
        elif kind == "coulomb_friction":
            truth.dry[j] += 0.12 * usual
            truth.size = {"Fc": [float(truth.dry[j])]}
        elif kind == "viscous_friction":
            truth.viscous[j] += 0.15 * usual / float(self.fastest[j])
            truth.size = {"b": [float(truth.viscous[j])]}
        elif kind == "external_force":
            direction = rng.normal(size=3)
            truth.force = direction / np.linalg.norm(direction) * 0.3 * usual
            truth.size = {"force": truth.force.tolist()}
        return truth

    def path(self, seconds: float, style: str) -> FloatArray:
        """Positions to follow, shape (N, n): sums of sines, or lines between points with rests, smooth or with even speed."""
        rng, n, count = self._rng, len(self.names), round(seconds / STEP)
        t, middle = np.arange(count) * STEP, 0.5 * (self.lower + self.upper)
        reach = np.minimum(0.3 * (self.upper - self.lower), 1.4)
        if style == "sines":
            waves, base = np.zeros((count, n)), rng.uniform(0.06, 0.12)
            for j in range(n):
                for k in range(1, 6):
                    waves[:, j] += rng.normal() / k * np.sin(2.0 * np.pi * k * base * t + rng.uniform(0.0, 6.28))
            speed = np.abs(np.gradient(waves, STEP, axis=0)).max(axis=0)
            swell = np.clip(t / 2.0, 0.0, 1.0)[:, None]
            size = np.minimum(reach / np.abs(waves).max(axis=0), self.fastest / speed)
            return np.asarray(middle + waves * size * swell**3 * (10.0 - 15.0 * swell + 6.0 * swell**2))
        parts: list[FloatArray] = []
        here = middle
        while not parts or sum(map(len, parts)) < count:
            there = middle + reach * rng.uniform(-1.0, 1.0, n)
            way = np.abs(there - here)
            slow = max(0.3, float(np.max(1.9 * way / self.fastest)), float(np.sqrt(1.5 * way.max())))
            s = np.linspace(0.0, 1.0, round(slow / STEP))
            smooth = s**3 * (10.0 - 15.0 * s + 6.0 * s**2) if style == "points" else _even(s)
            rest = round((rng.uniform(0.1, 1.0) if style == "points" else 0.15) / STEP)
            parts += [here + (there - here) * smooth[:, None], np.tile(there, (rest, 1))]
            here = there
        return np.concatenate(parts)[:count]

    def run(self, path: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Positions, velocities and torques of the motors while the arm follows a path, shape (N, n) each."""
        truth, n, usual = self.truth, len(self.names), self.usual
        velocity = np.gradient(path, STEP, axis=0)
        acceleration = np.gradient(velocity, STEP, axis=0)
        for model in (self.real, self.loaded):
            model.opt.timestep, model.opt.integrator = STEP / STEPS, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        data, known = mujoco.MjData(self.real), mujoco.MjData(self.nominal)
        data.qpos[:], mass = path[0], np.zeros((n, n))
        tip, out = int(self.real.jnt_bodyid[-1]), np.zeros((3, len(path), n))
        for i, (q, v, a) in enumerate(zip(path, velocity, acceleration, strict=True)):
            known.qpos[:], known.qvel[:] = data.qpos, data.qvel
            mujoco.mj_forward(self.nominal, known)
            mujoco.mj_fullM(self.nominal, known, mass)
            asked = a + 2.0 * BANDWIDTH * (v - data.qvel) + BANDWIDTH**2 * (q - data.qpos)
            inertia = np.diag(mass) + self.real.dof_armature
            torque = (mass + np.diag(self.real.dof_armature)) @ asked + known.qfrc_bias + truth.dry * np.tanh(v / 0.05)
            out[:, i] = data.qpos, data.qvel, torque
            if truth.force.any():
                data.xfrc_applied[tip, :3] = truth.force
                data.xfrc_applied[tip, 3:] = np.cross(data.xpos[tip] - data.xipos[tip], truth.force)
            model = self.loaded if truth.kind == "payload_change" and i * STEP >= PICK else self.real
            for _ in range(STEPS):
                speed = data.qvel.copy()
                dry = truth.dry * (1.0 + 0.25 * np.exp(-((speed / 0.05) ** 2))) * np.tanh(speed / 0.004)
                lost = dry + truth.viscous * speed
                stop = np.abs(speed) * inertia / (STEP / STEPS) * 0.9  # friction stops a joint, and does not turn it round
                data.qfrc_applied[:] = torque - np.sign(lost) * np.minimum(np.abs(lost), stop)
                j = truth.joint
                data.qfrc_applied[j] -= truth.spring[0] * (data.qpos[j] - truth.spring[1])
                data.qfrc_applied[j] -= truth.ripple[0] * np.sin(truth.ripple[1] * data.qpos[j] + truth.ripple[2])
                mujoco.mj_step(model, data)
        if not np.isfinite(out).all() or np.abs(out[2]).max() > 1e3 * usual.max():
            raise RuntimeError("the simulated arm does not follow its path.")
        return out[0], out[1], out[2]

    def measured(self, path: FloatArray, start: float) -> tuple[FloatArray, FloatArray, FloatArray | None, FloatArray]:
        """Times, positions, velocities (None where the driver gives none) and efforts as a driver publishes them."""
        rng, truth = self._rng, self.truth
        q, v, torque = self.run(path)
        t = np.arange(len(q)) * STEP
        late = np.stack([np.interp(t - truth.delay, t, x) for x in torque.T], axis=1) * truth.gain + truth.offset
        every = int(rng.choice([2, 4, 8, 10]))
        noise, colour = rng.normal(size=late[::every].shape), float(rng.choice([0.0, 0.8, 0.95]))
        for i in range(1, len(noise)):
            noise[i] = colour * noise[i - 1] + np.sqrt(1.0 - colour**2) * noise[i]
        steps = float(rng.choice([1e-6, 2e-5, 1e-4]))
        seen = np.round((q[::every] + truth.zero) / steps) * steps
        speeds = v[::every] + 1e-3 * rng.normal(size=seen.shape) if rng.random() < 0.5 else None
        return np.asarray(start + t[::every], dtype=float), seen, speeds, late[::every] + 0.005 * self.usual * noise


def _even(s: FloatArray) -> FloatArray:
    """Way over time, both from 0 to 1, with a quarter of the time to speed up and as much to slow down."""
    ramp, b = 2.0 * 0.25 * 0.75, 0.25
    return np.asarray(np.where(s < b, s**2 / ramp, np.where(s < 1 - b, (s - b / 2) / (1 - b), 1 - (1 - s) ** 2 / ramp)))


def _weld(model: Any, mass: float, com: FloatArray) -> None:
    """A ball of some radius on the last link."""
    body = int(model.jnt_bodyid[-1])
    own, place, flat = float(model.body_mass[body]), model.body_ipos[body].copy(), np.zeros(9)
    mujoco.mju_quat2Mat(flat, model.body_iquat[body])
    turn = flat.reshape(3, 3)
    centre = (own * place + mass * com) / (own + mass)
    inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T + 1.5e-3 * mass * np.eye(3)
    for m, c in ((own, place - centre), (mass, com - centre)):
        inertia += m * (c @ c * np.eye(3) - np.outer(c, c))
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, axes.reshape(-1).copy())
    model.body_mass[body], model.body_ipos[body] = own + mass, centre
    model.body_inertia[body], model.body_iquat[body] = moments, quaternion
