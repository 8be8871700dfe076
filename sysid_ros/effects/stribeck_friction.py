"""Dry friction that falls from its breakaway value as the joint gets moving."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.coulomb_friction import DryFriction
from sysid_ros.effects.effect import JointCurves, Knob, positive
from sysid_ros.effects.traits import Candidate
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import SLIDE, TURNS
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_SHARP = 0.005
"""Width of the sign of a velocity, below the speeds at which a joint counts as standing [rad/s]; a slide has less of it."""
_BREAKAWAY = 4.0
"""Breakaway friction is not more than so many times the friction of steady sliding."""


class StribeckFriction(DryFriction, JointCurves):
    """``tau_j = s (Fc (1 - e) + Fs e)``, s = tanh(v / width), e = exp(-(v / vs)^2), 0 <= Fc <= Fs [N m] (Armstrong-Hélouvry,
    Dupont, Canudas de Wit 1994, section 2.1).

    Args:
        robot: the model. joints: joints that rub; empty for all.
        vs: Stribeck velocity [rad/s]. width: speed at which the sign function has turned, well below vs: a wide one and a low vs
            look the same [rad/s].
    """

    id = "stribeck_friction"
    label = "Stribeck friction"
    words = "dry friction that is higher at low speed on {where} (Stribeck: {Fs} when it starts, {Fc} at speed)"
    setting_names = ("vs", "width")
    usual = 0.4
    nonnegative = True
    symbols = ("Fc", "Fs")
    symbol_units = ("N m", "N m")
    knobs = (Knob("vs", 0.02, 0.5, "rad/s"),)
    signature = "two levels by direction, with a bump at speeds below three Stribeck velocities"
    look_alikes = ("coulomb_friction", "presliding_hysteresis", "viscous_friction")
    separated_by = "slow moves at several constant speeds between 0.02 and 0.2 rad/s, in both directions"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), vs: float = 0.05, width: float = TURNS) -> None:
        super().__init__(robot, joints, width)
        self.vs = positive(vs, "vs", self.id)

    @property
    def nonnegative_rows(self) -> FloatArray:
        return np.vstack([np.eye(self.p), np.kron(np.eye(len(self.joints)), [-1.0, 1.0])])  # Fs - Fc

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        s = self.sign(state)
        e = np.exp(-((state.v / self.vs) ** 2))
        return np.stack([s * (1.0 - e), s * e])

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return self.of_symbol("Fc", theta)

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        slides = joint is not None and any(m.robot.is_prismatic[joint] for m in motions)
        return [Candidate({"vs": x, "width": _SHARP * (SLIDE if slides else 1.0)}) for x in cls.knobs[0].grid()]

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        high = float(theta[0] + 2.0 * std[0])
        return bool(high > 0.0 and max(theta[0], 0.0) < theta[1] < _BREAKAWAY * max(high, 0.2 * theta[1]))
