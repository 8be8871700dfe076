"""LeggedGround: what robots on legs walk on: how much it grips, how far feet sink into it, and stairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.sample import FloatArray

_BEGIN, _RUN, _FLIGHT, _END = 0.5, 0.3, 4, 15.0
"""Where the first step rises, how deep each is [m], steps up before as many go down, and where they end [m]."""
_HALF_WIDTH = 15.0


@dataclass(frozen=True, slots=True)
class LeggedGround:
    """A plane, or stairs that go up and down, ahead and behind alike.

    Attributes:
        grip: Coulomb coefficient of the feet. sink: how far a foot that carries a quarter of the robot sinks in [m]; 0: hard.
        rise: of a step of the stairs [m]; 0: there are none.
    """

    grip: float = 0.8
    sink: float = 0.0
    rise: float = 0.0

    def height(self, x: float) -> float:
        """Of the ground at x [m] ahead of where the robot begins [m]."""
        return self.rise * _steps(x) if self.rise > 0.0 else 0.0

    def boxes(self) -> list[tuple[FloatArray, FloatArray]]:
        """Centre and half the edges of each box that stairs are made of, shape (3,) each [m]."""
        if self.rise == 0.0:
            return []
        out = []
        for x in np.arange(_BEGIN + 0.5 * _RUN, _END, _RUN):
            height = self.height(float(x))
            if height > 0.0:
                half = np.array([0.5 * _RUN, _HALF_WIDTH, 0.5 * height])
                out += [(np.array([side * x, 0.0, 0.5 * height]), half) for side in (-1.0, 1.0)]
        return out


def _steps(x: float) -> int:
    k = int(max(np.floor((min(abs(x), _END) - _BEGIN) / _RUN) + 1.0, 0.0))
    return _FLIGHT - abs(k % (2 * _FLIGHT) - _FLIGHT)
