"""DoneIndex: which jobs on which bags need not be done again, in a few bytes each."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sysid_ros.fleet.dates import Told, told_in
from sysid_ros.fleet.store import Done, Results, Store

NOTHING: Final = Told()
"""Is told of a bag's date: its own stamps count."""

_KEPT = 10_000
"""Keys that are kept loose before they are sorted in."""


class DoneIndex:
    """What a store holds, by where a bag lies and by what it contains.

    A bag whose path and files' sizes and times are those of before is known without being read; one that was moved or copied is
    known by its content. A result that has another date than robots.yaml tells now is not done. A key is 64 bits of a hash: of a
    million bags two are taken for one another with a probability of 1e-7.

    Args:
        store: to look into. version: of the package: what another one found is not done.

    Attributes:
        unread: results of bags that could not be read at all, of which nothing is known.
    """

    def __init__(self, store: Store, version: str) -> None:
        self._version = version
        self._sorted: NDArray[np.uint64] = np.zeros(0, dtype=np.uint64)
        self._loose: set[int] = set()
        self.unread: set[Done] = set()
        names = ["bag", "stamp", "hash", "model", "version", "job", "date", "date_told", "campaign", "campaign_order"]
        for month in store.months():
            for row in store.read("bags", names, [month]).to_pylist():
                if not row["hash"]:
                    self.unread.add(Done(row["hash"], row["model"], row["version"], row["job"]))
                elif row["version"] == version:
                    self._add(row)

    def __len__(self) -> int:
        return len(self._sorted) + len(self._loose)

    def lies_there(self, bag: str, stamp: str, model: str, job: str, told: Told = NOTHING) -> bool:
        """Whether the job is done on the bag at this place, as its files are now, with the date that is told of it."""
        return bool(stamp) and self._has(_key("place", bag, stamp, model, job, told.key))

    def holds(self, content: str, model: str, job: str, told: Told = NOTHING) -> bool:
        """Whether the job is done on this content, with the date that is told of it."""
        return bool(content) and self._has(_key("content", content, model, job, told.key))

    def holds_dated_otherwise(self, content: str, model: str, job: str, told: Told) -> bool:
        """Whether the job is done on this content, but with another date."""
        return bool(content) and self._has(_key("any date", content, model, job)) and not self.holds(content, model, job, told)

    def add(self, result: Results) -> None:
        """A result is to be written."""
        row = result.bag
        if row["hash"]:
            self._add(row)

    def _add(self, row: Mapping[str, Any]) -> None:
        content, model, job, told = row["hash"], row["model"], row["job"], told_in(row).key
        self._loose |= {
            _key("place", row["bag"], row["stamp"], model, job, told),
            _key("content", content, model, job, told),
            _key("any date", content, model, job),
        }
        if len(self._loose) > _KEPT:
            self._sorted = np.union1d(self._sorted, np.fromiter(self._loose, dtype=np.uint64))
            self._loose.clear()

    def _has(self, key: int) -> bool:
        if key in self._loose:
            return True
        at = int(np.searchsorted(self._sorted, np.uint64(key)))
        return at < len(self._sorted) and int(self._sorted[at]) == key


def _key(*parts: str) -> int:
    return int.from_bytes(hashlib.blake2b("\0".join(parts).encode(), digest_size=8).digest())
