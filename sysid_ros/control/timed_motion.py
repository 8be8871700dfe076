"""TimedMotion: the way between the points of a trajectory."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BPoly, CubicSpline

from sysid_ros.control.controller import Reference
from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray

_BETWEEN = 8


class TimedMotion:
    """Points with splines between them: quintic where accelerations are given, cubic where only velocities are, and a cubic
    spline with continuous accelerations, at rest at its end, where there are only positions. At rest before and after.

    Args:
        t: times from the start, ascending, shape (N,) [s]. q, v, a: shape (N, n) each [rad or m, a second, a second squared]; v
            and a may be None. speed: velocity at the first of points that have only positions, shape (n,); None: at rest.

    Raises:
        DataError: there are fewer than two points, a number is not finite, or times do not ascend.
    """

    def __init__(
        self,
        t: FloatArray,
        q: FloatArray,
        v: FloatArray | None = None,
        a: FloatArray | None = None,
        speed: FloatArray | None = None,
    ) -> None:
        if len(t) < 2:
            raise DataError(f"the motion has {len(t)} points; it must have two or more.")
        if not all(np.all(np.isfinite(x)) for x in (t, q, v, a) if x is not None):
            raise DataError("the motion holds numbers that are not finite. Every point must be known.")
        if np.any(np.diff(t) <= 0.0):
            raise DataError("the times of the motion do not ascend. Sort the points, or leave out doubles.")
        if v is None:
            still = np.zeros(q.shape[1])
            self._q = CubicSpline(t, q, axis=0, bc_type=((1, still if speed is None else speed), (1, still)))
        else:
            given = [q, v] if a is None else [q, v, a]
            self._q = BPoly.from_derivatives(t, np.stack(given, axis=1))
        self._v, self._a = self._q.derivative(), self._q.derivative(2)
        self.begin, self.end = float(t[0]), float(t[-1])

    @classmethod
    def braking(cls, q: FloatArray, v: FloatArray, time: float) -> TimedMotion:
        """From the state q, v, shape (n,) each, to rest within ``time`` [s], half of it later along the way."""
        still = np.zeros_like(v)
        ends = [np.stack(pair) for pair in ((q, q + 0.5 * time * v), (v, still), (still, still))]
        return cls(np.array([0.0, time]), *ends)

    def at(self, t: float) -> Reference:
        """What is wanted t after the start [s]."""
        inside = min(max(t, self.begin), self.end)
        q = np.asarray(self._q(inside))
        if inside != t or t == self.end:
            return Reference(q, np.zeros_like(q), np.zeros_like(q))
        return Reference(q, np.asarray(self._v(t)), np.asarray(self._a(t)))

    def along(self, step: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Times, positions and velocities every ``step`` [s] at least and several times between any two points, shapes (M,),
        (M, n) and (M, n)."""
        points = self._q.x
        parts = np.linspace(points[:-1], points[1:], _BETWEEN, endpoint=False).ravel()
        t = np.union1d(parts, np.append(np.arange(self.begin, self.end, step), self.end))
        return t, np.asarray(self._q(t)), np.asarray(self._v(t))
