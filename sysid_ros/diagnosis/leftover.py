"""What is left over once the effects are in: does it still follow the motion, and what of it?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.unsteady import Leftover, unsteady
from sysid_ros.effects import Motion
from sysid_ros.effects.friction_drift import usual_temperature
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray

_MOST = 6
_PAYS_HERE = 14.0
"""Likelihood that a feature must gain on the fitted rows: it is the best of some hundred."""
_PAYS_THERE = 0.1
"""Part of the whitened held-out residual of a joint that the features must remove."""


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
        root_there = 1.0 / np.sqrt(fit.noise.variance(held.band.f)[:, j])
        found = _greedy(X * root[:, None], fit.residual[:, j] * root, len(root) * float(train.band.moves[j]))
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
    for i, name in enumerate(names):
        for k, other in enumerate(names):
            out[f"direction of {name} with the position of {other} (sin)"] = signs[:, i] * np.sin(motion.q[:, k])
            out[f"direction of {name} with the position of {other} (cos)"] = signs[:, i] * np.cos(motion.q[:, k])
            out[f"direction of {name} with the position of {other} (sin 2q)"] = signs[:, i] * np.sin(2.0 * motion.q[:, k])
            out[f"direction of {name} with the position of {other} (cos 2q)"] = signs[:, i] * np.cos(2.0 * motion.q[:, k])
            out[f"speed of {name} with the position of {other} (sin)"] = motion.v[:, i] * np.sin(motion.q[:, k])
            out[f"speed of {name} with the position of {other} (cos)"] = motion.v[:, i] * np.cos(motion.q[:, k])
            if i < k:
                out[f"direction of {name} with that of {other}"] = signs[:, i] * signs[:, k]
                out[f"speeds of {name} and {other}"] = motion.v[:, i] * motion.v[:, k]
    return out


def _greedy(X: FloatArray, r: FloatArray, count: float) -> list[int]:
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


__all__ = ["Leftover", "features", "leftovers"]
