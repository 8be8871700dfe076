"""What keeps a beat, or grows and shrinks with time: no function of the motion, and no noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray

_LOWEST, _HIGHEST = 0.5, 7.5
"""Of a beat [Hz]."""
_LOOKED_AT = 6
"""Frequencies with the most power that are looked at closely."""
_PAYS = 20.0
"""Likelihood that a beat must gain: it is the best of some thousand."""
_KNOTS = 2.0
"""Spacing of what a factor's change with time is made of [s]."""
_LEAST = 0.1
"""Part of the whitened residual of a joint, here and on held-out rows, that must go."""


@dataclass(frozen=True)
class Leftover:
    """What follows the motion in the residual of one joint.

    Attributes:
        joint: index. share: part of its held-out residual's power that features of the motion remove. follows: their names.
    """

    joint: int
    share: float
    follows: tuple[str, ...]


def unsteady(train: Prepared, fit: Fit, held: Prepared, residual: FloatArray) -> list[Leftover]:
    """Joints whose residual has a beat of one frequency, or follows the load, the direction or the speed by a factor that changes
    with time. Phases and changes belong to a recording: they are found anew on the held-out rows, the frequency is not.

    Args:
        residual: held-out rows that the fit leaves, shape (K, n).
    """
    out = []
    for j in (int(j) for j in train.problem.active if held.band.active[j]):
        here = train.band, fit.residual[:, j], 1.0 / np.sqrt(fit.variance[:, j])
        there = held.band, residual[:, j], 1.0 / np.sqrt(fit.noise.variance(held.band.f)[:, j])
        f, gain, share = _beat(*here, j)
        if gain > _PAYS and share > _LEAST:
            part, gain = _explained(*there, _waves(held.band, j, f), j)
            if part > _LEAST and gain > _price(2, held.band, j):
                out.append(Leftover(j, part, (f"time, with a beat of {f:.1f} Hz",)))
                continue
        for words in ("load", "direction", "speed"):
            parts = []
            for band, rows, root in (here, there):
                X = _changing(band, j, words)
                part, gain = _explained(band, rows, root, X, j)
                parts.append(part if gain > _price(X.shape[1], band, j) else 0.0)
            if min(parts) > _LEAST:
                out.append(Leftover(j, parts[1], (f"{words} by a factor that changes with time",)))
                break
    return out


def _price(parameters: int, band: Band, joint: int) -> float:
    """Likelihood that columns must gain (BIC), on each of two sets of rows."""
    return 0.5 * parameters * float(np.log(len(band.f) * band.moves[joint])) + float(np.log(20.0))


def _explained(band: Band, rows: FloatArray, root: FloatArray, X: FloatArray, joint: int) -> tuple[float, float]:
    """Part of the whitened power of rows that columns take, and the likelihood that they gain.

    Only while the joint moves do rows say anything of it: where it stands, they hold a straight line.
    """
    z, C = rows * root, X * root[:, None]
    left = z - C @ np.linalg.lstsq(C, z, rcond=1e-9)[0]
    part = 1.0 - float(left @ left) / max(float(z @ z), 1e-300)
    return part, -0.5 * len(z) * float(band.moves[joint]) * float(np.log(max(1.0 - part, 1e-12)))


def _beat(band: Band, rows: FloatArray, root: FloatArray, joint: int) -> tuple[float, float, float]:
    """Frequency [Hz] of the strongest beat, the likelihood that it gains, and its part of the whitened power."""
    power = np.where((band.f > _LOWEST) & (band.f < _HIGHEST), (rows * root) ** 2, 0.0)
    step = 1.0 / (2.0 * band.seconds)
    best = (0.0, 0.0, 0.0)
    for f in np.unique(np.round(band.f[np.argsort(power)[-_LOOKED_AT:]] / step)) * step:
        for near in f + step * np.arange(-4.0, 5.0):
            part, gain = _explained(band, rows, root, _waves(band, joint, float(near)), joint)
            if gain > best[1]:
                best = (float(near), gain, part)
    return best


def _waves(band: Band, joint: int, f: float) -> FloatArray:
    """A sine and a cosine in time, for each motion its own, shape (K, 2 motions)."""
    return _of_each(band, joint, [np.stack([np.sin(x), np.cos(x)]) for m in band.motions for x in (2.0 * np.pi * f * m.t,)])


def _changing(band: Band, joint: int, words: str) -> FloatArray:
    """The load, the direction or the speed of a joint times bumps of time, shape (K, c)."""
    curves = []
    for m in band.motions:
        v = m.v[:, joint]
        base = {"load": m.link_torque[:, joint], "direction": smoothed_sign(v), "speed": v}[words]
        count = max(2, round((m.t[-1] - m.t[0]) / _KNOTS))
        knots = np.concatenate([[m.t[0]] * 2, np.linspace(m.t[0], m.t[-1], count), [m.t[-1]] * 2])
        bumps = BSpline.design_matrix(np.clip(m.t, knots[0], knots[-1]), knots, 2).toarray()
        curves.append((base[:, None] * bumps).T)
    return _of_each(band, joint, curves)


def _of_each(band: Band, joint: int, curves: list[FloatArray]) -> FloatArray:
    """Rows of curves that each motion has for itself."""
    total = sum(len(c) for c in curves)
    padded, start = [], 0
    for c in curves:
        out = np.zeros((total, c.shape[1]))
        out[start : start + len(c)] = c
        start += len(c)
        padded.append(out)
    return band.joint_curves(joint, padded)
