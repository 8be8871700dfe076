"""Five black boxes for the torque of one joint that a physical model leaves; each is linear in what it learns.

Features of the motion alone and never of the torque measured before: what only follows the last residual is no cause.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sysid_ros.blackbox.rest_inputs import RestInputs, Spread
from sysid_ros.sample import FloatArray

_RIPPLES = 48
"""Highest harmonic of the position [1/rev]; every one as wide as the sampling of the motion allows."""
_COARSE = 12
_WAVES = 120
"""Random waves that stand for a Gaussian process (Rahimi, Recht 2007)."""
_LAGS = (-8, -4, -2, -1, 0, 1, 2, 4, 8, 16)
"""Steps of 20 ms that a memory looks back, or ahead: filters without phase have no past."""
_PLAYS = (0.003, 0.01, 0.03)
"""Half widths of play operators [rad]: presliding and backlash."""
_DYNAMIC = 6
_SPEEDS = (0.01, 0.03, 0.1, 0.3)
"""Speeds at which something may turn [rad/s]: friction has its shape at a fraction of what a joint usually does."""


@dataclass(frozen=True, slots=True)
class Box:
    """One black box.

    Attributes:
        name: for people. columns: of a stretch, for a joint, shape (N, c).
    """

    name: str
    columns: Callable[[RestInputs, Spread, int], FloatArray]


def _turns(i: RestInputs, j: int) -> FloatArray:
    """Steps of the joint's speed of several widths, and bumps, shape (N, 2 widths)."""
    v = i.v[:, [j]] / np.array(_SPEEDS)
    return np.column_stack([np.tanh(v), v * np.exp(0.5 * (1.0 - v**2))])


def _dictionary(i: RestInputs, s: Spread, j: int) -> FloatArray:
    """Functions that a robot suggests, of all joints: EDMD's dictionary for a static map."""
    sin, cos, sin2, cos2 = np.sin(i.q), np.cos(i.q), np.sin(2.0 * i.q), np.cos(2.0 * i.q)
    v, a, load = i.v / s.v, i.a / s.a, (i.load - s.load_mean) / s.load
    own_sign, own_v, own_a = i.sign[:, [j]], v[:, [j]], a[:, [j]]
    parts = [sin, cos, sin2, cos2, v, np.abs(v), a, i.sign, load, v * np.abs(v), load * i.sign, load * v, np.abs(load) * i.sign]
    parts += [own_sign * x for x in (sin, cos, sin2, cos2)] + [own_v * x for x in (sin, cos)] + [own_a * x for x in (sin, cos)]
    turns = _turns(i, j)
    parts += [own_v * v, own_sign * i.sign, turns, turns * load[:, [j]]]
    return np.column_stack(parts)


def _ripple(i: RestInputs, s: Spread, j: int) -> FloatArray:
    """Fourier series and powers of the joint's own position, the coarse part of them with the direction of motion too."""
    k = np.arange(1, _RIPPLES + 1)
    coarse = np.arange(1, _COARSE + 1)
    at, slow = i.q[:, [j]] * k, i.q[:, [j]] * coarse
    away = i.q[:, [j]] - s.q[j]
    both = np.column_stack([np.sin(slow), np.cos(slow), away, away**2, away**3])
    sign = i.sign[:, [j]]
    return np.column_stack([np.sin(at), np.cos(at), away, away**2, away**3, away * np.abs(away), sign * both, sign])


def _process(i: RestInputs, s: Spread, j: int) -> FloatArray:
    """A Gaussian process of the joint's own position, velocity, acceleration, load and direction."""
    rng = np.random.default_rng(7)
    # a speed counts by its order of size
    speed = np.arcsinh(i.v[:, j] / _SPEEDS[1]) / 2.0
    channels = [(i.q[:, j] - s.q[j]), speed, i.a[:, j] / s.a[j], (i.load[:, j] - s.load_mean[j]) / s.load[j], i.sign[:, j]]
    x = np.column_stack(channels)
    w = rng.standard_normal((x.shape[1], _WAVES)) * rng.choice([0.3, 1.0, 2.5], _WAVES)
    return np.column_stack([np.sqrt(2.0) * np.cos(x @ w + rng.uniform(0.0, 2.0 * np.pi, _WAVES)), x, _turns(i, j)])


def _memory(i: RestInputs, s: Spread, j: int) -> FloatArray:
    """Delays of speed, acceleration, direction and load, and play operators of the position."""
    base = np.column_stack([i.v[:, j] / s.v[j], i.a[:, j] / s.a[j], i.sign[:, j], (i.load[:, j] - s.load_mean[j]) / s.load[j]])
    return np.column_stack([*(_shifted(base, k) for k in _LAGS), *(_play(i.q[:, j], r) / r for r in _PLAYS), _turns(i, j)])


def _dynamic(i: RestInputs, s: Spread, j: int) -> FloatArray:
    """Finite responses to the accelerations and loads of all joints: any linear motion that dies away within the taps."""
    load = (i.load - s.load_mean) / s.load
    own = np.column_stack([i.v[:, j] / s.v[j], i.a[:, j] / s.a[j], load[:, j]])
    others = np.delete(np.column_stack([i.a / s.a]), j, axis=1)
    taps = range(-_DYNAMIC, _DYNAMIC + 1)
    return np.column_stack([*(_shifted(own, k) for k in taps), *(_shifted(others, k) for k in (-2, 0, 2))])


def _shifted(x: FloatArray, k: int) -> FloatArray:
    """Rows k steps before, the first or the last one repeated at the ends."""
    return x[np.clip(np.arange(len(x)) - k, 0, len(x) - 1)]


def _play(q: FloatArray, r: float) -> FloatArray:
    """``p(k) = max(q(k) - r, min(q(k) + r, p(k-1)))`` less q."""
    values, p = q.tolist(), float(q[0])
    out = []
    for x in values:
        p = x - r if x - r > p else min(p, x + r)
        out.append(p - x)
    return np.array(out)


BOXES = (
    Box("functions of all joints", _dictionary),
    Box("ripple over the position", _ripple),
    Box("Gaussian process of the joint", _process),
    Box("memory", _memory),
    Box("linear dynamics", _dynamic),
)


def _of_position(k: int) -> Callable[[RestInputs, Spread, int], FloatArray]:
    return lambda i, s, j: _ripple(i, s, k)


def _of(name: str, k: int) -> Callable[[RestInputs, Spread, int], FloatArray]:
    def columns(i: RestInputs, s: Spread, j: int) -> FloatArray:
        mean = s.load_mean[k] if name == "load" else 0.0
        x = (getattr(i, name)[:, k] - mean) / getattr(s, name)[k]
        more = [i.sign[:, k], _turns(i, k)] if name == "v" else []
        return np.column_stack([x, np.abs(x), x * np.abs(x), x**3, *more])

    return columns


def single_inputs(names: tuple[str, ...], joint: int) -> list[Box]:
    """Boxes that see one channel alone, in words: of all joints the position, of the own joint the rest too."""
    out = [Box(f"the position of {name}", _of_position(k)) for k, name in enumerate(names)]
    out += [Box(f"the speed of {name}", _of("v", k)) for k, name in enumerate(names)]
    own = names[joint]
    return [*out, Box(f"the acceleration of {own}", _of("a", joint)), Box(f"the load of {own}", _of("load", joint))]
