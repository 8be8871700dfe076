"""The velocity that was measured, where it sees more of a motion than the position does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, signal

from sysid_ros.sample import FloatArray
from sysid_ros.signals.seen_motion import smoothest

_BAND = 10.0
"""Accelerations are used below [Hz]."""
_SEGMENT = 2.0
"""Length of the stretches whose spectra are averaged, half of each in the next one as well [s]."""
_NOISE_ONLY = 0.4, 0.48
"""Parts of the rate between which channels have nothing but noise: above the motion, below what stamps and grid take away."""
_STRETCHES, _OVERLAP = 3, 1.1
"""Fewest stretches without overlap; part by which those that overlap are fewer than they seem."""
_OFF = 0.25
"""Part of the difference of both that may be in proportion to a velocity or its derivative."""


def continued(q: FloatArray, v: FloatArray, rate: float) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Positions whose noise is that of the velocity above a frequency f_c from which on that has less, and which these are.

    A coarse encoder does not see a vibration whose velocity is measured well by itself (on the motor, by a tachometer, by an
    observer): ``s = u + W (q - u)``, u the integral of v, W the smoother of :func:`.smoothest` that passes what is below f_c.
    With the noise of both known from above the motion, ``2 pi f_c = sqrt(N_v / N_q)``; where that is in the upper half of the
    band, nothing is gained. A velocity that was computed from the position shares its noise, which shows above the motion, and
    adds nothing either; one that lags or has another gain differs in proportion to itself, not by noise alone. None is used.

    Args:
        q, v: on an even grid, shape (N, n). rate: of the grid [Hz].

    Returns:
        positions, shape (N, n), and whether the velocity is in them, shape (n,).
    """
    out, used = q.copy(), np.zeros(q.shape[1], dtype=np.bool_)
    size = round(_SEGMENT * rate)
    if len(q) < _STRETCHES * size or not np.isfinite(v).all():
        return out, used
    # what never changes has no spectrum to compare
    for j in np.flatnonzero(np.ptp(q, axis=0) * np.ptp(v, axis=0)):
        spectra = Spectra.of(q[:, j], v[:, j], rate, size)
        if spectra.cutoff < 0.5 * _BAND and spectra.independent and spectra.off < _OFF:
            u = integrate.cumulative_trapezoid(v[:, j], dx=1.0 / rate, initial=0.0)
            out[:, j] = u + smoothest(q[:, j] - u, rate, spectra.cutoff)
            used[j] = True
    return out, used


@dataclass(frozen=True, slots=True)
class Spectra:
    """What the spectra of a position and of a velocity say of their noise.

    Attributes:
        cutoff: from which on the velocity has less noise [Hz]. independent: whether their noise is. off: part of the power of
            their difference that is in proportion to the velocity or its derivative.
    """

    cutoff: float
    independent: bool
    off: float

    @classmethod
    def of(cls, q: FloatArray, v: FloatArray, rate: float, size: int) -> Spectra:
        """Of channels on an even grid, shape (N,) each, in stretches of ``size``."""
        made: dict[str, Any] = {"fs": rate, "nperseg": size, "detrend": "linear"}
        derivative = np.gradient(q, 1.0 / rate)
        (f, of_q), (_, of_v), (_, of_both) = (signal.welch(x, **made) for x in (q, v, v - derivative))
        above = (f > _NOISE_ONLY[0] * rate) & (f < _NOISE_ONLY[1] * rate)
        noise_q, noise_v = (max(float(np.mean(x[above])), 1e-300) for x in (of_q, of_v))
        shared, stretches = signal.coherence(derivative, v, **made)[1][above], 2.0 * len(q) / size - 1.0
        # of independent channels and K stretches it has a beta distribution, 1 and K - 1, here of stretches that overlap
        limit = (1.0 + 4.0 / np.sqrt(0.5 * above.sum())) / stretches * _OVERLAP
        w, band = 2.0 * np.pi * f, (f > 0.0) & (f < _BAND)
        both = (signal.csd(v, v - derivative, **made)[1] / np.maximum(of_both, 1e-300))[band]
        size_v = (of_v / np.maximum(of_both, 1e-300))[band]
        gain = np.sum(both.real) / np.sum(size_v)
        lag = np.sum(w[band] * both.imag) / np.sum(w[band] ** 2 * size_v)
        off = np.sum((gain**2 + (lag * w[band]) ** 2) * of_v[band]) / np.sum(of_both[band])
        cutoff = max(float(np.sqrt(noise_v / noise_q)) / (2.0 * np.pi), float(f[1]))
        return cls(cutoff, bool(np.mean(shared) < limit), float(off))
