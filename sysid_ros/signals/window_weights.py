"""Weights of a window of even samples that give position and velocity in its middle."""

from __future__ import annotations

import numpy as np

from sysid_ros.sample import FloatArray


def slope_weights(half_width: int, period: float) -> FloatArray:
    """Weights that give the slope, in the middle, of the cubic that fits ``2 half_width + 1`` even samples best (Savitzky, Golay
    1964), shape (2 half_width + 1,) [1/s].

    Args:
        half_width: samples on each side, at least 2. period: time between samples [s].
    """
    x = np.arange(-half_width, half_width + 1) / half_width
    weights: FloatArray = np.linalg.pinv(np.vander(x, 4, increasing=True))[1] / (half_width * period)
    return weights


def value_weights(half_width: int) -> FloatArray:
    """Weights of the position in the middle of ``2 half_width + 1`` even samples, exact for cubics, whose noise does not
    correlate with that of the second difference there, shape (2 half_width + 1,).

    The middle sample itself does: the noise s^2 of the encoder would make a mean torque ``-2 s^2 / period^2 dM/dq`` in
    ``M(q) a``, which no low-pass averages out.

    Args:
        half_width: samples on each side, at least 2.
    """
    x = np.arange(-half_width, half_width + 1) / half_width
    second_difference = np.zeros(x.size)
    second_difference[half_width - 1 : half_width + 2] = 1.0, -2.0, 1.0
    conditions = np.vstack([np.vander(x, 4, increasing=True).T, second_difference])
    return np.asarray(np.linalg.pinv(conditions)[:, 0])
