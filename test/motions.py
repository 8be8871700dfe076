"""Motions of the test robots, and what sensors would measure in them: by inverse dynamics, exactly, plus noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from sysid_ros.effects import Effect
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement, Sample

Torque = Callable[[float], FloatArray]


class Motion:
    """A sum of sines a joint, within the joint's limits: ``motion(t)`` is q, v and a of shape (len(t), n).

    Args:
        speed: scales frequency; the largest velocity of a joint is about 1.5 times it [rad/s].
        still: joints that do not move.
    """

    def __init__(self, model: RobotModel, seed: int = 0, speed: float = 1.0, still: Sequence[str] = ()) -> None:
        self.model = model
        rng = np.random.default_rng(seed)
        lower, upper = np.maximum(model.position_lower, -2.5), np.minimum(model.position_upper, 2.5)
        self.centre = 0.5 * (lower + upper) + 0.1 * (upper - lower) * rng.uniform(-1.0, 1.0, model.n)
        self.omega = 2.0 * np.pi * speed * rng.uniform([0.1], [0.5], (3, model.n))
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (3, model.n))
        reach = np.minimum(0.3 * (upper - lower), 0.8) / 3.0
        self.amplitude = rng.uniform(0.6, 1.0, (3, model.n)) * reach
        self.amplitude[:, [model.joint_names.index(j) for j in still]] = 0.0

    def __call__(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        angle = self.omega * t[:, None, None] + self.phase
        q = self.centre + np.sum(self.amplitude * np.sin(angle), axis=1)
        v = np.sum(self.amplitude * self.omega * np.cos(angle), axis=1)
        a = -np.sum(self.amplitude * self.omega**2 * np.sin(angle), axis=1)
        return q, v, a


def measurements(
    motion: Motion,
    seconds: float,
    rate: float,
    effects: Sequence[tuple[Effect, FloatArray] | tuple[Effect, FloatArray, float, float]],
    torque_noise: float = 0.0,
    encoder_noise: float = 0.0,
    jitter: float = 0.0,
    start: float = 100.0,
    velocity: bool = True,
    seed: int = 0,
    links: bool = True,
) -> list[Measurement]:
    """What the sensors of a robot measure.

    Args:
        effects: causes of torque beside the links, each with its parameters, and from when till when [s] if not always.
        jitter: of the stamps, as a part of the period. start: stamp of the first [s].
        links: False for robots that publish the external torque.
    """
    model, rng = motion.model, np.random.default_rng(seed)
    count = round(seconds * rate)
    t = (np.arange(count) + jitter * rng.uniform(-1.0, 1.0, count)) / rate
    q, v, a = motion(t + start)
    tau = model.rnea_along(q, v, a) if links else np.zeros_like(q)
    for effect, theta, *span in effects:
        now = np.flatnonzero((span[0] <= t) & (t < span[1])) if span else np.arange(count)
        tau[now] += _torque_along(effect, theta, t[now], q[now], v[now], a[now])
    noise = rng.normal(size=(count, 2, model.n))
    tau += torque_noise * noise[:, 0]
    measured = q + encoder_noise * noise[:, 1]
    rows = zip((start + t).tolist(), measured, v, tau, strict=True)
    return [Measurement(at, x, speed if velocity else None, torque) for at, x, speed, torque in rows]


def _torque_along(effect: Effect, theta: FloatArray, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """What an effect adds, shape (N, n): that of bodies at once, of all others sample by sample, as the effect gives it."""
    if (body := effect.link_columns()) is not None:
        return np.asarray(effect.robot.regressor_along(q, v, a) @ (body @ theta))
    out = np.zeros_like(q)
    for k, at in enumerate(t.tolist()):
        out[k] = effect.torque(Sample(at, q[k], v[k], a[k], np.zeros(q.shape[1])), theta)
    return out
