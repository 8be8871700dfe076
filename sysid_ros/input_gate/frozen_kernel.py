"""Channels of a single joint that are frozen, compiled: an effort or a position that repeats exactly while the joint moves."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

# rows of the state, shape (13, n)
(
    EFFORT_HELD, EFFORT_RUN, EFFORT_BEGAN, EFFORT_USUAL, EFFORT_FROM, EFFORT_STAGE, EFFORT_SINCE,
    POSITION_HELD, POSITION_RUN, POSITION_SINCE, VELOCITY_BEFORE, TIME_BEFORE, WAY,
) = range(13)  # fmt: skip
ROWS: Final = 13
STANDS, BEGINS, MOVES = 0.0, 1.0, 2.0
"""Stages of a joint while its effort repeats: it stands, it has begun to move, it has gone a way since."""

SAMPLES: Final = 20
"""Fewest equal values; as of efforts that repeat on all joints."""
EFFORT_TIME: Final = 0.5
"""For which an effort repeats while its joint moves: other joints move on, so that it is no driver that hangs [s]."""
USUAL_RUNS: Final = 10.0
"""So many times longer than the channel's values usually repeat: those of a coarse one do."""
USUAL_FIRST: Final = 0.1
"""How long they do before any data [s]."""
USUAL_MEMORY, USUAL_MOST = 10.0, 0.1
"""Time over which that is learned [s], and the most that one run counts for: it may be one that was frozen."""
AT_LIMIT: Final = 0.098
"""Part of the largest effort that is believed, ten times the URDF's limit: a drive at its limit repeats it, and truly."""
POSITION_TIME: Final = 0.2
"""For which a position stands while its velocity says that the joint moves [s]."""


def nothing_held(n: int) -> FloatArray:
    """The state before the first message, shape (13, n)."""
    state = np.zeros((ROWS, n))
    state[EFFORT_HELD] = state[POSITION_HELD] = state[VELOCITY_BEFORE] = math.nan
    state[EFFORT_USUAL] = USUAL_FIRST
    return state


@njit(cache=True)  # type: ignore[untyped-decorator]
def frozen_effort(
    effort: float, q: float, v: float, t: float, standstill: float, moved: float, largest: float, state: FloatArray, j: int
) -> bool:
    """Whether the effort of joint j is frozen; NaN for a velocity that is not known. ``moved``: way from which a joint moves [rad
    or m]; ``largest``: the most that is believed, in the unit of the effort; ``state``: shape (13, n), changed."""
    if effort != state[EFFORT_HELD, j]:
        if state[EFFORT_RUN, j] > 0.0:
            lasted, known = state[TIME_BEFORE, j] - state[EFFORT_BEGAN, j], t - state[EFFORT_BEGAN, j]
            state[EFFORT_USUAL, j] += min(USUAL_MOST, known / USUAL_MEMORY) * (lasted - state[EFFORT_USUAL, j])
        state[EFFORT_HELD, j], state[EFFORT_RUN, j], state[EFFORT_BEGAN, j] = effort, 1.0, t
        state[EFFORT_FROM, j], state[EFFORT_STAGE, j] = q, STANDS
        return False
    state[EFFORT_RUN, j] += 1.0
    away = abs(q - state[EFFORT_FROM, j]) > moved
    if state[EFFORT_STAGE, j] == STANDS:
        if away or abs(v) > standstill:
            state[EFFORT_STAGE, j], state[EFFORT_SINCE, j], state[EFFORT_FROM, j] = BEGINS, t, q
        return False
    if away:
        state[EFFORT_STAGE, j] = MOVES
    return bool(
        state[EFFORT_STAGE, j] == MOVES
        and t - state[EFFORT_SINCE, j] >= EFFORT_TIME
        and t - state[EFFORT_BEGAN, j] >= USUAL_RUNS * state[EFFORT_USUAL, j]
        and state[EFFORT_RUN, j] >= SAMPLES
        and abs(effort) < AT_LIMIT * largest
    )


@njit(cache=True)  # type: ignore[untyped-decorator]
def frozen_position(q: float, v: float, t: float, standstill: float, moved: float, state: FloatArray, j: int) -> bool:
    """Whether the position of joint j, as received, is frozen: it stands while its velocity, NaN for none, goes a way."""
    dt, before = t - state[TIME_BEFORE, j], state[VELOCITY_BEFORE, j]
    state[TIME_BEFORE, j], state[VELOCITY_BEFORE, j] = t, v
    if q != state[POSITION_HELD, j] or math.isnan(v) or math.isnan(before) or abs(v) <= standstill:
        state[POSITION_HELD, j], state[POSITION_RUN, j], state[POSITION_SINCE, j], state[WAY, j] = q, 1.0, t, 0.0
        return False
    state[POSITION_RUN, j] += 1.0
    state[WAY, j] += 0.5 * (v + before) * dt
    if t - state[POSITION_SINCE, j] < POSITION_TIME or state[POSITION_RUN, j] < SAMPLES:
        return False
    return bool(abs(state[WAY, j]) > moved)
