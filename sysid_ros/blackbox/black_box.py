"""BlackBox: the one base of models that know nothing of the robot."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Self

import numpy as np

from sysid_ros.blackbox.series import Channels, Series, as_series
from sysid_ros.blackbox.state_space import StateSpace
from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording


class BlackBox(ABC):
    """A model from recordings alone: ``fit`` takes several, ``predict`` simulates one from its inputs.

    Args:
        channels: what of a recording is input and what is output; series have theirs already.
    """

    def __init__(self, channels: Channels | None = None) -> None:
        self.channels = channels or Channels()

    def fit(self, recordings: Sequence[Recording | Series]) -> Self:
        """Fit to recordings or series of one rate; gaps are never bridged.

        Raises:
            DataError: they hold too little, or do not fit one another.
        """
        self.fit_series(as_series(recordings, self.channels))
        return self

    def predict(self, recording: Recording | Series) -> FloatArray:
        """Outputs at the rows of a recording, shape (N, p), from its inputs and what it begins with; NaN where a gap leaves
        nothing to begin with."""
        self.require_fitted()
        if isinstance(recording, Series):
            return self.predict_series(recording)
        out: FloatArray | None = None
        for s in self.channels.series(recording, self.period):
            found = self.predict_series(s)
            if out is None:
                out = np.full((len(recording.t), found.shape[1]), np.nan)
            inside = (recording.t >= s.t[0] - 1e-9) & (recording.t <= s.t[-1] + 1e-9)
            out[inside] = np.column_stack([np.interp(recording.t[inside], s.t, x) for x in found.T])
        assert out is not None
        return out

    def require_fitted(self) -> None:
        """
        Raises:
            SettingsError: nothing was fitted yet.
        """
        if self.period <= 0.0:
            raise SettingsError("the model is not fitted yet. Call fit(recordings) first.")

    @property
    @abstractmethod
    def period(self) -> float:
        """Time between steps [s]; 0 before a fit."""

    @property
    @abstractmethod
    def order(self) -> int:
        """Number of states, of a static model 0."""

    @abstractmethod
    def as_state_space(self) -> StateSpace | None:
        """The model as a linear one; None where it is none."""

    @abstractmethod
    def fit_series(self, series: Sequence[Series]) -> None:
        """Fit to series of one rate and of the same channels."""

    @abstractmethod
    def predict_series(self, series: Series) -> FloatArray:
        """Outputs of a series, shape (N, p)."""
