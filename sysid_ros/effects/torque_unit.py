"""Efforts in another unit than newton metres."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.channel_effect import ChannelEffect, Channels
from sysid_ros.sample import FloatArray


class TorqueUnit(ChannelEffect):
    """Published effort = factor x torque: N mm, N cm, lbf ft, lbf in, amperes.

    Args:
        factors: published over N m, one a joint.
    """

    id = "torque_unit"
    label = "wrong unit of the effort"
    words = "efforts in another unit than N m ({sizes})"
    signature = "one factor for all joints, or one for each that has nothing to do with the motion"
    look_alikes = ("torque_scale", "payload")
    separated_by = "any motion in which the joints carry load"
    scales = True
    absorbs = "torque_scale"

    def __init__(self, factors: Sequence[float]) -> None:
        self.factors = np.array(factors, dtype=float)

    def publish(self, tau: FloatArray) -> FloatArray:
        return np.asarray(tau * self.factors)

    def undo(self, channels: Channels) -> Channels:
        return channels.with_tau(channels.tau / self.factors)
