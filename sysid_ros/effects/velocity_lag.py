"""A velocity that the driver has filtered."""

from sysid_ros.effects.channel_effect import ChannelEffect, Channels


class VelocityLag(ChannelEffect):
    """Published velocity = first-order low-pass of the true one: ``v' = 2 pi cutoff (dq/dt - v)``. Nothing here depends on the
    published velocity, so there is nothing to undo but to leave it out.

    Args:
        cutoff: of the low-pass [Hz].
    """

    id = "velocity_lag"
    label = "velocity late"
    words = "velocities behind a low-pass filter (cut-off {cutoff})"
    signature = "the published velocity lags behind the derivative of the position, more the faster it changes"
    look_alikes = ("time_delay",)
    separated_by = "fast motion; no torque is needed"

    def __init__(self, cutoff: float) -> None:
        self.cutoff = float(cutoff)

    def undo(self, channels: Channels) -> Channels:
        return Channels(channels.q, None, channels.tau)
