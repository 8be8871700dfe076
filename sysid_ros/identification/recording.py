"""Recording: all that a robot measured in one run, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray, Measurement

_CHUNK = 8192


@dataclass(frozen=True, slots=True)
class Recording:
    """Measurements of one run, raw, in the model's joint order.

    Attributes:
        name: where they come from.
        t: stamps, shape (N,) [s]. q: shape (N, n) [rad or m]. v: shape (N, n), NaN where the robot does not measure it.
            tau: shape (N, n) [N m or N].
    """

    name: str
    t: FloatArray
    q: FloatArray
    v: FloatArray
    tau: FloatArray

    @classmethod
    def of(cls, name: str, measurements: Iterable[Measurement], progress: Callable[[int], None] = lambda n: None) -> Recording:
        """Gather measurements, in chunks: what is kept is four arrays and not the measurements.

        Args:
            progress: called with the number of measurements since the last call, now and then.

        Raises:
            DataError: there is none.
        """
        stream = iter(measurements)
        chunks = []
        while chunk := list(islice(stream, _CHUNK)):
            q = np.array([m.q for m in chunk])
            missing = np.full(q.shape[1], np.nan)
            v = np.array([missing if m.v is None else m.v for m in chunk])
            chunks.append((np.array([m.t for m in chunk]), q, v, np.array([m.tau for m in chunk])))
            progress(len(chunk))
        if not chunks:
            raise DataError(f"{name}: it holds no usable sample. Check the messages above for why they were rejected.")
        return cls(name, *(np.concatenate([c[k] for c in chunks]) for k in range(4)))

    @property
    def period(self) -> float:
        """Usual time between measurements [s]."""
        steps = np.diff(self.t)
        steps = steps[steps > 0.0]
        return float(np.median(steps)) if steps.size else 0.0

    def stretches(self, max_gap: float) -> Iterator[slice]:
        """Where time runs on without a gap longer than ``max_gap`` [s] and without running back."""
        steps = np.diff(self.t)
        cuts = np.flatnonzero((steps <= 0.0) | (steps > max_gap)) + 1
        ends = [0, *cuts.tolist(), len(self.t)]
        for first, end in pairwise(ends):
            yield slice(first, end)
