"""What a position sensor sees of a motion: the band above its noise, and the smoothest motion within it."""

from __future__ import annotations

import numpy as np
from scipy import fft, interpolate, linalg, signal, sparse

from sysid_ros.sample import FloatArray

_BAND = 10.0
"""Accelerations are used below [Hz]."""
_CLEARLY = 10.0
"""Power over that of the noise at which a motion is seen well."""
_NOISE_ONLY = 0.4
"""Part of the band, from which on a position has nothing but noise."""
_SEEN, _DIFFERENCES = 2.0, 4
"""Frequency up to which a position is kept, over that up to which it is seen well; order of the differences that are small."""
_KNOTS, _DEGREE = 16, 5
"""Knots of a smooth position in a period of that frequency, and its degree."""
_COARSE = 0.01
"""Part of the power of an acceleration from which its noise matters: what is in proportion to it comes out too small by such a
part."""


def what_is_seen(q: FloatArray, rate: float, seen: FloatArray) -> FloatArray:
    """Positions on an even grid as far as they stand above the noise of their sensors, shape (N, n).

    A coarse encoder's steps are small beside the motion and, twice differentiated, large beside its acceleration: what the
    links' torque makes of them would be told as a rotor of less than no inertia. Each position gives way to the smoothest one
    near it, the least of ``sum (s - q)^2 + (rate / (2 pi f_c))^8 sum (D^4 s)^2`` (Whittaker 1923) among splines (Eilers, Marx
    1996), which passes what is below f_c, in its ends too.

    Args:
        q: shape (N, n). rate: of the grid [Hz]. seen: f_c, as of :func:`seen_band`, shape (n,) [Hz].
    """
    out = q.copy()
    for j in np.flatnonzero(np.isfinite(seen)):
        out[:, j] = smoothest(q[:, j], rate, seen[j])
    return out


def smoothest(x: FloatArray, rate: float, cutoff_hz: float) -> FloatArray:
    """The smoothest channel near x, shape (N,), as a spline with several knots a period of the cut-off.

    With a knot at each sample its equations would lose all digits where the cut-off is a thousandth of the rate.
    """
    times, every = np.arange(len(x)) / rate, max(1.0 / rate, 1.0 / (_KNOTS * cutoff_hz))
    count = int(np.ceil(times[-1] / every)) + 1
    knots = every * np.arange(-_DEGREE, count + _DEGREE)
    basis = interpolate.BSpline.design_matrix(times, knots, _DEGREE)
    rough = sparse.eye(basis.shape[1], format="csr")
    for _ in range(_DIFFERENCES):
        rough = rough[1:] - rough[:-1]
    weight = rate * every * (2.0 * np.pi * cutoff_hz * every) ** (-2 * _DIFFERENCES)
    normal = (basis.T @ basis + weight * (rough.T @ rough)).todia()
    bands = np.zeros((_DEGREE + 1, basis.shape[1]))
    for k in range(_DEGREE + 1):
        bands[k, : bands.shape[1] - k] = normal.diagonal(k)
    return np.asarray(x.mean() + basis @ linalg.solveh_banded(bands, basis.T @ (x - x.mean()), lower=True))


def seen_band(q: FloatArray, rate: float) -> FloatArray:
    """Frequency up to which each position on an even grid is worth keeping, shape (n,) [Hz]; infinite where it is fine enough.

    A position whose noise biases what is fitted to its acceleration is kept to twice the frequency to which it is seen clearly.

    Args:
        q: raw positions, shape (N, n). rate: of the grid [Hz].
    """
    f, power, noise = _spectrum(q, rate)
    twice = np.where(f < _BAND, (2.0 * np.pi * f) ** 4, 0.0)
    # a mean over a hertz would lift a slow motion to frequencies where it has no acceleration
    coarse = twice.sum() * noise > _COARSE * (twice @ power)
    kept = _SEEN * np.maximum(_clear(f, power, noise, rate), f[1])  # no stretch tells more of a joint at rest
    return np.where(coarse & (kept < _SEEN * _BAND), kept, np.inf)


def clear_band(q: FloatArray, rate: float) -> FloatArray:
    """Frequency up to which each position on an even grid stands clearly above the noise of its sensor, shape (n,) [Hz].

    Accelerations beyond it are noise that two differences have made large.

    Args:
        q: raw positions, shape (N, n). rate: of the grid [Hz].
    """
    return _clear(*_spectrum(q, rate), rate)


def _clear(f: FloatArray, power: FloatArray, noise: FloatArray, rate: float) -> FloatArray:
    width = max(1, int(np.searchsorted(f, 1.0)))
    mean = np.apply_along_axis(np.convolve, 0, power, np.ones(width) / width, "same")
    out = np.full(len(noise), 0.5 * rate)
    for j in range(len(noise)):
        above = np.flatnonzero(mean[:, j] > _CLEARLY * noise[j])
        out[j] = f[above[-1]] if above.size else 0.0
    return out


def _spectrum(q: FloatArray, rate: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Frequencies, shape (F,) [Hz], power of each position at them, shape (F, n), and that of its noise, shape (n,)."""
    # a record that does not begin and end at rest would spread over all frequencies
    rest = signal.detrend(q, axis=0) * signal.windows.hann(len(q))[:, None]
    power = np.abs(fft.rfft(rest, axis=0)) ** 2
    f = fft.rfftfreq(len(q), 1.0 / rate)
    return f, power, np.mean(power[f > _NOISE_ONLY * 0.5 * rate], axis=0)
