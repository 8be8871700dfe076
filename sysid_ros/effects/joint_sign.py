"""A joint that counts backwards."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.channel_effect import ChannelEffect, Channels
from sysid_ros.sample import FloatArray


class JointSign(ChannelEffect):
    """Published position, velocity and effort of some joints = -1 x the URDF's.

    Args:
        joints: indices of the joints.
    """

    id = "joint_sign"
    label = "joint that counts backwards"
    words = "positions that count backwards on {where}"
    signature = "all joints before it are wrong by far, and its own sign of position, velocity and effort with them"
    look_alikes = ("torque_sign", "joint_offset")
    separated_by = "any motion with gravity on the joints around it"

    def __init__(self, joints: Sequence[int]) -> None:
        self.joints = list(joints)

    def publish(self, tau: FloatArray) -> FloatArray:
        out = np.array(tau)
        out[:, self.joints] *= -1.0
        return out

    def undo(self, channels: Channels) -> Channels:
        v = None if channels.v is None else self.publish(channels.v)
        return Channels(self.publish(channels.q), v, self.publish(channels.tau))
