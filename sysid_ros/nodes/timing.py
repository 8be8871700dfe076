"""Timing: how late the messages are and how long a step takes; ReceiveClock: the time at which a message was received."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass

import numpy as np

from sysid_ros.sample import FloatArray

_CAPACITY = 65536
_EDGES = np.geomspace(1e-6, 100.0, 8 * 64 + 1)
"""Edges of the histogram since the start: 64 bins a decade, so that a quantile is good to 4 %."""


class ReceiveClock:
    """ROS time at the price of the monotonic clock: its difference is taken again at every :meth:`follow`.

    It goes on where ROS time stands still, as when ``use_sim_time`` is set and nobody publishes ``/clock``.

    Attributes:
        offset: of ROS time from the monotonic clock [s].
    """

    def __init__(self) -> None:
        self.offset = time.time() - time.monotonic()

    def now(self) -> float:
        """[s]"""
        return time.monotonic() + self.offset

    def follow(self, ros_time: float) -> None:
        """Take over ROS time [s]; 0 means that there is none."""
        if ros_time > 0.0:
            self.offset = ros_time - time.monotonic()


@dataclass(frozen=True, slots=True)
class TimingReport:
    """Since the last report; latency is from a message's stamp to the moment after its step.

    Attributes:
        messages, estimates: how many.
        period: length of the time reported on [s].
        latency: median, 99 % quantile and maximum [s]; NaN where there was no message. step: the same for the step alone [s].
        total_latency: median and 99 % quantile since the start [s].
        load: part of the time spent in steps.
    """

    messages: int
    estimates: int
    period: float
    latency: tuple[float, float, float]
    step: tuple[float, float, float]
    total_latency: tuple[float, float]
    load: float


class Timing:
    """Collects times, a pair a message.

    Attributes:
        messages: time since its stamp and time that its step took [s], of each message since the last report, the newest of many.
        estimates: how many since the last report.
    """

    def __init__(self) -> None:
        self.messages: deque[tuple[float, float]] = deque(maxlen=_CAPACITY)
        self.estimates = 0
        self._histogram = np.zeros(_EDGES.size + 1, dtype=np.int64)
        self._since = time.monotonic()

    def report(self) -> TimingReport:
        """What was collected since the last report."""
        now = time.monotonic()
        latency, step = np.array(self.messages).reshape(-1, 2).T
        self._histogram += np.bincount(np.searchsorted(_EDGES, latency), minlength=self._histogram.size)
        period = max(now - self._since, 1e-9)
        report = TimingReport(
            messages=latency.size,
            estimates=self.estimates,
            period=period,
            latency=_quantiles(latency),
            step=_quantiles(step),
            total_latency=(self._quantile(0.5), self._quantile(0.99)),
            load=float(step.sum()) / period,
        )
        self.messages.clear()
        self.estimates = 0
        self._since = now
        return report

    def _quantile(self, part: float) -> float:
        total = int(self._histogram.sum())
        if total == 0:
            return float("nan")
        k = int(np.searchsorted(np.cumsum(self._histogram), part * total))
        return float(_EDGES[min(max(k, 0), _EDGES.size - 1)])


def _quantiles(values: FloatArray) -> tuple[float, float, float]:
    if values.size == 0:
        return (float("nan"),) * 3
    median, high = np.quantile(values, (0.5, 0.99))
    return float(median), float(high), float(values.max())
