"""Faults that need no dynamics to be seen: a filtered velocity, an effort in coarse steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import interpolate, optimize, signal

from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

_BAND = 12.0
_LEAST_LAG = 1.5e-3
_PAYS = 0.3
_MOVES = 0.05
_LATTICE = 0.02
_COARSE = 1.2


@dataclass(frozen=True)
class Lag:
    """First-order low-pass on the published velocity: cutoff and its standard deviation [Hz], and the part of the difference
    between published and true velocity that it explains."""

    cutoff: float
    std: float
    share: float


def velocity_lag(recordings: Sequence[Recording]) -> Lag | None:
    """The low-pass that the published velocity went through, where there is one.

    A velocity that is the difference of two messages, ``(q(t) - q(t - T)) / T``, is late too, by half of T, and no low-pass.
    """
    pairs = [p for r in recordings if (p := _velocities(r)) is not None]
    if not pairs:
        return None

    def left(tau: float) -> float:
        return float(sum(np.sum((_lagged(true, tau, period) - published) ** 2) for true, _, published, period in pairs))

    found = optimize.minimize_scalar(lambda x: left(float(np.exp(x))), bounds=(np.log(2e-4), np.log(0.3)), method="bounded")
    tau = float(np.exp(found.x))
    differences = float(sum(np.sum((differs - published) ** 2) for _, differs, published, _ in pairs))
    without = min(left(0.0), differences)
    share = 1.0 - left(tau) / max(without, 1e-30)
    if tau < _LEAST_LAG or share < _PAYS:
        return None
    step = 0.02 * tau
    curvature = (left(tau + step) - 2.0 * left(tau) + left(tau - step)) / step**2
    # rows below the band's edge are independent; those of the fine grid are not
    independent = sum(2.0 * _BAND * period * true.size for true, _, _, period in pairs)
    count = sum(true.size for true, _, _, _ in pairs)
    variance = 2.0 * (left(tau) / count) / max(curvature, 1e-30) * count / independent
    # by half a sample the driver's own filter may be early or late, depending on how it was discretised
    variance += (0.5 * max(period for *_, period in pairs) / 1.96) ** 2
    cutoff = 1.0 / (2.0 * np.pi * tau)
    return Lag(cutoff, float(cutoff * np.sqrt(variance) / tau), share)


def _velocities(r: Recording) -> tuple[FloatArray, FloatArray, FloatArray, float] | None:
    """True velocity, differences of messages, and published velocity in the same band, on an even grid, and its spacing [s]."""
    if r.v is None or len(r.t) < 50 or not np.isfinite(r.v).all():
        return None
    moving = np.ptp(r.q, axis=0) > _MOVES
    if np.any(np.ptp(r.v[:, moving], axis=0) == 0.0):
        return None  # never filled in
    rate = r.rate
    keep = np.concatenate([[True], np.diff(r.t) > 0.0])
    t = r.t[keep] - r.t[0]
    grid = np.arange(0.0, t[-1], 1.0 / rate)
    q = interpolate.make_interp_spline(t, r.q[keep], k=3)(grid)
    v = interpolate.make_interp_spline(t, r.v[keep], k=1)(grid)
    sections = signal.butter(3, min(_BAND, rate / 5.0), fs=rate, output="sos")
    q, v = (signal.sosfiltfilt(sections, x, axis=0) for x in (q, v))
    true = interpolate.make_interp_spline(grid, q, k=5)(grid, nu=1)
    differs = np.diff(q, axis=0, prepend=q[:1]) * rate
    edge = int(0.5 * rate)
    return true[edge:-edge], differs[edge:-edge], v[edge:-edge], 1.0 / rate


def _lagged(v: FloatArray, tau: float, period: float) -> FloatArray:
    """v through ``tau dy/dt + y = v``, exactly for a v that goes in straight lines."""
    if tau <= 0.0:
        return v
    e = np.exp(-period / tau)
    k = tau / period * (1.0 - e)
    b, a = [1.0 - k, k - e], [1.0, -e]
    start = signal.lfilter_zi(b, a)[:, None] * v[0]
    out: FloatArray = signal.lfilter(b, a, v, axis=0, zi=start)[0]
    return out


def quantisation(recordings: Sequence[Recording]) -> FloatArray:
    """Step of the lattice that the raw efforts of each joint lie on, shape (n,) [N m]; 0 where it is finer than their noise."""
    tau = np.concatenate([r.tau for r in recordings])
    steps = np.zeros(tau.shape[1])
    for j in range(tau.shape[1]):
        values = np.unique(tau[:, j])
        if not 3 <= len(values) <= len(tau) // 4:
            continue
        gaps = np.diff(values)
        gaps = gaps[gaps > 1e-6 * np.ptp(values)]
        step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
        multiples = gaps / step
        if np.max(np.abs(multiples - np.round(multiples))) > _LATTICE * max(1.0, float(multiples.max())):
            continue
        rate = recordings[0].rate
        sections = signal.butter(4, min(30.0, rate / 5.0), "high", fs=rate, output="sos")
        fast = np.concatenate([signal.sosfiltfilt(sections, r.tau[:, j]) for r in recordings])
        if step > _COARSE * float(np.std(fast)):
            steps[j] = step
    return steps
