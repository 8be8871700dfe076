"""Noise of rows in the frequency domain, of one colour, with the likeliest levels by Whittle's likelihood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit
from scipy import sparse

from sysid_ros.sample import FloatArray

_CORNERS = np.geomspace(0.03, 2.0, 8)
_BINS = 36
_STEPS = 30
_TOP = 8.0
"""Frequency at which the part of the acceleration is stated [Hz]."""


@njit(cache=True)  # type: ignore[untyped-decorator]
def _likeliest(power: FloatArray, count: FloatArray, f: FloatArray, corners: FloatArray, steps: int, out: FloatArray) -> None:
    """Rows of ``out``: white level, coloured level, corner and level of the acceleration's noise that maximise Whittle's
    likelihood, by multiplicative updates."""
    bins, joints = power.shape
    rising = (f / _TOP) ** 4
    falling = np.empty(bins)
    for j in range(joints):
        total = 0.0
        members = 0.0
        for b in range(bins):
            total += count[b] * power[b, j]
            members += count[b]
        level = max(total / members, 1e-30)
        best = np.inf
        for k in range(corners.size):
            for b in range(bins):
                falling[b] = 1.0 / (1.0 + (f[b] / corners[k]) ** 2)
            w, c, r = 0.5 * level, 2.0 * level, 0.5 * level
            for _ in range(steps):
                wn = wd = cn = cd = rn = rd = 0.0
                for b in range(bins):
                    s = w + c * falling[b] + r * rising[b]
                    here, ratio = count[b] / s, power[b, j] / s
                    wn += here * ratio
                    wd += here
                    cn += here * falling[b] * ratio
                    cd += here * falling[b]
                    rn += here * rising[b] * ratio
                    rd += here * rising[b]
                w = max(w * wn / wd, 1e-6 * level)
                c = max(c * cn / cd, 1e-9 * level)
                r = max(r * rn / rd, 1e-9 * level)
            cost = 0.0
            for b in range(bins):
                s = w + c * falling[b] + r * rising[b]
                cost += count[b] * (np.log(s) + power[b, j] / s)
            if cost < best:
                best = cost
                out[j, 0], out[j, 1], out[j, 2], out[j, 3] = w, c, corners[k], r


class Frequencies(Protocol):
    """Rows in the frequency domain."""

    @property
    def f(self) -> FloatArray:
        """Frequency of each coefficient, shape (K,) [Hz]."""


@dataclass(frozen=True, slots=True)
class Bins:
    """Bins of coefficients of about the same frequency, those that have any.

    Attributes:
        count: how many each has, shape (b,). f: mean frequency of each, shape (b,) [Hz]. mean: what K coefficients are multiplied
            by for their mean in each bin, shape (b, K).
    """

    count: FloatArray
    f: FloatArray
    mean: sparse.csr_array

    @classmethod
    def of(cls, f: FloatArray) -> Bins:
        """Of the frequency of each coefficient, shape (K,) [Hz]."""
        edges = np.concatenate([[0.0], np.geomspace(0.05, float(f.max()) + 1e-9, _BINS)])
        where = np.minimum(np.searchsorted(edges, f, side="right") - 1, _BINS - 1)
        count = np.bincount(where, minlength=_BINS).astype(float)
        used = count > 0
        row = (np.cumsum(used) - 1)[where]
        mean = sparse.csr_array((1.0 / count[where], (row, np.arange(len(f)))), shape=(int(used.sum()), len(f)))
        return cls(count[used], mean @ f, mean)


@dataclass(frozen=True, slots=True)
class Noise:
    """``S(f) = white + coloured / (1 + (f / corner)^2) + rising (f / 8 Hz)^4``, variance of a coefficient, each of shape (n,).

    The second part is a first-order process with the correlation time ``1 / (2 pi corner)``; the third is white noise of the
    positions, differentiated twice and carried by the links' inertia.
    """

    white: FloatArray
    coloured: FloatArray
    corner: FloatArray
    rising: FloatArray

    def variance(self, f: FloatArray) -> FloatArray:
        """S, shape (K, n)."""
        slow = self.coloured / (1.0 + (f[:, None] / self.corner) ** 2)
        variance: FloatArray = self.white + slow + self.rising * (f[:, None] / _TOP) ** 4
        return variance

    def along(self, band: Frequencies) -> FloatArray:
        """S of each coefficient of a band, shape (K, n)."""
        return self.variance(band.f)

    @property
    def at_zero(self) -> FloatArray:
        """S(0), shape (n,)."""
        return self.white + self.coloured

    def loglik(self, f: FloatArray, rows: FloatArray) -> float:
        """Of rows of shape (K, n), up to a constant (Whittle 1953)."""
        variance = self.variance(f)
        return -0.5 * float(np.sum(np.log(variance) + rows**2 / variance))

    @classmethod
    def even(cls, power: FloatArray) -> Noise:
        """White noise of a power, shape (n,)."""
        nothing = np.zeros_like(power)
        return cls(np.maximum(power, 1e-30), nothing, np.ones_like(power), nothing)

    @classmethod
    def of(cls, f: FloatArray, power: FloatArray) -> Noise:
        """The noise that makes coefficients of this power the most likely.

        Args:
            f: shape (K,) [Hz]. power: squares of the coefficients, shape (K, n).
        """
        return cls.in_bins(Bins.of(f), power)

    @classmethod
    def in_bins(cls, bins: Bins, power: FloatArray) -> Noise:
        """As :meth:`of`, for frequencies whose bins are known."""
        out = np.zeros((power.shape[1], 4))
        _likeliest(np.ascontiguousarray(bins.mean @ power), bins.count, bins.f, _CORNERS, _STEPS, out)
        white, coloured, corner, rising = np.ascontiguousarray(out.T)
        return cls(white, coloured, corner, rising)
