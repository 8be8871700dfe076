"""An effort in coarse steps."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.channel_effect import ChannelEffect, Channels


class TorqueQuantisation(ChannelEffect):
    """Published effort = the nearest multiple of ``step``. It can't be undone; it is noise of ``step / sqrt(12)``.

    Args:
        steps: one a joint, 0 where it is finer than the noise [N m].
    """

    id = "torque_quantisation"
    label = "coarse steps of the effort"
    words = "efforts in coarse steps on {where} ({step})"
    signature = "the raw effort takes only values on a lattice that is wider than its noise"
    look_alikes = ("torque_saturation",)
    separated_by = "any motion"

    def __init__(self, steps: Sequence[float]) -> None:
        self.steps = np.array(steps, dtype=float)

    def undo(self, channels: Channels) -> Channels:
        return channels
