"""What black boxes may see of a motion when they predict the torque that a physical model leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sysid_ros.robot.smoothed_sign import SLIDE, smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.zero_phase import low_passed

LEAST, MOST = 8.0, 20.0
"""Cut-off of the low-pass that all channels go through together [Hz]: that of the diagnosis, and that of the measured torques.
Between them it is where the positions drown in the noise of their sensors: beyond, accelerations are noise that both the model
and the black boxes see, and to predict the one from the other is no discovery."""
_ROWS = 2.5
"""Rows a period of the cut-off."""
_STANDS = 0.015
"""Speed below which dry friction leaves a torque undetermined [rad/s]."""
_SETTLES = 0.06
"""Time beside a standstill in which a filtered torque still knows of it [s]."""


@dataclass(frozen=True, eq=False)
class RestInputs:
    """One stretch of motion.

    Attributes:
        t: shape (N,) [s]. q, v, a, load (of the links): shape (N, n). sign: of v. moving: where each joint moves, shape (N, n).
        period: between rows [s]. every: rows of the motion that one row stands for.
    """

    t: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray
    load: FloatArray
    sign: FloatArray
    moving: NDArray[np.bool_]
    period: float
    every: int

    @classmethod
    def of(cls, motion: Motion, cutoff: float) -> RestInputs:
        """Every so many rows of a motion, below a cut-off [Hz]."""
        every = max(1, int(1.0 / (_ROWS * cutoff * motion.period)))
        unit = np.where(motion.robot.is_prismatic, SLIDE, 1.0)
        moving = np.abs(motion.v) > _STANDS * unit
        width = max(1, round(_SETTLES / motion.period))
        moving = ndimage.binary_erosion(moving, np.ones((2 * width + 1, 1)), border_value=1)
        t, q, v, a, load = (x[::every] for x in (motion.t, *below(motion, cutoff)))
        sign = low_passed(smoothed_sign(motion.v / unit), cutoff, motion.period)
        return cls(t, q, v, a, load, np.asarray(sign)[::every], np.asarray(moving[::every]), every * motion.period, every)


def cutoff_of(motions: Sequence[Motion]) -> float:
    """Of the low-pass for some motions [Hz]."""
    clear = [float(np.min(m.clear[m.clear > 0.0])) for m in motions if m.clear is not None and np.any(m.clear > 0.0)]
    slowest = 0.4 / max(m.period for m in motions)
    return float(min(np.clip(min(clear, default=LEAST), LEAST, MOST), slowest))


def below(motion: Motion, cutoff: float) -> list[FloatArray]:
    """Position, velocity, acceleration and load below a cut-off [Hz], shape (N, n) each."""
    return [low_passed(x, cutoff, motion.period) for x in (motion.q, motion.v, motion.a, motion.link_torque)]


@dataclass(frozen=True, eq=False)
class Spread:
    """Mean and size of each channel over the fitted motions, so that features have no units; shape (n,) each."""

    q: FloatArray
    v: FloatArray
    a: FloatArray
    load_mean: FloatArray
    load: FloatArray

    @classmethod
    def of(cls, inputs: Sequence[RestInputs]) -> Spread:
        """Over all rows."""

        def rms(name: str) -> FloatArray:
            return np.asarray(np.maximum(np.sqrt(np.mean(np.concatenate([getattr(i, name) for i in inputs]) ** 2, axis=0)), 1e-9))

        every = np.concatenate([i.load for i in inputs])
        mean = np.mean(np.concatenate([i.q for i in inputs]), axis=0)
        size = np.maximum(np.std(every, axis=0), 1e-9)
        return cls(mean, rms("v"), rms("a"), every.mean(axis=0), size)
