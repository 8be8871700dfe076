"""Postures: where a robot's joints were, a few times a second, to be looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.sample import FloatArray, ImuRecord, Measurement

RATE = 25.0
"""Postures a second [Hz]: as a film."""


@dataclass(frozen=True, eq=False, slots=True)
class Postures:
    """A motion to be looked at.

    Attributes:
        t: stamps, shape (N,) [s]. q: joint positions in the model's order, shape (N, n) [rad or m].
        orientation: of the IMU's link in the world as the IMU says it, x, y, z, w, shape (N, 4); None where none does.
        imu_frame: that link.
    """

    t: FloatArray
    q: FloatArray
    orientation: FloatArray | None = None
    imu_frame: str = ""


class PostureLog:
    """Keeps a posture every twenty-fifth of a second of a stream of measurements."""

    def __init__(self) -> None:
        self._t: list[float] = []
        self._q: list[FloatArray] = []
        self._turns: list[Sequence[float] | FloatArray] = []
        self._next = -np.inf
        self._turn: Sequence[float] | FloatArray = (0.0, 0.0, 0.0, 0.0)
        self._frame = ""

    def turn(self, record: ImuRecord) -> None:
        """The orientation that postures have from now on."""
        self._turn, self._frame = record.orientation, record.frame_id

    def add(self, measurement: Measurement) -> None:
        """A measurement, in the order of time."""
        if measurement.t >= self._next:
            self._t.append(measurement.t)
            self._q.append(measurement.q)
            self._turns.append(self._turn)
            self._next = measurement.t + (1.0 - 1e-6) / RATE

    def postures(self) -> Postures | None:
        """All of them; None where there was no measurement."""
        if not self._t:
            return None
        turns = np.array(self._turns, dtype=float)
        # an IMU without an orientation says so by zeros, or by a first covariance of -1 with anything
        there = bool(np.all(np.abs(np.linalg.norm(turns, axis=1) - 1.0) < 0.05))
        return Postures(np.array(self._t), np.array(self._q), turns if there else None, self._frame if there else "")
