"""What is left of the torque, over position, velocity, time and frequency: the curves of the report, in numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sysid_ros.identification.result import ResidualSeries
from sysid_ros.sample import FloatArray

_CLASSES = 24


def residual_curves(series: Sequence[ResidualSeries], joints: Sequence[str]) -> list[dict[str, Any]]:
    """For each joint, means of the residual [N m] over classes of position, velocity and time (of the rows in which it moves),
    and the amplitude density of residual and torque [N m/sqrt(Hz)] over frequency.

    Time is since the first stamp of each recording [s]; the classes hold equally many rows.
    """
    out = []
    moving = np.concatenate([s.moving for s in series])
    residual = np.concatenate([s.residual for s in series])
    channels = {
        "position": np.concatenate([s.q for s in series]),
        "velocity": np.concatenate([s.v for s in series]),
        "time": np.concatenate([np.repeat((s.t - s.t[0])[:, None], s.q.shape[1], axis=1) for s in series]),
    }
    for j, joint in enumerate(joints):
        here = moving[:, j]
        entry: dict[str, Any] = {"joint": joint}
        for name, values in channels.items():
            centre, mean = class_means(values[here, j], residual[here, j])
            entry[name] = {"at": centre, "residual": mean}
        times, period = [s.t for s in series], series[0].period
        hz, density = spectrum([s.residual[:, j] for s in series], times, period)
        _, of_torque = spectrum([s.tau_measured[:, j] for s in series], times, period)
        entry["frequency"] = {"hz": hz, "residual": density, "torque": of_torque}
        out.append(entry)
    return out


def class_means(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Means of x and y over classes of equally many points along x."""
    if len(x) < 4 * _CLASSES:
        return np.zeros(0), np.zeros(0)
    classes = np.array_split(np.argsort(x), _CLASSES)
    return np.array([x[c].mean() for c in classes]), np.array([y[c].mean() for c in classes])


def spectrum(values: Sequence[FloatArray], times: Sequence[FloatArray], period: float) -> tuple[FloatArray, FloatArray]:
    """Frequencies [Hz] and amplitude density [N m/sqrt(Hz)] over all stretches without a gap (Welch 1967)."""
    from scipy.signal import welch

    stretches = [
        part
        for y, t in zip(values, times, strict=True)
        for part in np.split(y, np.flatnonzero(np.abs(np.diff(t) - period) > 0.5 * period) + 1)
    ]
    length = min(256, max((len(part) for part in stretches), default=0))
    used = [part for part in stretches if len(part) >= length]
    if length < 16:
        return np.zeros(0), np.zeros(0)
    found = [welch(part, 1.0 / period, nperseg=length, detrend="constant") for part in used]
    weight = np.array([len(part) for part in used], dtype=float)
    power = np.average([power for _, power in found], axis=0, weights=weight)
    return np.asarray(found[0][0][1:]), np.sqrt(np.maximum(power[1:], 1e-30))
