"""Channels that stand under the name of another joint."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.channel_effect import ChannelEffect, Channels
from sysid_ros.sample import FloatArray


class JointOrder(ChannelEffect):
    """Published channel i = that of joint ``source[i]``.

    Args:
        source: which joint each channel shows, a permutation. efforts_only: positions and velocities are right.
    """

    id = "joint_order"
    label = "joints in the wrong order"
    words = "channels that stand under another joint's name ({sizes})"
    signature = "what one joint should show, another one does"
    look_alikes = ("joint_coupling", "joint_sign")
    separated_by = "joints that carry different loads"

    def __init__(self, source: Sequence[int], efforts_only: bool) -> None:
        self.source = list(source)
        self.efforts_only = efforts_only

    def publish(self, tau: FloatArray) -> FloatArray:
        return np.asarray(tau[:, self.source])

    def undo(self, channels: Channels) -> Channels:
        back = np.argsort(self.source)
        if self.efforts_only:
            return channels.with_tau(channels.tau[:, back])
        return Channels(channels.q[:, back], None if channels.v is None else channels.v[:, back], channels.tau[:, back])
