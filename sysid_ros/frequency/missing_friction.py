"""Dry friction that the model lacks: no response explains it, and what it does to one looks like other causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.frequency.lines import rests
from sysid_ros.frequency.stretches import Stretch
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray

_TURNS = 0.02
"""Speed at which it has turned [rad/s], a tenth of it for slides [m/s]."""
_PART = 0.2
"""Part of the misfit's power that sign(v) must explain beside v and an offset."""
_SOME, _BOTH = 0.04, 0.5
"""The same, and what both must explain, where there is much viscous friction beside it. (A late effort may look like v alone.)"""
_NOTABLE = 0.03
"""Size over the torque's root mean square."""


@dataclass(frozen=True, slots=True)
class MissingFriction:
    """``tau_measured - tau_model = Fc sign(v) + b v + offset + g tau_model - d dtau_model/dt + e d2tau_model/dt2``.

    The last three are what a gain, a delay and a spring do at first, and keep them from being taken for friction.

    Attributes:
        coulomb, viscous: Fc [N m], b [N m s/rad]. part: of the misfit's power that both explain.
    """

    coulomb: float
    viscous: float
    part: float


def missing_friction(stretches: Sequence[Stretch], joint: int) -> MissingFriction | None:
    """Dry friction that the model lacks on a joint, by least squares while it moves; None where it is nothing to speak of."""
    rest, speed, torque, others = [], [], [], []
    prismatic = bool(stretches[0].motion.robot.is_prismatic[joint])
    for stretch in stretches:
        motion = stretch.motion
        whole, _, _ = rests(motion.v[:, joint], stretch.period, prismatic)
        rest.append((motion.tau[:, joint] - stretch.model[:, joint])[whole])
        speed.append(motion.v[whole, joint])
        torque.append(motion.tau[whole, joint])
        model = stretch.smooth[:, joint]
        rate = motion.rate_of(model)
        others.append(np.stack([model, rate, motion.rate_of(rate)], axis=1)[whole])
    e, v = np.concatenate(rest), np.concatenate(speed)
    if len(e) < 50:
        return None
    turns = _TURNS * (0.1 if prismatic else 1.0)
    beside = np.column_stack([np.ones_like(v), np.concatenate(others)])
    columns = np.column_stack([smoothed_sign(v, turns), v, beside])
    theta, left = _fit(columns, e)
    power = max(float(np.sum((e - e.mean()) ** 2)), 1e-300)
    dry, both = ((_fit(columns[:, first:], e)[1] - left) / power for first in (1, 2))
    size = float(np.sqrt(np.mean(np.concatenate(torque) ** 2)))
    named = dry > _PART or (dry > _SOME and both > _BOTH and theta[1] > 0.0)
    return MissingFriction(float(theta[0]), float(theta[1]), both) if named and theta[0] > _NOTABLE * size else None


def _fit(columns: FloatArray, e: FloatArray) -> tuple[FloatArray, float]:
    """Parameters and sum of squares that is left."""
    size = np.maximum(np.sqrt(np.sum(columns**2, axis=0)), 1e-300)
    theta = np.linalg.lstsq(columns / size, e, rcond=None)[0] / size
    return theta, float(np.sum((e - columns @ theta) ** 2))
