"""Series: inputs and outputs of a stretch without gaps on an even grid; what of a Recording is which."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

_CHANNELS = ("q", "v", "tau")
_FEWEST = 20
"""Rows below which a stretch tells nothing."""
_GAP = 3.0
"""Usual periods that a gap may last."""


@dataclass(frozen=True, eq=False)
class Series:
    """Inputs and outputs of one stretch, at even times.

    Attributes:
        u: inputs, shape (N, m). y: outputs, shape (N, p). period: between rows [s]. name: where it comes from.
        start: stamp of the first row [s].

    Raises:
        DataError: the shapes do not fit, or a value is no number.
    """

    u: FloatArray
    y: FloatArray
    period: float
    name: str = ""
    start: float = 0.0

    def __post_init__(self) -> None:
        if self.u.ndim != 2 or self.y.ndim != 2 or len(self.u) != len(self.y):
            raise DataError(f"{self.name or 'a series'}: u has shape {self.u.shape} and y {self.y.shape}; both must be (N, ...).")
        if not (np.isfinite(self.u).all() and np.isfinite(self.y).all()):
            raise DataError(f"{self.name or 'a series'}: a value of u or y is no number. Leave out the rows where that is so.")

    def __len__(self) -> int:
        return len(self.u)

    @property
    def t(self) -> FloatArray:
        """Stamps, shape (N,) [s]."""
        return np.asarray(self.start + self.period * np.arange(len(self.u)), dtype=np.float64)

    def rows(self, part: slice) -> Series:
        """Some rows in a row."""
        begin = part.indices(len(self))[0]
        return Series(self.u[part], self.y[part], self.period, self.name, self.start + begin * self.period)


@dataclass(frozen=True, slots=True)
class Channels:
    """What of a recording is input and what output.

    Attributes:
        inputs, outputs: of "q", "v", "tau". joints: indices; None for all.
    """

    inputs: tuple[str, ...] = ("tau",)
    outputs: tuple[str, ...] = ("q",)
    joints: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        for name in (*self.inputs, *self.outputs):
            if name not in _CHANNELS:
                raise SettingsError(f"the channel is {name!r}; it must be one of {', '.join(_CHANNELS)}.")
        if not self.outputs:
            raise SettingsError("there is no output channel; give one of q, v, tau.")

    def series(self, recording: Recording, period: float = 0.0) -> list[Series]:
        """Stretches of a recording without gaps on an even grid, by straight lines between messages.

        Args:
            period: of the grid [s]; 0 for the usual time between messages.

        Raises:
            DataError: there is none that is long enough, or the recording lacks velocities that are asked for.
        """
        recording = recording.in_order()
        usual = recording.period
        if "v" in (*self.inputs, *self.outputs) and recording.v is None:
            raise DataError(f"{recording.name} has no velocities. Take positions instead.")
        every, out = period or usual, []
        for part in recording.stretches(_GAP * max(usual, 1e-9)):
            t = recording.t[part]
            grid = t[0] + every * np.arange(int((t[-1] - t[0]) / max(every, 1e-9) + 1e-6) + 1) if len(t) > 1 else t
            if len(grid) < _FEWEST:
                continue
            u, y = (self._on(grid, t, recording.at(part), names) for names in (self.inputs, self.outputs))
            out.append(Series(u, y, every, recording.name, float(t[0])))
        if not out:
            raise DataError(f"{recording.name}: no stretch without a gap has {_FEWEST} messages. Record for longer.")
        return out

    def _on(self, grid: FloatArray, t: FloatArray, part: Recording, names: Iterable[str]) -> FloatArray:
        n = part.q.shape[1]
        joints = range(n) if self.joints is None else self.joints
        columns = [np.interp(grid, t, getattr(part, name)[:, j]) for name in names for j in joints]
        return np.column_stack(columns) if columns else np.zeros((len(grid), 0))


def as_series(recordings: Sequence[Recording | Series], channels: Channels) -> list[Series]:
    """All stretches of recordings on one grid; what is a series already stays as it is.

    Raises:
        DataError: there is none, or they differ in their channels or periods.
    """
    period = next((r.period for r in recordings), 0.0)
    out = [s for r in recordings for s in ([r] if isinstance(r, Series) else channels.series(r, period))]
    if not out:
        raise DataError("no recording is given. Give at least one.")
    first = out[0]
    for s in out:
        if s.u.shape[1] != first.u.shape[1] or s.y.shape[1] != first.y.shape[1]:
            raise DataError(f"{s.name or 'a series'} has other channels than the first one.")
        if abs(s.period - first.period) > 1e-3 * first.period:
            raise DataError(f"{s.name or 'a series'} has a period of {s.period:g} s, the first one {first.period:g} s.")
    return out
