"""Messages of a driver that polls a slower source: when their values were true, which is before their stamps.

A driver that asks every T_p for the latest sample of a source with the period T_s > T_p gets each sample up to T_p late. That
age falls by T_s - T_p from message to message; where it would fall below zero no new sample has come yet, and the message
repeats the one before. So the last message before a repeat is as good as new, and the samples between two such messages are
even in time. Left as they are, the stamps run along with a sawtooth, whose every edge is an impulse of acceleration that no
torque belongs to.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sysid_ros.input_gate.neighbours import applied, stencil, without_gaps
from sysid_ros.sample import FloatArray

_USUAL = 0.05
"""Part of the recordings with repeated messages whose driver polls, before any data; in others messages were lost."""
_FEWEST = 3
"""Repeats that make two beats, the least that shows one to be like the other."""
_REGULAR = np.array([0.1, 0.5, 0.9])
"""Parts of the beats that may be as long as most are, before any data: in a rest, or where messages are lost, one is not."""


def times_of_samples(t: FloatArray, q: FloatArray, repeats: NDArray[np.bool_]) -> FloatArray:
    """Times at which the values of messages were true, shape (N,) [s]; the stamps themselves where that is likelier.

    Likelier is what leaves the positions smoother: each differs less from the cubic through two neighbours on each side, and the
    difference is taken as normal with a size of its own for each joint and each of the two hypotheses. And one beat of a driver
    that polls is as long as another, while messages that repeat others for another reason, as where coarse values do not change,
    come at any time.

    Args:
        t: stamps in order, shape (N,) [s]. q: positions, shape (N, n). repeats: messages that repeat all values of the one before
            at a later stamp, shape (N,); their own times are not changed.
    """
    new = np.flatnonzero(~repeats)
    before_repeat = np.flatnonzero(repeats[new[1:] - 1])
    if len(before_repeat) < _FEWEST:
        return t
    out = t.copy()
    period = float(np.median(np.diff(t)))
    out[new] = _even(t[new], before_repeat, period)
    if np.array_equal(out, t):
        return t
    usable = without_gaps(t[new]) & without_gaps(out[new])
    power = [np.sum(applied(stencil(x[new]), q[new])[usable] ** 2, axis=0) for x in (t, out)]
    moves = (power[0] > 0.0) & (power[1] > 0.0)
    gain = 0.5 * float(np.sum(usable)) * float(np.sum(np.log(power[0][moves] / power[1][moves])))
    gain += _evenness(np.diff(t[new][before_repeat]), period)
    return out if gain + np.log(_USUAL / (1.0 - _USUAL)) > 0.0 else t


def _evenness(beats: FloatArray, period: float) -> float:
    """Log-odds of beats, shape (b,) [s], where most are alike to a message, against repeats by chance: exponential beats. The one
    that says how long the others are says nothing by itself."""
    mean, off = float(np.mean(beats)), np.abs(beats - np.median(beats))
    likelier = np.where(off < 1.5 * period, mean / (3.0 * period) * np.exp(np.minimum(beats / mean, 50.0)), 0.0)
    likelier[np.argmin(off)] = 1.0
    odds = np.log(_REGULAR[:, None] * likelier + (1.0 - _REGULAR[:, None])).sum(axis=1)
    return float(np.logaddexp.reduce(odds) - np.log(len(odds)))


def _even(t: FloatArray, newest: NDArray[np.intp], period: float) -> FloatArray:
    """Even times between samples that are as new as their stamps, where no sample is then later than its stamp, nor older than a
    step between messages; the stamps elsewhere. Args: t: shape (N,). newest: indices. period: of the messages [s]."""
    index = np.arange(len(t), dtype=float)
    out = np.interp(index, newest, t[newest])
    for ends, (a, b) in ((index < newest[0], newest[:2]), (index > newest[-1], newest[-2:])):
        out[ends] = t[a] + (index[ends] - a) * (t[b] - t[a]) / (b - a)
    steps = np.diff(t)
    usual = steps[steps < 1.5 * period]
    jitter = float(np.max(np.abs(usual - period))) if len(usual) else 0.0
    wrong = (out > t + jitter) | (out < t - period - jitter)
    beat = np.searchsorted(newest, index, side="right")
    return np.where(np.isin(beat, beat[wrong]), t, out)
