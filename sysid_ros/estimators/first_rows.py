"""learn_first: the noise of the first rows, from one fit to all of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.estimators import variable_update
from sysid_ros.estimators.update_state import FLOOR, SPREAD
from sysid_ros.sample import FloatArray

_SUPPOSED = 10.0
"""For so many rows counts what is supposed of their noise."""
_ITERATIONS = 10
"""Of the expectation maximisation; each brings the spread of a row of which half is told by half as near."""


def learn_first(
    early: Sequence[tuple[FloatArray, FloatArray, FloatArray]],
    theta: FloatArray,
    levels: FloatArray,
    freedom: float,
    period: float,
) -> list[tuple[FloatArray, FloatArray]]:
    """Learn the spread of residuals anew from the first rows; the residuals, brought to the noise that all rows have,
    and the part of their variance that is noise.

    A row next to whose noise much more may hide tells nothing of it: its spread is first supposed to be above its floor as those
    of the others are.

    Args:
        early: Y (m, p), tau (m,) and extra variance (m,) of each. theta: fitted to them, shape (p,).
        levels: as of :func:`.variable_update.take_in`. freedom: part of the residuals' variance that the fit leaves.
        period: between updates [s].
    """
    residuals = np.array([torque - rows @ theta for rows, torque, _ in early]) / np.sqrt(freedom)
    extra, spread = np.array([more for _, _, more in early]), levels[SPREAD]
    spread[:] = _typical(residuals, extra, spread, levels[FLOOR])
    for count, (residual, more) in enumerate(zip(residuals, extra, strict=True)):
        rate, clip = max(1.0 / (count + 1), period / variable_update.SPREAD_MEMORY), count * period > variable_update.CLIP_AFTER
        variable_update.learn_spread(residual, more, levels, rate, clip)
    part = spread / (spread + extra)
    return list(zip(residuals * np.sqrt(part), part, strict=True))


def _typical(residuals: FloatArray, extra: FloatArray, spread: FloatArray, floor: FloatArray) -> FloatArray:
    """Spread of each row, (m,), from what all residuals (N, m) tell together of how far above their floors (m,) they are."""
    for _ in range(_ITERATIONS):
        part = spread / (spread + extra)
        told = part.sum(axis=0)
        own = np.sum(part * (part * part * residuals**2 + (1.0 - part) * spread), axis=0) / np.maximum(told, 1e-9)
        above = told @ np.log(np.maximum(own / floor, 1.0)) / max(float(told.sum()), 1e-9)
        spread = (told * own + _SUPPOSED * floor * np.exp(above)) / (told + _SUPPOSED)
    return np.maximum(spread, floor)
