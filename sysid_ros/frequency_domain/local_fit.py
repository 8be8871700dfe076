"""The frequency response by local polynomials: on a few neighbouring lines, response and transient are smooth.

Pintelon, Schoukens 2012, chapter 7 (after Schoukens, Vandersteen, Barbe, Pintelon 2009)::

    Y(k) = [g0 + g1 r + g2 r^2] U(k) + (d0 + d1 r) D(k) + [t0 + t1 r + t2 r^2] + noise,      r = (f_k - f0) / half width

by least squares over the lines of a window; g is shared by all records, each record that is not a whole number of periods has its
own t, each with dry friction D its own d. What is left gives the variance of the noise, so no model of it is needed and it may
have any colour that is smooth. A window of its own for every frequency: neighbouring results are independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.frequency_domain.lines import ComplexArray, Record
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray

_ORDERS = (2, 1, 0)
_CONDITION = 1e4
_AROUND = 2
"""Windows on each side that the noise of a window is averaged with: a few degrees of freedom make a poor weight."""


@dataclass(frozen=True, eq=False)
class Window:
    """The response on one window.

    Attributes:
        f: in its middle [Hz]. low, high: its ends [Hz].
        H: response there. variance: E|error of H|^2, shape (). freedom: complex degrees of freedom of the variance.
        noise: variance of a line of Y, E|noise|^2 [(N m)^2]. coherence: part of Y's power that follows U, 0 to 1.
        input_noise: part of U's power that is noise.
        lines: for each record the indices of its lines; empty where it has none there.
        clear: whether the input stands above its noise, so that the response can be estimated.
        share: of the input in the root mean square of the sum of input and dry friction.
    """

    f: float
    low: float
    high: float
    H: complex
    variance: float
    freedom: float
    noise: float
    coherence: float
    input_noise: float
    lines: tuple[NDArray[np.intp], ...]
    clear: bool
    share: float = 1.0

    @property
    def radius(self) -> float:
        """Of the circle that holds H with 95 %: ``|error|^2 / variance`` is F-distributed with 2 and 2 nu degrees of freedom."""
        return float(np.sqrt(self.variance * circular_quantile(self.freedom)))


def circular_quantile(freedom: float, level: float = TOLERANCES.level) -> float:
    """Quantile of F(2, 2 nu): nu ((1 - level)^(-1/nu) - 1)."""
    return float(freedom * ((1.0 - level) ** (-1.0 / freedom) - 1.0))


def local_fit(records: Sequence[Record], top_hz: float) -> list[Window]:
    """Windows side by side from the first lines to ``top_hz``."""
    if not records:
        return []
    spacing = [r.spacing for r in records]
    density = sum(1.0 / s for s in spacing)
    # what a record needs beside the response costs lines
    unknowns = 3 + sum(_beside(r) for r in records)
    least = (unknowns + TOLERANCES.spare) / density
    low = min(float(r.f[0]) for r in records) - 0.5 * min(spacing)
    out = []
    while low < top_hz:
        high = low + max(least, TOLERANCES.width * low)
        lines = tuple(np.flatnonzero((r.f >= low) & (r.f < high)) for r in records)
        if sum(len(i) for i in lines) < unknowns + TOLERANCES.spare - 1 and high >= top_hz:
            break
        window = _fit(records, lines, low, high)
        if window is not None:
            out.append(window)
        low = high
    return out


def _beside(record: Record) -> int:
    """Complex unknowns of a record in a window beside the response."""
    return (3 if record.transient else 0) + (0 if record.D is None else record.D.shape[1] + 1)


def enough(record: Record, count: int) -> bool:
    """Whether so many lines of a record in a window tell anything."""
    return count > _beside(record)


def beside_basis(record: Record, here: NDArray[np.intp], middle: float, half: float) -> ComplexArray | None:
    """What a transient and dry friction can make of some lines of a record, orthonormal, shape (K, b); None where b is 0."""
    r: FloatArray = ((record.f[here] - middle) / half)[:, None]
    columns = []
    if record.transient:
        columns.append((r ** np.arange(3)).astype(complex))
    if record.D is not None:
        dry = np.hstack([record.D[here], record.D[here, :1] * r])
        columns.append(dry / np.maximum(np.max(np.abs(dry), axis=0), 1e-300))
    if not columns:
        return None
    left, size, _ = np.linalg.svd(np.concatenate(columns, axis=1), full_matrices=False)
    return np.asarray(left[:, size > 1e-6 * size[0]])


def _without(x: ComplexArray, basis: ComplexArray | None) -> ComplexArray:
    return x if basis is None else np.asarray(x - basis @ (basis.conj().T @ x))


def _fit(records: Sequence[Record], lines: tuple[NDArray[np.intp], ...], low: float, high: float) -> Window | None:
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    inputs: list[ComplexArray] = []
    outputs: list[ComplexArray] = []
    noise, freedom, smooth, dry = 0.0, 0.0, 0.0, 0.0
    for record, here in zip(records, lines, strict=True):
        if not enough(record, len(here)):
            continue
        position = (record.f[here] - middle) / half
        powers: FloatArray = position[:, None] ** np.arange(3)
        columns = np.asarray(record.U[here][:, None] * powers)
        basis = beside_basis(record, here, middle, half)
        own = len(here) - (0 if basis is None else basis.shape[1])
        freedom += own
        smooth += float(np.sum(np.abs(record.U[here]) ** 2))
        dry += 0.0 if record.D is None else float(np.sum(np.abs(record.D[here, 0]) ** 2))
        inputs.append(_without(columns, basis))
        outputs.append(_without(record.Y[here], basis))
        noise += float(np.sum(record.input_noise[here])) * own / len(here)
    if not inputs:
        return None
    X, Y = np.concatenate(inputs), np.concatenate(outputs)
    power = float(np.sum(np.abs(X[:, 0]) ** 2))
    if power <= 0.0:
        return None
    part, share = noise / power, float(np.sqrt(smooth / (smooth + dry)))
    for order in _ORDERS:
        used = X[:, : order + 1]
        nu = freedom - (order + 1)
        if nu < 2.0:
            continue
        singular = np.linalg.svd(used, compute_uv=False)
        if singular[-1] * _CONDITION < singular[0]:
            continue
        inverse = np.linalg.pinv(used)
        g = inverse @ Y
        rest = Y - used @ g
        s2 = float(np.sum(np.abs(rest) ** 2)) / nu
        unexplained = s2 * freedom / max(float(np.sum(np.abs(Y) ** 2)), 1e-300)
        factor = 1.0 / max(1.0 - part, 1.0 - TOLERANCES.input_noise)
        return Window(
            middle,
            low,
            high,
            complex(g[0]) * factor,
            s2 * float(np.sum(np.abs(inverse[0]) ** 2)) * factor**2,
            nu,
            s2,
            float(np.clip(1.0 - unexplained, 0.0, 1.0)),
            part,
            lines,
            part < TOLERANCES.input_noise,
            share,
        )
    return None


def smoothed_noise(windows: Sequence[Window]) -> FloatArray:
    """Noise variance of each window, smoothed along its neighbours: a straight line of logarithms over logarithms.

    The mean logarithm of a variance with nu complex degrees of freedom is low by 1 / (2 nu) + 1 / (12 nu^2).
    """
    nu = np.array([w.freedom for w in windows])
    logs = np.log([max(w.noise, 1e-300) for w in windows]) + 0.5 / nu + 1.0 / (12.0 * nu**2)
    at = np.log([w.f for w in windows])
    count = len(windows)
    out = np.empty(count)
    for i in range(count):
        first = int(np.clip(i - _AROUND, 0, max(count - 2 * _AROUND - 1, 0)))
        near = slice(first, first + 2 * _AROUND + 1)
        x = at[near] - at[i]
        columns = np.stack([np.ones_like(x), x], axis=1)[:, : 2 if len(x) > 3 else 1]
        out[i] = np.linalg.lstsq(columns, logs[near], rcond=None)[0][0]
    return np.exp(out)
