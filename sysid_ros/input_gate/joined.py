"""JoinedRecords: the joint states of one robot where other publishers share its topic, or several publish parts of it."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.sample import FloatArray, JointStateRecord

Names = tuple[str, ...]
WHOLE, PART, OTHER = "whole", "part", "other"
WAITS, EARLY, GAP = "the others may still come", "it is older than all others", "the others are too far apart"
PATIENCE = 0.5
"""A message with some of the joints waits no longer for the others [s]."""
_BACK_IN_TIME = 1.0
_KINDS = 64
_LISTED = 3


@dataclass(frozen=True, slots=True)
class _Supply:
    """Messages that hold what the main ones lack: ``index``, where in them the ``joints`` stand."""

    names: Names
    joints: Names
    index: list[int]


class JoinedRecords:
    """Messages that hold all joints of a robot, made from those that are received.

    A message with all of them is passed on as it is, and those with some of them, which come beside, are left out. Where none has
    all, the messages with the most joints are completed: the others' values are interpolated between the two messages whose own
    stamps lie about theirs. Messages that name none of the joints are another publisher's.

    Args:
        joints: of the robot. max_gap: between two stamps that are interpolated between [s].

    Attributes:
        left_out: messages that were another publisher's, or had no match yet, by the joints that they name. joined: how many were
            completed.
    """

    def __init__(self, joints: Sequence[str], max_gap: float = 0.1) -> None:
        self._joints, self._max_gap = frozenset(joints), max_gap
        self.left_out: Counter[Names] = Counter()
        self.joined = 0
        self._kinds: dict[Names, str] = {}
        self._complete = False
        self._main: Names = ()
        self._supplies: list[_Supply] | None = None
        self._names: Names = ()
        self._pending: deque[JointStateRecord] = deque()
        self._series: dict[Names, deque[JointStateRecord]] = {}

    def take(self, record: JointStateRecord) -> Sequence[JointStateRecord]:
        """The messages that a received one makes whole; itself where it can't be completed, for others to tell what it lacks."""
        names = tuple(record.names)
        kind = self._kinds.get(names) or self._learn(names)
        if kind == WHOLE:
            self._complete = True
            return (record,)
        if kind == OTHER or self._complete:
            self.left_out[names] += 1
            return ()
        n = len(names)
        lengths = len(record.velocity), len(record.effort)
        if self._supplies is None or len(record.position) != n or not {0, n}.issuperset(lengths):
            return (record,)
        if names != self._main and all(names != supply.names for supply in self._supplies):
            self.left_out[names] += 1
            return ()
        return self._join(names, record)

    @property
    def joins(self) -> bool:
        """Whether the messages that came so far name all of the joints together."""
        return self._supplies is not None

    @property
    def notes(self) -> tuple[str, ...]:
        """What was put together and what was left out, a sentence each."""
        notes = []
        if self.joined and self._supplies:
            others = "; ".join(", ".join(s.joints) for s in self._supplies)
            notes.append(f"{self.joined} messages of {', '.join(self._main)} were completed by {others}, by their stamps.")
        if self.left_out:
            listed = [f"{count} of {', '.join(names[:8])}" for names, count in self.left_out.most_common(_LISTED)]
            rest = len(self.left_out) - len(listed)
            more = f" and of {rest} others" if rest else ""
            notes.append(f"Messages of other publishers on the topic are left out: {'; '.join(listed)}{more}.")
        return tuple(notes)

    def _learn(self, names: Names) -> str:
        held = self._joints.intersection(names)
        kind = PART if held else OTHER
        if len(held) == len(self._joints) or not names or len(set(names)) < len(names):
            kind = WHOLE  # or wrong in a way that others tell
        if len(self._kinds) < _KINDS:
            self._kinds[names] = kind
            if kind == PART:
                self._plan()
        return kind

    def _plan(self) -> None:
        """Choose the messages that are completed, and those that complete them."""
        parts = [names for names, kind in self._kinds.items() if kind == PART]
        parts.sort(key=lambda names: -len(self._joints.intersection(names)))
        self._main, *others = parts
        self._names = tuple(name for name in self._main if name in self._joints)
        supplies = []
        for names in others:
            joints = tuple(name for name in names if name in self._joints and name not in self._names)
            if joints:
                supplies.append(_Supply(names, joints, [names.index(name) for name in joints]))
                self._names += joints
        self._supplies = supplies if len(set(self._names)) == len(self._joints) else None
        for record in self._pending:
            self.left_out[tuple(record.names)] += 1
        self._pending.clear()

    def _join(self, names: Names, record: JointStateRecord) -> list[JointStateRecord]:
        t = _time(record)
        series = self._series.setdefault(names, deque())
        if series and t < _time(series[-1]) - _BACK_IN_TIME:
            self._pending.clear()
            self._series = {names: (series := deque())}
        if names == self._main:
            self._pending.append(record)
        else:
            series.append(record)
            while len(series) > 2 and _time(series[1]) <= t - PATIENCE:
                series.popleft()
        done: list[JointStateRecord] = []
        while self._pending:
            main = self._pending[0]
            values = self._supplied(_time(main))
            if values == WAITS and record.receive_time - main.receive_time <= PATIENCE:
                break
            self._pending.popleft()
            if values == EARLY:
                self.left_out[self._main] += 1
            else:
                done.append(main if isinstance(values, str) else self._completed(main, values))
        return done

    def _supplied(self, t: float) -> list[FloatArray] | str:
        """Position, velocity and effort of the joints that a message of time t lacks, shape (3, k) for each supply; or why they
        are not there."""
        found = []
        for supply in self._supplies or ():
            series = self._series.get(supply.names)
            if not series or _time(series[-1]) < t:
                return WAITS
            while len(series) > 1 and _time(series[1]) <= t:
                series.popleft()
            first, last = series[0], series[min(1, len(series) - 1)]
            t0, t1 = _time(first), _time(last)
            if t0 > t:
                return EARLY
            if t0 < t and t1 - t0 > self._max_gap:
                return GAP
            share = (t - t0) / (t1 - t0) if t0 < t else 0.0
            found.append((1.0 - share) * _values(first, supply.index) + share * _values(last, supply.index))
        return found

    def _completed(self, main: JointStateRecord, supplied: list[FloatArray]) -> JointStateRecord:
        own = [k for k, name in enumerate(main.names) if name in self._joints]
        q, v, tau = np.concatenate([_values(main, own), *supplied], axis=1)
        self.joined += 1
        none: FloatArray = np.empty(0)
        return JointStateRecord(
            main.stamp, main.receive_time, self._names, q, none if np.isnan(v).any() else v, tau if len(main.effort) else none
        )


def _time(record: JointStateRecord) -> float:
    """The message's own stamp; when it was received, where it has none [s]."""
    return record.stamp or record.receive_time


def _values(record: JointStateRecord, index: list[int]) -> FloatArray:
    """Position, velocity and effort of some of the joints, shape (3, k); NaN where a message has none."""
    nothing = np.full(len(record.names), np.nan)
    arrays = (record.position, record.velocity, record.effort)
    return np.array([np.asarray(x if len(x) else nothing, dtype=float)[index] for x in arrays])
