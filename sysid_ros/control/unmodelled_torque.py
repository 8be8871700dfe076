"""UnmodelledTorque: what the feedback has to add to a model, and what that says of a payload that somebody tells."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.stats import chi2

from sysid_ros.sample import FloatArray

_MEAN, _SCATTER = 0.1, 5.0
"""Time constants of the mean and of the squared scatter about it [s]."""
_FIRST: Final = 0.01
"""Standard deviation before anything is known of it, in parts of the effort limit: the friction of a good gear."""
_CHANCE: Final = 1e-3
_SAME: Final = 1.0
"""Squared distance, in standard deviations of the torque, up to which two values told one after the other are of one payload."""
CLEARLY: Final = 3.0
"""Logarithm of a likelihood ratio from which one of two payloads is believed against what was told: 20 to 1."""


class UnmodelledTorque:
    """Mean and scatter of the torque that was sent beyond what the model asks for: weight, friction and forces it does not know.

    Args:
        effort_limit: shape (n,) [N m].

    Attributes:
        mean: over the last tenth of a second, shape (n,) [N m]. variance: of single values about it, shape (n,).
    """

    def __init__(self, effort_limit: FloatArray) -> None:
        known = np.where(np.isfinite(effort_limit), effort_limit, np.nan)
        usual = float(np.nanmedian(known)) if np.isfinite(known).any() else 100.0
        self._first = (_FIRST * np.where(np.isfinite(known), known, usual)) ** 2
        self.forget()

    def forget(self) -> None:
        """Nothing is known."""
        self.mean: FloatArray = np.zeros_like(self._first)
        self.variance: FloatArray = self._first.copy()
        self._time, self._furthest = 0.0, 0.0
        self._strange: FloatArray = np.zeros_like(self._first)
        self._strangest = self._strange

    def add(self, torque: FloatArray, period: float, learned: FloatArray | None = None) -> None:
        """Take in what was sent beyond the model for ``period`` [s], shape (n,) [N m]; ``learned`` is that part of the model,
        shape (n,), which nobody told it."""
        if not period > 0.0:
            return
        self._time += period
        scatter = min(period / _SCATTER, 1.0)
        self.variance = (1.0 - scatter) * self.variance + scatter * (torque - self.mean) ** 2
        part = min(period / min(_MEAN, self._time), 1.0)
        self.mean = self.mean + part * (torque - self.mean)
        self._strange = self._strange + part * (torque + (0.0 if learned is None else learned) - self._strange)
        if (distance := self.distance(self._strange)) > self._furthest:
            self._furthest, self._strangest = distance, self._strange

    def strangest(self) -> FloatArray | None:
        """What was furthest beyond the model and what was told, on average over a tenth of a second since the last call, shape
        (n,) [N m]: friction, weight or forces that nobody knows. None where chance makes it as large in one of a thousand."""
        far, strangest = self._furthest, self._strangest
        self._furthest, self._strangest = 0.0, np.zeros_like(self._first)
        return strangest if chi2.sf(far, len(strangest)) < _CHANCE else None

    def distance(self, change: FloatArray) -> float:
        """Squared, of a change of the torque, shape (n,), in standard deviations."""
        return float(np.sum(change**2 / np.maximum(self.variance, self._first)))

    def against(self, change: FloatArray) -> float:
        """Logarithm of the likelihood ratio against a model whose torque is larger by ``change``, shape (n,) [N m]: above 0 where
        the feedback would have to take it back, below where it has been adding it already."""
        variance = np.maximum(self.variance, self._first)
        return float(np.sum(((self.mean - change) ** 2 - self.mean**2) / variance) / 2.0)


class ToldPayload:
    """Which of two payloads a controller believes in: one that it is told, or the one before.

    The torque says it: what is carried is carried by the feedback until it is believed, and what is not carried has to be taken
    back by it. So a false value is not taken over, one that comes before the grasp waits for it, and one that falls is let go of,
    before its weight moves the arm.

    Attributes:
        refused: True while what was told last is not believed.
    """

    def __init__(self) -> None:
        self._heard: FloatArray | None = None
        self._told: FloatArray | None = None
        self._before: FloatArray = np.zeros(10)
        self._new = False
        self.refused = False

    @property
    def payload(self) -> FloatArray:
        """That was told last and is believed, shape (10,); zeros where there is none."""
        return np.zeros(10) if self._told is None or self.refused else self._told

    @property
    def believed(self) -> bool:
        """True where what was told last is believed, and nothing is to be decided about it."""
        return self._told is not None and not (self._new or self.refused)

    @property
    def mass(self) -> float:
        """That was told last [kg]."""
        return 0.0 if self._told is None else float(self._told[0])

    def tell(self, payload: FloatArray) -> None:
        """Hear of a payload, shape (10,)."""
        self._heard = np.array(payload)

    def choose(self, columns: FloatArray, believed: FloatArray, unmodelled: UnmodelledTorque) -> FloatArray | None:
        """What the law is to be told now, shape (10,); None where nothing is new.

        Args:
            columns: torque a parameter, shape (n, 10). believed: by the law now, shape (10,).
        """
        if self._heard is not None:
            heard, self._heard = self._heard, None
            if self._told is None or unmodelled.distance(columns @ (heard - self._told)) > _SAME:
                self._before, self._new, self.refused = np.array(believed), True, False
            elif not (self._new or self.refused):
                self._told = heard
                return heard
            self._told = heard
        if self._told is None:
            return None
        if self._new or self.refused:
            against = unmodelled.against(columns @ (self._told - believed))
            if against <= (CLEARLY if self._new else 0.0):
                self._new = self.refused = False
                return self._told
            self._new, self.refused = False, True
            return None
        if unmodelled.against(columns @ (self._before - believed)) < -CLEARLY:
            self.refused = True
            return self._before
        return None
