"""How far samples are off the cubic through their neighbours: a smooth motion next to nothing, a wrong stamp not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sysid_ros.sample import FloatArray


def stencil(t: FloatArray) -> FloatArray:
    """Weights of five samples in a row that give the cubic through two on each side less the one between them, shape (N - 4, 5).

    Args:
        t: rising, shape (N,) [s].
    """
    nodes, at = [t[:-4], t[1:-3], t[3:-1], t[4:]], t[2:-2]
    out = []
    for i in range(4):
        weight = np.ones_like(at)
        for k in range(4):
            if k != i:
                weight = weight * (at - nodes[k]) / (nodes[i] - nodes[k])
        out.append(weight)
    return np.stack([out[0], out[1], -np.ones_like(at), out[2], out[3]], axis=1)


def applied(weights: FloatArray, q: FloatArray) -> FloatArray:
    """The differences of samples, shape (N - 4, n). Args: weights: shape (N - 4, 5). q: shape (N, n)."""
    count = len(weights)
    return np.asarray(sum(weights[:, i, None] * q[i : i + count] for i in range(weights.shape[1])))


def without_gaps(t: FloatArray) -> NDArray[np.bool_]:
    """Where the five samples follow each other about as usual, shape (N - 4,)."""
    width = t[4:] - t[:-4]
    near: NDArray[np.bool_] = width < 3.0 * np.median(width)
    return near


def slopes(t: FloatArray, q: FloatArray) -> FloatArray:
    """Velocity from the sample before to the one after, shape (N - 4, n)."""
    return np.asarray((q[3:-1] - q[1:-3]) / (t[3:-1] - t[1:-3])[:, None])
