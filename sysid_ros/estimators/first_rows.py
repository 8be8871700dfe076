"""learn_first: the noise of the first rows, from one fit to all of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.estimators import variable_update
from sysid_ros.sample import FloatArray


def learn_first(
    early: Sequence[tuple[FloatArray, FloatArray, FloatArray]],
    theta: FloatArray,
    levels: FloatArray,
    freedom: float,
    period: float,
    memory: float,
    clip_after: float,
) -> list[FloatArray]:
    """Learn the spread of residuals anew from the first rows; the residuals, brought to the noise that all rows have.

    Args:
        early: Y (m, p), tau (m,) and extra variance (m,) of each. theta: fitted to them, shape (p,).
        levels: as of :func:`.variable_update.take_in`. freedom: part of the residuals' variance that the fit leaves.
        period: between updates [s]. memory, clip_after: as of :class:`.VariableForgetting` [s].
    """
    out = []
    for count, (rows, torque, more) in enumerate(early):
        residual = (torque - rows @ theta) / np.sqrt(freedom)
        spread = levels[variable_update.SPREAD]
        out.append(residual * np.sqrt(spread / (spread + more)))
        variable_update.learn_spread(residual, more, levels, max(1.0 / (count + 1), period / memory), count * period > clip_after)
    return out
