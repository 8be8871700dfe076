"""When what is carried changes within a bag: steps of a body's columns that explain the residual far better than chance does."""

from __future__ import annotations

import math

import numpy as np

from sysid_ros.effects.payload import COMPACT_STD
from sysid_ros.fleet.track_fit import TrackFit, fit
from sysid_ros.fleet.track_rows import DELAY, EACH, TrackRows
from sysid_ros.sample import FloatArray

_MOST = 8
"""Changes that are looked for in a bag."""
_FIRST = 4
"""Of a body's parameters: mass and first moment, which a step of a second's length shows."""
_APART = 1.0
"""Changes nearer to one another, or to an end of the bag, are not told apart [s]: a motion's start has friction like one."""
_WORTH_A_FIT = 0.05
"""Part of the residual's power that a step must explain before it is fitted, for speed: of noise alone the best of all explains
some 3 % in ten seconds, less in longer bags."""
_NOTABLE = 0.1
"""Change of twice the log-likelihood for which a time is not moved on."""


def with_changes(rows: TrackRows) -> TrackFit:
    """The fit with as many changes of the payload as the bag shows, one found after the other, each moved to its best time.

    A step is taken where twice its log-likelihood ratio exceeds the price of its parameters and of its time by the Bayesian
    information criterion (Killick, Fearnhead, Eckley 2012). The noise is that which is left with the step: without it, a
    payload that is missed for half of the bag would be noise that hides itself.
    """
    found = fit(rows)
    for _ in range(_MOST):
        gains, times = _gains(found), found.rows.rows.t - found.rows.smooth.start
        best = int(np.argmax(gains))
        if not gains[best] > _WORTH_A_FIT * float(np.sum(found.weight * found.left**2)):
            break
        bodies = found.theta[EACH * rows.n :].reshape(-1, 10)
        which = int(np.searchsorted(np.asarray(found.rows.changes), times[best], side="right"))
        changed = found.rows.changing([*found.rows.changes, float(times[best])])
        start = np.concatenate([found.theta[: EACH * rows.n], np.insert(bodies, which, bodies[which], axis=0).ravel()])
        with_step = _moved(fit(changed, start), which)
        ratio = _cost(found.Y, found.left, found, with_step.weight) - _cost(
            with_step.Y, with_step.left, with_step, with_step.weight
        )
        if not ratio > (bodies.shape[1] + 1) * math.log(max(float(rows.rows.moving.sum()), 2.0)):
            break
        found = with_step
    return found


def _moved(found: TrackFit, which: int) -> TrackFit:
    """With a change at the best of the times about it, by the noise as it was found: the filtered step smears it over some
    rows, and with noise of its own each time would be better in its own way."""
    period, best, least = found.rows.rows.period, found.rows, _cost(found.Y, found.left, found, found.weight)
    for step in (4.0 * period, 2.0 * period, period):
        for by in (-step, step):
            while (rows := _later(best, which, by)) is not None:
                Y, left = rows.linear(found.theta, found.theta[DELAY * rows.n : (DELAY + 1) * rows.n])
                if not (cost := _cost(Y, left, found, found.weight)) < least - _NOTABLE:
                    break
                best, least = rows, cost
    return found if best is found.rows else fit(best, found.theta)


def _later(rows: TrackRows, which: int, by: float) -> TrackRows | None:
    """The rows with a change moved by a time [s]; None where that is too near to another one or to an end."""
    changes, t = list(rows.changes), rows.rows.t - rows.smooth.start
    changes[which] += by
    return None if np.any(np.diff([t[0], *changes, t[-1]]) < _APART) else rows.changing(changes)


def _cost(Y: FloatArray, left: FloatArray, found: TrackFit, weight: FloatArray) -> float:
    """Weighted squares after one step of the parameters, for weights of the rows, shape (N, n)."""
    n, p = Y.shape[1:]
    A, b = np.diag(1.0 / found.prior_std**2), np.zeros(p)
    for j in range(n):
        weighted = Y[:, j].T * weight[:, j]
        A += weighted @ Y[:, j]
        b += weighted @ left[:, j]
    return float(np.sum(weight * left**2) - b @ np.linalg.solve(A, b))


def _gains(found: TrackFit) -> FloatArray:
    """Twice the log-likelihood ratio of a step of mass and first moment at each row, shape (N,); 0 where none may be.

    The step's columns are those of the body from the row on, without what all other columns explain of them.
    """
    rows, n = found.rows, found.rows.n
    body = rows.filtered[2].sum(axis=1)[..., :_FIRST]
    count = len(body)
    own, cross, score = np.zeros((count, _FIRST, _FIRST)), np.zeros((count, _FIRST, rows.p)), np.zeros((count, _FIRST))
    for j in range(n):
        weighted = body[:, j] * found.weight[:, j, None]
        own += weighted[:, :, None] * body[:, j, None, :]
        cross += weighted[:, :, None] * found.Y[:, j, None, :]
        score += weighted * found.left[:, j, None]
    own, cross, score = (np.cumsum(x[::-1], axis=0)[::-1] for x in (own, cross, score))
    free = own - np.einsum("tap,pq,tbq->tab", cross, found.inverse, cross, optimize=True)
    t = rows.rows.t - rows.smooth.start
    ends = np.array([t[0], *rows.changes, t[-1]])
    allowed = np.abs(t[:, None] - ends).min(axis=1) > _APART
    out = np.zeros(count)
    prior = np.diag(1.0 / COMPACT_STD[:_FIRST] ** 2)
    for k in np.flatnonzero(allowed):
        out[k] = score[k] @ np.linalg.solve(free[k] + prior, score[k])
    return out
