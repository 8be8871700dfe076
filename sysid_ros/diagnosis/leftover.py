"""What is left over once the effects are in: does it still follow the motion, keep a beat, or grow and shrink with time?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.effects import Motion
from sysid_ros.effects.friction_drift import usual_temperature
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray

_MOST = 6
_PAYS_HERE = 14.0
"""Likelihood that a feature must gain on the fitted rows: it is the best of some hundred."""
_PAYS_THERE = 0.1
"""Part of the whitened held-out residual of a joint that the features must remove."""
_LOWEST, _HIGHEST = 0.5, 7.5
"""Of a beat [Hz]."""
_LOOKED_AT = 6
"""Frequencies with the most power that are looked at closely."""
_PAYS = 20.0
"""Likelihood that a beat must gain: it is the best of some thousand."""
_KNOTS = 2.0
"""Spacing of what a factor's change with time is made of [s]."""
_GOES = 0.1
"""Part of the whitened residual of a joint, here and on held-out rows, that must go."""


def leftovers(train: Prepared, fit: Fit, held: Prepared, residual: FloatArray) -> list[Leftover]:
    """Joints whose residual features of the motion predict on held-out rows, the largest share first.

    The features are no causes: signs, speeds and positions of every joint and products of them, as a net that catches what no
    effect describes.

    Args:
        residual: held-out rows that the fit leaves, shape (K, n).
    """
    names = train.motions[0].robot.joint_names
    warm = _temperatures(train, held)
    here = [features(m, names, warm) for m in train.motions]
    there = [features(m, names, warm) for m in held.motions]
    labels = list(here[0])
    out = []
    for j in (int(j) for j in train.problem.active if held.band.active[j]):
        X = train.band.joint_curves(j, [np.stack(list(f.values())) for f in here])
        Z = held.band.joint_curves(j, [np.stack(list(f.values())) for f in there])
        root = 1.0 / np.sqrt(fit.variance[:, j])
        root_there = 1.0 / np.sqrt(fit.noise.along(held.band)[:, j])
        found = greedy(X * root[:, None], fit.residual[:, j] * root, len(root) * float(train.band.moves[j]))
        if not found:
            continue
        theta = np.linalg.lstsq(X[:, found] * root[:, None], fit.residual[:, j] * root, rcond=1e-9)[0]
        before = residual[:, j] * root_there
        after = before - (Z[:, found] @ theta) * root_there
        gain = 1.0 - float(after @ after) / max(float(before @ before), 1e-30)
        if gain > _PAYS_THERE:
            raw = residual[:, j] - Z[:, found] @ theta
            share = 1.0 - float(raw @ raw) / max(float(residual[:, j] @ residual[:, j]), 1e-30)
            out.append(Leftover(int(j), max(share, gain), tuple(labels[i] for i in found)))
    known = {x.joint for x in out}
    out += [x for x in unsteady(train, fit, held, residual) if x.joint not in known]
    return sorted(out, key=lambda x: -x.share)


def _temperatures(train: Prepared, held: Prepared) -> dict[int, float]:
    """Joints whose temperature is known everywhere and changes, with its mean on the fitted rows [degrees Celsius]."""
    out = {}
    for j in range(train.motions[0].robot.n):
        usual = usual_temperature(train.motions, j)
        if usual is not None and all(m.temperature is not None and np.isfinite(m.temperature[:, j]).all() for m in held.motions):
            out[j] = usual
    return out


def features(motion: Motion, names: Sequence[str], warm: Mapping[int, float] | None = None) -> dict[str, FloatArray]:
    """Curves of a motion by their names, shape (N,) each.

    Args:
        warm: joints whose temperature is known, with the one that it is counted from [degrees Celsius].
    """
    out: dict[str, FloatArray] = {}
    signs = smoothed_sign(motion.v)
    for i, name in enumerate(names):
        q, v = motion.q[:, i], motion.v[:, i]
        out[f"direction of {name}"] = signs[:, i]
        out[f"speed of {name}"] = v
        out[f"speed of {name} without its sign"] = np.abs(v)
        out[f"acceleration of {name}"] = motion.a[:, i]
        for order in (1, 2):
            out[f"position of {name} (sin {order}q)"] = np.sin(order * q)
            out[f"position of {name} (cos {order}q)"] = np.cos(order * q)
    for i, usual in (warm or {}).items():
        assert motion.temperature is not None
        warmer = motion.temperature[:, i] - usual
        out[f"temperature of {names[i]}"] = warmer
        out[f"direction of {names[i]} with its temperature"] = signs[:, i] * warmer
        out[f"speed of {names[i]} with its temperature"] = motion.v[:, i] * warmer
    waves = {"sin": np.sin(motion.q), "cos": np.cos(motion.q), "sin 2q": np.sin(2.0 * motion.q), "cos 2q": np.cos(2.0 * motion.q)}
    for i, name in enumerate(names):
        for k, other in enumerate(names):
            for wave, curve in waves.items():
                out[f"direction of {name} with the position of {other} ({wave})"] = signs[:, i] * curve[:, k]
            for wave in ("sin", "cos"):
                out[f"speed of {name} with the position of {other} ({wave})"] = motion.v[:, i] * waves[wave][:, k]
            if i < k:
                out[f"direction of {name} with that of {other}"] = signs[:, i] * signs[:, k]
                out[f"speeds of {name} and {other}"] = motion.v[:, i] * motion.v[:, k]
    return out


def greedy(X: FloatArray, r: FloatArray, count: float) -> list[int]:
    """Columns that gain enough, one after the other.

    Args:
        X: whitened, shape (K, c). r: whitened, shape (K,). count: rows that are independent.
    """
    found: list[int] = []
    scale = np.sqrt(np.sum(X**2, axis=0))
    usable = scale > 1e-6 * scale.max()
    Q = np.zeros((len(r), 0))
    rest = r.copy()
    for _ in range(_MOST):
        left = X - Q @ (Q.T @ X)
        size = np.sum(left**2, axis=0)
        drop = np.where(usable & (size > 1e-4 * scale**2), (left.T @ rest) ** 2 / np.maximum(size, 1e-30), 0.0)
        best = int(np.argmax(drop))
        power = float(rest @ rest)
        if 0.5 * count * float(np.log(power / max(power - drop[best], 1e-9 * power))) < _PAYS_HERE:
            break
        found.append(best)
        direction = left[:, best] / np.sqrt(size[best])
        Q = np.column_stack([Q, direction])
        rest = rest - direction * (direction @ rest)
    return found


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
        there = held.band, residual[:, j], 1.0 / np.sqrt(fit.noise.along(held.band)[:, j])
        f, gain, share = _beat(*here, j)
        if gain > _PAYS and share > _GOES:
            part, gain = _explained(*there, _waves(held.band, j, f), j)
            if part > _GOES and gain > _price(2, held.band, j):
                out.append(Leftover(j, part, (f"time, with a beat of {f:.1f} Hz",)))
                continue
        for words in ("load", "direction", "speed"):
            parts = []
            for band, rows, root in (here, there):
                X = _changing(band, j, words)
                part, gain = _explained(band, rows, root, X, j)
                parts.append(part if gain > _price(X.shape[1], band, j) else 0.0)
            if min(parts) > _GOES:
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
