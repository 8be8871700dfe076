"""StanceLog: how often feet slipped, contacts were told wrong, and the robot did not stand, in numbers and words."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sysid_ros.contact_projection import Stance
from sysid_ros.sample import FloatArray

_LONGER = 0.05
"""A contact that is told otherwise than the leg's torques show for longer than this counts as wrong [s]."""
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
        feet: their names.

    Attributes:
        samples: all. untrusted: the feet did not carry the robot; the rows are left out. slipping: feet that stand moved against
            each other. wrong: of each foot, samples in which its contact was told wrong, shape (k,).
        inferred: samples whose stance no message told.
    """

    def __init__(self, feet: tuple[str, ...]) -> None:
        self._feet = feet
        self._agreed: FloatArray = np.full(len(feet), -np.inf)
        self.samples = self.untrusted = self.slipping = self.inferred = 0
        self.wrong: FloatArray = np.zeros(len(feet))

    def add(self, stance: Stance, t: float) -> None:
        """Take in the stance at t [s]."""
        self.samples += 1
        self.untrusted += not stance.trusted
        self.slipping += stance.slips
        self.inferred += not stance.told
        if stance.told:
            _compare(stance.stands, stance.loaded, t, self._agreed, self.wrong)

    @property
    def counts(self) -> dict[str, int]:
        """Samples by what was found: 'not_standing', 'foot_slip', 'contact_wrong', 'contact_inferred'; those that are not 0."""
        found = {
            "not_standing": self.untrusted,
            "foot_slip": self.slipping,
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
                f"Feet that stand move against each other in {100 * self.slipping / total:.0f} % of the time: the "
                f"robot slips, or "
                "its kinematics are not those of the URDF."
            )
        return sentences
