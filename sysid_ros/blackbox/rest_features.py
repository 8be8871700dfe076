"""Functions of a motion that may stand in what a physical model leaves of a joint's torque, in blocks of one kind each.

Each function is computed on the fine grid and goes through the low-pass that the torques went through. Shapes: from (M, n) on the
fine grid to (N, c) at the rows; none has a unit. Of the motion alone, and never of the torque measured before: what only follows
the last residual is no cause.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sysid_ros.blackbox.rest_inputs import RestInputs, Spread
from sysid_ros.sample import FloatArray
from sysid_ros.signals.bristle import bristle

Blocks = dict[str, FloatArray]
Making = Callable[[RestInputs, Spread, int], Blocks]
_RIPPLES = 48
"""Highest harmonic of the position [1/rev]; every one as wide as the sampling of the motion allows."""
_COARSE = 12
_WAVES = 40
"""Random waves of one length that stand for a Gaussian process (Rahimi, Recht 2007)."""
_LENGTHS = (0.3, 1.0, 2.5)
"""Their frequencies [1/spread of a channel]."""
_STEP = 0.02
_LAGS = (-8, -4, -2, -1, 1, 2, 4, 8, 16)
"""Steps of 20 ms that a memory looks back, or ahead: filters without phase have no past."""
_TAPS = range(-6, 7)
_PLAYS = (0.003, 0.01, 0.03, 0.1)
"""Half widths of play operators [rad] (Krasnosel'skii, Pokrovskii 1989)."""
_BRISTLES = (0.003, 0.01, 0.02, 0.04, 0.08, 0.16)
"""Displacements within which a bristle bends [rad] (Dahl 1976); joints of geared arms: 0.005 to 0.08."""
_SPEEDS = (0.01, 0.03, 0.1, 0.3)
"""Speeds at which something may turn [rad/s]: friction has its shape at a fraction of what a joint usually does."""


def speeds(i: RestInputs, s: Spread, j: int) -> Blocks:
    """Steps of the joint's speed of several widths, bumps, and powers."""
    narrow, v = i.v[:, [j]] / np.array(_SPEEDS), i.v[:, [j]] / s.v[j]
    bumps = narrow * np.exp(0.5 * (1.0 - narrow**2))
    return {"speed": i.below(np.column_stack([np.tanh(narrow), bumps, v, v * np.abs(v), v**3, np.abs(v), v**2]))}


def positions(i: RestInputs, s: Spread, j: int) -> Blocks:
    """Powers and first harmonics of the joint's position; and coarse harmonics that turn with the direction of motion."""
    q, away, sign = i.q[:, [j]], i.q[:, [j]] - s.q[j], i.sign[:, [j]]
    powers = [away, away**2, away**3, away * np.abs(away)]
    slow = q * np.arange(1, _COARSE + 1)
    return {
        "position": i.below(np.column_stack([np.sin(q), np.cos(q), np.sin(2.0 * q), np.cos(2.0 * q), *powers])),
        "position and direction": i.below(sign * np.column_stack([np.ones(len(q)), np.sin(slow), np.cos(slow), *powers[:3]])),
    }


def ripples(i: RestInputs, s: Spread, j: int) -> Blocks:
    """Fourier series of the joint's position."""
    return {"ripple": harmonics(i, j, np.arange(1.0, _RIPPLES + 1.0))}


def harmonics(i: RestInputs, j: int, k: FloatArray) -> FloatArray:
    """Sines and cosines of k times a joint's position, shape (N, 2 len(k))."""
    at = i.q[:, [j]] * k
    return i.below(np.column_stack([np.sin(at), np.cos(at)]))


def process(i: RestInputs, s: Spread, j: int) -> Blocks:
    """A Gaussian process of the joint's own position, velocity, acceleration, load and direction, at three length scales."""
    rng = np.random.default_rng(7)
    # a speed counts by its order of size
    speed = np.arcsinh(i.v[:, j] / _SPEEDS[1]) / 2.0
    channels = [(i.q[:, j] - s.q[j]), speed, i.a[:, j] / s.a[j], (i.load[:, j] - s.load_mean[j]) / s.load[j], i.sign[:, j]]
    x = np.column_stack(channels)
    out = {"channels": i.below(x)}
    for length in _LENGTHS:
        w = rng.standard_normal((x.shape[1], _WAVES)) * length
        out[f"waves {length:g}"] = i.below(np.cos(x @ w + rng.uniform(0.0, 2.0 * np.pi, _WAVES)))
    return out


def loads(i: RestInputs, s: Spread, j: int) -> Blocks:
    """Of the joint: friction that grows with what it carries, at every speed."""
    load, v, sign = i.load[:, [j]] / s.load[j], i.v[:, [j]] / s.v[j], i.sign[:, [j]]
    turns, size = np.tanh(i.v[:, [j]] / np.array(_SPEEDS)), np.abs(load)
    return {
        "load": i.below(np.column_stack([load, size, load * sign, size * sign, load * v, size * v])),
        "load and turns": i.below(np.column_stack([turns * size, turns * load])),
    }


def all_joints(i: RestInputs, s: Spread, j: int) -> Blocks:
    """What a robot's equations are made of, of all joints: EDMD's dictionary for a static map."""
    waves = np.column_stack([np.sin(i.q), np.cos(i.q), np.sin(2.0 * i.q), np.cos(2.0 * i.q)])
    first = waves[:, : 2 * i.q.shape[1]]
    v, a, load, sign = i.v / s.v, i.a / s.a, i.load / s.load, i.sign
    own = [j]
    return {
        "positions": i.below(waves),
        "speeds": i.below(np.column_stack([v, np.abs(v), v * np.abs(v), sign])),
        "loads": i.below(np.column_stack([load, a, np.abs(load), load * sign, np.abs(load) * sign, load * v])),
        "direction and positions": i.below(sign[:, own] * waves),
        "speed and positions": i.below(v[:, own] * first),
        "acceleration and positions": i.below(a[:, own] * first),
        "speed and speeds": i.below(
            np.column_stack([v[:, own] * v, sign[:, own] * sign, v[:, own] * np.abs(v), np.abs(v[:, own]) * v])
        ),
    }


def memories(i: RestInputs, s: Spread, j: int) -> Blocks:
    """Bristles and plays of the position; delays of speed and direction."""
    q = i.q[:, j]
    lagged = np.column_stack([i.v[:, j] / s.v[j], i.sign[:, j]])
    return {
        "bristles": i.below(np.column_stack([bristle(q[:, None], w, i.period) for w in _BRISTLES])),
        "plays": i.below(np.column_stack([play(q, w) / w for w in _PLAYS])),
        "delays": _lagged(i, lagged, _LAGS),
    }


def dynamics(i: RestInputs, s: Spread, j: int) -> Blocks:
    """Finite responses to accelerations and loads; and what joints that give do to this one.

    Where the links of joint k lag behind its motor by ``z``, the torque of joint j is off by ``dtau_j/dq_k z + dtau_j/dv_k z' +
    M_jk z''`` (to first order, Spong 1987), with z as the load of joint k, and as its second derivative: the spring's next order.
    """
    own = np.column_stack([i.v[:, j] / s.v[j], i.a[:, j] / s.a[j], i.load[:, j] / s.load[j]])
    out = {"responses": np.column_stack([_lagged(i, own, _TAPS), _lagged(i, i.a / s.a, (-2, 2))])}
    rates = [i.below(x / s.load) for x in i.load_rates]
    for name, z in (("deflections", rates[:3]), ("swings", rates[2:])):
        out[name] = np.asarray(sum(by[:, j, :] * x for by, x in zip(i.turned, z, strict=True)))
    return out


def _lagged(i: RestInputs, x: FloatArray, lags: tuple[int, ...] | range) -> FloatArray:
    """Steps of 20 ms before, the first or the last point repeated at the ends; shape (N, c len(lags))."""
    low, step = i.below(x), _STEP / i.period
    at = np.arange(len(low))
    return np.column_stack([np.interp(at - k * step, at, c) for k in lags for c in low.T])


def play(q: FloatArray, r: float) -> FloatArray:
    """``p(k) = max(q(k) - r, min(q(k) + r, p(k-1)))`` less q."""
    values, p = q.tolist(), float(q[0])
    out = []
    for x in values:
        p = x - r if x - r > p else min(p, x + r)
        out.append(p - x)
    return np.array(out)
