"""Reference: what a controller is asked to follow at one instant."""

from __future__ import annotations

from dataclasses import dataclass

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class Reference:
    """The wanted motion at one instant, in the model's joint order.

    Attributes:
        q: positions, shape (n,) [rad or m]. v: velocities, shape (n,) [rad/s or m/s].
        a: accelerations, shape (n,) [rad/s^2 or m/s^2].
    """

    q: FloatArray
    v: FloatArray
    a: FloatArray
