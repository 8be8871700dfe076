"""Where the low-pass on both sides of the equation cuts off: by the rate, and by the noise of the positions."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sysid_ros.sample import FloatArray

_ACCELERATION_NOISE: Final = 0.015  # [rad/s^2], half a percent of the accelerations that identify inertia
_SLOWEST: Final = 2.5  # cut-off that keeps the motion itself [Hz]


def default_cutoff(rate: float, noise: float = 0.0) -> float:
    """Cut-off of the low-pass for data at ``rate`` [Hz] whose positions have white ``noise`` [rad]: 10 Hz, a twentieth of the
    rate where that is less, and less where accelerations would be noisy.

    Accelerations are regressors. Their noise biases the estimate towards zero, by its square over that of the motion's
    accelerations (errors in variables), and averaging does not help. A Butterworth low-pass of order 4 passes
    ``2 noise^2 / rate (2 pi)^4 0.425 cutoff^5`` of it: so the fifth power of the cut-off keeps that small.
    """
    cutoff = min(10.0, rate / 20.0)
    if noise <= 0.0:
        return cutoff
    quiet = _ACCELERATION_NOISE**2 / acceleration_variance(rate, noise, 1.0)
    return float(max(min(cutoff, quiet**0.2), _SLOWEST))


def acceleration_variance(rate: float, noise: float, cutoff: float) -> float:
    """Variance of what the low-pass passes of the second difference of positions with white ``noise`` [rad], [(rad/s^2)^2]."""
    return float(2.0 * noise**2 / rate * (2.0 * math.pi) ** 4 * 0.425 * cutoff**5)


def position_noise(q: FloatArray) -> float:
    """Standard deviation of the white noise of even positions (N, n), root mean square over the joints [rad]: from their fourth
    differences, in which motion hardly shows; 0 where they are too few or not finite."""
    if len(q) < 5 or not np.isfinite(q).all():
        return 0.0
    fourth = np.diff(q, 4, axis=0)
    return float(np.sqrt(np.mean(fourth * fourth) / 70.0))


def window_half_width(rate: float) -> int:
    """Samples on each side of the derivative's window: 10 ms, at least 2 samples."""
    return int(min(max(round(0.010 * rate), 2), 15))
