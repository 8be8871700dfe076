"""An effort from which the controller's own gravity torque was taken away, or to which it was added."""

from collections.abc import Sequence

from sysid_ros.effects.effect import Acts, Effect
from sysid_ros.effects.parameter import Parameter
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_COMPENSATED = 0.15
"""How far a coefficient may be from -1 or +1."""


class GravityCompensatedEffort(Effect):
    """``tau = coef g(q)``: -1 where gravity is missing from the effort, +1 where it stands in it twice [1]."""

    id = "gravity_compensated_effort"
    label = "effort with gravity already compensated"
    parameter_names, units = ("coef",), ("1",)
    acts = Acts.MEASUREMENT
    signature = "the whole gravity torque, in all joints at once, with a factor of -1 or +1"
    look_alikes = ("torque_scale", "link_inertia", "base_tilt")
    separated_by = "fast motion in several postures: the inertial part of the torque is then right"

    def fill(self, sample: Sample, out: FloatArray) -> None:
        still = sample.q[None] * 0.0
        out[:, 0] = self.robot.rnea_along(sample.q[None], still, still)[0]

    def columns_along(self, motion: Motion) -> FloatArray:
        return motion.gravity_torque[:, :, None]

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return abs(abs(float(theta[0])) - 1.0) < _COMPENSATED

    def in_words(self, parameters: Sequence[Parameter], where: str) -> str:
        lost = "efforts without the arm's weight (its controller took it out)"
        return lost if parameters[0].value < 0.0 else "efforts with the arm's weight in them twice"
