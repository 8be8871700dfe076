"""Noise of the windows, smoothed along the frequency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.frequency.local_fit import Window
from sysid_ros.sample import FloatArray

_AROUND = 2
"""Windows on each side that the noise of a window is averaged with: a few degrees of freedom make a poor weight."""


def smoothed_noise(windows: Sequence[Window]) -> FloatArray:
    """Noise variance of each window, smoothed along its neighbours: a straight line of logarithms over logarithms.

    The mean logarithm of a variance with nu complex degrees of freedom is low by 1 / (2 nu) + 1 / (12 nu^2).
    """
    nu = np.array([w.freedom for w in windows])
    logs = np.log([max(w.noise, 1e-300) for w in windows]) + 0.5 / nu + 1.0 / (12.0 * nu**2)
    at = np.log([w.f for w in windows])
    count = len(windows)
    out = np.empty(count)
    for i in range(count):
        first = int(np.clip(i - _AROUND, 0, max(count - 2 * _AROUND - 1, 0)))
        near = slice(first, first + 2 * _AROUND + 1)
        x = at[near] - at[i]
        columns = np.stack([np.ones_like(x), x], axis=1)[:, : 2 if len(x) > 3 else 1]
        out[i] = np.linalg.lstsq(columns, logs[near], rcond=None)[0][0]
    return np.exp(out)
