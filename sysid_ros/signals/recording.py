"""Recording: what a robot published, as it was published."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray, Measurement, TrunkReading
from sysid_ros.signals.trunk_channels import TrunkChannels

_CHUNK = 8192
"""Measurements gathered at once."""


@dataclass(frozen=True)
class Recording:
    """Raw channels of one recording, in the model's joint order.

    Attributes:
        name: where it comes from.
        t: stamps, shape (N,) [s].
        q, tau: positions and torques, shape (N, n). v: velocities alike, or None where any message lacks them.
        temperature: of the joints, shape (N, n) [degrees Celsius], NaN where it is not known; None where none is.
        first: stamp that times count from, of a part of a recording [s]; None for the first one here.
        trunk: what IMU and feet tell at the same stamps, of a robot on legs; else None.
        part_of: name of the recording that it is a part of; empty where it is a whole one.

    Raises:
        DataError: the shapes do not fit one another.
    """

    name: str
    t: FloatArray
    q: FloatArray
    v: FloatArray | None
    tau: FloatArray
    temperature: FloatArray | None = None
    first: float | None = None
    trunk: TrunkChannels | None = None
    part_of: str = ""

    def __post_init__(self) -> None:
        shapes = [np.shape(x) for x in (self.q, self.tau, self.v, self.temperature) if x is not None]
        if np.ndim(self.t) != 1 or any(shape != shapes[0] or len(shape) != 2 or shape[0] != len(self.t) for shape in shapes):
            raise DataError(
                f"{self.name}: t has shape {np.shape(self.t)} and the channels {', '.join(map(str, shapes))}; t must be (N,) and "
                "each channel (N, n)."
            )

    @classmethod
    def from_measurements(
        cls, name: str, measurements: Iterable[Measurement], progress: Callable[[int], None] = lambda count: None
    ) -> Recording:
        """The channels of measurements, gathered in chunks: what is kept is arrays and not the measurements. The velocity
        only where all of them have one.

        Args:
            progress: called with the number of measurements since the last call, now and then.

        Raises:
            DataError: there is none.
        """
        stream = iter(measurements)
        chunks: list[tuple[FloatArray, ...]] = []
        velocities: list[FloatArray] | None = []
        readings: list[TrunkReading] = []
        while chunk := list(islice(stream, _CHUNK)):
            chunks.append((np.array([m.t for m in chunk]), np.stack([m.q for m in chunk]), np.stack([m.tau for m in chunk])))
            v = [m.v for m in chunk if m.v is not None and np.isfinite(m.v).all()]
            readings += [m.trunk for m in chunk if m.trunk is not None]
            if velocities is not None:
                velocities = [*velocities, np.stack(v)] if len(v) == len(chunk) else None
            progress(len(chunk))
        if not chunks:
            raise DataError(
                f"{name}: no message of it can be used. Record positions and efforts of the robot's joints, and look above for "
                "why messages were rejected."
            )
        t, q, tau = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
        trunk = TrunkChannels.of(readings) if len(readings) == len(t) else None
        return cls(name, t, q, np.concatenate(velocities) if velocities else None, tau, trunk=trunk)

    def at(self, rows: slice | NDArray[np.bool_] | NDArray[np.intp], name: str = "") -> Recording:
        """The messages of some rows, in their order; ``name`` is a new one, of a part."""
        v, warm = (None if x is None else x[rows] for x in (self.v, self.temperature))
        trunk = None if self.trunk is None else self.trunk.at(rows)
        whole, name = (self.whole, name) if name else (self.part_of, self.name)
        return Recording(name, self.t[rows], self.q[rows], v, self.tau[rows], warm, self.start, trunk, whole)

    @property
    def whole(self) -> str:
        """Name of the recording that it is, or is a part of."""
        return self.part_of or self.name

    @property
    def start(self) -> float:
        """Stamp that times count from [s]."""
        return float(self.t[0]) if self.first is None else self.first

    @property
    def seconds(self) -> float:
        """From the first stamp to the last [s]."""
        return float(self.t[-1] - self.t[0]) if len(self.t) else 0.0

    @property
    def period(self) -> float:
        """Usual time between messages [s]; 0 where there are not two."""
        steps = np.diff(self.t)
        steps = steps[steps > 0.0]
        return float(np.median(steps)) if steps.size else 0.0

    @property
    def rate(self) -> float:
        """Messages a second, from the usual time between them [Hz]."""
        return 1.0 / self.period if self.period else 0.0

    def in_order(self) -> Recording:
        """Without messages whose stamp repeats or runs back, or whose position or torque is no number."""
        t = np.asarray(self.t, dtype=float)
        keep = np.asarray(np.isfinite(np.hstack([self.q, self.tau])).all(axis=1))
        keep[1:] &= t[1:] > np.maximum.accumulate(t)[:-1]
        return self if keep.all() else self.at(keep)

    def stretches(self, max_gap: float) -> Iterator[slice]:
        """Where time runs on without a gap longer than ``max_gap`` [s] and without running back."""
        steps = np.diff(self.t)
        cuts = np.flatnonzero((steps <= 0.0) | (steps > max_gap)) + 1
        for first, end in pairwise([0, *cuts.tolist(), len(self.t)]):
            yield slice(first, end)
