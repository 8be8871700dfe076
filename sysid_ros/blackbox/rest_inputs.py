"""What black boxes may see of a motion when they predict the torque that a physical model leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sysid_ros.robot.robot_model import RobotModel
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
_FINE = 8.0
"""Points a period of the cut-off at which functions of the motion are computed before the low-pass: a function of a filtered
motion is not the filtered function. What aliases at eight points is seven times above the cut-off."""
_STANDS = 0.015
"""Speed below which dry friction leaves a torque undetermined [rad/s]."""
_SETTLES = 0.06
"""Time beside a standstill in which a filtered torque still knows of it [s]."""
_CLEAR_LOAD = 0.6
"""Cut-off, over that of all channels, below which a load is known well enough for its derivatives: its second one, the fourth
of a position, grows with the square of the frequency, so the noise at the edge falls to a third."""


@dataclass(frozen=True, eq=False)
class RestInputs:
    """One stretch of motion: rows that are judged, and the fine grid from which they are taken.

    Attributes:
        robot: whose motion it is.
        t: of the rows, shape (N,) [s]. moving: where each joint moves, shape (N, n). stands: number of the stretch, from 1, in
            which all joints stand, 0 where one moves, shape (N,).
        q, v: on the fine grid, shape (M, n). a, load (of the links): the same below the cut-off. sign: of v.
        cutoff: of the low-pass [Hz]. period: between rows [s]. every: rows of the motion that one row stands for.
        fine: rows of the motion that a point of the fine grid stands for.
    """

    robot: RobotModel
    t: FloatArray
    moving: NDArray[np.bool_]
    stands: NDArray[np.intp]
    q: FloatArray
    v: FloatArray
    a: FloatArray
    load: FloatArray
    sign: FloatArray
    cutoff: float
    period: float
    every: int
    fine: int

    @classmethod
    def of(cls, motion: Motion, cutoff: float) -> RestInputs:
        """Every so many rows of a motion, below a cut-off [Hz]."""
        fine = max(1, int(1.0 / (_FINE * cutoff * motion.period)))
        every = fine * max(1, int(1.0 / (_ROWS * cutoff * motion.period * fine)))
        unit = np.where(motion.robot.is_prismatic, SLIDE, 1.0)
        fast = np.abs(motion.v) > _STANDS * unit
        width = np.ones((2 * max(1, round(_SETTLES / motion.period)) + 1, 1))
        moving = ndimage.binary_erosion(fast, width, border_value=1)
        still = ndimage.binary_erosion(~fast.any(axis=1), width[:, 0], border_value=1)
        a, load = (low_passed(x[::fine], cutoff, motion.period * fine) for x in (motion.a, motion.link_torque))
        return cls(
            motion.robot,
            motion.t[::every],
            np.asarray(moving[::every]),
            np.asarray(ndimage.label(still)[0][::every], dtype=np.intp),
            motion.q[::fine],
            motion.v[::fine],
            a,
            load,
            smoothed_sign(motion.v[::fine] / unit),
            cutoff,
            every * motion.period,
            every,
            fine,
        )

    @property
    def fine_period(self) -> float:
        """Between points of the fine grid [s]."""
        return self.period * self.fine / self.every

    def below(self, x: FloatArray) -> FloatArray:
        """Rows of what is known on the fine grid, shape (M, ...), below the cut-off, shape (N, ...)."""
        return low_passed(x, self.cutoff, self.fine_period)[:: self.every // self.fine]

    def seen(self, x: FloatArray) -> FloatArray:
        """Rows of a channel on the motion's own grid, below the cut-off."""
        return self.below(x[:: self.fine])

    @cached_property
    def white(self) -> tuple[FloatArray, FloatArray]:
        """Lags [s], and how much of white noise is alike at them below the cut-off, 1 at none; shape (l,) each."""
        half = int(np.ceil(4.0 / self.cutoff / self.fine_period))
        pulse = np.zeros(2 * half + 1)
        pulse[half] = 1.0
        answer = low_passed(pulse, self.cutoff, self.fine_period)
        alike = np.asarray(np.correlate(answer, answer, "full")[2 * half :])
        return np.asarray(self.fine_period * np.arange(len(alike)), dtype=float), np.asarray(alike / alike[0])

    @cached_property
    def turned(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives of the URDF's torques by q, v and a at the rows, shape (N, n, n) each."""
        step = self.every // self.fine
        return self.robot.rnea_derivatives_along(self.q[::step], self.v[::step], self.a[::step])

    @cached_property
    def load_rates(self) -> list[FloatArray]:
        """Load and its first four derivatives by time on the fine grid, shape (M, n) each."""
        out = [low_passed(self.load, _CLEAR_LOAD * self.cutoff, self.fine_period)]
        for _ in range(4):
            out.append(np.gradient(out[-1], self.fine_period, axis=0))
        return out


def cutoff_of(motions: Sequence[Motion]) -> float:
    """Of the low-pass for some motions [Hz]."""
    clear = [float(np.min(m.clear[m.clear > 0.0])) for m in motions if m.clear is not None and np.any(m.clear > 0.0)]
    slowest = 0.4 / max(m.period for m in motions)
    return float(min(np.clip(min(clear, default=LEAST), LEAST, MOST), slowest))


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
        """Over all points."""

        def rms(name: str) -> FloatArray:
            return np.asarray(np.maximum(np.sqrt(np.mean(np.concatenate([getattr(i, name) for i in inputs]) ** 2, axis=0)), 1e-9))

        every = np.concatenate([i.load for i in inputs])
        mean = np.mean(np.concatenate([i.q for i in inputs]), axis=0)
        size = np.maximum(np.std(every, axis=0), 1e-9)
        return cls(mean, rms("v"), rms("a"), every.mean(axis=0), size)
