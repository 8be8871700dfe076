"""Efforts that do not measure the motion beside them: counts that wrap, columns of another run, values that stand still."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sysid_ros.input_gate.kernel import STUCK_SAMPLES, STUCK_TIME
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

_BITS = (8, 16, 32)
_MOVED = 0.01
"""Way during values that stand still from which the arm moves [rad or m]."""
MOSTLY = 0.5
"""Part of a recording with efforts that stand still from which nothing can be told of the rest."""
_FEWEST = 20
"""Rows, not all alike, of which chance never makes two that are the same to the last bit."""


def wrapping_counts(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    """Why a joint's effort is an unsigned integer that wraps: whole numbers of a register's range that jump by more than half of
    it, there and back."""
    for r in recordings:
        for j, name in enumerate(robot.joint_names):
            values = r.tau[np.isfinite(r.tau[:, j]), j]
            if len(values) < _FEWEST or np.any(values < 0.0) or np.any(values != np.round(values)):
                continue
            bits = next((b for b in _BITS if values.max() < 2.0**b), None)
            jumps = np.diff(values)
            if bits and np.any(jumps > 2.0 ** (bits - 1)) and np.any(jumps < -(2.0 ** (bits - 1))):
                return (
                    f"{r.name}: the effort of {name} is a count of {bits} bits that wraps ({values.min():g} to {values.max():g}, "
                    f"with jumps of {np.abs(jumps).max():g}). Read it as a signed number, and multiply by its N m a count "
                    "(effort_scale)."
                )
    return None


def same_efforts(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    """Why the efforts of two recordings can't both be measured: they are the same to the bit, and the positions are not."""
    for a, b in combinations(recordings, 2):
        if len(a.t) != len(b.t) or len(a.t) < _FEWEST:
            continue
        same = [
            name
            for j, name in enumerate(robot.joint_names)
            if np.ptp(a.tau[:, j]) > 0.0 and np.array_equal(a.tau[:, j], b.tau[:, j]) and not np.array_equal(a.q[:, j], b.q[:, j])
        ]
        if same:
            return (
                f"{a.name} and {b.name}: the efforts of {', '.join(same)} are the same to the last bit in both, the positions "
                "are not. So they were not measured in these runs (a command, or another run's column). Record measured efforts."
            )
    return None


def frozen_efforts(robot: RobotModel, recordings: Sequence[Recording]) -> str | None:
    """Why most of a recording has no measured efforts."""
    for r in recordings:
        still = float(np.mean(standing_still(r.t, r.q, r.tau))) if len(r.t) else 0.0
        if still >= MOSTLY:
            return (
                f"{r.name}: in {100 * still:.0f} % of its messages no effort has changed for {STUCK_TIME:g} s or more while the "
                "robot moves: the drives were off, or the driver repeats old values. Record with the drives on, or cut it out."
            )
    return None


def standing_still(t: FloatArray, q: FloatArray, tau: FloatArray) -> NDArray[np.bool_]:
    """Rows in which no joint's effort has changed for a quarter of a second or more while the arm moves, shape (N,).

    Args:
        t: stamps, shape (N,) [s]. q, tau: shape (N, n).
    """
    same = np.all((np.diff(tau, axis=0) == 0.0) | np.isnan(tau[1:]), axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
    out = np.zeros(len(t), dtype=np.bool_)
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        run = slice(first, last + 1)
        moved = float(np.max(np.ptp(q[run], axis=0)))
        if last - first >= STUCK_SAMPLES and t[last] - t[first] >= STUCK_TIME and moved > _MOVED:
            out[first + 1 : last + 1] = True
    return out
