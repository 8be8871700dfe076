"""Faults that are seen without any dynamics: a velocity that the driver has filtered, efforts in coarse steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft, interpolate, optimize, signal

from sysid_ros.diagnosis.evidence import Evidence
from sysid_ros.diagnosis.sets.block_scatter import scatter_ratios
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.whittle import Noise

_BAND = 12.0
_LEAST_LAG = 1.5e-3
_PAYS = 0.3
_MOVES = 0.05
_SEGMENT = 2.0
"""Length of the stretches whose coefficients are compared [s]."""
_FLAT = 0.8
"""Part of the band in which its filter leaves the noise as it is."""
_END = 0.5
"""Left out at both ends [s]."""
_ROUNDS = 4
_PROBE = 0.02
_LATTICE = 0.02
_COARSE = 1.2


@dataclass(frozen=True)
class Lag:
    """First-order low-pass on the published velocity: cutoff and its standard deviation [Hz], and the part of the difference
    between published and true velocity that it explains; the evidence is against a velocity that is not filtered."""

    cutoff: float
    std: float
    share: float
    evidence: Evidence


@dataclass(frozen=True, eq=False)
class _Velocities:
    """Velocities of one recording in the same band on an even grid, shape (N, n) each: true ones, differences of messages,
    published ones; spacing [s] and upper end of the band [Hz]."""

    true: FloatArray
    differences: FloatArray
    published: FloatArray
    period: float
    edge: float

    @property
    def inner(self) -> slice:
        """Without the ends, where filters have no past or no future."""
        cut = round(_END / self.period)
        return slice(cut, -cut)

    def rows(self, values: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Frequencies (k,) and coefficients (k, n) of values (N, n) in each stretch of time."""
        out = []
        inner = values[self.inner]
        for part in np.array_split(inner, max(1, round(len(inner) * self.period / _SEGMENT))):
            count = int(2.0 * _FLAT * self.edge * len(part) * self.period)
            out.append((np.arange(count) / (2.0 * len(part) * self.period), fft.dct(part, axis=0, norm="ortho")[:count]))
        return out


def velocity_lag(recordings: Sequence[Recording]) -> Lag | None:
    """The low-pass that the published velocity went through, where there is one.

    A velocity that is the difference of two messages, ``(q(t) - q(t - T)) / T``, is late too, by half of T, and no low-pass.
    """
    parts = [p for r in recordings if (p := _velocities(r)) is not None]
    if not parts:
        return None

    def left(tau: float) -> float:
        return float(sum(np.sum((_lagged(p.true, tau, p.period) - p.published)[p.inner] ** 2) for p in parts))

    found = optimize.minimize_scalar(lambda x: left(float(np.exp(x))), bounds=(np.log(2e-4), np.log(0.3)), method="bounded")
    tau = float(np.exp(found.x))
    without = min(left(0.0), float(sum(np.sum((p.differences - p.published)[p.inner] ** 2) for p in parts)))
    share = 1.0 - left(tau) / max(without, 1e-30)
    if tau < _LEAST_LAG or share < _PAYS:
        return None
    return _measured(parts, float(found.x), share)


def _measured(parts: Sequence[_Velocities], log_tau: float, share: float) -> Lag:
    """The likeliest lag near one, in coefficients that are nearly independent, each weighted by the noise of its frequency.

    The driver's filter may be late or early by up to half a sample, depending on how it was discretised: that is a parameter of
    its own, of which as much is known before any data.
    """
    prior = np.array([0.0, (1.96 / (0.5 * max(p.period for p in parts))) ** 2])
    x = np.array([log_tau, 0.0])
    stretch = np.concatenate([np.full(len(f), i) for i, (f, _) in enumerate(_rows(parts, [p.true for p in parts]))])
    for _ in range(_ROUNDS):
        f, residual = _stacked(parts, [p.published - y for p, y in zip(parts, _models(parts, x), strict=True)])
        weight = 1.0 / Noise.of(f, residual**2).variance(f)
        columns = []
        for step in (np.array([_PROBE, 0.0]), np.array([0.0, 0.1 / np.sqrt(prior[1])])):
            sides = [_models(parts, x + s) for s in (step, -step)]
            slope = [(a - b) / (2.0 * step.sum()) for a, b in zip(*sides, strict=True)]
            columns.append(_stacked(parts, slope)[1])
        J = np.stack(columns, axis=-1)
        each = np.einsum("kja,kj,kjb->kab", J, weight, J)
        information = each.sum(axis=0) + np.diag(prior)
        inverse = np.linalg.inv(information)
        scores = np.einsum("kja,kj->ka", J, weight * residual)
        x = x + inverse @ (scores.sum(axis=0) - prior * x)
    f, residual = _stacked(parts, [p.published - y for p, y in zip(parts, _models(parts, x), strict=True)])
    plain = [[p.published - p.true for p in parts], [p.published - p.differences for p in parts]]
    rise = 2.0 * (_likelihood(f, residual) - max(_likelihood(*_stacked(parts, e)) for e in plain)) - float(prior @ x**2)
    by_stretch, told = (np.stack([x[stretch == i].sum(axis=0) for i in range(stretch.max() + 1)]) for x in (scores, each))
    variance = (inverse.diagonal() * scatter_ratios(by_stretch, told, information))[0]
    cutoff = float(1.0 / (2.0 * np.pi * np.exp(x[0])))
    return Lag(cutoff, cutoff * float(np.sqrt(variance)), share, Evidence(rise, 1, float(residual.size), len(plain)))


def _models(parts: Sequence[_Velocities], x: FloatArray) -> list[FloatArray]:
    """Published velocities by the logarithm of a lag and a small delay, shape (N, n) each."""
    lagged = [_lagged(p.true, float(np.exp(x[0])), p.period) for p in parts]
    return [y - x[1] * np.gradient(y, p.period, axis=0) for p, y in zip(parts, lagged, strict=True)]


def _rows(parts: Sequence[_Velocities], values: Sequence[FloatArray]) -> list[tuple[FloatArray, FloatArray]]:
    return [rows for p, v in zip(parts, values, strict=True) for rows in p.rows(v)]


def _stacked(parts: Sequence[_Velocities], values: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Frequencies (K,) and coefficients (K, n) of all stretches."""
    f, rows = zip(*_rows(parts, values), strict=True)
    return np.concatenate(f), np.concatenate(rows)


def _likelihood(f: FloatArray, residual: FloatArray) -> float:
    return Noise.of(f, residual**2).loglik(f, residual)


def _velocities(r: Recording) -> _Velocities | None:
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
    edge = min(_BAND, rate / 5.0)
    sections = signal.butter(3, edge, fs=rate, output="sos")
    q, v = (signal.sosfiltfilt(sections, x, axis=0) for x in (q, v))
    true = interpolate.make_interp_spline(grid, q, k=5)(grid, nu=1)
    differs = np.diff(q, axis=0, prepend=q[:1]) * rate
    return _Velocities(true, differs, v, 1.0 / rate, edge)


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


@dataclass(frozen=True)
class Lattice:
    """Values ``x = x_0 + step k`` of the effort of one joint.

    Attributes:
        joint: its index. step, std: of the line of the values over their numbers k [N m]. evidence: against a continuous effort.
    """

    joint: int
    step: float
    std: float
    evidence: Evidence


def lattices(recordings: Sequence[Recording]) -> list[Lattice]:
    """The joints whose raw efforts lie on a lattice that is coarser than their noise."""
    out = []
    for j in range(recordings[0].tau.shape[1]):
        parts = [r.tau[:, j] for r in recordings]
        if step := _step(np.concatenate(parts)):
            rate = recordings[0].rate
            sections = signal.butter(4, min(30.0, rate / 5.0), "high", fs=rate, output="sos")
            fast = np.concatenate([signal.sosfiltfilt(sections, x) for x in parts])
            if step > _COARSE * float(np.std(fast)):
                out.append(lattice_of(j, parts, step, recordings[0].tau.shape[1]))
    return out


def _step(tau: FloatArray) -> float:
    """Usual gap between neighbouring values, of which all others are multiples [N m]; 0 where they are not."""
    values = np.unique(tau)
    if not 3 <= len(values) <= len(tau) // 4:
        return 0.0
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-6 * np.ptp(values)]
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    multiples = gaps / step
    off = float(np.max(np.abs(multiples - np.round(multiples))))
    return 0.0 if off > _LATTICE * max(1.0, float(multiples.max())) else step


def lattice_of(joint: int, parts: Sequence[FloatArray], step: float, candidates: int) -> Lattice:
    """The lattice of about this step through the efforts of one joint in several recordings, shape (N,) each [N m].

    Each value is judged by the one before, so that slow torques count for no more than they tell. A continuous effort moves on
    by a normal number; one on a lattice by so many steps, each number of steps as often as it was seen, and off it by what the
    values scatter about the line, or what a double can't hold.
    """
    tau = np.concatenate(parts).astype(np.longdouble)
    about = tau - tau.mean()
    k = np.round((tau - tau[0]) / step)
    about_k = k - k.mean()
    span = float(np.sum(about_k**2))
    exact = np.sum(about_k * about) / np.sum(about_k**2)
    rounding = float(np.spacing(float(np.abs(tau).max())))
    off = float(np.mean((about - exact * about_k) ** 2)) + rounding**2 / 12.0
    starts = np.cumsum([0, *(len(x) for x in parts[:-1])])
    moved, steps = (np.delete(np.diff(x), starts[1:] - 1) for x in (tau, k))
    continuous = 0.5 * np.log(max(float(np.mean(moved**2)), off)) * len(steps)
    times = np.unique(steps, return_counts=True)[1]
    on_lattice = 0.5 * np.log(off) * len(steps) - float(np.sum(times * np.log(times / len(steps))))
    # the step, what the values scatter, and how often each number of steps is, against one variance
    evidence = Evidence(2.0 * float(continuous - on_lattice), len(times) + 1, float(len(steps)), candidates)
    return Lattice(joint, float(exact), float(np.sqrt(off / span + float(np.spacing(float(exact))) ** 2)), evidence)
