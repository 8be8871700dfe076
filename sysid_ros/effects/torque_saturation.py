"""A torque that does not go beyond a limit."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.effect import Acts, Depends, JointCurves, Knob, positive
from sysid_ros.effects.parameter import Parameter, by_delta_method
from sysid_ros.effects.traits import Candidate
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_SHARE = (0.6, 1.5)
"""What is cut of the torque beyond a limit, as a part of all of it."""
_LIMITS = (0.5, 0.6, 0.7, 0.8, 0.87, 0.93, 0.97)
"""Quantiles of the torque of the drives that are tried first as limits of a sensor."""
_ASKED = 0.97
"""Limit of a motor as a part of what is asked of it at most."""
_OFTEN, _AT_MOST = 0.85, 0.99
"""Quantiles of the efforts asked and of the torques given: what is not at the limit, and what is hardly ever exceeded."""


def _given(motions: Sequence[Motion], joint: int) -> float:
    """Torque that a joint's motor has been seen to give, that of the links: its limit is not below [N m].

    What friction and rotors seem to take does not count: fitted without the limit, they take what the motor was asked for.
    """
    asked = np.concatenate([np.abs(m.tau[:, joint]) for m in motions])
    given = np.concatenate([np.abs(m.link_torque[:, joint]) for m in motions])
    return max(float(np.quantile(asked, _OFTEN)), float(np.quantile(given, _AT_MOST)))


class TorqueSaturation(JointCurves):
    """``tau_j = -share max(|tau| - limit, 0) sign(tau)`` [N m] of the torque that a sensor would show: the measured torque stays
    flat at the limit where share is 1.

    Or the motor itself can do no more, and the published effort is what was asked of it: ``tau_j = share max(|tau_asked| - limit,
    0) sign(tau_asked)``, the measured torque less what the sensor adds.

    Args:
        robot: the model. joints: joints that saturate; empty for all. limit: largest torque [N m].
        kind: "sensor" or "motor": what it is the largest torque of.

    Raises:
        ModelFileError: there is no such kind, or the limit is not a positive number.
    """

    id = "torque_saturation"
    label = "saturation of the torque"
    words = "efforts that stop at a limit on {where} ({limit})"
    setting_names = ("limit", "kind")
    acts = Acts.MEASUREMENT
    depends_on = frozenset({Depends.DRIVE, Depends.SENSOR})
    partial = True
    symbols = ("share",)
    symbol_units = ("1",)
    knobs = (Knob("limit", 0.1, 1e4, "N m"),)
    signature = "nothing below the limit, and beyond it all that exceeds it"
    look_alikes = ("torque_scale",)
    separated_by = "motion that reaches the limit from both sides, and some that stays well below it"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), limit: float = 10.0, kind: str = "sensor") -> None:
        super().__init__(robot, joints)
        self.limit = positive(limit, "limit", self.id)
        if kind not in ("sensor", "motor"):
            raise ModelFileError(f"effect '{self.id}' is of kind {kind!r}; it must be 'sensor' or 'motor'.")
        self.kind = kind

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        return self._beyond(load if self.kind == "sensor" else state.tau)

    def curves_along(self, motion: Motion) -> FloatArray:
        """A sensor shows no more than its limit of all that it would show; a motor gives no more of what it was asked for, which
        the sensor's offset and gain are not."""
        added = motion.sensor_torque
        return self._beyond(motion.drive_torque + added if self.kind == "sensor" else motion.tau - added)

    def _beyond(self, torque: FloatArray) -> FloatArray:
        sign = -1.0 if self.kind == "sensor" else 1.0
        return sign * (np.maximum(np.abs(torque) - self.limit, 0.0) * np.sign(torque))[None]

    @property
    def from_measured(self) -> bool:
        return self.kind == "motor"

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        assert joint is not None
        drive = np.concatenate([np.abs(m.drive_torque[:, joint]) for m in motions])
        asked = max(float(np.abs(m.tau[:, joint]).max()) for m in motions)
        out = [Candidate({"limit": float(x), "kind": "sensor"}) for x in np.unique(np.quantile(drive, _LIMITS)) if x > 0.0]
        least = _given(motions, joint)
        if 0.0 < least < _ASKED * asked:
            out += [Candidate({"limit": float(x), "kind": "motor"}) for x in np.geomspace(least, _ASKED * asked, len(_LIMITS))]
        return out

    def reference_torque(self, motions: Sequence[Motion]) -> float:
        return _given(motions, int(self.joints[0])) if self.kind == "motor" else 0.0

    def search_range(self, knob: Knob, value: float, torque: float) -> tuple[float, float]:
        return max(0.9 * value, torque), max(1.1 * value, 1.1 * torque)

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return bool(_SHARE[0] < theta[0] < _SHARE[1] and self.limit > 0.95 * torque)

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        (joint,) = self.joint_names
        return [by_delta_method("limit", joint, "N m", lambda x: float(x[1]), values, covariance)]
