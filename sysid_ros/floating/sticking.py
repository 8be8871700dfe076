"""What joints of legs that stand hide in the rows of the whole robot, and the rows without it."""

from __future__ import annotations

import numpy as np

from sysid_ros.sample import FREE, FloatArray

_BLOCK = 0.5
"""For so long dry friction at standstill is wrong by the same torque [s]."""
_NOISE = 0.1
"""Other errors of a joint's torque over what dry friction at rest may hide."""


def without_sticking(hidden: FloatArray, lever: FloatArray, period: float, *sides: FloatArray) -> None:
    """Take out of rows of the whole robot what dry friction of standing joints may hold, in place.

    A joint of a leg that stands holds any torque up to its dry friction, through the ground against the other legs. Within a
    block of half a second that is a torque c of the joint by itself, ``y = Y theta + H c + noise`` with ``c ~ N(0, 1)``, so that
    the rows have the covariance ``S + H H'``. They are multiplied by
    ``S^1/2 (1 + S^-1/2 H H' S^-1/2)^-1/2 S^-1/2``, which changes nothing but what H reaches.

    Args:
        hidden: H, what the dry friction of each joint does to each row where the joint stands, shape (N, 6, n).
        lever: the same where it moves, which gives the size S of what other errors of the torques do, shape (N, 6, n).
        period: time between rows [s]. sides: arrays of shape (N, n, ...) whose first six rows are changed.
    """
    length = max(1, round(_BLOCK / period))
    for first in range(0, len(hidden), length):
        block = slice(first, first + length)
        size = np.sqrt(np.maximum(np.mean(np.sum(lever[block] ** 2, axis=2), axis=0), 1e-18)) * _NOISE
        K = hidden[block] / size[None, :, None]
        count = len(K)
        U, s, _ = np.linalg.svd(K.reshape(count * FREE, -1), full_matrices=False)
        less = 1.0 / np.sqrt(1.0 + s**2) - 1.0
        for side in sides:
            rows = side[block, :FREE].reshape(count, FREE, -1) / size[None, :, None]
            flat = rows.reshape(count * FREE, -1)
            flat = flat + U @ (less[:, None] * (U.T @ flat))
            side[block, :FREE] = (flat.reshape(rows.shape) * size[None, :, None]).reshape(side[block, :FREE].shape)
