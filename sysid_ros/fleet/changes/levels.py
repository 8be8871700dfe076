"""Levels: what is usual of a robot's own friction, rotor and noise, in whose units robots of one kind are alike.

What temperature, load and the days do to a friction is a part of that friction, and frictions of one kind differ by tens of per
cent: in N m a robot whose gear is stiff would seem to scatter and to wander more than its kind, and that would pass for a change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid_ros.fleet.changes.series import Series
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.sample import FloatArray

RELATIVE = ("coulomb_friction", "viscous_friction", "rotor_inertia", "noise")
"""Parameters that are positive, and of which all that moves them is a part."""
_BETWEEN = 0.5
"""Prior standard deviation of the logarithm of a level, between robots of a kind."""
_OF_MEDIAN = 1.253
"""Standard deviation of a median over that of a mean."""


def levels(joints: Sequence[Series]) -> list[FloatArray]:
    """Of the same joint of each robot, its usual level over that of the kind, shape (8,): 1 where a parameter is no relative one,
    and as near to 1 as its bags know little of it."""
    found = [np.ones(len(JOINT_PARAMETERS)) for _ in joints]
    for p in (JOINT_PARAMETERS.index(name) for name in RELATIVE):
        known = [np.isfinite(j.y[:, p]) for j in joints]
        usual = np.array([np.median(j.y[k, p]) if k.any() else np.nan for j, k in zip(joints, known, strict=True)])
        positive = usual > 0.0
        if positive.sum() < 2:
            continue
        of_kind = float(np.median(usual[positive]))
        for r in np.flatnonzero(positive):
            some = joints[int(r)].y[known[int(r)], p]
            error = _OF_MEDIAN * float(np.std(some)) / np.sqrt(some.size) / usual[r] if some.size > 1 else np.inf
            part = _BETWEEN**2 / (_BETWEEN**2 + error**2)
            found[r][p] = np.exp(part * np.log(usual[r] / of_kind))
    return found


def in_levels(series: Series, level: FloatArray) -> Series:
    """A series in units of a level of each parameter, shape (8,)."""
    return replace(series, y=series.y / level, covariance=series.covariance / np.outer(level, level))
