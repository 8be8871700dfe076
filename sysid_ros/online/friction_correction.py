"""FrictionCorrection: offset and friction of an arm's joints that are estimated beside its payload."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numba import njit

from sysid_ros.effects import Curve, Effect
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import TURNS
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.torque.known_effect import KnownEffect


class FrictionCorrection(Effect):
    """``tau_j = offset_j + Fc_j tanh(v_j / width) + b_j v_j``: what has changed since the arm was identified, or all of
    it where it never was. The three as one effect, because its columns are written at the robot's rate.

    Args:
        robot: the model. settings: how large the change may be, what counts as slow. known: effects that are known, or None where
            no model is.

    Attributes:
        expected_std: before any data, of offset, Coulomb and viscous friction, shape (3 n,): small beside a known model, of the
            size of the effort limits without one.
    """

    id: ClassVar[str] = "friction_correction"
    label: ClassVar[str] = "correction of offset and friction"

    def __init__(self, robot: RobotModel, settings: OnlineSettings, known: Sequence[KnownEffect] | None) -> None:
        super().__init__(robot)
        self.parameter_names = tuple(f"{symbol}[{joint}]" for symbol in ("offset", "Fc", "b") for joint in robot.joint_names)
        force = tuple("N" if slides else "N m" for slides in robot.is_prismatic)
        self.units = (*force, *force, *("N s/m" if slides else "N m s/rad" for slides in robot.is_prismatic))
        self._settings = settings
        stated = known is None and settings.effort_type == "total"
        nothing: FloatArray = np.zeros(robot.n)
        self._coulomb = sum(
            (np.abs(k.effect.as_dry_friction(k.theta)) for k in known or ()), robot.friction if stated else nothing
        )
        self._viscous = np.abs(sum((k.effect.as_damping(k.theta) for k in known or ()), nothing))
        self.expected_std = self._drifted() if known is not None else self.unknown_std()
        joints = np.arange(robot.n)
        self._rows, self._columns = np.tile(joints, 3), np.arange(3 * robot.n)
        self._curves = np.ones((3, robot.n))

    def unknown_std(self) -> FloatArray:
        """As ``expected_std``, of an arm whose friction nothing is known of."""
        limit = self.robot.effort_limit
        size = self._settings.friction_unknown * np.where(np.isfinite(limit), limit, 50.0)
        return np.concatenate([0.2 * size, size, 2.0 * size])

    def _drifted(self) -> FloatArray:
        least, drift = np.full(self.robot.n, 0.1), self._settings.friction_drift
        return np.concatenate([0.5 * drift * self._coulomb + least, drift * self._coulomb + least, drift * self._viscous + least])

    def fill(self, sample: Sample, out: FloatArray) -> None:
        curves = self._curves
        np.tanh(sample.v / TURNS, out=curves[1])
        curves[2] = sample.v
        out[self._rows, self._columns] = curves.ravel()

    def simple_curves(self) -> FloatArray:
        joints = np.arange(self.robot.n)
        kinds = (Curve.ONE, Curve.SIGN, Curve.SPEED)
        return np.vstack([np.column_stack([0 * joints + kind, 0 * joints + TURNS, joints]) for kind in kinds])

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        n = self.robot.n
        return theta[n : 2 * n]

    def hidden_variance(self, slow: FloatArray, speed: FloatArray, theta: FloatArray, variance: FloatArray) -> FloatArray:
        """Variance of the torque that may hide in dry friction near standstill, where no model holds, shape (n,) [(N m)^2].

        Args:
            slow: part of a row from when each joint hardly moved, shape (n,). speed: of each joint, shape (n,) [rad/s].
            theta, variance: its parameters as they are estimated now and how uncertain they are, shape (3 n,) each, or none where
                they are not estimated.
        """
        s, extra = self._settings, np.empty(slow.size)
        _hidden(slow, speed, self._coulomb, theta, variance, s.low_velocity, s.stiction**2, extra)
        return extra


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _hidden(
    slow: FloatArray,
    speed: FloatArray,
    known: FloatArray,
    theta: FloatArray,
    variance: FloatArray,
    low: float,
    stiction: float,
    extra: FloatArray,
) -> None:
    """As :meth:`FrictionCorrection.hidden_variance`, into ``extra``; ``known``: Coulomb friction. ``stiction``: its variance,
    below the speed ``low`` of all joints."""
    n = slow.size
    beneath = stiction if speed.max() < low else 0.0
    for i in range(n):
        coulomb = known[i] ** 2
        if theta.size > 0:
            coulomb = (known[i] + theta[n + i]) ** 2 + variance[n + i]
        extra[i] = coulomb * (0.5 * slow[i]) ** 2 + beneath
