"""Dry friction that grows with the load on the gear."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.coulomb_friction import CoulombFriction, DryFriction
from sysid_ros.effects.effect import Depends, JointCurves, Knob, positive
from sysid_ros.effects.presliding_hysteresis import PreslidingHysteresis
from sysid_ros.effects.searched import Searched
from sysid_ros.effects.traits import Candidate
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import TURNS, smoothed_sign
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.bristle import bristle
from sysid_ros.signals.motion import Motion

_Z_S = Knob("z_s", 2e-3, 0.2, "rad", reach=5.0, reported=False)
_BUILT_UP = (0.005, 0.02, 0.08)
"""Displacements over which it builds up that a search starts from [rad]."""


class LoadDependentFriction(DryFriction, JointCurves):
    """``tau_j = s (Fc + mu |tau_link|)``, s = tanh(v / width), Fc >= 0 [N m], mu >= 0 [1] (Hamon, Gautier, Garrec 2010, section
    III). The load is the model's torque on the link side: the measured one would bring its noise into the column.

    On a joint whose friction builds up after each reversal (:class:`PreslidingHysteresis`) so does the part that grows: s is
    the bristle's state ``z / z_s`` there.

    Args:
        robot: the model. joints: joints that rub; empty for all. width: as :class:`DryFriction` has it.
        level: with Fc; without it the part that grows stands beside any other form of dry friction.
        z_s: displacement over which it builds up [rad]; 0: it turns with the velocity.

    Raises:
        ModelFileError: the width is not a positive number, z_s a negative one, or the level neither true nor false.
    """

    id = "load_dependent_friction"
    label = "friction that grows with the load"
    words = "dry friction that grows with the load on {where} ({mu} N m for each N m of load)"
    setting_names = ("width", "level")
    depends_on = frozenset({Depends.LOAD})
    usual = 0.4
    nonnegative = True
    symbols = ("Fc", "mu")
    symbol_units = ("N m", "1")
    signature = "the level of friction follows the torque that the links need"
    look_alikes = ("torque_scale", "asymmetric_coulomb_friction", "coulomb_friction")
    separated_by = "the same loaded and unloaded postures passed in both directions"

    def __init__(
        self, robot: RobotModel, joints: Sequence[str] = (), width: float = TURNS, level: bool = True, z_s: float = 0.0
    ) -> None:
        if not isinstance(level, bool):
            raise ModelFileError(f"effect '{self.id}' has level {level!r}; it must be true or false.")
        self.level, self.z_s = level, positive(z_s, "z_s", self.id) if z_s else 0.0
        # of this one, not of its class
        if not level:
            vars(self).update(family="", symbols=("mu",), symbol_units=("1",))
        if z_s:
            vars(self).update(setting_names=("level", "z_s"), knobs=(_Z_S,))
        super().__init__(robot, joints, width)

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        turns = [Candidate({"level": True}), Candidate({"level": False})]
        return turns + [Candidate({"level": False, "z_s": z_s}) for z_s in _BUILT_UP]

    def excludes(self, other: Searched) -> bool:
        if super().excludes(other):
            return True
        if self.z_s and other.family == self.__class__.family:
            return not isinstance(other, PreslidingHysteresis)
        # beside Coulomb friction it would be what it is with a level
        return not self.level and isinstance(other, CoulombFriction)

    def sign(self, state: Sample | Motion) -> FloatArray:
        if not self.z_s:
            return super().sign(state)
        return bristle(state.q, self.z_s, state.period) if isinstance(state, Motion) else smoothed_sign(state.v)

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        s = self.sign(state)
        grows = s * np.abs(load)
        return np.stack([s, grows] if self.level else [grows])

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return self.of_symbol("Fc", theta) if self.level else np.zeros(self.robot.n)

    @property
    def stated(self) -> FloatArray:
        return super().stated * [s != "mu" for s in self.symbols]

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return bool(np.all(theta + 2.0 * std > 0.0))
