"""What is wrong with messages: repeated, dropped, late, frozen, spiked, out of order. Stamps and raw values alone show it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sysid_ros.exceptions import DataError
from sysid_ros.input_gate.effort_channels import MOSTLY, standing_still
from sysid_ros.input_gate.neighbours import applied, slopes, stencil, without_gaps
from sysid_ros.input_gate.polled import times_of_samples
from sysid_ros.input_gate.stamp_jitter import stamp_jitter
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.spikes import without_spikes

_MISSING = 1.6
"""A step between stamps is too long from this multiple of the usual one on."""
_LONGEST_DROP = 1.0
"""A longer gap is an interruption, not lost messages [s]."""
_RESTART = 1.0
"""Stamps that run back further belong to another recording [s]."""
_MOVES = 0.02
"""Speed from which two messages with the same values are one that was sent twice [rad/s]."""
_CLEARLY_MOVES = 0.1
"""Speed from which the time of a message shows in its positions [rad/s]."""
_OTHERWISE = 0.2
"""Part of a squared difference that a lateness may leave."""
_LATE_MOST, _LATE_SIGMA = 0.5, 7.0
"""A message is late (or early) from this part of the usual step on, and from so many robust standard deviations on."""
_ELSEWHERE = 0.05
"""A position from which it can't have come from zero, nor gone there, within a message [rad]."""
_NAMED = 0.01
"""Part of the messages from which a fault is a finding of its own; fewer are a note. The same part of a step is the least level
of the stamps' errors that is corrected."""

FAULTS = ("repeated", "polled", "dropped", "late", "frozen", "empty", "spiked", "unordered")

Order = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class MessageFaults:
    """Faults of the times of N messages, in the order in which they were recorded.

    Attributes:
        count: N. period: usual step between stamps [s].
        repeated: messages with the stamp, or all of the values, of the one before. dropped: messages that are missing.
        late: messages whose values belong to another time than their stamp. delay: largest of these differences [s].
        polled: messages of a driver that polls a slower source, see :mod:`.polled`. age: of the oldest of their values [s].
        frozen: messages whose efforts have long not changed while the arm moves; a diagnosis counts each joint's channels, too.
        empty: messages that hold nothing but zeros, as of a driver that has no values yet, or has lost them.
        unordered: messages that came after one with a later stamp.
        spiked: messages, of those that are used, with a torque that fits neither the one before nor the one after.
        order: puts the messages in the order of their stamps, shape (N,). keep: what is used, in that order, shape (N,).
        jitter: level of the stamps' errors where the positions tell them, see :mod:`.stamp_jitter` (rms), else 0 [s].
        times: when the values of the messages were true, in that order, shape (N,) [s].
    """

    count: int
    period: float
    repeated: int
    dropped: int
    late: int
    delay: float
    frozen: int
    empty: int
    polled: int
    age: float
    jitter: float
    unordered: int
    order: Order
    keep: Mask
    times: FloatArray
    spiked: int = 0

    def shares(self) -> dict[str, float]:
        """Part of the messages that each fault concerns."""
        return {name: getattr(self, name) / max(self.count, 1) for name in FAULTS}

    def named(self) -> dict[str, float]:
        """The shares that are a finding of their own."""
        return {name: share for name, share in self.shares().items() if share >= _NAMED}

    def in_words(self) -> str:
        """What was found, empty where the messages are in order."""
        said = {
            "repeated": f"{self.repeated} repeat the one before and are left out",
            "polled": f"all come from a slower source, with values that are up to {1e3 * self.age:.0f} ms older than the stamps, "
            "and were put to their own times",
            "dropped": f"about {self.dropped} are missing",
            "late": f"{self.late} hold values that are up to {1e3 * self.delay:.0f} ms off their stamp and are left out",
            "frozen": f"{self.frozen} have the efforts of long before while the arm moves and are left out",
            "empty": f"{self.empty} hold nothing but zeros and are left out",
            "spiked": f"{self.spiked} hold a torque far from those before and after it, which gave way to the middle of these",
            "unordered": f"{self.unordered} came out of order and were put in the order of their stamps",
        }
        found = [text for name, text in said.items() if getattr(self, name)]
        sentences = [f"Of {self.count} messages {', '.join(found)}."] if found else []
        if self.jitter:
            size = (
                f"The stamps are off by {1e3 * self.jitter:.2g} ms (rms), as the positions of all joints at once show, and were "
            )
            sentences.append(f"{size}corrected.")
        return " ".join(sentences)


def in_order(recording: Recording) -> tuple[Recording, MessageFaults]:
    """The recording in the order of its stamps, without the messages that repeat another or are late, and what was found.

    Raises:
        DataError: most stamps are before the one before: there is no order to bring them into.
    """
    back = int(np.sum(np.diff(recording.t) < 0.0))
    if back > 0.5 * len(recording.t):
        raise DataError(
            f"{recording.name}: time runs backwards, {back} of {len(recording.t)} stamps are before the one before. Correct "
            "the clock that stamps them, or turn the order of the rows round."
        )
    faults = find_message_faults(recording.t, recording.q, recording.tau)
    if faults.keep.all() and not faults.unordered and not faults.jitter:
        return recording, faults
    return replace(recording.at(faults.order[faults.keep]), t=faults.times[faults.keep]), faults


def despiked(recording: Recording, faults: MessageFaults) -> tuple[Recording, MessageFaults]:
    """The recording, in order, without spikes of its torques, and the faults with how many messages had one."""
    tau, spikes = without_spikes(recording.tau)
    if not spikes.any():
        return recording, faults
    return replace(recording, tau=tau), replace(faults, spiked=int(np.sum(spikes.any(axis=1))))


def at_own_times(recording: Recording) -> tuple[Recording, str]:
    """The recording with its values at the times at which they were true, where its messages tell these, and without spikes of
    its torques, and what was found.

    Other faults of its messages are left as they are: who asks this has checks of its own for them.
    """
    if np.any(np.diff(recording.t) < 0.0):
        return recording, ""
    ordered, faults = in_order(recording)
    if faults.frozen:
        return recording, ""
    if not (faults.polled or faults.jitter):
        ordered, faults = recording, replace(faults, repeated=0, dropped=0, late=0, unordered=0)
        if faults.empty:
            ordered = recording.at(np.flatnonzero(~_empty(recording.q, recording.tau)))
    cleaned, faults = despiked(ordered, faults)
    return cleaned, faults.in_words()


def find_message_faults(t: FloatArray, q: FloatArray, tau: FloatArray) -> MessageFaults:
    """Faults of messages with stamps t (N,) [s], positions and efforts of shape (N, n) each.

    A message that is late by d stands off the line through its neighbours by -v d in every joint at once. The difference from
    the cubic through two neighbours on each side, projected on the velocity, is that d; its noise comes from all messages.
    """
    order, unordered = _in_order(t)
    t, q, tau = t[order], q[order], tau[order]
    steps = np.diff(t)
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    same = np.all(np.diff(q, axis=0) == 0.0, axis=1) & np.all((np.diff(tau, axis=0) == 0.0) | np.isnan(tau[1:]), axis=1)
    empty = _empty(q, tau)
    keep: Mask = np.ones(len(t), dtype=np.bool_)
    keep[1:] = (steps != 0.0) & ~(same & _moving(t, q))
    repeated = int(np.sum(~keep & ~empty))
    times, distinct = t.copy(), np.flatnonzero(np.concatenate([[True], steps > 0.0]) & ~empty)
    if not np.any(steps < 0.0):
        times[distinct] = times_of_samples(t[distinct], q[distinct], ~keep[distinct])
    age = float(np.max(t - times))
    keep &= ~empty
    polled = int(np.sum(keep)) if age > 0.0 else 0
    late, delay = _late(times[keep], q[keep], usual)
    where = np.flatnonzero(keep)[late]
    keep[where] = False
    jitter = _without_jitter(times, q, keep, usual)
    # where stamps are off, their steps say nothing of what is missing
    steps = np.diff(times) if jitter else steps
    long = steps[(steps > _MISSING * usual) & (steps < _LONGEST_DROP)]
    dropped = int(np.sum(np.round(long / usual) - 1.0)) if usual > 0.0 else 0
    still = standing_still(t, q, tau)
    # a recording that is mostly so is refused, and not emptied
    frozen = still & keep & (np.mean(still) < MOSTLY)
    return MessageFaults(
        count=len(t),
        period=usual,
        repeated=repeated,
        dropped=dropped,
        late=len(where),
        delay=delay,
        frozen=int(np.sum(frozen)),
        empty=int(np.sum(empty)),
        polled=polled,
        age=age,
        jitter=jitter,
        unordered=unordered,
        order=order,
        keep=keep & ~frozen,
        times=times,
    )


def _empty(q: FloatArray, tau: FloatArray) -> Mask:
    """Messages in which all positions and efforts are exactly zero, while the robot is elsewhere before and after them."""
    zeros: Mask = ~np.any(q, axis=1) & ~np.any(np.nan_to_num(tau), axis=1)
    others = np.flatnonzero(~zeros)
    if q.shape[1] < 2 or not zeros.any() or len(others) < MOSTLY * len(q):
        return np.zeros_like(zeros)
    following = np.searchsorted(others, np.arange(len(q)))
    around = others[np.maximum(following - 1, 0)], others[np.minimum(following, len(others) - 1)]
    elsewhere: Mask = np.all([np.max(np.abs(q[x]), axis=1) > _ELSEWHERE for x in around], axis=0)
    return np.asarray(zeros & elsewhere)


def _without_jitter(times: FloatArray, q: FloatArray, keep: Mask, usual: float) -> float:
    """Correct the times of the messages that are kept, in place; the level of what they were off by (rms), 0 for nothing [s].

    Errors of less than a hundredth of a step move no torque and are left as they are.
    """
    rows = np.flatnonzero(keep & np.isfinite(q).all(axis=1))
    if np.any(np.diff(times[rows]) <= 0.0):
        return 0.0
    jitter = stamp_jitter(times[rows], q[rows])
    if jitter is None or jitter.std < _NAMED * usual:
        return 0.0
    times[rows] += jitter.errors
    return jitter.std


def _in_order(t: FloatArray) -> tuple[Order, int]:
    """Order of the stamps, within the parts between restarts of the clock, and how many messages were overtaken."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(t) < -_RESTART) + 1, [len(t)]])
    parts, overtaken = [], 0
    for a, b in pairwise(starts):
        parts.append(a + np.argsort(t[a:b], kind="stable"))
        overtaken += int(np.sum(t[a:b] < np.maximum.accumulate(t[a:b])))
    return np.concatenate(parts).astype(np.intp), overtaken


def _moving(t: FloatArray, q: FloatArray) -> Mask:
    """True for each step in whose tenth of a second a joint is faster than :data:`_MOVES`, shape (N - 1,)."""
    before, after = (np.clip(np.searchsorted(t, t[1:] + d), 0, len(t) - 1) for d in (-0.05, 0.05))
    seconds = np.maximum(t[after] - t[before], 1e-9)
    moving: Mask = np.max(np.abs(q[after] - q[before]), axis=1) / seconds > _MOVES
    return moving


def _late(t: FloatArray, q: FloatArray, period: float) -> tuple[Order, float]:
    """Messages that are late or early, and the largest difference [s]."""
    none = np.zeros(0, dtype=np.intp)
    if len(t) < 50 or period <= 0.0:
        return none, 0.0
    late: Order = none
    worst = 0.0
    kept = np.arange(len(t))
    # the worst ones pull their neighbours: they go first
    for _ in range(4):
        delay, way, agree = _delays(t[kept], q[kept])
        spread = 1.4826 * float(np.median(np.abs(way[way != 0.0]))) if np.any(way) else np.inf
        far = np.abs(way)
        peak = agree & (far > _LATE_SIGMA * spread) & (far >= np.maximum(np.roll(far, 1), np.roll(far, -1)))
        peak &= np.abs(delay) > _LATE_MOST * period
        if not peak.any():
            break
        worst = max(worst, float(np.abs(delay[peak]).max()))
        late = np.concatenate([late, kept[peak]])
        kept = kept[~peak]
    return np.sort(late), worst


def _delays(t: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray, Mask]:
    """How far each message's values lag its stamp [s], the way that the robot goes in that time over the noise, and whether the
    joints agree on it, shape (N,) each; 0 where the robot hardly moves or neighbours are missing."""
    delay, way, agree = np.zeros(len(t)), np.zeros(len(t)), np.zeros(len(t), dtype=np.bool_)
    weights, velocity = stencil(t), slopes(t, q)
    off = applied(weights, q)
    usable = (np.linalg.norm(velocity, axis=1) > _CLEARLY_MOVES) & without_gaps(t)
    noise = _noise_of(off, q, float(np.median(np.sum(weights**2, axis=1))))
    off, velocity = off / noise, velocity / noise
    speed = np.linalg.norm(velocity, axis=1)
    along = np.sum(off * velocity, axis=1) / np.maximum(speed, 1e-9)
    # a late message explains the difference in all joints at once; a jump of one joint does not
    agree[2:-2] = np.sum(off**2, axis=1) - along**2 < _OTHERWISE * np.sum(off**2, axis=1)
    way[2:-2] = np.where(usable, along, 0.0)
    delay[2:-2] = way[2:-2] / np.maximum(speed, 1e-9)
    return delay, way, agree


def _noise_of(off: FloatArray, q: FloatArray, power: float) -> FloatArray:
    """Standard deviation of each joint's differences, shape (n,): what most of them show, and the steps of the encoder."""
    steps = np.abs(np.diff(q, axis=0))
    step = np.min(np.where(steps > 0.0, steps, np.inf), axis=0)
    usual = 1.4826 * np.median(np.abs(off), axis=0)
    found = np.sqrt(usual**2 + np.where(np.isfinite(step), step, 0.0) ** 2 / 12.0 * power)
    return np.asarray(np.where(found > 0.0, found, np.inf))  # what never moves tells nothing
