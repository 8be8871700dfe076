"""batch: jobs on many bags, on Dask, into a store; what is there is not done again."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any

from sysid_ros import __version__
from sysid_ros.exceptions import ClusterError, OutputError
from sysid_ros.fleet.bags import find, stamp_of
from sysid_ros.fleet.cluster import threads_of
from sysid_ros.fleet.dates import told_in
from sysid_ros.fleet.done import DoneIndex
from sysid_ros.fleet.in_flight import KILLED, LOST, InFlight
from sysid_ros.fleet.jobs import Task, fingerprint, run
from sysid_ros.fleet.rules import Entry, Rules
from sysid_ros.fleet.store import KEY, Done, Results, Store

_AHEAD = 4
"""Bags that are handed over for each that is at work: enough that no worker waits, and few that are lost with a scheduler."""
_WORTH = 1.0
"""Work in one task of Dask's, of as many bags as that takes [s]: beside it the milliseconds that a task costs are little."""
_TOGETHER, _NEW = 8, 0.2
"""Bags in one task at most; what the newest counts in the mean of what one takes: a worker's first ones load and compile."""
_OFTEN = 10.0
"""Results are written at least so often [s]: what a stop of this process costs at most."""
_MANY = 256
"""Results that are written at once."""
_JOIN = 100
"""Writes after which the part files of months that have many are joined."""
_PARTS = 64
"""Part files of a month that are many while more are written."""
_NEWS = 2.0
"""Time after which the number of workers is asked for again [s]."""
_AGAIN = 3
"""Times that a task is given to a worker alone after workers died over it."""


@dataclass
class Counts:
    """What became of the bags.

    Attributes:
        found: bags. skipped: of which all was done. done, failed: results. unknown: bags of a robot that no rule names.
        reasons: of the first failures, a bag each. seconds: of processors, of all jobs [s]. written: times.
    """

    found: int = 0
    skipped: int = 0
    done: int = 0
    failed: int = 0
    unknown: list[str] = field(default_factory=list)
    reasons: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    written: int = 0


_SHOWN = 20
"""Bags of which the reason is kept for the end."""


class Batch:
    """One run over some bags.

    Args:
        store: to write to, within its :meth:`.Store.writing`. rules: which robot a bag is of. jobs: names of :data:`.jobs.JOBS`.
        client: of Dask. advance: called with the number of bags that are through.

    Attributes:
        counts: so far.
    """

    def __init__(
        self, store: Store, rules: Rules, jobs: Sequence[str], client: Any, advance: Callable[[int], None] = lambda bags: None
    ) -> None:
        self.counts = Counts()
        self._store, self._rules, self._jobs, self._client, self._advance = store, rules, tuple(jobs), client, advance
        self._index = DoneIndex(store, __version__)
        self._buffer: list[Results] = []
        self._stale: set[Done] = set()
        self._last_write = time.monotonic()
        self._entries: dict[tuple[str, ...], Any] = {}
        self._threads, self._asked, self._ends = 1, -math.inf, False
        self._each = math.inf
        self._hard: list[tuple[Task, tuple[Entry, ...]]] = []

    def run(self, patterns: Sequence[str]) -> Counts:
        """Do what is not done yet on the bags that the patterns match. Whatever stops it, what was found till then is written.

        Raises:
            SettingsError: a pattern matches nothing, a job or a robot's file is not there.
            ClusterError: the scheduler was lost, or can't run the package. OutputError: the store can't be written.
        """
        if self._index.unread:
            self._store.forget(self._index.unread)  # whatever kept them from being read may be over
        try:
            self._work(self._tasks(patterns))
            for task, entries in self._hard:
                self._alone(task, entries)
        except BaseException:
            self._write_rest()
            raise
        self._write()
        self._store.compact()
        return self.counts

    def _tasks(self, patterns: Sequence[str]) -> Iterator[tuple[Task, tuple[Entry, ...]]]:
        """What there is to do, bag after bag."""
        for bag in find(patterns):
            self.counts.found += 1
            entries = tuple(self._rules.entries(bag))
            if not entries:
                if len(self.counts.unknown) < _SHOWN:
                    self.counts.unknown.append(bag)
                self._advance(1)
                continue
            stamp, told = stamp_of(bag), tuple(self._rules.told(bag))
            known = list(zip((entry.digest for entry in entries), told, strict=True))
            left = [job for job in self._jobs if not any(self._index.lies_there(bag, stamp, m, job, when) for m, when in known)]
            if left:
                yield Task(bag, stamp, tuple(left), told), entries
            else:
                self._skip()

    def _work(self, tasks: Iterator[tuple[Task, tuple[Entry, ...]]]) -> None:
        """A window of tasks at work, filled up as they are done: neither names nor results gather here."""
        flight = InFlight(self._client)
        known = len(self._index) > 0  # else nothing that a bag contains can be done
        ready: list[tuple[Task, tuple[Entry, ...]]] = []
        while True:
            free = self._window() - len(flight) - len(ready)
            wanted = free if free >= self._together() else 0  # else they would go one by one as they come back
            more = list(islice(tasks, wanted))
            self._ends = self._ends or len(more) < wanted
            if known:
                flight.submit(fingerprint, [((*item, True), (item[0].bag,)) for item in more], self._together())
            else:
                ready += more
            self._submit(flight, ready)
            ready = []
            if not flight:
                return
            for (task, entries, look), found in flight.next():
                if look:
                    task = self._not_contained(task, entries, "" if found is KILLED else found)
                    if task.jobs:
                        ready.append((task, entries))
                    else:
                        self._skip()
                elif found is KILLED:
                    self._hard.append((task, entries))
                else:
                    self._take(found)

    def _window(self) -> int:
        """How many bags are handed over at once: workers come and go, and are asked for now and then.

        Raises:
            ClusterError: the scheduler was lost.
        """
        now = time.monotonic()
        if now - self._asked > _NEWS:
            try:
                self._threads = max(threads_of(self._client), 1)
            except (OSError, TimeoutError) as error:
                raise ClusterError(LOST) from error
            self._asked = now
        return max(_AHEAD, 2 * self._together()) * self._threads

    def _together(self) -> int:
        """How many bags are one task of Dask's, by what a bag took lately; of the last ones each is its own, so that none of the
        workers is long at work when the others are done."""
        return 1 if self._ends else int(min(max(_WORTH / max(self._each, 1e-3), 1.0), _TOGETHER))

    def _submit(self, flight: InFlight, work: Sequence[tuple[Task, tuple[Entry, ...]]]) -> None:
        flight.submit(run, [((task, entries, False), (task, self._sent(entries))) for task, entries in work], self._together())

    def _sent(self, entries: tuple[Entry, ...]) -> Any:
        """The entries as a result of its own, which is made again where the worker that has it dies."""
        # robots may be called otherwise and be known alike
        which = tuple(x for entry in entries for x in (entry.robot, entry.kind, entry.description, entry.digest))
        if which not in self._entries:
            self._entries[which] = self._client.submit(_themselves, entries, pure=False)
        return self._entries[which]

    def _not_contained(self, task: Task, entries: tuple[Entry, ...], content: str) -> Task:
        """The task without the jobs that were done on the same content elsewhere."""
        known = [(entry.digest, task.of(k)) for k, entry in enumerate(entries)]
        left = [job for job in task.jobs if not any(self._index.holds(content, model, job, told) for model, told in known)]
        return replace(task, jobs=tuple(left))

    def _alone(self, task: Task, entries: tuple[Entry, ...]) -> None:
        """A task over which workers died, with no other at work; a row of its own where they die again."""
        task = self._not_contained(task, entries, "")
        for _ in range(_AGAIN):
            flight = InFlight(self._client)
            self._submit(flight, [(task, entries)])
            for _, found in flight.next():
                if found is not KILLED:
                    self._take(found)
                    return
        reason = (
            f"The processes that worked on bag '{task.bag}' were killed, each time, as where it needs more memory than they have."
        )
        key = {"hash": "", "model": entries[0].digest, "version": __version__, "robot": entries[0].robot, "kind": entries[0].kind}
        own = {"stamp": task.stamp, "status": "failed", "reason": reason} | task.of(0).columns(None)
        rows = [{"bag": task.bag, **key, "job": job} | own for job in task.jobs]
        self._take([Results(row) for row in rows])

    def _take(self, found: list[Results]) -> None:
        """Results of one bag, to be written."""
        took = sum(one.bag.get("seconds") or 0.0 for one in found)
        self._each = took if math.isinf(self._each) else self._each + _NEW * (took - self._each)
        for one in found:
            row = one.bag
            if row["version"] != __version__:
                raise ClusterError(
                    f"Dask's workers have sysid_ros {row['version']}, here it is {__version__}. Install the same there as here."
                )
            told, result = told_in(row), (row["hash"], row["model"], row["job"])
            if self._index.holds(*result, told):
                continue  # the same content at two places, both at work at once
            if self._index.holds_dated_otherwise(*result, told):
                self._redated(Done(row["hash"], row["model"], __version__, row["job"]))
            self._index.add(one)
            self._buffer.append(one)
            self.counts.seconds += row.get("seconds") or 0.0
            if row["status"] == "ok":
                self.counts.done += 1
            else:
                self.counts.failed += 1
                if len(self.counts.reasons) < _SHOWN:
                    self.counts.reasons.setdefault(row["bag"], row["reason"])
        self._advance(1)
        if len(self._buffer) >= _MANY or time.monotonic() - self._last_write > _OFTEN:
            self._write()

    def _redated(self, result: Done) -> None:
        """A result of before has another date than is told now: its rows go when the new ones come."""
        self._stale.add(result)
        self._buffer = [one for one in self._buffer if Done(*(one.bag[name] for name in KEY)) != result]

    def _skip(self) -> None:
        self.counts.skipped += 1
        self._advance(1)

    def _write(self) -> None:
        if self._buffer:
            if self._stale:
                self._store.forget(self._stale)
                self._stale = set()
            self._store.append(self._buffer)
            self._buffer = []
            self.counts.written += 1
            if self.counts.written % _JOIN == 0:
                self._store.compact(_PARTS)
        self._last_write = time.monotonic()

    def _write_rest(self) -> None:
        """On the way out of an error: what is known is written where that is possible."""
        try:
            self._write()
        except OutputError:
            return  # it is what is told already, or what follows from it


def _themselves(entries: tuple[Entry, ...]) -> tuple[Entry, ...]:
    return entries


def failed_before(store: Store) -> set[Done]:
    """Results that are failures, to be forgotten where they are to be tried again."""
    return store.done() - store.done(failed=False)
