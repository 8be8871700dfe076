"""TruthSegment: what a simulation knows and an estimate is compared with."""

from __future__ import annotations

from dataclasses import dataclass

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class TruthSegment:
    """The payload that was really there from ``start`` to ``end``.

    Attributes:
        start, end: stamps of the same clock as the estimates [s].
        mass: [kg]; 0 where nothing was carried.
        com: centre of mass in the estimate's frame, shape (3,) [m].
        inertia_com: inertia about the centre of mass, axes parallel to the frame, shape (3, 3) [kg m^2].
    """

    start: float
    end: float
    mass: float
    com: FloatArray
    inertia_com: FloatArray
