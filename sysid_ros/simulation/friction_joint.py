"""One simulated joint with friction, followed by PD, by computed torque and by data-enabled predictive control."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sysid_ros.blackbox.series import Series
from sysid_ros.control.data_enabled import DeePC, PredictiveSettings
from sysid_ros.sample import FloatArray

PERIOD = 0.01
"""Of the control loop [s]; its torque is held in between."""
_STEP = 1e-3
_ENCODER = 2e-5
_STIFF, _DAMP = 150.0, 19.0
"""Feedback of all laws but DeePC [N m/rad], [N m s/rad]: a bandwidth of 16 rad/s, beyond which the hold of 10 ms swings it up."""
_RECORDED, _NOISE = 8.0, 5.0
"""What DeePC is given: so many seconds of PD with noise of this size beside its torque [s], [N m]."""
_SETTLED = 0.5
_UNIT = 0.01
"""Outputs of DeePC are positions in this unit [rad]."""
SETTINGS = PredictiveSettings(past=6, horizon=20, output_weight=1.0, input_weight=0.003, noise_weight=3.0, slack_weight=300.0)
Law = Callable[[float, float, float], float]


@dataclass(frozen=True, slots=True)
class Joint:
    """``I a = tau - G sin q - b v - F sign v``: inertia [kg m^2], gravity [N m], viscous [N m s/rad], coulomb [N m]."""

    inertia: float = 0.6
    gravity: float = 4.0
    viscous: float = 0.8
    coulomb: float = 1.5


@dataclass(frozen=True, slots=True)
class JointRun:
    """How a law did: error at every PERIOD, shape (N,) [rad]; its rms once settled [rad]; step: processor time that 99 % of the
    decisions keep below [s]."""

    law: str
    error: FloatArray
    rms: float
    step: float


def wanted(t: float | FloatArray, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A sum of four sines drawn from a seed: position, velocity and acceleration, of the shape of t."""
    rng = np.random.default_rng(1000 + seed)
    size, w, phase = rng.uniform(0.1, 0.3, 4), 2.0 * np.pi * rng.uniform(0.1, 0.8, 4), rng.uniform(0.0, 6.0, 4)
    angle = np.multiply.outer(t, w) + phase
    parts = size * np.sin(angle), size * w * np.cos(angle), -size * w**2 * np.sin(angle)
    return tuple(np.asarray(x.sum(-1)) for x in parts)  # type: ignore[return-value]


def follow(seed: int = 0, seconds: float = 8.0, joint: Joint | None = None) -> list[JointRun]:
    """All three laws on the same motion and noise."""
    body = joint or Joint()

    def feedback(s: int) -> Law:
        def law(t: float, q: float, v: float) -> float:
            r = wanted(t, s)
            return float(_STIFF * (r[0] - q) + _DAMP * (r[1] - v))

        return law

    pd = feedback(seed)

    def computed(t: float, q: float, v: float) -> float:
        return pd(t, q, v) + float(body.inertia * wanted(t, seed)[2] + body.gravity * np.sin(q))

    rng, rows = np.random.default_rng(seed + 77), []
    gather = feedback(seed + 500)

    def excited(t: float, q: float, v: float) -> float:
        tau = gather(t, q, v) + _NOISE * float(rng.standard_normal())
        rows.append((tau, q))
        return tau

    _run("", excited, seed + 500, _RECORDED, body)
    tau, q = np.array(rows).T
    laws: dict[str, Law] = {"pd": pd, "computed_torque": computed, "deepc": _DataEnabled(tau, q, seed)}
    return [_run(name, law, seed, seconds, body) for name, law in laws.items()]


class _DataEnabled:
    """Changes of torque by DeePC, so that a constant load leaves no error; the wanted positions are its reference.

    Args:
        tau, q: what was recorded at every PERIOD, shape (N,). seed: of the motion.
    """

    def __init__(self, tau: FloatArray, q: FloatArray, seed: int) -> None:
        change = np.diff(tau)[:-1, None]
        self._size, self._seed = float(np.std(change)), seed
        # what a change leads to is seen one step later
        self._law = DeePC([Series(change / self._size, q[2:, None] / _UNIT, PERIOD)], SETTINGS)
        self._tau, self._changes, self._seen = 0.0, np.zeros((SETTINGS.past, 1)), np.zeros((0, 1))

    def __call__(self, t: float, q: float, v: float) -> float:
        if not len(self._seen):
            self._seen = np.full((SETTINGS.past, 1), q / _UNIT)
        self._seen = np.vstack([self._seen[1:], [[q / _UNIT]]])
        later = np.asarray(t + PERIOD * np.arange(1, SETTINGS.horizon + 1), dtype=np.float64)
        ahead = wanted(later, self._seed)[0][:, None] / _UNIT
        change = self._law.inputs(self._changes, self._seen, ahead)[0]
        self._changes = np.vstack([self._changes[1:], change])
        self._tau += float(change[0]) * self._size
        return self._tau


def _run(name: str, law: Law, seed: int, seconds: float, body: Joint) -> JointRun:
    rng = np.random.default_rng(seed)
    start = wanted(0.0, seed)
    q, v, tau = float(start[0]), float(start[1]), 0.0
    errors, times = [], []
    for k in range(round(seconds / _STEP)):
        if k % round(PERIOD / _STEP) == 0:
            t, seen = k * _STEP, q + _ENCODER * float(rng.standard_normal())
            began = time.thread_time()
            tau = law(t, seen, v)
            times.append(time.thread_time() - began)
            errors.append(float(wanted(t, seed)[0]) - q)
        a = (tau - body.gravity * np.sin(q) - body.viscous * v - body.coulomb * np.tanh(v / 0.01)) / body.inertia
        v += _STEP * float(a)
        q += _STEP * v
    error = np.array(errors)
    settled = error[round(_SETTLED / PERIOD) :]
    return JointRun(name, error, float(np.sqrt(np.mean(settled**2))), float(np.percentile(times, 99)))
