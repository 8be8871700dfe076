"""How a robot on legs stands: StanceLog, how often its feet slip or are reported wrong; GroundContact, whether it was lifted."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sysid_ros.floating.contact_projection import Stance
from sysid_ros.sample import FloatArray

_LONGER = 0.05
"""A contact that is reported otherwise than the leg's torques show for longer than this counts as wrong [s]."""
_EXCESS = 0.03
"""Difference to gravity above which a warning is given; on Earth gravity itself differs by so much [m/s^2]."""
_USUAL = 0.1
"""Bias of an accelerometer that is nothing unusual [m/s^2]."""
_TOGETHER, _MOST = 100, 300
"""Rows whose excess over gravity is averaged, some steps of a gait, and averages that are kept."""
STEP = 0.25
"""A robot on legs takes about a step in so long [s]."""
_SHARE = 0.02
"""Share of the samples from which on a warning is given."""
_CARRY, _ASKEW = 0.5, 0.5
"""Part of the weight from which on feet carry the robot, and angle of their force to the vertical that no ground makes [rad]."""


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _compare(reported: NDArray[np.bool_], loaded: NDArray[np.bool_], t: float, agreed: FloatArray, wrong: FloatArray) -> None:
    """Count the feet that were reported otherwise than they are loaded for too long; ``agreed`` is when each last was not."""
    for i in range(reported.size):
        if reported[i] == loaded[i] or not 0.0 <= t - agreed[i] < 1e6:
            agreed[i] = t
        elif t - agreed[i] > _LONGER:
            wrong[i] += 1.0


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _lands(loaded: NDArray[np.bool_], before: NDArray[np.bool_]) -> bool:
    """Whether a foot is loaded that was not ``before``, which is brought up to date."""
    lands = False
    for i in range(loaded.size):
        lands = lands or (loaded[i] and not before[i])
        before[i] = loaded[i]
    return lands


class StanceLog:
    """Counts over the samples of a floating base.

    Args:
        feet: their names. gravity: at the place [m/s^2]. bias_is_free: a bias of the accelerometer is estimated.
        mass: of the robot [kg].

    Attributes:
        samples: all. untrusted: the feet did not carry the robot; the rows are left out. slipping: feet that stand moved against
            each other. stretched: a leg that may stand was. inferred: no message reported the stance. steps: within a step's time
            since a foot landed.
        wrong: of each foot, samples in which its contact was reported wrong, shape (k,).
    """

    def __init__(self, feet: tuple[str, ...], gravity: float = 9.81, bias_is_free: bool = False, mass: float = 0.0) -> None:
        self._feet, self._weight = feet, mass * gravity
        self._force, self._up, self._feet_at = np.zeros((3, 3))
        self._agreed: FloatArray = np.full(len(feet), -np.inf)
        self._loaded, self._landed = np.ones(len(feet), dtype=np.bool_), -np.inf
        self.samples = self.untrusted = self.slipping = self.stretched = self.inferred = self.steps = 0
        self.wrong: FloatArray = np.zeros(len(feet))
        self._gravity, self.bias_is_free = gravity, bias_is_free
        self._seconds: list[float] = []
        self._rows, self._excess = 0, 0.0

    def add(self, stance: Stance, t: float, points: FloatArray) -> None:
        """Take in the stance at t [s]; ``points``: Jacobians of those that touch the ground, shape (k, 3, n)."""
        self.samples += 1
        if not stance.trusted:
            self._away(stance, points)
        self.untrusted += not stance.trusted
        self.slipping += stance.slips
        self.stretched += stance.stretched
        self.inferred += not stance.reported
        if _lands(stance.loaded, self._loaded):
            self._landed = t
        self.steps += 0.0 <= t - self._landed < STEP
        if stance.reported:
            _compare(stance.stands, stance.loaded, t, self._agreed, self.wrong)

    def _away(self, stance: Stance, points: FloatArray) -> None:
        """The feet do not carry the robot: which way they push it, where the IMU's up is, and where they are."""
        self._force += _SHARE * (stance.forces.sum(axis=0) - self._force)
        self._up += _SHARE * (stance.normal - self._up)
        place = points.mean(axis=0)  # a turn of the trunk about x moves a point by (0, -z, y), about y by (z, 0, -x)
        self._feet_at += _SHARE * (np.array([-place[2, 4], place[2, 3], -place[1, 3]]) - self._feet_at)

    @property
    def against(self) -> str:
        """Why feet that do not carry the robot may do so all the same, a sentence; empty where they don't."""
        force, up = float(np.linalg.norm(self._force)), float(np.linalg.norm(self._up))
        if not (force > _CARRY * self._weight > 0.0 and up > 0.0):
            return ""
        angle = float(np.arccos(np.clip(self._force @ self._up / (force * up), -1.0, 1.0)))
        if angle < _ASKEW:
            return ""
        if self._force @ self._feet_at > 0.0:
            return (
                f"By the torques the feet pull at the ground with {force:.0f} N: have the efforts the wrong sign (effort_scale), "
                "or is their order another?"
            )
        return (
            f"By the torques the feet do carry it, with {force:.0f} N, but {np.degrees(angle):.0f} degrees from what the IMU "
            "shows as up: is the IMU mounted otherwise than its frame says (imu_frame, imu_rpy), or is linear_acceleration of "
            "the other sign?"
        )

    def add_gravity(self, excess: float) -> None:
        """Take in by how much more than gravity the accelerometer shows beside the motion over the feet [m/s^2]."""
        self._rows += 1
        self._excess += excess
        if self._rows == _TOGETHER:
            self._seconds = [*self._seconds[-_MOST:], self._excess / self._rows]
            self._rows, self._excess = 0, 0.0

    @property
    def counts(self) -> dict[str, int]:
        """Samples by what was found, those that are not 0: 'not_standing', 'foot_slip', 'leg_stretched', 'contact_wrong',
        'contact_inferred'."""
        found = {
            "not_standing": self.untrusted,
            "foot_slip": self.slipping,
            "leg_stretched": self.stretched,
            "contact_wrong": int(self.wrong.max(initial=0.0)),
            "contact_inferred": self.inferred,
        }
        return {name: count for name, count in found.items() if count}

    @property
    def warnings(self) -> list[str]:
        """What the user should know, a sentence each."""
        sentences = []
        total = max(self.samples, 1)
        if self.inferred == self.samples > 0:
            sentences.append("No message tells which feet stand; the stance is inferred from the torques of the legs.")
        for foot, wrong in zip(self._feet, self.wrong, strict=True):
            if wrong > _SHARE * total:
                sentences.append(
                    f"The contact of {foot} is reported otherwise than its leg's torques show in {100 * wrong / total:.0f} % of "
                    "the time. The estimate does not rest on it; check the sensor, and that contact_frames has the order "
                    "of the messages."
                )
        if self.slipping > _SHARE * total:
            sentences.append(
                f"Feet that stand move against each other in {100 * self.slipping / total:.0f} % of the time: the robot slips, "
                "or its kinematics are not those of the URDF."
            )
        if self.stretched > _SHARE * total:
            sentences.append(
                f"A leg is stretched in {100 * self.stretched / total:.0f} % of the time: no torque tells the force along it; "
                "what is measured then is left out. Stand with bent knees."
            )
        return sentences + self._doubts_gravity()

    @property
    def stepping(self) -> float:
        """Part of the time in which it steps."""
        return self.steps / max(self.samples, 1)

    def mass_error(self, mass: float) -> float:
        """By how much a mass [kg] that hangs on the feet is wrong if that excess is a bias that is not estimated [kg]."""
        return 0.0 if self.bias_is_free else mass * self.excess / self._gravity

    @property
    def excess(self) -> float:
        """By how much more than gravity the accelerometer shows, as far as that is no noise [m/s^2]."""
        excess, std = self._average()
        return excess * _USUAL**2 / (_USUAL**2 + std**2)

    @property
    def is_doubtful(self) -> bool:
        """Whether that is neither noise nor gravity at another place."""
        excess, std = self._average()
        return abs(excess) > max(_EXCESS, 4.0 * std)

    def _average(self) -> tuple[float, float]:
        count = len(self._seconds)
        if count < 3:
            return 0.0, 1.0
        return float(np.mean(self._seconds)), float(np.std(self._seconds)) / np.sqrt(count - 1)

    def _doubts_gravity(self) -> list[str]:
        if not self.is_doubtful or self.bias_is_free:
            return []
        excess = self._average()[0]
        return [
            f"Beside its motion the accelerometer shows {self._gravity + excess:.3f} m/s^2; gravity is {self._gravity:.3f}. "
            f"If that is a bias, the mass is wrong by {100 * abs(excess) / self._gravity:.1f} % of robot and load: set "
            "accelerometer_bias_std to what its maker states, and it is estimated. If gravity is another there, set gravity."
        ]


STANDS, AIRBORNE, LIFTED, SET_DOWN, STANDS_AGAIN = range(5)
"""It stands; its feet have left the ground for a moment; for long; it stands again, for how long is not known; and for good."""

_TRUSTED = 0.5
"""Part of a row that is from when the feet carried the robot, below which the row is left out."""
_SETTLES = 1.0
"""Time on the ground after which nobody is taken to hold the robot any more [s]."""


class GroundContact:
    """Follows the share of the rows that were measured on the ground.

    Who lifts a robot pulls at it before its feet are off the ground and after they are on it again, and what it carries may be
    another thing afterwards. So after it was lifted it counts as standing only when it has stood for a while, and then what was
    learned before is to be forgotten.

    Args:
        timeout: off the ground for longer than this it was lifted [s]. stances: of the same robot.

    Attributes:
        seconds: off the ground, or since it was set down [s].
    """

    def __init__(self, timeout: float, stances: StanceLog) -> None:
        self._timeout, self._stances = timeout, stances
        self._lifted = False
        self.seconds = 0.0
        self._stood = True

    @property
    def lifted(self) -> bool:
        """True from when it was lifted until it stands again."""
        return self._lifted

    @property
    def reason(self) -> str:
        """The state in a sentence."""
        if self._stood:
            return f"The robot has been set down {self.seconds:.1f} s ago; what it carries is looked for anew."
        return (
            f"For {self.seconds:.1f} s the feet have not carried the robot, or a leg was stretched; what it carries is not known "
            f"any more. {self._stances.against}".rstrip()
        )

    def update(self, trust: float, period: float) -> int:
        """Take in the share of a row (0 to 1) that stands for ``period`` [s]; the state from then on."""
        stands = trust >= _TRUSTED
        self.seconds = period if stands != self._stood else self.seconds + period
        self._stood = stands
        if not stands:
            self._lifted = self._lifted or self.seconds > self._timeout
            return LIFTED if self._lifted else AIRBORNE
        if not self._lifted:
            return STANDS
        if self.seconds < _SETTLES:
            return SET_DOWN
        self._lifted = False
        return STANDS_AGAIN
