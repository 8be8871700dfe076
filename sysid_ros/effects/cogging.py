"""Torque that repeats over a turn: cogging, gear mesh."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.effect import JointCurves, Knob, positive
from sysid_ros.effects.parameter import Parameter, by_delta_method
from sysid_ros.effects.traits import Candidate
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class Cogging(JointCurves):
    """``tau_j = s sin(n q) + c cos(n q)`` [N m], amplitude sqrt(s^2 + c^2) (Gandhi, Thomas, Guglielmino 2002).

    Args:
        robot: the model. joints: joints that cog; empty for all. harmonic: periods a turn, n.
    """

    id = "cogging"
    label = "cogging"
    words = "torque ripple over the turn of {where} (amplitude {amp}, {harmonic})"
    setting_names = ("harmonic",)
    symbols = ("s", "c")
    symbol_units = ("N m", "N m")
    knobs = (Knob("harmonic", 3.0, 330.0, "1/rev", False, reach=0.6, bumpy=True),)
    share = 0.1
    signature = "a line at the joint's speed times the harmonic: visible over the position, not over time"
    look_alikes = ("spring",)
    separated_by = "slow motion of changing speed, so that the harmonic stays below the band of the torque"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), harmonic: float = 12.0) -> None:
        super().__init__(robot, joints)
        self.harmonic = positive(harmonic, "harmonic", self.id)

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        return np.stack([np.sin(self.harmonic * state.q), np.cos(self.harmonic * state.q)])

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        """Every whole number of periods a turn, up to that of a strain wave gear of ratio 160, whose teeth mesh 320 times; closer
        where the joint goes over several turns, which tell one number from the next that much better."""
        (knob,) = cls.knobs
        spans = [0.0, *(float(np.ptp(m.q[:, joint])) for m in motions)]
        closer = max(1, round(max(spans) / (2.0 * np.pi)))
        number = closer * round(knob.high - knob.low) + 1
        return [Candidate({knob.name: float(h)}) for h in np.linspace(knob.low, knob.high, number)]

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        (joint,) = self.joint_names
        return [
            by_delta_method("harmonic", joint, "1/rev", lambda x: float(x[2]), values, covariance),
            by_delta_method("amp", joint, self.units[0], lambda x: float(np.hypot(x[0], x[1])), values, covariance),
        ]
