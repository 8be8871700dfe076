"""LegParameters: what is not known of a robot on legs beside its payload, and where it stands among the free parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects import AccelerometerBias, Effect
from sysid_ros.estimators import Estimator
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.trunk_inertia import TrunkInertia
from sysid_ros.online.leg_drives import LegDrives, LegEfforts
from sysid_ros.online.trunk_errors import FootRadius, ImuDelay, ImuPlacement
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.smoothed_sign import TURNS
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel

_BIAS = 0.02
"""Standard deviation of a bias of the accelerometer that is not estimated [m/s^2]; above half as much again it shows, see
:class:`.StanceLog`."""
_KNOWN_RADIUS = 1.5e-3
"""By how much feet are pressed together [m]."""

_SYNCHRONISE = "Synchronise the clocks, or stamp messages when they are measured."


class LegParameters:
    """Rotors and friction of the legs, radius of the feet, and where and when the IMU measures, each with what is expected of it.

    Args:
        base: the robot. frame: of the payload. settings: how well the IMU's place and, without a model, the efforts' gains are
            known, and whether the IMU's bias and the legs' friction are estimated. known: what was identified of the robot, None
            where nothing was.

    Attributes:
        drives: of the legs, None where they are not estimated. effects: free ones beside the payload, in order.
        prior_std: of their parameters, shape (p,).
        dry: where those of the drives stand among all free parameters. radius, delay, placement, bias: the same of these; None
            where it is not free. inertia: what the trunk's accelerations cost robot and load.
    """

    def __init__(self, base: FloatingBase, frame: str, settings: OnlineSettings, known: Sequence[KnownEffect] | None) -> None:
        robot = base.robot
        s = settings
        self._base, self._late, self.inertia = base, 0.0, TrunkInertia(robot, robot.frame_id(frame))
        self.effects: list[Effect] = []
        self._prior: list[FloatArray] = []
        torques = None if known is None else TorqueModel(robot, [], known)
        self.drives = LegDrives(base, torques) if s.estimate_friction else None
        self._efforts = LegEfforts(base, s.effort_gain_error) if known is None and s.effort_gain_error > 0.0 else None
        self.dry: slice | None = None
        if self.drives is not None:
            where = [self._add(e, std) for e, std in zip(self.drives.effects, np.split(self.drives.prior_std, 3), strict=True)]
            self.dry = slice(where[0].start, where[-1].stop)
        unsure, sure = np.where(base.radius_told, _KNOWN_RADIUS, base.radius_std), base.setup_std
        self.radius: slice | None = self._add(FootRadius(robot), [float(np.sqrt(np.mean(unsure**2)))])
        self.placement: slice | None = None
        if s.imu_tilt_std > 0.0 or s.imu_lever_std > 0.0:
            tilt, lever = ([x] * 3 for x in (s.imu_tilt_std, s.imu_lever_std))
            if sure is not None:
                tilt, lever = (np.minimum(x, known).tolist() for x, known in ((tilt, sure.tilt), (lever, sure.lever)))
            self.placement = self._add(ImuPlacement(robot, self.inertia), tilt + lever)
        self.delay: slice | None = None
        if s.imu_delay_std > 0.0:
            self.delay = self._add(ImuDelay(robot), [min(s.imu_delay_std, sure.delay) if sure else s.imu_delay_std])
        self._bias = AccelerometerBias(robot, frame=frame) if s.accelerometer_bias_std > 0.0 else None
        self.bias = self._add(self._bias, [s.accelerometer_bias_std] * 3) if self._bias else None

    @property
    def moving(self) -> tuple[slice, ...]:
        """Where the parameters stand whose columns are zero at rest."""
        lever = slice(self.placement.start + 3, self.placement.stop) if self.placement else None
        return tuple(where for where in (self.dry, lever, self.delay) if where is not None)

    @property
    def prior_std(self) -> FloatArray:
        """Before any data, shape (p,)."""
        return np.concatenate(self._prior)

    def told(self, theta: FloatArray, std: FloatArray) -> list[str]:
        """What was found to be otherwise than it is said of IMU and feet, a sentence each.

        Args:
            theta, std: free parameters and their standard deviations, shape (p,) each.
        """
        sentences = []
        if self.placement is not None:
            (tilt, lever), sure = np.split(theta[self.placement], 2), self._is_sure(self.placement, theta, std)
            if sure[:3].any():
                angles = ", ".join(f"{x:.1f}" for x in np.degrees(tilt))
                sentences.append(
                    f"The IMU is turned by [{angles}] degrees about the trunk's axes against its frame; that is counted in. "
                    "Correct imu_rpy, or the frame in the URDF."
                )
            if sure[3:].any():
                place = ", ".join(f"{1e3 * x:.0f}" for x in lever)
                sentences.append(f"The IMU sits [{place}] mm from its frame; that is counted in. Correct imu_xyz.")
        if self._late:
            sentences.append(f"{self._late_by(self._late)}; its stamps are corrected by that. {_SYNCHRONISE}")
        elif self.delay is not None and self._is_sure(self.delay, theta, std)[0]:
            late = self._late_by(float(theta[self.delay][0]))
            sentences.append(f"{late}; that is counted in as far as a slope can. {_SYNCHRONISE}")
        return sentences

    def settle(self, estimator: Estimator) -> str:
        """Correct the IMU's stamps by a delay that is surely larger than expected, so that what is left is one that a slope
        tells; why all is estimated anew then, empty where it is not."""
        if self.delay is None or not estimator.noise_known:
            return ""
        theta, variance = estimator.marginal(slice(0, self.delay.stop))
        if not self._is_sure(self.delay, theta, np.sqrt(variance))[0]:
            return ""
        late = float(theta[self.delay][0])
        self._base.setup = self._base.setup + TrunkSetup(delay=late)
        self._late += late
        return f"{self._late_by(self._late).replace('The', 'the', 1)}, and its stamps are corrected by that from now on"

    @staticmethod
    def _late_by(seconds: float) -> str:
        return f"The IMU is {1e3 * abs(seconds):.1f} ms {'late' if seconds > 0.0 else 'early'} against the joints"

    def _is_sure(self, where: slice, theta: FloatArray, std: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Which parameters are larger than expected, and surely so."""
        prior = np.concatenate(self._prior)[where.start - 10 : where.stop - 10]
        return np.asarray((np.abs(theta[where]) > prior) & (np.abs(theta[where]) > 4.0 * std[where]))

    def carry(self, load: FloatArray) -> None:
        """Take in the ten parameters of what is carried: what the IMU gets wrong concerns it too."""
        self.inertia.carry(load)
        if self._bias is not None:
            self._bias.load = load

    @property
    def considered(self) -> int:
        """Number of errors that :meth:`fill` writes."""
        return sum(x.considered for x in (self.drives, self._efforts) if x is not None) + (self._bias is None)

    def fill(self, sample: Sample, out: FloatArray) -> None:
        """Write the considered torques of a sample into the rows (n, c) of the whole robot."""
        done = 0
        if self.drives is not None:
            self.drives.fill(sample.v, sample.tau, TURNS, out)
            done = self.drives.considered
        if self._efforts is not None:
            self._efforts.fill(sample.tau, out[:, done:])
        if self._bias is None:
            force = sample.a[:3]
            along = force / max(float(np.linalg.norm(force)), 1e-9)
            out[:, -1] = _BIAS * (self.inertia.columns(sample.q)[:, :3] @ along)

    def know(self, theta: FloatArray, variance: FloatArray) -> None:
        """Take in the free parameters as they are known now, and their variances, shape (p,) each."""
        if self.drives is not None:
            self.drives.know(theta[self.dry], variance[self.dry])

    def _add(self, effect: Effect, std: FloatArray | list[float]) -> slice:
        start = 10 + sum(e.p for e in self.effects)
        self.effects.append(effect)
        self._prior.append(np.maximum(np.asarray(std, dtype=float), 1e-9))
        return slice(start, start + effect.p)
