"""DoneIndex: which jobs on which bags need not be done again, in a few bytes each."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from sysid_ros.fleet.store import Done, Results, Store

_KEPT = 10_000
"""Keys that are kept loose before they are sorted in."""


class DoneIndex:
    """What a store holds, by where a bag lies and by what it contains.

    A bag whose path and files' sizes and times are those of before is known without being read; one that was moved or copied is
    known by its content. A key is 64 bits of a hash: of a million bags two are taken for one another with a probability of 1e-7.

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
        names = ["bag", "stamp", "hash", "model", "version", "job"]
        for month in store.months():
            rows = store.read("bags", names, [month])
            for bag, stamp, content, model, its, job in zip(*(rows.column(n).to_pylist() for n in names), strict=True):
                if not content:
                    self.unread.add(Done(content, model, its, job))
                elif its == version:
                    self._add(bag, stamp, content, model, job)

    def __len__(self) -> int:
        return len(self._sorted) + len(self._loose)

    def lies_there(self, bag: str, stamp: str, model: str, job: str) -> bool:
        """Whether the job is done on the bag at this place, as its files are now."""
        return bool(stamp) and self._has(_key("place", bag, stamp, model, job))

    def holds(self, content: str, model: str, job: str) -> bool:
        """Whether the job is done on this content."""
        return bool(content) and self._has(_key("content", content, model, job))

    def add(self, result: Results) -> None:
        """A result is to be written."""
        row = result.bag
        if row["hash"]:
            self._add(row["bag"], row["stamp"], row["hash"], row["model"], row["job"])

    def _add(self, bag: str, stamp: str, content: str, model: str, job: str) -> None:
        self._loose |= {_key("place", bag, stamp, model, job), _key("content", content, model, job)}
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
