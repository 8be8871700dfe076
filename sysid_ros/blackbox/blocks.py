"""Stretches of recordings that are added, left out and drawn again: for held-out errors and for intervals."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sysid_ros.blackbox.moments import Moments
from sysid_ros.blackbox.series import Series
from sysid_ros.blackbox.state_space import StateSpace
from sysid_ros.sample import FloatArray

_NEAR = 3
"""Blocks on each side that a block may be drawn from: a chirp is not the same everywhere."""
_BEYOND_ALL = 1e12
"""Squared error of one step beyond which a prediction has run away."""


def blocks_of(series: Sequence[Series], moments: Moments, count: int) -> tuple[FloatArray, list[Series]]:
    """Moments of blocks of about equal length, shape (b, w, w), and their rows with the past that they begin with.

    Args:
        count: of blocks; fewer where they would be shorter than three pasts.
    """
    total = sum(len(s) for s in series)
    length = max(total // count, 3 * moments.p)
    out, pieces = [], []
    for s in series:
        own = max(len(s) // length, 1) if len(s) > 2 * moments.p else 0
        edges = np.linspace(moments.p, len(s), own + 1).astype(int) if own else np.zeros(1, dtype=int)
        for a, b in pairwise(edges):
            piece = s.rows(slice(int(a) - moments.p, int(b)))
            out.append(moments.of(piece.u, piece.y))
            pieces.append(piece)
    return np.array(out), pieces


def drawn_near(count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """For each block one of its neighbours, or itself (local block bootstrap, Paparoditis, Politis 2002), shape (count,)."""
    at = np.arange(count) + rng.integers(-_NEAR, _NEAR + 1, count)
    # mirrored at the ends
    return np.asarray(np.where(at < 0, -at - 1, np.where(at >= count, 2 * count - 1 - at, at)), dtype=np.intp)


def prediction_error(model: StateSpace, pieces: Sequence[Series], steps: int) -> float:
    """Mean square error of the outputs predicted from the past and the inputs over the next 1 to ``steps`` steps."""
    total, count, p = 0.0, 0, model.past
    for s in pieces:
        starts = np.arange(p, len(s) - steps, 2)
        if not starts.size:
            continue
        z = np.column_stack([s.u, s.y])
        windows = np.lib.stride_tricks.sliding_window_view(z, p, axis=0)[starts - p]
        x = model.state @ np.swapaxes(windows, 1, 2).reshape(len(starts), -1).T
        for step in range(steps):
            at = s.u[starts + step].T
            rest = s.y[starts + step].T - model.C @ x - model.D @ at
            total += float(np.sum(np.minimum(rest**2, _BEYOND_ALL)))
            count += rest.size
            x = model.A @ x + model.B @ at
    return total / max(count, 1)
