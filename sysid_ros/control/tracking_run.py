"""TrackingRun: how a control law did."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class TrackingRun:
    """How a law did, at 100 Hz.

    Attributes:
        law: its name. t: shape (N,) [s]. error: wanted minus true positions, shape (N, n) [rad].
        tip_error: distance of the tip from where it should be, shape (N,) [m]. mass: that the law believed in, shape (N,) [kg].
        tau: torques, shape (N, n) [N m]. clipped: steps in which a torque was at its limit. lost: time at which the motion was
        lost [s], None where it was not; the run ends there. notes: of the law's feedback. q: true positions,
        shape (N, n) [rad]; None where they were not kept.
    """

    law: str
    t: FloatArray
    error: FloatArray
    tip_error: FloatArray
    mass: FloatArray
    tau: FloatArray
    clipped: int
    lost: float | None
    notes: tuple[str, ...] = ()
    q: FloatArray | None = None

    def tip_rms(self, begin: float, end: float) -> float:
        """Of the tip's error from ``begin`` to ``end`` [s], NaN where the run has no sample there [m]."""
        part = self.tip_error[(self.t >= begin) & (self.t < end)]
        return float(np.sqrt(np.mean(part**2))) if part.size else float("nan")
