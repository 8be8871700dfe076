"""Recording: what a robot published, as it was published."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray, Measurement


@dataclass(frozen=True)
class Recording:
    """Raw channels of one recording, in the model's joint order.

    Attributes:
        name: where it comes from.
        t: stamps, shape (N,) [s].
        q, tau: positions and torques, shape (N, n). v: velocities alike, or None where the robot does not publish them.
        temperature: of the joints, shape (N, n) [degrees Celsius], NaN where it is not known; None where none is.
        first: stamp that times count from, of a part of a recording [s]; None for the first one here.

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

    def __post_init__(self) -> None:
        shapes = [np.shape(x) for x in (self.q, self.tau, self.v, self.temperature) if x is not None]
        if np.ndim(self.t) != 1 or any(shape != shapes[0] or len(shape) != 2 or shape[0] != len(self.t) for shape in shapes):
            raise DataError(
                f"{self.name}: t has shape {np.shape(self.t)} and the channels {', '.join(map(str, shapes))}; t must be (N,) and "
                "each channel (N, n)."
            )

    @classmethod
    def from_measurements(cls, name: str, measurements: Sequence[Measurement]) -> Recording:
        """The channels of measurements; the velocity only where all of them have one.

        Raises:
            DataError: there is none.
        """
        if not measurements:
            raise DataError(f"{name}: no message of it can be used. Record positions and efforts of the robot's joints.")
        v = [m.v for m in measurements if m.v is not None]
        return cls(
            name,
            np.array([m.t for m in measurements]),
            np.stack([m.q for m in measurements]),
            np.stack(v) if len(v) == len(measurements) else None,
            np.stack([m.tau for m in measurements]),
        )

    def at(self, rows: slice | NDArray[np.bool_] | NDArray[np.intp], name: str = "") -> Recording:
        """The messages of some rows, in their order; ``name`` is a new one."""
        v, warm = (None if x is None else x[rows] for x in (self.v, self.temperature))
        return Recording(name or self.name, self.t[rows], self.q[rows], v, self.tau[rows], warm, self.start)

    @property
    def start(self) -> float:
        """Stamp that times count from [s]."""
        return float(self.t[0]) if self.first is None else self.first

    @property
    def seconds(self) -> float:
        """From the first stamp to the last [s]."""
        return float(self.t[-1] - self.t[0]) if len(self.t) else 0.0

    @property
    def rate(self) -> float:
        """Messages a second, from the usual step between stamps [Hz]."""
        steps = np.diff(self.t)
        steps = steps[steps > 0.0]
        return float(1.0 / np.median(steps)) if steps.size else 0.0
