"""The clock that measurements were taken by, found one message after the other, compiled: :func:`own_time` and its steps.

The k-th value was taken at an even time c(k), or its stamp s(k) is right; which it is the positions tell. Each is off the cubic
through two neighbours on each side by e0 at the stamps and by e1 on the clock, in all joints at once, and the log-likelihood of
the clock over the stamps is ``sum (e0^2 - e1^2) / (2 level)``, less what the noise of the positions does to both by the stencils
alone. With the odds that stamps are right as a rule it says which is likelier, and the time is ``s - share (s - c)`` with a share
of 1 or 0. Even stamps are the clock and stay as they are.

A driver that polls a slower source is the same case: it repeats a value now and then, which is no step of the clock, and between
repeats the stamps run along with a sawtooth about the clock.

The clock is the line through the stamps over their count, by least squares with a memory that grows to a limit (Morrison 1969,
chapters 9 and 10: expanding, then fading memory). The sawtooth of a driver that polls is taken off
before. A constant difference between clock and stamps is not seen and bends no motion.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

# entries of `clock`, shape (20,)
COUNT, AT, PERIOD, OFF, VARIANCE, ROW, SEEN, ALONG, INFORMATION, SHARE, OFFSET, SHIFT, POWER, HELD, REPEATED, FORMER = range(16)
BEAT, BEATS, BEGAN, POLL = 16, 17, 18, 19
# rows of `ring`, shape (5, 2 + 2 n): stamp, time of the clock, positions, torques, the newest last
STAMP, CLOCK, VALUES = 0, 1, 2

MEMORY: Final = 500.0
"""Measurements over which clock and share are learned: longer than a beat of a polled source as a rule, in which it drifts by
less than a five hundredth where it is not."""
FIRST: Final = 25.0
"""Measurements that period and variance are read from before any is put to its own time."""
BEFORE: Final = 5.0
"""Measurements that tell the period as well as the median step of the first 25 does: ``sqrt(12) / k^1.5`` is 0.35 there."""
_MOVES: Final = 0.02
"""Speed from which two messages with the same values are one that was sent twice [rad/s]."""
_EXPLAINED: Final = 1.5
"""Periods since the last new value up to which one that is repeated may be polled."""
_LOST: Final = 4.6
"""Log odds of a message that arrives against one that is lost, one in a hundred, before any data."""
_TAILS: Final = 4.0
"""Degrees of freedom of the stamps' distribution about the clock."""
_LONGEST: Final = 10.5
"""Steps of the clock over which it is not carried on."""
_BEATS: Final = 20.0
"""Beats over which the driver's own step is learned."""
_SHORTEST: Final = 3.0
"""Values of the shortest beat with a shape: of shorter ones the next has another length as often as not."""
_FINEST: Final = 1e-30
"""Least variance of the positions: below it numbers have no digits."""
_USUAL: Final = math.log(1e-4)
"""Log odds of a clock that is better than the stamps, before any data."""


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _weights(ring: FloatArray, row: int, out: FloatArray) -> None:
    """Weights that give the cubic through two samples on each side less the one between, at the times in a column of the ring."""
    at = ring[2, row]
    for i in range(5):
        weight = -1.0
        if i != 2:
            weight = 1.0
            for k in range(5):
                if k != i and k != 2:
                    weight *= (at - ring[k, row]) / (ring[i, row] - ring[k, row])
        out[i] = weight


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _learn_share(clock: FloatArray, ring: FloatArray, levels: FloatArray, weights: FloatArray) -> None:
    """What the five newest positions say of the share, and of their own noise (variances ``levels``, shape (n,))."""
    _weights(ring, STAMP, weights[0])
    _weights(ring, CLOCK, weights[1])
    share = clock[SHARE]
    along = own = mixed = 0.0
    for i in range(5):
        apart = weights[0, i] - weights[1, i]
        along += weights[0, i] * apart
        own += apart * apart
        mixed += (weights[0, i] - share * apart) ** 2
    clock[SEEN] += 1.0
    part = 1.0 / min(clock[SEEN], MEMORY)
    a = b = 0.0
    for j in range(levels.size):
        e0 = e1 = 0.0
        for i in range(5):
            e0 += weights[0, i] * ring[i, VALUES + j]
            e1 += weights[1, i] * ring[i, VALUES + j]
        x = e0 - e1
        off = (e0 - share * x) ** 2 / mixed
        if not off + x * x < math.inf:
            continue
        levels[j] += part * (off - levels[j])
        if levels[j] > _FINEST:
            a += (e0 * x / levels[j] - along) / mixed
            b += (x * x / levels[j] - own) / mixed
    # as much is forgotten as comes in at most: what stands still tells nothing and takes nothing
    information = max(clock[INFORMATION], 0.0)
    kept = 1.0 - min(max(b, 0.0) / information, 1.0 / MEMORY) if information > 0.0 else 1.0
    clock[ALONG] = kept * clock[ALONG] + a
    clock[INFORMATION] = kept * clock[INFORMATION] + b
    explained = min(clock[ALONG], clock[INFORMATION])  # a position that is farther off than the clock accounts for bends
    # each value is in five stencils, and a count of its errors once is a fifth of the sum
    clock[SHARE] = 1.0 if (explained - 0.5 * clock[INFORMATION]) / 5.0 + _USUAL > 0.0 else 0.0


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _repeats(clock: FloatArray, newest: FloatArray, before: FloatArray, t: float, q: FloatArray, tau: FloatArray) -> int:
    """Whether a message repeats the newest value: 0 not, 1 as one that is polled does, 2 for longer or while the robot stands."""
    if clock[COUNT] < 2.0:
        return 0
    n, moving = q.size, False
    for j in range(n):
        if q[j] != newest[VALUES + j] or tau[j] != newest[VALUES + n + j]:
            return 0
        moving = moving or abs(q[j] - before[VALUES + j]) > _MOVES * (newest[STAMP] - before[STAMP])
    return 1 if moving and clock[HELD] >= 0.0 and t - newest[STAMP] < _EXPLAINED * clock[PERIOD] else 2


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _odds(clock: FloatArray, ring: FloatArray, levels: FloatArray, t: float, q: FloatArray, steps: float) -> float:
    """Log-likelihood, but for a constant, of ``steps`` of the clock from the newest value to q with the stamp t.

    Stamps have a Student distribution about the clock, as what is late now and then has; positions are normal about the parabola
    through the three before, where its own noise is not all there is.
    """
    period = clock[PERIOD]
    variance = max(clock[VARIANCE], (1e-3 * period) ** 2)
    off = t - clock[AT] - steps * period
    out = -0.5 * (_TAILS + 1.0) * math.log(1.0 + off * off / (_TAILS * variance)) - _LOST * (steps - 1.0)
    if clock[ROW] < 5.0:
        return float(out)
    a, b, c = ring[2, CLOCK], ring[3, CLOCK], ring[4, CLOCK]
    at = c + steps * period
    first = (at - b) * (at - c) / ((a - b) * (a - c))
    second = (at - a) * (at - c) / ((b - a) * (b - c))
    third = (at - a) * (at - b) / ((c - a) * (c - b))
    gain = 1.0 + first * first + second * second + third * third
    for j in range(q.size):
        far = q[j] - first * ring[2, VALUES + j] - second * ring[3, VALUES + j] - third * ring[4, VALUES + j]
        if levels[j] > _FINEST:
            out -= 0.5 * (far * far / (gain * levels[j]) + math.log(gain))
    return float(out)


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _steps(clock: FloatArray, ring: FloatArray, levels: FloatArray, t: float, q: FloatArray) -> float:
    """Likeliest number of steps of the clock from the newest value to q with the stamp t, of which some may be lost."""
    best, highest = 1.0, 0.0
    for since in (t - clock[AT], t - ring[4, STAMP]):
        steps = np.rint(since / clock[PERIOD])
        if steps > 1.0 and steps != best:
            if steps > _LONGEST:
                return float(steps)
            if highest == 0.0:
                highest = _odds(clock, ring, levels, t, q, 1.0)
            odds = _odds(clock, ring, levels, t, q, steps)
            if odds > highest:
                best, highest = steps, odds
    return float(best)


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _sawtooth(clock: FloatArray, t: float, before: float) -> float:
    """By how much the stamp t of a new value is late, about the mean of a beat, where the source is polled: by a step of the
    driver less one of the source more from value to value between two repeats. The line would follow that, and bend the motion.
    ``before``: stamp of the value before."""
    if clock[HELD] > 0.0:
        if clock[BEAT] > 1.0:
            own = (before - clock[BEGAN]) / (clock[BEAT] - 1.0)
            clock[POLL] += (own - clock[POLL]) / min(clock[REPEATED] + 1.0, _BEATS)
        clock[BEATS] = clock[BEAT] if clock[BEATS] >= 0.0 else 0.0  # of the first beat the beginning was not seen
        clock[BEAT] = 0.0
    place = clock[BEAT]
    clock[BEAT] += 1.0
    if place == 0.0:
        clock[BEGAN] = t
    if clock[BEATS] < _SHORTEST or place > 1.5 * clock[BEATS]:
        return 0.0
    return float((place - 0.5 * (clock[BEATS] - 1.0)) * (clock[POLL] - clock[PERIOD]))


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _tick(clock: FloatArray, ring: FloatArray, levels: FloatArray, t: float, q: FloatArray) -> None:
    """Carry the clock on to a new value q with the stamp t."""
    count = clock[COUNT]
    steps = _steps(clock, ring, levels, t, q) if count > 0.0 and clock[HELD] == 0.0 else 1.0
    clock[COUNT] += 1.0
    if count == 0.0 or clock[HELD] < 0.0 or steps > _LONGEST:
        clock[AT] = t - clock[OFF]  # as far from its stamp as the one before
        clock[ROW] = 0.0
    else:
        k = min(count + BEFORE, MEMORY)
        clock[AT] += steps * clock[PERIOD]
        late = t - clock[AT] - _sawtooth(clock, t, ring[4, STAMP])
        clock[AT] += late * 2.0 * (2.0 * k - 1.0) / (k * (k + 1.0))
        clock[PERIOD] += late * 6.0 / (k * (k + 1.0))
        clock[VARIANCE] += ((t - clock[AT]) ** 2 - clock[VARIANCE]) / min(count + FIRST, MEMORY)
    clock[OFF] = t - clock[AT]
    clock[ROW] += 1.0


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def own_time(
    clock: FloatArray, ring: FloatArray, levels: FloatArray, weights: FloatArray, t: float, q: FloatArray, tau: FloatArray
) -> float:
    """Time at which the value of a message was true [s]; NaN where it may repeat the one before as a source that is polled does:
    ``clock[HELD]`` counts these. It is -1 where there are more of them than that explains.

    Args:
        clock: shape (20,); ``PERIOD`` [s] and ``VARIANCE`` [s^2] as the first stamps show them, all else zero at first.
        ring: shape (5, 2 + 2 n). levels: variances of the positions' noise, shape (n,). weights: room, shape (2, 5).
        t: stamp [s]. q, tau: shape (n,).
    """
    n, before = q.size, clock[OFF]
    kind = _repeats(clock, ring[4], ring[3], t, q, tau)
    if kind == 1:
        clock[HELD] += 1.0
        return math.nan
    if kind == 2:
        clock[HELD] = -1.0
        return float(t + clock[SHIFT])
    _tick(clock, ring, levels, t, q)
    clock[REPEATED] += max(clock[HELD], 0.0)
    clock[HELD] = 0.0
    ring[:4] = ring[1:]
    newest = ring[4]
    newest[STAMP], newest[CLOCK] = t, clock[AT]
    newest[VALUES : VALUES + n], newest[VALUES + n :] = q, tau
    share = clock[SHARE]
    if clock[ROW] >= 5.0:
        _learn_share(clock, ring, levels, weights)
    # a share that is known better moves no time at once: the difference is an offset that fades
    clock[OFFSET] = (clock[OFFSET] + (clock[SHARE] - share) * before) * (1.0 - 1.0 / MEMORY)
    shift = clock[OFFSET] - clock[SHARE] * clock[OFF]
    if t + shift > ring[3, STAMP] + clock[SHIFT] or clock[COUNT] < 2.0:
        clock[SHIFT] = shift
    else:  # values keep their order
        clock[OFFSET] += clock[SHIFT] - shift
    bend = clock[SHARE] * (clock[OFF] - 2.0 * before + clock[FORMER])
    clock[FORMER] = before
    clock[POWER] += (bend * bend / 6.0 - clock[POWER]) / min(clock[COUNT], MEMORY)
    return float(t + clock[SHIFT])
