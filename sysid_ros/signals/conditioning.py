"""From raw recordings to smooth motions on an even grid, without shifting any channel in time.

The order of the stamps, the stretches without a gap, the even grid and the design of the low-pass are those of every recording
(:mod:`.recording`, :mod:`.zero_phase`). The low-pass itself is not that of identification's rows: the same one must go over
modelled dry friction on the motion's own grid (:func:`as_measured`), which a filter that decimates can't do.
"""

from __future__ import annotations

import numpy as np
from scipy import interpolate

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.seen_motion import clear_band, seen_band, what_is_seen
from sysid_ros.signals.velocity_channel import continued
from sysid_ros.signals.zero_phase import low_passed, on_even_grid

SMOOTHING = 20.0
"""Cut-off of the zero-phase low-pass on positions and torques [Hz]: far enough above the band that is judged."""
FINEST = 200.0
"""Largest rate of the grid [Hz]."""
MAX_GAP = 0.1
"""A longer gap between stamps splits a recording [s]."""
SHORTEST = 2.0
"""Shorter stretches are left out [s]."""
_FEWEST = 20
"""Rows that a stretch must have more of."""
_SLOW = 0.2
"""No joint's temperature follows faster; readings come in steps [Hz]."""
_EDGE = 0.25
"""Ends of a stretch, where the filters are still in transient, are cut off [s]."""


def motions(robot: RobotModel, recording: Recording) -> list[Motion]:
    """Smooth motions of the stretches without a gap; times since the recording's first stamp.

    Stamps that repeat or run back are left out. Positions and torques go through the same even grid and the same low-pass
    forward and backward; velocity and acceleration are derivatives of the quintic spline
    through the positions. A temperature that is not known all along a stretch is NaN in all of it.
    """
    gap, recording = _gap(recording), recording.in_order()
    t, out = recording.t - recording.start, []
    for part in recording.stretches(gap):
        if part.stop - part.start > _FEWEST and t[part][-1] - t[part][0] >= SHORTEST:
            v = None if recording.v is None else recording.v[part]
            out.append(_smooth(robot, t[part], recording.q[part], recording.tau[part], v))
            out[-1].recording = recording.whole
            if recording.temperature is not None:
                out[-1].temperature = _along(out[-1].t, t[part], recording.temperature[part])
    return out


def longest_stretch(recording: Recording) -> float:
    """Time without a gap, of which :func:`motions` makes a motion where it is :data:`SHORTEST` or more [s]."""
    gap, recording = _gap(recording), recording.in_order()
    parts = [recording.t[part] for part in recording.stretches(gap)]
    return max((float(t[-1] - t[0]) for t in parts if len(t) > _FEWEST), default=0.0)


def _gap(recording: Recording) -> float:
    """That splits a recording [s]."""
    return max(MAX_GAP, 3.0 * recording.period)


def _smooth(robot: RobotModel, t: FloatArray, q: FloatArray, tau: FloatArray, v: FloatArray | None) -> Motion:
    period, n = float(np.median(np.diff(t))), q.shape[1]
    rate = 1.0 / period
    grid, even = on_even_grid(t, np.hstack([q, tau]), period)
    seen, clear = seen_band(even[:, :n], rate), clear_band(even[:, :n], rate)
    if v is not None:
        velocity = on_even_grid(t, v, period)[1]
        even[:, :n], used = continued(even[:, :n], velocity, rate)
        if used.any():
            seen[used], clear[used] = np.inf, clear_band(velocity[:, used], rate)
    smooth_q, smooth_tau = np.split(as_measured(even, period), [n], axis=1)
    every = max(1, int(rate / FINEST))
    grid, smooth_q, smooth_tau = grid[::every], smooth_q[::every], smooth_tau[::every]
    smooth_q = what_is_seen(smooth_q, rate / every, seen)
    spline = interpolate.make_interp_spline(grid, smooth_q, k=5)
    inside = slice(*np.searchsorted(grid, [grid[0] + _EDGE, grid[-1] - _EDGE]))
    speed, a = (spline(grid, nu=order)[inside] for order in (1, 2))
    motion = Motion(robot, grid[inside], smooth_q[inside], speed, a, smooth_tau[inside])
    motion.clear = clear
    return motion


def as_measured(x: FloatArray, period: float) -> FloatArray:
    """Columns of a channel on an even grid, through the low-pass that measured torques go through, shape (N, n)."""
    return low_passed(x, min(SMOOTHING, 0.2 / period), period)


def _along(grid: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    """Columns of slow values on a grid, without the steps of their sensors, shape (grid, n); NaN where one of a column is."""
    period = float(np.median(np.diff(grid)))
    out = np.full((len(grid), values.shape[1]), np.nan)
    for j in np.flatnonzero(np.isfinite(values).all(axis=0)):
        even = np.interp(grid, t, values[:, j])
        out[:, j] = low_passed(even, _SLOW, period, order=2, padding=1.0 / _SLOW)
    return out
