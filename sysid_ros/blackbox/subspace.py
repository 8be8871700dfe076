"""Subspace: a linear state-space model of recordings, its order, and how sure its modes are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.blackbox.black_box import BlackBox
from sysid_ros.blackbox.blocks import blocks_of, prediction_error
from sysid_ros.blackbox.moments import Moments
from sysid_ros.blackbox.series import Channels, Series
from sysid_ros.blackbox.state_space import StateSpace
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.sample import FloatArray

CRITERIA = ("heldout", "bic", "aic", "singular_values")
_FOLDS = 4
_BLOCKS = 32
_PASTS = (6, 10, 15, 20, 30, 40, 60, 80)
"""Steps of the past that are tried."""
_MORE = 1.5
_LEAST_GAIN = 0.01
"""Part of the held-out error by which a higher order must be better, and by one standard error (Breiman et al. 1984)."""


@dataclass(frozen=True, eq=False)
class OrderChoice:
    """What speaks for which order; arrays have shape (orders,).

    Attributes:
        orders: that were tried. singular_values: of past to future, over the largest, shape (k,).
        aic, bic: Akaike's and Schwarz's criterion of the one-step innovations. heldout, heldout_std: error of predictions over
            the length of the past on blocks that were not fitted, over that of order 0, and the standard error of its mean over
            the folds. chosen: the order by each criterion of :data:`CRITERIA`.
    """

    orders: tuple[int, ...]
    singular_values: FloatArray
    aic: FloatArray
    bic: FloatArray
    heldout: FloatArray
    heldout_std: FloatArray
    chosen: dict[str, int]


class Subspace(BlackBox):
    """Subspace identification, see :mod:`.moments`.

    Args:
        order: number of states; 0 lets ``criterion`` choose. past: steps of the past p; 0 lets :func:`long_enough` choose.
            weights: one of :data:`~sysid_ros.blackbox.moments.WEIGHTS`. future: steps of the future; 0 for half the past.
        highest: highest order that is tried. criterion: one of :data:`CRITERIA`.
        feedthrough: whether outputs may answer within the step.
    """

    def __init__(
        self,
        order: int = 0,
        past: int = 0,
        weights: str = "pbsid",
        future: int = 0,
        highest: int = 10,
        criterion: str = "heldout",
        feedthrough: bool = True,
        channels: Channels | None = None,
    ) -> None:
        super().__init__(channels)
        if criterion not in CRITERIA:
            raise SettingsError(f"the criterion is {criterion!r}; it must be one of {', '.join(CRITERIA)}.")
        if order < 0 or past < 0 or past == 1 or highest < 1:
            raise SettingsError(f"order {order}, past {past}, highest {highest}: the least allowed are 0, 2 (or 0) and 1.")
        self._wanted, self._past, self._future, self._highest = order, past, future, highest
        self._weights, self._criterion, self._feedthrough = weights, criterion, feedthrough
        self._model: StateSpace | None = None
        self._mean_u: FloatArray = np.zeros(0)
        self._mean_y: FloatArray = np.zeros(0)
        self.choice: OrderChoice | None = None
        """Of the order, where it was chosen."""
        self.singular_values: FloatArray = np.zeros(0)
        """Of past to future, over the largest."""
        self.blocks: FloatArray = np.zeros((0, 0, 0))
        """Moments of blocks of the fitted series, shape (b, w, w)."""
        self.moments: Moments | None = None
        """That the blocks are of."""

    @property
    def period(self) -> float:
        return self._model.period if self._model else 0.0

    @property
    def order(self) -> int:
        return self.as_state_space().order

    def as_state_space(self) -> StateSpace:
        self.require_fitted()
        assert self._model is not None
        return self._model

    def fit_series(self, series: Sequence[Series]) -> None:
        m, p = series[0].u.shape[1], series[0].y.shape[1]
        self._mean_u = np.mean(np.concatenate([s.u for s in series]), axis=0)
        self._mean_y = np.mean(np.concatenate([s.y for s in series]), axis=0)
        centred = [self._centred(s) for s in series]
        past = self._past or long_enough(centred)
        self.moments = moments = Moments(past, m, p, self._weights, self._future, self._feedthrough)
        blocks, pieces = blocks_of(centred, moments, _BLOCKS)
        if not len(pieces) or sum(len(s) for s in series) < 3 * (m + p) * past:
            raise DataError(
                f"{series[0].name or 'the series'}: {sum(len(s) for s in series)} rows are too few for a past of {past} "
                f"steps of {m + p} channels; {3 * (m + p) * past} are needed, without a gap."
            )
        rows = _windows(pieces, moments)
        self.blocks = blocks
        order = self._wanted
        if not order:
            self.choice = choose_order(moments, blocks, pieces, range(min(self._highest, moments.most) + 1), series[0].period)
            order = self.choice.chosen[self._criterion]
        elif order > moments.most:
            raise SettingsError(f"the order is {order}; with a past of {past} steps it can be {moments.most} at most.")
        (found,) = moments.models(blocks.sum(axis=0), [order], series[0].period, rows)
        self._model, self.singular_values = found[0], found[1] / max(float(found[1][0]), 1e-300)

    def predict_series(self, series: Series) -> FloatArray:
        model, s = self.as_state_space(), self._centred(series)
        first = slice(0, min(len(s), max(2 * model.past, 3 * model.order)))
        x = model.first_state(s.u[first], s.y[first])
        return np.asarray(model.simulate(s.u, x) + self._mean_y)

    def _centred(self, s: Series) -> Series:
        return Series(s.u - self._mean_u, s.y - self._mean_y, s.period, s.name, s.start)


def choose_order(
    moments: Moments, blocks: FloatArray, pieces: Sequence[Series], orders: Sequence[int], period: float
) -> OrderChoice:
    """Every criterion on the same blocks.

    Args:
        blocks: moments, shape (b, w, w). pieces: their rows. orders: to try, from 0.

    Raises:
        DataError: there are too few blocks to leave some out.
    """
    if len(blocks) < 2 * _FOLDS:
        raise DataError(
            f"the recordings make {len(blocks)} blocks of three pasts; {2 * _FOLDS} are needed to leave some out. "
            "Give the order, or record for longer."
        )
    orders, m, p = list(orders), moments.inputs, moments.outputs
    rows = _windows(pieces, moments)
    found = moments.models(blocks.sum(axis=0), orders, period, rows)
    free = np.array([n * (m + 2 * p) + m * p for n in orders], dtype=float)
    deviance = np.array([rows * float(np.linalg.slogdet(model.noise)[1]) for model, _ in found])
    errors = np.zeros((_FOLDS, len(orders)))
    for fold in range(_FOLDS):
        own = np.arange(len(blocks)) % _FOLDS == fold
        held = [piece for piece, here in zip(pieces, own, strict=True) if here]
        fitted = moments.models(blocks[~own].sum(axis=0), orders, period, rows)
        errors[fold] = [prediction_error(model, held, moments.p) for model, _ in fitted]
    errors /= max(float(errors[:, 0].mean()), 1e-300)
    values = found[0][1] / max(float(found[0][1][0]), 1e-300)
    aic, bic = deviance + 2.0 * free, deviance + np.log(max(rows, 2.0)) * free
    chosen = {
        "heldout": orders[_simplest(errors)],
        "bic": orders[int(np.argmin(bic))],
        "aic": orders[int(np.argmin(aic))],
        "singular_values": _gap(values, max(orders)),
    }
    return OrderChoice(
        tuple(orders), values, aic, bic, errors.mean(axis=0), np.std(errors, axis=0, ddof=1) / np.sqrt(_FOLDS), chosen
    )


def long_enough(series: Sequence[Series]) -> int:
    """Steps of the past that predict the next step best by Akaike's criterion, with half as many again: the order of a long
    autoregression, which must grow with the data for its bias to vanish (Chiuso 2007, section 4).

    Raises:
        DataError: the series are too short for the shortest past.
    """
    m, p = series[0].u.shape[1], series[0].y.shape[1]
    rows = sum(len(s) for s in series)
    longest = min(rows // (4 * (m + p)), max(len(s) for s in series) // 8)
    tried = [k for k in _PASTS if k <= longest]
    if not tried:
        raise DataError(f"{series[0].name or 'the series'}: {rows} rows are too few for a past of {_PASTS[0]} steps.")
    most = tried[-1]
    moments = Moments(most, m, p)
    G = np.sum([moments.of(s.u, s.y) for s in series], axis=0)
    G = G + 1e-9 * np.diag(np.diag(G))
    count = float(sum(max(len(s) - most, 0) for s in series))
    now, scores = most * (m + p) + m + np.arange(p), []
    for k in tried:
        known = np.arange((most - k) * (m + p), most * (m + p) + m)
        left = G[np.ix_(now, now)] - G[np.ix_(now, known)] @ np.linalg.solve(G[np.ix_(known, known)], G[np.ix_(known, now)])
        scores.append(count * float(np.linalg.slogdet(left / count)[1]) + 2.0 * p * len(known))
    return int(min(round(_MORE * tried[int(np.argmin(scores))]), longest))


def _windows(pieces: Sequence[Series], moments: Moments) -> float:
    return float(sum(max(len(s) - moments.window + 1, 0) for s in pieces))


def _simplest(errors: FloatArray) -> int:
    """The first of the columns that is as good as the best one within a standard error, of errors of shape (folds, c)."""
    total = errors.sum(axis=0)
    best = int(np.argmin(total))
    for i in range(best):
        apart = errors[:, i] - errors[:, best]
        if apart.sum() < max(float(np.std(apart)) * np.sqrt(len(errors)), _LEAST_GAIN * total[best]):
            return i
    return best


def _gap(values: FloatArray, highest: int) -> int:
    """The order after which singular values fall most, by their ratio."""
    kept = np.maximum(values[: highest + 1], 1e-12)
    return int(np.argmax(kept[:-1] / kept[1:])) + 1 if len(kept) > 1 else len(kept)
