"""What the figure and the page of an excitation show, free of any drawing library."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.excitation.excite import Excitation
from sysid_ros.excitation.motion_limits import KINDS
from sysid_ros.sample import FloatArray

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#555555", "#8C6D31")
"""Of the joints, over again where there are more."""

TITLES = {
    "position": "Position",
    "velocity": "Velocity",
    "acceleration": "Acceleration",
    "torque": "Nominal torque",
}
_POINTS = 1000


@dataclass(frozen=True, slots=True)
class Curves:
    """A motion over time.

    Attributes:
        t: shape (N,) [s].
        use: part of each limit that is used, signed, shape (4, N, n), in the order of ``KINDS``; 0 where there is no limit.
        q: shape (N, n) [rad or m].
        position_unit: of most joints.
    """

    t: FloatArray
    use: FloatArray
    q: FloatArray
    position_unit: str


def curves(excitation: Excitation) -> Curves:
    """A thousand points of the motion."""
    trajectory, limits = excitation.trajectory, excitation.limits
    t = np.linspace(0.0, trajectory.duration, _POINTS)
    q, v, a = trajectory.sample(t)
    slides = limits.robot.is_prismatic
    unit = "m" if np.all(slides) else "rad" if not np.any(slides) else "rad or m"
    return Curves(t, limits.use(q, v, a, limits.torque(q, v, a)), q, unit)


def headline(excitation: Excitation) -> str:
    """The criteria in a line."""
    median = float(np.median([c.d for c in excitation.random]))
    best = excitation.random[0].d
    return (
        f"D {excitation.criteria.d:.1f} (of {len(excitation.random)} random feasible motions: median {median:.1f}, "
        f"best {best:.1f}), condition number {excitation.criteria.condition_number:.1f}"
    )


def used(excitation: Excitation) -> FloatArray:
    """Largest part of each limit that is used, shape (n, 4), columns in the order of ``KINDS``."""
    return np.asarray(excitation.use.limits.T)


__all__ = ["COLOURS", "KINDS", "TITLES", "Curves", "curves", "headline", "used"]
