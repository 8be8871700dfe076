"""A joint that counts backwards."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from sysid_ros.effects.channel_effect import ChannelEffect, Channels
from sysid_ros.sample import FloatArray


class JointSign(ChannelEffect):
    """Published position, velocity and effort of some joints = -1 x the URDF's.

    Args:
        joints: indices of the joints.
    """

    id: ClassVar[str] = "joint_sign"
    label: ClassVar[str] = "joint that counts backwards"
    signature: ClassVar[str] = (
        "all joints before it are wrong by far, and its own sign of position, velocity and effort with them"
    )
    look_alikes: ClassVar[tuple[str, ...]] = ("torque_sign", "joint_offset")
    separated_by: ClassVar[str] = "any motion with gravity on the joints around it"

    def __init__(self, joints: Sequence[int]) -> None:
        self.joints = list(joints)

    def publish(self, tau: FloatArray) -> FloatArray:
        out = np.array(tau)
        out[:, self.joints] *= -1.0
        return out

    def undo(self, channels: Channels) -> Channels:
        q, tau = np.array(channels.q), np.array(channels.tau)
        v = None if channels.v is None else np.array(channels.v)
        for channel in (q, tau, *(() if v is None else (v,))):
            channel[:, self.joints] *= -1.0
        return Channels(q, v, tau)
