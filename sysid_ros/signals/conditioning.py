"""From raw recordings to smooth motions on an even grid, without shifting any channel in time.

The order of the stamps, the stretches without a gap, the even grid and the design of the low-pass are those of every recording
(:mod:`.recording`, :mod:`.zero_phase`). The low-pass itself is not that of identification's rows: the same one must go over
modelled dry friction on the motion's own grid (:func:`as_measured`), which a filter that decimates can't do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft, interpolate, linalg, signal, sparse

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.zero_phase import low_passed, on_even_grid

SMOOTHING = 20.0
"""Cut-off of the zero-phase low-pass on positions and torques [Hz]: far enough above the band that is judged."""
FINEST = 200.0
"""Largest rate of the grid [Hz]."""
MAX_GAP = 0.1
"""A longer gap between stamps splits a recording [s]."""
SHORTEST = 2.0
"""Shorter stretches are left out [s]."""
_FEWEST = 20
"""Rows that a stretch must have more of."""
_SLOW = 0.2
"""No joint's temperature follows faster; readings come in steps [Hz]."""
_CLEARLY = 10.0
"""Power over that of the noise at which a motion is seen well."""
_NOISE_ONLY = 0.4
"""Part of the band, from which on a position has nothing but noise."""
_SEEN, _DIFFERENCES = 2.0, 4
"""Frequency up to which a position is kept, over that up to which it is seen well; order of the differences that are small."""
_COARSE = 0.01
"""Part of the power of an acceleration below half of :data:`SMOOTHING` from which its noise matters: what is in proportion to
it comes out too small by such a part."""
_EDGE = 0.25
"""Ends of a stretch, where the filters are still in transient, are cut off [s]."""


def motions(robot: RobotModel, recording: Recording) -> list[Motion]:
    """Smooth motions of the stretches without a gap; times since the recording's first stamp.

    Stamps that repeat or run back are left out. Positions and torques go through the same even grid and the same low-pass
    forward and backward; velocity and acceleration are derivatives of the quintic spline
    through the positions. A temperature that is not known all along a stretch is NaN in all of it.
    """
    gap, recording = _gap(recording), recording.in_order()
    t, out = recording.t - recording.start, []
    for part in recording.stretches(gap):
        if part.stop - part.start > _FEWEST and t[part][-1] - t[part][0] >= SHORTEST:
            out.append(_smooth(robot, t[part], recording.q[part], recording.tau[part]))
            out[-1].recording = recording.name
            if recording.temperature is not None:
                out[-1].temperature = _along(out[-1].t, t[part], recording.temperature[part])
    return out


def longest_stretch(recording: Recording) -> float:
    """Time without a gap, of which :func:`motions` makes a motion where it is :data:`SHORTEST` or more [s]."""
    gap, recording = _gap(recording), recording.in_order()
    parts = [recording.t[part] for part in recording.stretches(gap)]
    return max((float(t[-1] - t[0]) for t in parts if len(t) > _FEWEST), default=0.0)


def _gap(recording: Recording) -> float:
    """That splits a recording [s]."""
    return max(MAX_GAP, 3.0 * recording.period)


def _smooth(robot: RobotModel, t: FloatArray, q: FloatArray, tau: FloatArray) -> Motion:
    period, n = float(np.median(np.diff(t))), q.shape[1]
    rate = 1.0 / period
    grid, even = on_even_grid(t, np.hstack([q, tau]), period)
    clear = clear_band(even[:, :n], rate)
    smooth_q, smooth_tau = np.split(as_measured(even, period), [n], axis=1)
    every = max(1, int(rate / FINEST))
    grid, smooth_q, smooth_tau = grid[::every], smooth_q[::every], smooth_tau[::every]
    smooth_q = what_is_seen(smooth_q, rate / every, np.where(is_coarse(even[:, :n], rate), clear, 0.0))
    spline = interpolate.make_interp_spline(grid, smooth_q, k=5)
    inside = slice(*np.searchsorted(grid, [grid[0] + _EDGE, grid[-1] - _EDGE]))
    v, a = (spline(grid, nu=order)[inside] for order in (1, 2))
    motion = Motion(robot, grid[inside], smooth_q[inside], v, a, smooth_tau[inside])
    motion.clear = clear
    return motion


def as_measured(x: FloatArray, period: float) -> FloatArray:
    """Columns of a channel on an even grid, through the low-pass that measured torques go through, shape (N, n)."""
    return low_passed(x, min(SMOOTHING, 0.2 / period), period)


def _along(grid: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    """Columns of slow values on a grid, without the steps of their sensors, shape (grid, n); NaN where one of a column is."""
    period = float(np.median(np.diff(grid)))
    out = np.full((len(grid), values.shape[1]), np.nan)
    for j in np.flatnonzero(np.isfinite(values).all(axis=0)):
        even = np.interp(grid, t, values[:, j])
        out[:, j] = low_passed(even, _SLOW, period, order=2, padding=1.0 / _SLOW)
    return out


def what_is_seen(q: FloatArray, rate: float, clear: FloatArray) -> FloatArray:
    """Positions on an even grid as far as they stand above the noise of their sensors, shape (N, n).

    A coarse encoder's steps are small beside the motion and, twice differentiated, large beside its acceleration: what the
    links' torque makes of them would be told as a rotor of less than no inertia. Each position gives way to the smoothest one
    near it, the least of ``sum (s - q)^2 + (rate / (2 pi f_c))^8 sum (D^4 s)^2`` (Whittaker 1923; Eilers 2003), which passes what
    is below f_c, twice the frequency up to which its motion is seen, in its ends too.

    Args:
        q: shape (N, n). rate: of the grid [Hz]. clear: as of :func:`clear_band`, shape (n,) [Hz]; 0: the position stays as it is.
    """
    out, coarse = q.copy(), np.flatnonzero((clear > 0.0) & (_SEEN * clear < SMOOTHING))
    if not coarse.size or len(q) <= 2 * _DIFFERENCES:
        return out
    D = sparse.eye(len(q), format="csr")
    for _ in range(_DIFFERENCES):
        D = D[1:] - D[:-1]
    rough = (D.T @ D).todia()
    bands = np.zeros((_DIFFERENCES + 1, len(q)))
    for k in range(_DIFFERENCES + 1):
        bands[k, : len(q) - k] = rough.diagonal(k)
    for j in coarse:
        own = bands * (rate / (2.0 * np.pi * _SEEN * clear[j])) ** (2 * _DIFFERENCES)
        own[0] += 1.0
        # about its mean, of which a matrix of so many orders of magnitude would lose digits
        out[:, j] = q[:, j].mean() + linalg.solveh_banded(own, q[:, j] - q[:, j].mean(), lower=True)
    return out


def is_coarse(q: FloatArray, rate: float) -> NDArray[np.bool_]:
    """Whether the noise of each position on an even grid is a part of its acceleration that biases what is fitted to it, (n,).

    Args:
        q: raw positions, shape (N, n). rate: of the grid [Hz].
    """
    f, mean, noise = _spectrum(q, rate)
    twice = np.where(f < 0.5 * SMOOTHING, (2.0 * np.pi * f) ** 4, 0.0)
    return np.asarray(twice.sum() * noise > _COARSE * (twice @ mean))


def clear_band(q: FloatArray, rate: float) -> FloatArray:
    """Frequency up to which each position on an even grid stands clearly above the noise of its sensor, shape (n,) [Hz].

    Accelerations beyond it are noise that two differences have made large.

    Args:
        q: raw positions, shape (N, n). rate: of the grid [Hz].
    """
    f, mean, noise = _spectrum(q, rate)
    out = np.full(q.shape[1], 0.5 * rate)
    for j in range(q.shape[1]):
        above = np.flatnonzero(mean[:, j] > _CLEARLY * noise[j])
        out[j] = f[above[-1]] if above.size else 0.0
    return out


def _spectrum(q: FloatArray, rate: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Frequencies, shape (F,) [Hz], power of each position in a hertz about them, shape (F, n), and that of its noise, (n,)."""
    # a record that does not begin and end at rest would spread over all frequencies
    rest = signal.detrend(q, axis=0) * signal.windows.hann(len(q))[:, None]
    power = np.abs(fft.rfft(rest, axis=0)) ** 2
    f = fft.rfftfreq(len(q), 1.0 / rate)
    noise = np.mean(power[f > _NOISE_ONLY * 0.5 * rate], axis=0)
    width = max(1, int(np.searchsorted(f, 1.0)))
    mean = np.apply_along_axis(np.convolve, 0, power, np.ones(width) / width, "same")
    return f, mean, noise
