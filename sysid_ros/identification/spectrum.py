"""The cut-off of the low-pass, chosen from what the torques do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import signal

from sysid_ros.identification.recording import Recording
from sysid_ros.identification.result import CutOff
from sysid_ros.identification.zero_phase import on_even_grid
from sysid_ros.sample import FloatArray
from sysid_ros.signals import default_cutoff

_PART = 0.995
_MARGIN = 1.5
_LOWEST = 2.0
_SECONDS = 8.0


def choose_cutoff(recordings: Sequence[Recording], joint_names: Sequence[str], max_gap: float = 0.1) -> CutOff:
    """One and a half times the frequency below which 99.5 % of what a torque does above its noise floor lies.

    The floor of each joint is the median of its power spectrum (Welch 1967) in the upper half of the frequencies. The fastest
    joint decides. The cut-off stays between 2 Hz and what the rate allows: a twentieth of it, 10 Hz at most, because the
    acceleration from positions grows noisier with the square of the frequency.

    Args:
        recordings: of one robot. joint_names: for the reason.
    """
    highest = min(default_cutoff(1.0 / max(r.period, 1e-9)) for r in recordings)
    edges = np.array([_busy_below(r, max_gap) for r in recordings])
    edge, joint = float(edges.max()), joint_names[int(np.argmax(edges.max(axis=0)))]
    if not edge > 0.0:
        return CutOff(highest, f"no torque rises above its noise; {highest:.3g} Hz is what the rate allows")
    wanted = _MARGIN * edge
    found = f"{100 * _PART:g} % of the torque of {joint} above its noise lies below {edge:.2g} Hz"
    if wanted > highest:
        return CutOff(highest, f"{found}; {highest:.3g} Hz is the most that the rate of the data allows")
    if wanted < _LOWEST:
        return CutOff(min(_LOWEST, highest), f"{found}; {min(_LOWEST, highest):.3g} Hz is the least that is used")
    return CutOff(wanted, f"{found}; the cut-off is {_MARGIN:g} times that")


def _busy_below(recording: Recording, max_gap: float) -> FloatArray:
    """The frequency of each joint, shape (n,) [Hz], 0 where nothing rises above the noise."""
    longest = max(recording.stretches(max_gap), key=lambda part: part.stop - part.start)
    n = recording.tau.shape[1]
    if longest.stop - longest.start < 64 or recording.period <= 0.0:
        return np.zeros(n)
    _, tau = on_even_grid(recording.t[longest], recording.tau[longest], recording.period)
    rate = 1.0 / recording.period
    segment = min(len(tau), int(_SECONDS * rate))
    frequency, power = signal.welch(tau, rate, window="hann", nperseg=segment, detrend="constant", axis=0)
    floor = np.median(power[frequency > 0.25 * rate], axis=0)
    above = np.where(power > 4.0 * floor, power - floor, 0.0)
    total = np.cumsum(above, axis=0)
    edge = np.array(
        [frequency[np.searchsorted(total[:, j], _PART * total[-1, j])] if total[-1, j] > 0.0 else 0.0 for j in range(n)]
    )
    return np.asarray(edge, dtype=float)
