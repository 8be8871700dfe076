"""The checks that every sample goes through, compiled: :func:`check` and its steps."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sysid_ros.input_gate.frozen_kernel import frozen_effort, frozen_position, nothing_held
from sysid_ros.sample import FloatArray

OK: Final = 0
WINDOW_AGREES: Final = 1
WINDOW_DISAGREES: Final = 2
POSITION_NAN: Final = 3
POSITION_RANGE: Final = 4
POSITION_JUMP: Final = 5
VELOCITY_RANGE: Final = 6
EFFORT_NAN: Final = 7
EFFORT_RANGE: Final = 8
EFFORT_ZERO: Final = 9
EFFORT_STUCK: Final = 10
VELOCITY_NAN: Final = 11
EFFORT_FROZEN: Final = 12
POSITION_FROZEN: Final = 13
CODES: Final = 16  # what check() returns is code + CODES * joint

# rows of `limits`, shape (8, n)
MAX_POSITION, MAX_VELOCITY, MAX_EFFORT, MAX_JUMP_RATE, JUMP_FLOOR, PERIODIC, SCALE, MOVED = range(8)
# rows of `state`, shape (8, n)
LAST_Q, LAST_V, LAST_EFFORT, TURNS, STILL_Q, WINDOW_Q, INTEGRAL, TRAVEL = range(8)
# entries of `clock`, shape (6,)
LAST_T, FRESH, REPEATS, REPEATS_SINCE, WINDOW_SINCE, DOUBTFUL = range(6)

SMALLEST: Final = 2.2250738585072014e-308  # below it a number is denormal, what misread bytes often are
STUCK_SAMPLES: Final = 20
STUCK_TIME: Final = 0.25
VELOCITY_WINDOW: Final = 0.5
VELOCITY_TOLERANCE: Final = 0.25  # of the way travelled
VELOCITY_FLOOR: Final = 0.02  # rad or m in a window


def nothing_seen(n: int) -> tuple[FloatArray, FloatArray]:
    """``state`` and ``held`` of :func:`check` before the first message of n joints."""
    state = np.zeros((8, n))
    state[LAST_EFFORT] = math.nan
    return state, nothing_held(n)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _value_fault(q: float, v: float, effort: float, has_velocity: bool, limits: FloatArray, j: int) -> int:
    """What is wrong with the values of joint j by themselves, or OK."""
    tau = effort * limits[SCALE, j]
    if math.isnan(q):
        return POSITION_NAN
    if math.isnan(effort):
        return EFFORT_NAN
    if not math.isfinite(q) or abs(q) > limits[MAX_POSITION, j] or 0.0 < abs(q) < SMALLEST:
        return POSITION_RANGE
    if not math.isfinite(tau) or abs(tau) > limits[MAX_EFFORT, j] or 0.0 < abs(effort) < SMALLEST:
        return EFFORT_RANGE
    if has_velocity and (not math.isfinite(v) or abs(v) > limits[MAX_VELOCITY, j]):
        return VELOCITY_RANGE
    return OK


@njit(cache=True)  # type: ignore[untyped-decorator]
def _without_velocity(raw: FloatArray, index: NDArray[np.intp]) -> int:
    """The first joint whose velocity is NaN, or -1."""
    for j in range(index.size):
        if math.isnan(raw[1, index[j]]):
            return j
    return -1


@njit(cache=True)  # type: ignore[untyped-decorator]
def _unwrap(q: float, dt: float, limits: FloatArray, state: FloatArray, j: int) -> float:
    """Turns to be added to the position of joint j [rad], so that it follows the last one; NaN where it jumped."""
    turns = state[TURNS, j]
    step = q + turns - state[LAST_Q, j]
    if limits[PERIODIC, j] != 0.0 and abs(step) > math.pi:
        turns -= 2.0 * math.pi * np.rint(step / (2.0 * math.pi))
        step = q + turns - state[LAST_Q, j]
    return math.nan if abs(step) > limits[MAX_JUMP_RATE, j] * dt + limits[JUMP_FLOOR, j] else turns


@njit(cache=True)  # type: ignore[untyped-decorator]
def _is_stuck(
    raw: FloatArray,
    index: NDArray[np.intp],
    t: float,
    standstill: float,
    limits: FloatArray,
    state: FloatArray,
    clock: FloatArray,
    out: FloatArray,
) -> bool:
    """Take note of whether the efforts repeat, and while a joint moves; True where they have for long."""
    repeats, moving = True, False
    clock[DOUBTFUL] = 0.0
    for j in range(index.size):
        repeats = repeats and raw[2, index[j]] == state[LAST_EFFORT, j]
    if not repeats:
        clock[REPEATS], clock[REPEATS_SINCE] = 0.0, t
        for j in range(index.size):
            state[LAST_EFFORT, j] = raw[2, index[j]]
            state[STILL_Q, j] = out[0, j]
        return False
    clock[REPEATS] += 1.0
    for j in range(index.size):
        moving = moving or abs(out[1, j]) > standstill or abs(out[0, j] - state[STILL_Q, j]) > limits[MOVED, j]
    clock[DOUBTFUL] = 1.0 if moving else 0.0
    return moving and clock[REPEATS] >= STUCK_SAMPLES and t - clock[REPEATS_SINCE] >= STUCK_TIME


@njit(cache=True)  # type: ignore[untyped-decorator]
def _frozen_channel(
    raw: FloatArray,
    proven_velocity: bool,
    index: NDArray[np.intp],
    t: float,
    standstill: float,
    limits: FloatArray,
    held: FloatArray,
    out: FloatArray,
) -> int:
    """Take note of which channels of single joints repeat; the first of those that are frozen, or OK."""
    found: int = OK
    for j in range(index.size):
        effort, largest = raw[2, index[j]], limits[MAX_EFFORT, j] / abs(limits[SCALE, j])
        of_effort = frozen_effort(effort, out[0, j], out[1, j], t, standstill, limits[MOVED, j], largest, held, j)
        v = out[1, j] if proven_velocity else math.nan
        of_position = frozen_position(raw[0, index[j]], v, t, standstill, limits[MOVED, j], held, j)
        if found == OK and (of_effort or of_position):
            found = (POSITION_FROZEN if of_position else EFFORT_FROZEN) + CODES * j
    return found


@njit(cache=True)  # type: ignore[untyped-decorator]
def _accept(
    raw: FloatArray, has_velocity: bool, index: NDArray[np.intp], t: float, state: FloatArray, clock: FloatArray, out: FloatArray
) -> None:
    """Remember an accepted sample, and add it to the window in which velocities are compared with positions."""
    begin = clock[FRESH] != 0.0 or math.isnan(state[LAST_V, 0])
    dt = t - clock[LAST_T]
    for j in range(index.size):
        if begin:
            state[WINDOW_Q, j] = out[0, j]
            state[INTEGRAL, j] = state[TRAVEL, j] = 0.0
        elif has_velocity:
            state[INTEGRAL, j] += 0.5 * (out[1, j] + state[LAST_V, j]) * dt
            state[TRAVEL, j] += 0.5 * (abs(out[1, j]) + abs(state[LAST_V, j])) * dt
        state[TURNS, j] = out[0, j] - raw[0, index[j]]
        state[LAST_Q, j], state[LAST_V, j] = out[0, j], out[1, j]
    clock[LAST_T], clock[FRESH] = t, 0.0
    if begin:
        clock[WINDOW_SINCE] = t


@njit(cache=True)  # type: ignore[untyped-decorator]
def _compare_velocities(t: float, state: FloatArray, clock: FloatArray, out: FloatArray) -> int:
    """At the end of a window: whether the integral of each velocity is the way that its position went; the next one begins."""
    verdict = OK
    for j in range(out.shape[1]):
        way = out[0, j] - state[WINDOW_Q, j]
        travel = max(abs(way), state[TRAVEL, j])
        if abs(way - state[INTEGRAL, j]) > VELOCITY_TOLERANCE * travel + VELOCITY_FLOOR:
            verdict = WINDOW_DISAGREES + CODES * j
        elif travel > 2.0 * VELOCITY_FLOOR and verdict == OK:
            verdict = WINDOW_AGREES
        state[WINDOW_Q, j] = out[0, j]
        state[INTEGRAL, j] = state[TRAVEL, j] = 0.0
    clock[WINDOW_SINCE] = t
    return verdict


@njit(cache=True)  # type: ignore[untyped-decorator]
def check(
    raw: FloatArray,
    has_velocity: bool,
    needs_velocity: bool,
    proven_velocity: bool,
    index: NDArray[np.intp],
    t: float,
    may_be_zero: bool,
    standstill: float,
    limits: FloatArray,
    state: FloatArray,
    clock: FloatArray,
    held: FloatArray,
    out: FloatArray,
) -> int:
    """Puts a message in the model's order, unwraps it and checks it. ``state`` and ``clock`` change only if it is accepted, but
    for what is remembered of values that repeat.

    Args:
        raw: position, velocity, effort as received, shape (3, m).
        has_velocity: whether raw[1] holds anything; NaN in it is as good as nothing.
        needs_velocity: whether a sample without velocities is rejected.
        proven_velocity: whether velocities were seen to be those of the positions.
        index: where in the message each joint of the model stands, shape (n,). t: stamp [s], after that of the last accepted.
        may_be_zero: whether an effort of exactly zero on all joints can be true.
        standstill: speed below which a joint stands [rad/s or m/s].
        limits: shape (8, n), rows as named above.
        state: shape (8, n), rows as named above.
        clock: shape (6,), entries as named above.
        held: shape (13, n), rows as named in :mod:`.frozen_kernel`.
        out: q, v, tau in the model's order, shape (3, n), written; v is NaN where there is none.

    Returns:
        One of the codes above plus ``CODES`` times the joint it is about.
    """
    lacks = _without_velocity(raw, index) if has_velocity else -1
    if lacks >= 0 and needs_velocity:
        return VELOCITY_NAN + CODES * lacks
    has_velocity = has_velocity and lacks < 0
    all_zero = True
    for j in range(index.size):
        q, v, effort = raw[0, index[j]], raw[1, index[j]], raw[2, index[j]]
        fault: int = _value_fault(q, v, effort, has_velocity, limits, j)
        if fault != OK:
            return fault + CODES * j
        turns = state[TURNS, j] if clock[FRESH] != 0.0 else _unwrap(q, t - clock[LAST_T], limits, state, j)
        if math.isnan(turns):
            return POSITION_JUMP + CODES * j
        out[0, j], out[1, j], out[2, j] = q + turns, v if has_velocity else math.nan, effort * limits[SCALE, j]
        all_zero = all_zero and effort == 0.0
    if all_zero and not may_be_zero:
        return EFFORT_ZERO
    if _is_stuck(raw, index, t, standstill, limits, state, clock, out):
        return EFFORT_STUCK
    frozen: int = _frozen_channel(raw, proven_velocity, index, t, standstill, limits, held, out)
    if frozen != OK and clock[REPEATS] == 0.0:  # where all repeat it is not a channel of one joint
        return frozen
    _accept(raw, has_velocity, index, t, state, clock, out)
    wait = not has_velocity or t - clock[WINDOW_SINCE] < VELOCITY_WINDOW
    return OK if wait else int(_compare_velocities(t, state, clock, out))
