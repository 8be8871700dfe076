"""Watch: memory of a batch's processes while it runs."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import psutil

MB = 1024.0**2


@dataclass
class Watch:
    """Memory of this process (driver and scheduler) and of each worker, once a second, until it is stopped.

    Attributes:
        through: bags so far. rows: of bags through, memory of this process and of its largest worker [MB].
    """

    through: int = 0
    rows: list[tuple[int, float, float]] = field(default_factory=list)

    @contextmanager
    def watching(self) -> Iterator[None]:
        """While the block lasts."""
        stop = threading.Event()

        def look() -> None:
            me = psutil.Process()
            while not stop.wait(1.0):
                workers = [w.memory_info().rss / MB for w in me.children(recursive=True) if w.is_running()]
                self.rows.append((self.through, me.memory_info().rss / MB, max(workers, default=0.0)))

        thread = threading.Thread(target=look, daemon=True)
        thread.start()
        yield
        stop.set()
        thread.join()

    def growth(self) -> tuple[float, float]:
        """Median of the last quarter less that of the second, of this process and of the largest worker [MB]."""
        rows, done = np.array(self.rows or [(0, 0.0, 0.0)], dtype=float), max(self.through, 1)
        second = rows[(rows[:, 0] > 0.25 * done) & (rows[:, 0] <= 0.5 * done)]
        last = rows[rows[:, 0] > 0.75 * done]
        if not len(second) or not len(last):
            return float("nan"), float("nan")
        by = np.median(last, axis=0) - np.median(second, axis=0)
        return float(by[1]), float(by[2])
