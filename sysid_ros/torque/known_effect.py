"""KnownEffect: a cause of torque whose parameters are given."""

from __future__ import annotations

from dataclasses import dataclass

from sysid_ros.effects import Effect
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class KnownEffect:
    """An effect with its parameters.

    Attributes:
        effect: the cause.
        theta: its parameters, shape (p,).
        covariance: how well they are known, shape (p, p), or None where they are taken as exact.
    """

    effect: Effect
    theta: FloatArray
    covariance: FloatArray | None = None
