"""Koopman: a linear model of functions of the state (DMD with control, EDMD), and how long it can be believed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sysid_ros.blackbox.black_box import BlackBox
from sysid_ros.blackbox.dictionary import Dictionary, linear
from sysid_ros.blackbox.series import Channels, Series
from sysid_ros.blackbox.state_space import StateSpace
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.sample import FloatArray

_RIDGES = (0.0, *np.logspace(-9, -1, 5))
"""That are tried, of functions over their spread; a part of the number of rows."""
_FOLDS = 4
_STEPS = 50
"""Of the predictions that the ridge is judged by."""
_STARTS = 12
_RAN_AWAY = 1e6
"""Standard deviations of the outputs from which a prediction has run away and stays where it is."""
_SURE = 0.9


@dataclass(frozen=True, eq=False)
class _Map:
    """``psi(k+1) = F [psi(k), u(k)]`` of functions over their spread."""

    F: FloatArray
    scale: FloatArray


class Koopman(BlackBox):
    """``psi(s(k+1)) = A psi(s(k)) + B u(k)``, y(k) the first entries of s(k).

    EDMD of Williams, Kevrekidis, Rowley 2015, with inputs as Korda, Mezic 2018.

    s(k) holds the outputs and, with delays, those and the inputs of the steps before. The ridge, and whether functions are
    computed anew from the predicted state at every step ("relift", no longer a linear model), are those that predict stretches
    that were not fitted best.

    Args:
        dictionary: functions of s; none is DMD with control. delays: steps in s, 1 for the present one alone.
        ridge, relift: fixed; None chooses. steps: of the predictions that choose.
    """

    def __init__(
        self,
        dictionary: Dictionary | None = None,
        delays: int = 1,
        ridge: float | None = None,
        relift: bool | None = None,
        steps: int = _STEPS,
        channels: Channels | None = None,
    ) -> None:
        super().__init__(channels)
        if delays < 1 or steps < 1 or (ridge is not None and ridge < 0.0):
            raise SettingsError(f"delays {delays}, steps {steps}, ridge {ridge}: the least allowed are 1, 1 and 0.")
        self.dictionary, self.delays, self.steps = dictionary or linear(), delays, steps
        self.ridge, self.relift = ridge, relift
        self.heldout = float("nan")
        """Root mean square error of predictions of left-out stretches, over the spread of the outputs."""
        self._map: _Map | None = None
        self._period = 0.0
        self._shape = (0, 0)
        self._spread: FloatArray = np.zeros(0)

    @property
    def period(self) -> float:
        return self._period

    @property
    def order(self) -> int:
        self.require_fitted()
        assert self._map is not None
        return len(self._map.F)

    def as_state_space(self) -> StateSpace | None:
        """Of the functions as states; None where they are computed anew at every step."""
        self.require_fitted()
        assert self._map is not None
        if self.relift:
            return None
        n, (m, p) = self.order, self._shape
        F = self._map.F * self._map.scale[:n, None] / self._map.scale
        A, B = F[:, :n], F[:, n:]
        C = np.zeros((p, n))
        C[:, :p] = np.eye(p)
        return StateSpace(A, B, C, np.zeros((p, m)), np.zeros((n, p)), self._period, np.zeros((n, 0)), np.zeros((p, p)))

    def fit_series(self, series: Sequence[Series]) -> None:
        self._period, self._shape = series[0].period, (series[0].u.shape[1], series[0].y.shape[1])
        self._spread = np.maximum(np.std(np.concatenate([s.y for s in series]), axis=0), 1e-12)
        pieces = _pieces([s for s in series if len(s) > self.delays + 1], self.delays)
        if len(pieces) < _FOLDS:
            raise DataError(f"the series have {len(pieces)} stretches of {2 * self.delays + 8} rows; {_FOLDS} are needed.")
        rows = [self._rows(s) for s in pieces]
        now, then = np.concatenate([a for a, _ in rows]), np.concatenate([b for _, b in rows])
        scale = np.maximum(np.sqrt(np.mean(now**2, axis=0)), 1e-12)
        count = then.shape[1]
        sums = [
            (a.T @ a / np.outer(scale, scale), a.T @ b / np.outer(scale, scale[:count])) for a, b in ((x, y) for x, y in rows)
        ]
        fold = np.arange(len(pieces)) % _FOLDS
        ridges = _RIDGES if self.ridge is None else (self.ridge,)
        own_ways = (False, True) if then.shape[1] > self._state_size + 1 else (False,)
        ways = own_ways if self.relift is None else (self.relift,)
        best = (np.inf, ridges[0], ways[0])
        for ridge in ridges:
            left_out = [_solve([s for s, k in zip(sums, fold, strict=True) if k != f], ridge, scale) for f in range(_FOLDS)]
            for way in ways:
                error = self._error(left_out, pieces, fold, way)
                best = min(best, (error, ridge, way), key=lambda x: x[0])
        self.heldout, self.ridge, self.relift = float(np.sqrt(best[0])), float(best[1]), best[2]
        self._map = _solve(sums, self.ridge, scale)

    def predict_series(self, series: Series) -> FloatArray:
        """The first ``delays`` rows are what was measured."""
        self.require_fitted()
        assert self._map is not None
        d = self.delays
        out = self._run(self._map, series.y[None, :d], series.u[None], bool(self.relift))
        return np.concatenate([series.y[:d], out[0]])[: len(series)]

    def predictions(self, series: Series, starts: NDArray[np.intp], steps: int) -> tuple[FloatArray, FloatArray]:
        """Outputs predicted from some rows on and measured ones, shape (starts, steps, p) each.

        Args:
            starts: first rows that are predicted, from ``delays`` to the length less ``steps``, shape (s,).
        """
        self.require_fitted()
        assert self._map is not None
        at = np.asarray(starts, dtype=int)[:, None]
        d = self.delays
        before = series.y[at + np.arange(-d, 0)]
        inputs = series.u[at + np.arange(-d, steps)]
        return self._run(self._map, before, inputs, bool(self.relift)), series.y[at + np.arange(steps)]

    @property
    def _state_size(self) -> int:
        return self.delays * self._shape[1] + (self.delays - 1) * self._shape[0]

    def _rows(self, s: Series) -> tuple[FloatArray, FloatArray]:
        """[psi(k), u(k)] and psi(k+1), of all steps."""
        d = self.delays
        state = np.column_stack(
            [*(s.y[d - 1 - i : len(s) - i] for i in range(d)), *(s.u[d - 1 - i : len(s) - i] for i in range(1, d))]
        )
        psi = self.dictionary(state)
        return np.column_stack([psi[:-1], s.u[d - 1 : len(s) - 1]]), psi[1:]

    def _run(self, found: _Map, before: FloatArray, u: FloatArray, relift: bool) -> FloatArray:
        """Outputs, shape (b, N - d, p), after d rows, shape (b, d, p), with inputs from those rows on, shape (b, N, m)."""
        d, p = self.delays, before.shape[2]
        state = np.concatenate([*(before[:, d - 1 - i] for i in range(d)), *(u[:, d - 1 - i] for i in range(1, d))], axis=1)
        limit = _RAN_AWAY * self._spread
        psi = self.dictionary(state)
        out = np.empty((len(before), u.shape[1] - d, p))
        F = (found.F * found.scale[: psi.shape[1], None]) / found.scale
        for k in range(out.shape[1]):
            now = u[:, d - 1 + k]
            psi = np.column_stack([psi, now]) @ F.T
            y = np.clip(np.nan_to_num(psi[:, :p], nan=np.inf), -limit, limit)  # inf - inf has run away too
            out[:, k] = y
            if relift:
                older_u = state[:, d * p :]
                state = np.column_stack(
                    [y, state[:, : (d - 1) * p], *([now, older_u[:, : -u.shape[2] or None]] if d > 1 else [])]
                )
                state = state[:, : d * p + (d - 1) * u.shape[2]]
                psi = self.dictionary(state)
            else:
                psi = np.clip(np.nan_to_num(psi, nan=np.inf), -1e12, 1e12)
        return out

    def _error(self, found: Sequence[_Map], pieces: Sequence[Series], fold: NDArray[np.intp], relift: bool) -> float:
        """Mean squared error over the outputs' spread of the pieces, each predicted by the model without it."""
        total, count = 0.0, 0
        steps = min(self.steps, *(len(s) - self.delays - 1 for s in pieces))
        back, on = np.arange(-self.delays, 0), np.arange(-self.delays, steps)
        for f in range(_FOLDS):
            before, inputs, then = [], [], []
            for s in (s for s, k in zip(pieces, fold, strict=True) if k == f):
                at = np.linspace(self.delays, len(s) - steps, min(_STARTS, len(s) - steps - self.delays + 1)).astype(int)[:, None]
                before.append(s.y[at + back])
                inputs.append(s.u[at + on])
                then.append(s.y[at + np.arange(steps)])
            made = self._run(found[f], np.concatenate(before), np.concatenate(inputs), relift)
            rest = (made - np.concatenate(then)) / self._spread
            total += float(np.sum(np.minimum(rest**2, _RAN_AWAY)))
            count += rest.size
        return total / max(count, 1)


def _pieces(series: Sequence[Series], delays: int) -> list[Series]:
    """Series as they are where there are many, else cut up."""
    if len(series) >= 2 * _FOLDS:
        return list(series)
    out = []
    for s in series:
        parts = max(1, min(2 * _FOLDS, len(s) // (2 * delays + 8)))
        edges = np.linspace(0, len(s), parts + 1).astype(int)
        out += [s.rows(slice(int(a), int(b))) for a, b in pairwise(edges)]
    return out


def _solve(sums: Sequence[tuple[FloatArray, FloatArray]], ridge: float, scale: FloatArray) -> _Map:
    """Ridge regression from sums of products."""
    G, H = np.sum([g for g, _ in sums], axis=0), np.sum([h for _, h in sums], axis=0)
    weight = ridge * float(np.trace(G)) / len(G) + 1e-13 * float(np.trace(G))
    F = np.linalg.solve(G + weight * np.eye(len(G)), H).T
    return _Map(np.asarray(F), scale)


@dataclass(frozen=True, eq=False)
class Horizon:
    """For how long a model can be believed.

    Attributes:
        seconds, steps: the longest time over which predictions stay within ``band`` in nine of ten starts, so that no more than
            one such statement in ten is too long; 0 where none is. band: largest error of any output, shape (p,).
        within: part of the starts that are within the band up to each step, shape (steps,). starts: their number.
        passes: first step at which the root mean square error exceeds that of another model [s]; None where it does not.
    """

    seconds: float
    steps: int
    band: FloatArray
    within: FloatArray
    starts: int
    passes: float | None


def horizon(
    errors: FloatArray, band: FloatArray, period: float, independent: int | None = None, others: FloatArray | None = None
) -> Horizon:
    """How long errors stay within a band, with the certainty that the number of starts allows (Clopper, Pearson 1934).

    Args:
        errors: of predictions of what was not fitted, shape (starts, steps, p). band: shape (p,). period: of a step [s].
        independent: how many starts are independent; None: all. others: errors of another model from the same starts.
    """
    inside = np.logical_and.accumulate(np.all(np.abs(errors) <= band, axis=2), axis=1)
    within = inside.mean(axis=0)
    count = independent or len(errors)
    least = np.array([stats.beta.ppf(1.0 - _SURE, k, count - k + 1) if k > 0 else 0.0 for k in within * count])
    good = np.flatnonzero(np.logical_and.accumulate(least >= _SURE))
    steps = int(good[-1]) + 1 if good.size else 0
    passes = None
    if others is not None:
        own, other = (np.sqrt(np.mean((e / band) ** 2, axis=(0, 2))) for e in (errors, others))
        over = np.flatnonzero(own > other)
        passes = float((over[0] + 1) * period) if over.size else None
    return Horizon(steps * period, steps, band, within, len(errors), passes)
