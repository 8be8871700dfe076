"""What the figure of a payload shows, as arrays: quantities with their 95 % bands, spans of one status, limits, the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class TruthSegment:
    """The payload that was really there from ``start`` to ``end``.

    Attributes:
        start, end: stamps of the same clock as the estimates [s].
        mass: [kg]; 0 where nothing was carried.
        com: centre of mass in the estimate's frame, shape (3,) [m].
        inertia_com: inertia about the centre of mass, axes parallel to the frame, shape (3, 3) [kg m^2].
    """

    start: float
    end: float
    mass: float
    com: FloatArray
    inertia_com: FloatArray


QUANTILE = 1.96
BELIEVED = ("ok", "no_payload")
"""Statuses whose values set the limits of the axes."""
_AXES = ("x", "y", "z")
_ABOVE_NOISE = 3.0
_LEAST_MASS = 0.01
_FOUND_WITHIN = 0.3
"""Time in which an event is found: until then the estimate still tells what was before, or a mixture [s]."""

BoolArray = np.ndarray[tuple[int], np.dtype[np.bool_]]


@dataclass(frozen=True, slots=True)
class Quantity:
    """One quantity over time.

    Attributes:
        label: what it is.
        value, band: estimate and half of its 95 % interval, shape (N,); NaN where the estimate says nothing of it.
        truth: value on each truth segment, NaN where there is none.
    """

    label: str
    value: FloatArray
    band: FloatArray
    truth: tuple[float, ...]

    def at(self, index: int | None) -> str:
        """Label with value and half interval at one estimate, to two digits of the latter; the label alone where it has none."""
        if index is None or not np.isfinite(self.value[index]) or not 0.0 < self.band[index] < np.inf:
            return self.label
        decimals = max(0, 1 - math.floor(math.log10(self.band[index])))
        return f"{self.label} {self.value[index]:.{decimals}f} ± {self.band[index]:.{decimals}f}".replace("-", "−")


@dataclass(frozen=True, slots=True)
class Quantities:
    """Those that share an axis: its title, its unit and its limits."""

    title: str
    unit: str
    quantities: tuple[Quantity, ...]
    limits: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Span:
    """From ``start`` to ``end`` [s since the start] the status was ``status``."""

    start: float
    end: float
    status: str


def relative_times(series: Sequence[PayloadEstimate]) -> FloatArray:
    """Times since the first estimate, shape (N,) [s]."""
    return np.array([e.t for e in series]) - series[0].t


def longest_step(t: FloatArray) -> float:
    """A longer step between two estimates is a gap, over which no line is drawn [s]."""
    return max(0.5, 10.0 * float(np.median(np.diff(t)))) if t.size > 1 else 0.5


def status_spans(series: Sequence[PayloadEstimate]) -> list[Span]:
    """Stretches of one status; a gap in the series is left out."""
    t = relative_times(series)
    longest = longest_step(t)
    period = float(np.median(np.diff(t))) if t.size > 1 else 1.0
    spans: list[Span] = []
    start = 0
    for k in range(1, len(series) + 1):
        last = k == len(series)
        gap = not last and t[k] - t[k - 1] > longest
        if last or gap or series[k].status != series[start].status:
            spans.append(Span(float(t[start]), float(t[k - 1] + period if last or gap else t[k]), series[start].status))
            start = k
    return spans


def payload_quantities(
    series: Sequence[PayloadEstimate], truth: Sequence[TruthSegment]
) -> tuple[Quantities, Quantities, Quantities]:
    """Mass [kg], centre of mass [mm] and diagonal of the inertia about it [1e-3 kg m^2].

    Centre and inertia are ratios to the mass: they are left out (NaN) where the mass is less than three of its own standard
    deviations, and inertia also where the motion does not determine it.
    """
    believed = np.array([e.status in BELIEVED for e in series])
    mass = np.array([e.mass for e in series])
    mass_std = np.array([e.mass_std for e in series])
    there = (mass > np.maximum(_ABOVE_NOISE * mass_std, _LEAST_MASS)) & np.array([e.status != "no_payload" for e in series])
    com, com_std = np.full((2, len(series), 3), np.nan)
    inertia, inertia_std = np.full((2, len(series), 3), np.nan)
    for k in np.flatnonzero(there).tolist():
        e = series[k]
        com[k], com_std[k] = e.com, e.com_std
        known = e.observable[[4, 6, 9]]
        jacobian = inertia_diagonal_jacobian(e.theta)
        variance = np.einsum("ij,jk,ik->i", jacobian, e.covariance, jacobian)
        inertia[k, known] = np.diag(e.inertia_com)[known]
        inertia_std[k, known] = np.sqrt(np.maximum(variance[known], 0.0))
    nothing = np.full(3, np.nan)
    true_com = [s.com if s.mass > 0.0 else nothing for s in truth]
    true_inertia = [np.diag(s.inertia_com) if s.mass > 0.0 else nothing for s in truth]
    weight = Quantity("mass", mass, QUANTILE * mass_std, tuple(s.mass for s in truth))
    return (
        Quantities("Mass", "kg", (weight,), robust_limits((weight,), believed, 0.1)),
        _ratios("Centre of mass", "mm", _three("{}", com, com_std, true_com, 1e3), believed, 4.0),
        _ratios("Inertia about com", "10⁻³ kg m²", _three("I{0}{0}", inertia, inertia_std, true_inertia, 1e3), believed, 0.5),
    )


def last_known(series: Sequence[PayloadEstimate], events: Sequence[PayloadEvent]) -> int | None:
    """Index of the last estimate of status ok that no event has just overtaken, None where there is none."""
    overtaken = [(e.t, e.t + _FOUND_WITHIN) for e in events]
    for k in range(len(series) - 1, -1, -1):
        if series[k].status == "ok" and not any(start < series[k].t <= end for start, end in overtaken):
            return k
    return None


def event_text(event: PayloadEvent) -> str:
    """What an event's label says."""
    # + 0.0 makes -0.00 a plain zero
    before, after = (round(x, 2) + 0.0 for x in (event.mass_before, event.mass_after))
    return f"{event.kind} {before:.2f} → {after:.2f} kg"


def inertia_diagonal_jacobian(theta: FloatArray) -> FloatArray:
    """Derivative by theta of the inertia's diagonal about the centre of mass, shape (3, 10): ``I_xx - (mc_y^2 + mc_z^2) / m``."""
    com = theta[1:4] / theta[0]
    jacobian = np.zeros((3, 10))
    for axis, column in enumerate((4, 6, 9)):
        others = [i for i in range(3) if i != axis]
        jacobian[axis, column] = 1.0
        jacobian[axis, 0] = float(np.sum(com[others] ** 2))
        jacobian[axis, [1 + i for i in others]] = -2.0 * com[others]
    return jacobian


def robust_limits(curves: Sequence[Quantity], believed: BoolArray, least: float) -> tuple[float, float]:
    """Limits that hold what is believed with nearly all of its band, and the truth, but not the wide bands of the warm-up.

    Args:
        curves: that share the axis.
        believed: shape (N,), which estimates count; all of them where none does.
        least: smallest height of the axis.
    """
    seen: list[float] = [x for c in curves for x in c.truth if np.isfinite(x)]
    for curve in curves:
        finite = np.isfinite(curve.value) & np.isfinite(curve.band)
        use = finite & believed
        if not use.any():
            use = finite
        if use.any():
            value, band = curve.value[use], curve.band[use]
            seen += np.quantile(value, [0.02, 0.98]).tolist()
            seen += [float(np.quantile(value - band, 0.1)), float(np.quantile(value + band, 0.9))]
    if not seen:
        return -0.5 * least, 0.5 * least
    low, high = min(seen), max(seen)
    room = 0.1 * (high - low) + max(0.0, 0.5 * (least - (high - low)))
    return low - room, high + room


def _ratios(title: str, unit: str, curves: Sequence[Quantity], believed: BoolArray, least: float) -> Quantities:
    """A panel whose curves are left out where they shoot far beyond the axis: a ratio while the mass itself is changing."""
    low, high = robust_limits(curves, believed, least)
    room = 0.2 * (high - low)
    kept = []
    for curve in curves:
        far = ~((curve.value > low - room) & (curve.value < high + room))
        kept.append(replace(curve, value=np.where(far, np.nan, curve.value), band=np.where(far, np.nan, curve.band)))
    return Quantities(title, unit, tuple(kept), (low, high))


def _three(label: str, value: FloatArray, std: FloatArray, truth: Sequence[FloatArray], scale: float) -> list[Quantity]:
    return [
        Quantity(label.format(name), scale * value[:, i], scale * QUANTILE * std[:, i], tuple(float(scale * x[i]) for x in truth))
        for i, name in enumerate(_AXES)
    ]
