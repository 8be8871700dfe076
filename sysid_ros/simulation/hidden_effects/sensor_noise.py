"""Noise of the messages: white, and with a memory."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from sysid_ros.sample import FloatArray

BAND = 8.0
"""Low-pass in which effects are looked for [Hz]."""


@dataclass(frozen=True)
class Noise:
    """What the sensors add.

    Attributes:
        torque: standard deviation of the white part of the efforts, shape (n,) [N m].
        coloured: standard deviation of their part with a memory, shape (n,) [N m]. memory: its correlation time [s].
        position: standard deviation of the positions [rad]. resolution: their steps; 0: none; of each joint (n,) or of all [rad].
        velocity: standard deviation of the velocities [rad/s].
    """

    torque: FloatArray
    coloured: FloatArray
    memory: float = 1.0
    position: float = 2e-5
    resolution: float | FloatArray = 1e-4
    velocity: float = 1e-3

    def floor(self, rate: float) -> FloatArray:
        """Standard deviation of the efforts below ``BAND`` when sampled at ``rate`` [Hz], shape (n,) [N m]."""
        white = self.torque**2 * min(2.0 * BAND / rate, 1.0)
        return np.asarray(np.sqrt(white + self.coloured**2))

    def read(self, q: FloatArray) -> FloatArray:
        """Positions (N, n) [rad] in the steps of their encoders."""
        step = np.asarray(self.resolution)
        divisor = np.where(step > 0.0, step, 1.0)
        return np.where(step > 0.0, np.round(q / divisor) * divisor, q)

    def of_torque(self, count: int, period: float, rng: np.random.Generator) -> FloatArray:
        """Noise of ``count`` messages, shape (count, n): white plus a first-order autoregression (stationary from the start)."""
        n = self.torque.size
        decay = np.exp(-period / self.memory)
        drive = rng.standard_normal((count, n)) * np.sqrt(1.0 - decay**2)
        start = rng.standard_normal((1, n))
        slow, _ = lfilter([1.0], [1.0, -decay], drive, axis=0, zi=decay * start)
        return np.asarray(self.torque * rng.standard_normal((count, n)) + self.coloured * slow)
