"""An effort with the wrong sign."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.channel_effect import ChannelEffect, Channels
from sysid_ros.sample import FloatArray


class TorqueSign(ChannelEffect):
    """Published effort of some joints = -1 x torque.

    Args:
        joints: indices of the joints.
    """

    id = "torque_sign"
    label = "wrong sign of the effort"
    words = "efforts with the wrong sign on {where}"
    signature = "twice the torque of the joint is left, with a gain of exactly -1"
    look_alikes = ("joint_sign", "torque_scale")
    separated_by = "a joint that carries gravity"
    scales = True

    def __init__(self, joints: Sequence[int]) -> None:
        self.joints = list(joints)

    def publish(self, tau: FloatArray) -> FloatArray:
        out = np.array(tau)
        out[:, self.joints] *= -1.0
        return out

    def undo(self, channels: Channels) -> Channels:
        return channels.with_tau(self.publish(channels.tau))
