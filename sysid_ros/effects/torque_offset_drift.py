"""An error of the torque measurement that grows with time."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.effect import Acts, Depends, JointEffect
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class TorqueOffsetDrift(JointEffect):
    """``tau_j = rate_j (t - start)`` [N m], from the start of the recording.

    Args:
        robot: the model. joints: joints that drift; empty for all. start: time from which it drifts [s].
    """

    id = "torque_offset_drift"
    label = "drift of the torque measurement"
    words = "efforts whose zero drifts on {where} ({rate})"
    setting_names = ("start",)
    acts = Acts.MEASUREMENT
    depends_on = frozenset({Depends.TIME})
    times = ("start",)
    symbol = "rate"
    unit = "N m/s"
    share = 0.1
    signature = "a slow ramp, whatever the motion"
    look_alikes = ("friction_drift", "payload_change")
    separated_by = "a long recording that repeats one motion at its start and at its end"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), start: float = 0.0) -> None:
        super().__init__(robot, joints)
        self.start = float(start)

    def curve(self, sample: Sample | Motion) -> FloatArray:
        since = np.asarray(sample.t) - self.start
        return np.broadcast_to(since[..., None], sample.q.shape)
