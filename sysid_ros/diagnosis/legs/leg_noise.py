"""Noise of robots on legs: each recording has its own, and an error that every step of a gait repeats is one error, not many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft

from sysid_ros.diagnosis.band import Band
from sysid_ros.sample import FloatArray
from sysid_ros.signals.repetition import repeated_power
from sysid_ros.signals.whittle import Noise


@dataclass(frozen=True, slots=True)
class Gait:
    """What the noise of a recording follows: the period of its steps, 0 where it has none, and how long it is [s]."""

    step: float
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class NoiseOfEach:
    """Variance ``S_r(f) + P_r T / (2 F L_r)`` of the coefficients of recording r: noise of its own colour, and the power P_r that
    is left of every step alike, which impacts leave and no model says.

    The second does not average out over steps. Its power is that of the ``2 F L`` values that one step of length L has below the
    end F of the band, so that all steps of all recordings, T long, tell of a cause what one of them would tell.

    Attributes:
        each: of each recording, by its name. repeated: P, shape (n,). gaits: of each recording.
    """

    each: Mapping[str, Noise]
    repeated: Mapping[str, FloatArray]
    gaits: Mapping[str, Gait]

    @classmethod
    def of(cls, parts: Sequence[tuple[Band, FloatArray]], gaits: Mapping[str, Gait]) -> NoiseOfEach:
        """The noise that makes what is left of rows the most likely.

        Args:
            parts: bands with what is left of their rows, shape (K, n) each. gaits: of all their recordings.
        """
        each, repeated = {}, {}
        for band, rows in parts:
            for name in dict.fromkeys(m.recording for m in band.motions):
                own, values = _coefficients(band, name), list[FloatArray]()
                power = rows[own] ** 2
                step = gaits[name].step
                if step > 0.0:
                    values, period = _in_time(band, rows, name, 0.5 / step)
                    repeated[name] = repeated_power(values, period, step)
                each[name] = Noise.of(band.f[own], power)
        return cls(each, repeated, gaits)

    def repeating_as(self, other: NoiseOfEach) -> NoiseOfEach:
        """The same, with what another one has of every step."""
        return replace(self, repeated=other.repeated)

    def along(self, band: Band) -> FloatArray:
        """Of each coefficient of a band, shape (K, n); the largest of all for a recording whose noise is not known."""
        out, begin = np.empty((len(band.f), band.n)), 0
        stepping = sum(gait.seconds for gait in self.gaits.values() if gait.step > 0.0)
        for i, where, count in band.slices:
            motion, rows = band.motions[i], slice(begin, begin + count)
            begin += count
            names = [motion.recording] if motion.recording in self.each else list(self.each)
            options = []
            for name in names:
                variance = self.each[name].variance(band.f[rows])
                if name in self.repeated:
                    size = (where.stop - where.start) / count
                    variance = variance + size * self.repeated[name] * max(stepping / self.gaits[name].step, 1.0)
                options.append(variance)
            out[rows] = np.max(options, axis=0)
        return out

    @property
    def at_zero(self) -> FloatArray:
        """Of the quietest recording, whose rows say the most, shape (n,)."""
        return np.asarray(np.min([noise.at_zero for noise in self.each.values()], axis=0))


def _coefficients(band: Band, name: str) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which coefficients are of a recording, shape (K,)."""
    of = [band.motions[i].recording == name for i, _, _ in band.slices]
    return np.repeat(of, [count for _, _, count in band.slices])


def _in_time(band: Band, rows: FloatArray, name: str, above: float) -> tuple[list[FloatArray], float]:
    """Rows of each segment of a recording in time, without what is slower than ``above`` [Hz], and their period [s]."""
    out, begin, period = [], 0, 1.0
    for i, where, count in band.slices:
        part = slice(begin, begin + count)
        begin += count
        if band.motions[i].recording == name:
            full = np.zeros((where.stop - where.start, rows.shape[1]))
            full[:count] = np.where(band.f[part, None] >= above, rows[part], 0.0)
            out.append(np.asarray(fft.idct(full, axis=0, norm="ortho")))
            period = band.motions[i].period
    return out, period
