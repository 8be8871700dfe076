"""Single torques that fit neither the one before nor the one after."""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sysid_ros.sample import FloatArray

_TIMES: Final = 12.0  # a spike is so many times farther from the middle of its neighbours than measurements are in the mean
_STIRS: Final = 4.0  # and others so many times, where something has happened to the robot
_CALM: Final = 0.01  # part of a measurement in that mean
_FIRST: Final = 25.0  # measurements that are only looked at
_ROUNDED: Final = 0.29  # that mean of values that are rounded, in their steps: of a - (b + c) / 2, each even within half a step


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def remove_spikes(window: FloatArray, first: int, usual: FloatArray, alone: bool) -> int:
    """Put the middle of its neighbours in place of a torque in the third of four measurements that is a spike; how many were.

    A step, as of a load that is picked up, is none: its neighbours differ by more than it does from their middle. Nor is the top
    of a curve, as of a torque without noise: the one before a spike bends the other way.

    Args:
        window: the newest measurements, a row each, shape (4, c). first: column of the first torque.
        usual: of each torque its mean distance from the middle of its neighbours and the least step that it made, and the number
            of measurements so far, shape (2 (c - first) + 1,), at first 0.
        alone: a spike is in one torque alone: what shows in others too is an impact, as when a foot lands.
    """
    found = stirred = 0
    n = usual.size // 2
    steps = usual[n : 2 * n]
    for j in range(n):
        before, at, after = window[1, first + j], window[2, first + j], window[3, first + j]
        step = abs(after - at)
        if step > 0.0 and (steps[j] == 0.0 or step < steps[j]):
            steps[j] = step
        stirred += alone and abs(at - 0.5 * (before + after)) > _STIRS * usual[j]
    count = usual[-1] = usual[-1] + 1.0
    for j in range(n):
        before, at, after = window[1, first + j], window[2, first + j], window[3, first + j]
        middle = 0.5 * (before + after)
        far, mean = abs(at - middle), max(usual[j], _ROUNDED * steps[j])
        bent = (window[0, first + j] - before + at - before) * (at - middle)  # the one before is off the other way, by half
        sticks_out = abs(after - before) < 0.5 * far and bent > 0.5 * far * far
        if stirred <= 1 and count > _FIRST and usual[j] > 0.0 and far > _TIMES * mean and sticks_out:
            window[2, first + j] = middle
            found += 1
        elif np.isfinite(far):
            rate = max(1.0 / count, _CALM)
            usual[j] += rate * (min(far, 4.0 * usual[j]) - usual[j]) if count > _FIRST else rate * (far - usual[j])
    return found


def without_spikes(tau: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Recorded torques, shape (N, n), with the middle of its neighbours in place of each spike, as :func:`remove_spikes` finds
    them in one torque alone, and where they were, shape (N, n)."""
    out = np.array(tau, dtype=float, order="C")
    _remove_all(out)
    return out, (out != tau) & ~np.isnan(tau)


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _remove_all(tau: FloatArray) -> None:
    """Remove the spikes of torques of shape (N, n) in place."""
    usual = np.zeros(2 * tau.shape[1] + 1)
    for k in range(len(tau) - 3):
        remove_spikes(tau[k : k + 4], 0, usual, True)
