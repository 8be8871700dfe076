"""Levers: what an error of a joint's zero or of a mass at the tip costs in a bag's motion, in millimetres and newton metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.fleet.track_rows import TrackRows
from sysid_ros.sample import FloatArray

_EVERY = 0.1
"""Time between the postures that are looked at [s]; those between are alike."""


@dataclass(frozen=True, slots=True)
class Levers:
    """Of n joints, root mean squares over the time of a bag.

    Attributes:
        reach: way of the carrying link's origin per way of the joint, shape (n,) [m/rad; 1 of a prismatic joint].
        by_zero: change of torque per error of the joint's zero, of the joint where that is most, shape (n,) [N m/rad].
        by_mass: torque of the joint per mass at the carrying link's origin, shape (n,) [N m/kg].
    """

    reach: FloatArray
    by_zero: FloatArray
    by_mass: FloatArray


def levers_of(rows: TrackRows) -> Levers:
    """From the motion and the model of a bag."""
    known = rows.known
    q = np.concatenate([m.q[:: max(1, round(_EVERY * len(m.t) / max(np.ptp(m.t), _EVERY)))] for m in rows.motions])
    jacobian = known.robot.frame_jacobian_along(q, known.robot.frame_id(known.frame))
    _, turned, bodies = rows.filtered
    return Levers(
        reach=np.sqrt(np.mean(np.sum(jacobian**2, axis=1), axis=0)),
        by_zero=np.sqrt(np.mean(turned**2, axis=0)).max(axis=0),
        by_mass=np.sqrt(np.mean(bodies.sum(axis=1)[:, :, 0] ** 2, axis=0)),
    )
