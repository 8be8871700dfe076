"""Filtered rows of the equation from a whole recording, for least squares over all of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.front_end import FrontEnd
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.signals import default_cutoff
from sysid_ros.torque_model import TorqueModel

_SLOW_PART = 0.1
"""Part of a row that may come from a joint hardly moving, where dry friction leaves its torque undetermined."""

_SHORTEST = 2.0
"""Rows of a recording must cover at least this [s]."""


@dataclass(frozen=True, slots=True)
class BagRows:
    """Rows of one recording: ``y = Y theta + noise``.

    Attributes:
        name: where they come from.
        t: shape (N,) [s]. period: time between rows [s].
        Y: shape (N, n, p). y: what the known effects leave of the torque, shape (N, n) [N m]. tau: measured torque, shape (N,
            n) [N m].
        moving: rows of joints whose friction is determined, shape (N, n), bool.
    """

    name: str
    t: FloatArray
    period: float
    Y: FloatArray
    y: FloatArray
    tau: FloatArray
    moving: np.ndarray[tuple[int, int], np.dtype[np.bool_]]

    @property
    def seconds(self) -> float:
        """Time that the rows cover [s]."""
        return len(self.t) * self.period


def collect_rows(
    model: TorqueModel,
    measurements: Iterable[Measurement],
    name: str,
    cutoff_hz: float = 0.0,
    max_gap: float = 0.1,
    progress: Callable[[], None] = lambda: None,
) -> BagRows:
    """Run the online filters over a recording and keep about four rows a cut-off period.

    Filters start again after a gap longer than ``max_gap`` [s] and after time that runs back.

    Raises:
        DataError: the recording is too short to leave a row.
    """
    rows = []
    for stretch in _stretches(measurements, max_gap, progress):
        if len(stretch) < 25:
            continue
        period = float(np.median(np.diff([m.t for m in stretch])))
        cutoff = cutoff_hz or default_cutoff(1.0 / period)
        front_end = FrontEnd(model, period, 4.0 * cutoff, cutoff)
        rows += [r for m in stretch for r in front_end.push(m)]
    seconds = len(rows) * front_end.period if rows else 0.0
    if seconds < _SHORTEST:
        raise DataError(
            f"{name}: {seconds:.1f} s are left once the filters are full; {_SHORTEST:g} s are the least that can be used. "
            "Record at least 10 s without gaps."
        )
    return BagRows(
        name=name,
        t=np.array([r.sample.t for r in rows]),
        period=front_end.period,
        Y=np.stack([r.Y for r in rows]),
        y=np.stack([r.y for r in rows]),
        tau=np.stack([r.tau for r in rows]),
        moving=np.stack([r.slow < _SLOW_PART for r in rows]),
    )


def _stretches(measurements: Iterable[Measurement], max_gap: float, progress: Callable[[], None]) -> Iterable[list[Measurement]]:
    stretch: list[Measurement] = []
    for m in measurements:
        progress()
        if stretch and not 0.0 < m.t - stretch[-1].t <= max_gap:
            yield stretch
            stretch = []
        stretch.append(m)
    yield stretch
