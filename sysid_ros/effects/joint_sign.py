"""A joint that counts backwards."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.channel_effect import ChannelEffect, Channels
from sysid_ros.sample import FloatArray


class JointSign(ChannelEffect):
    """Published position and velocity, and as a rule effort, of some joints = -1 x the URDF's.

    Args:
        joints: indices of the joints. efforts: False where their efforts have the URDF's sign.
    """

    id = "joint_sign"
    label = "joint that counts backwards"
    words = "positions that count backwards on {where}"
    signature = "all joints before it are wrong by far, and its own sign of position, velocity and effort with them"
    look_alikes = ("torque_sign", "joint_offset")
    separated_by = "any motion with gravity on the joints around it"

    def __init__(self, joints: Sequence[int], efforts: bool = True) -> None:
        self.joints = list(joints)
        self.efforts = efforts

    @property
    def told_as(self) -> str:
        return self.words if self.efforts else f"{self.words}, while the efforts there do not"

    def publish(self, tau: FloatArray) -> FloatArray:
        return self._turned(tau) if self.efforts else tau

    def undo(self, channels: Channels) -> Channels:
        v = None if channels.v is None else self._turned(channels.v)
        return Channels(self._turned(channels.q), v, self.publish(channels.tau))

    def _turned(self, values: FloatArray) -> FloatArray:
        out = np.array(values)
        out[:, self.joints] *= -1.0
        return out
