"""StanceLog: how often feet slipped, contacts were told wrong, and the robot did not stand, in numbers and words."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sysid_ros.floating.contact_projection import Stance
from sysid_ros.sample import FloatArray

_LONGER = 0.05
"""A contact that is told otherwise than the leg's torques show for longer than this counts as wrong [s]."""
_EXCESS = 0.03
"""Difference to gravity that is worth a warning; on Earth gravity itself differs by so much [m/s^2]."""
_TOGETHER, _MOST = 100, 300
"""Rows whose excess over gravity is averaged, some steps of a gait, and averages that are kept."""
_SHARE = 0.02
"""Share of the samples from which on it is worth a warning."""


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _compare(told: NDArray[np.bool_], loaded: NDArray[np.bool_], t: float, agreed: FloatArray, wrong: FloatArray) -> None:
    """Count the feet that have been told otherwise than they are loaded for too long; ``agreed`` is when each last was not."""
    for i in range(told.size):
        if told[i] == loaded[i] or not 0.0 <= t - agreed[i] < 1e6:
            agreed[i] = t
        elif t - agreed[i] > _LONGER:
            wrong[i] += 1.0


class StanceLog:
    """Counts over the samples of a floating base.

    Args:
        feet: their names. gravity: at the place [m/s^2]. bias_is_free: a bias of the accelerometer is estimated.

    Attributes:
        samples: all. untrusted: the feet did not carry the robot; the rows are left out. slipping: feet that stand moved against
            each other. stretched: a leg that may stand was. inferred: no message told the stance.
        wrong: of each foot, samples in which its contact was told wrong, shape (k,).
    """

    def __init__(self, feet: tuple[str, ...], gravity: float = 9.81, bias_is_free: bool = False) -> None:
        self._feet = feet
        self._agreed: FloatArray = np.full(len(feet), -np.inf)
        self.samples = self.untrusted = self.slipping = self.stretched = self.inferred = 0
        self.wrong: FloatArray = np.zeros(len(feet))
        self._gravity, self.bias_is_free = gravity, bias_is_free
        self._seconds: list[float] = []
        self._rows, self._excess = 0, 0.0

    def add(self, stance: Stance, t: float) -> None:
        """Take in the stance at t [s]."""
        self.samples += 1
        self.untrusted += not stance.trusted
        self.slipping += stance.slips
        self.stretched += stance.stretched
        self.inferred += not stance.told
        if stance.told:
            _compare(stance.stands, stance.loaded, t, self._agreed, self.wrong)

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
                    f"The contact of {foot} is told otherwise than its leg's torques show in {100 * wrong / total:.0f} % of the "
                    "time. The estimate does not rest on it; check the sensor, and that contact_frames has the order "
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
    def excess(self) -> float:
        """By how much more than gravity the accelerometer shows [m/s^2]; 0 where it may be noise, or gravity at another place."""
        count = len(self._seconds)
        if count < 3:
            return 0.0
        excess, std = float(np.mean(self._seconds)), float(np.std(self._seconds)) / np.sqrt(count - 1)
        return 0.0 if abs(excess) < max(_EXCESS, 4.0 * std) else excess

    def _doubts_gravity(self) -> list[str]:
        excess = self.excess
        if not excess or self.bias_is_free:
            return []
        return [
            f"Beside its motion the accelerometer shows {self._gravity + excess:.3f} m/s^2; gravity is {self._gravity:.3f}. "
            f"If that is a bias, the mass is wrong by {100 * abs(excess) / self._gravity:.1f} % of robot and load: set "
            "accelerometer_bias_std to what its maker states, and it is estimated. If gravity is another there, set gravity."
        ]
