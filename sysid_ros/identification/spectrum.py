"""The cut-off of the low-pass, chosen from what the torques do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.identification.result import CutOff
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray
from sysid_ros.signals.cutoff import default_cutoff
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.zero_phase import on_even_grid


def choose_cutoff(recordings: Sequence[Recording], joint_names: Sequence[str], max_gap: float = 0.1) -> CutOff:
    """One and a half times the frequency below which 99.5 % of what a torque does above its noise floor lies.

    The floor of each joint is the median of its power spectrum (Welch 1967) in the upper half of the frequencies. The fastest
    joint decides. The cut-off stays between 2 Hz and what the rate allows: a twentieth of it, 10 Hz at most. It is lower where
    the noise of the positions would make more than a ten-thousandth of the acceleration's power: noise in the regressor biases
    inertias towards zero, and grows with the fifth power of the cut-off. It never falls into the motion's own band.

    Args:
        recordings: of one robot. joint_names: for the reason.
    """
    highest = min(default_cutoff(1.0 / max(r.period, 1e-9)) for r in recordings)
    lowest = min(TOL.lowest_cutoff, highest)
    bands = [_bands(r, max_gap) for r in recordings]
    edges = np.array([b.torque for b in bands])
    edge, joint = float(edges.max()), joint_names[int(np.argmax(edges.max(axis=0)))]
    clean = np.array([b.clean for b in bands])
    least = max(lowest, min(TOL.above_motion * float(np.max([b.motion for b in bands])), highest))
    noisy, noisy_joint = float(clean.min()), joint_names[int(np.argmin(clean.min(axis=0)))]
    if not edge > 0.0:
        wanted, reason = highest, "no torque rises above its noise, so it is what the rate of the data allows"
    else:
        found = f"{100 * TOL.torque_power:g} % of the torque of {joint} above its noise lies below {edge:.2g} Hz"
        wanted, reason = TOL.cutoff_margin * edge, f"{found}; the cut-off is {TOL.cutoff_margin:g} times that"
        if wanted > highest:
            wanted, reason = highest, f"{found}; {highest:.3g} Hz is the most that the rate of the data allows"
        elif wanted < lowest:
            wanted, reason = lowest, f"{found}; {lowest:.3g} Hz is the least that is used"
    if max(noisy, least) < wanted:
        wanted = max(noisy, least)
        reason = f"above that the noise of the position of {noisy_joint} would bias its inertia"
    return CutOff(wanted, reason)


@dataclass(frozen=True, slots=True)
class _Bands:
    """Frequencies of each joint, shape (n,) [Hz].

    ``torque``: below it lies what the torque does above its noise, 0 where nothing is. ``motion``: below it lies 95 % of the
    acceleration. ``clean``: up to it a low-pass leaves little noise in the acceleration, infinite for a joint that stands.
    """

    torque: FloatArray
    motion: FloatArray
    clean: FloatArray


def _bands(recording: Recording, max_gap: float) -> _Bands:
    from scipy import signal  # takes longer to load than the rest of the package

    longest = max(recording.stretches(max_gap), key=lambda part: part.stop - part.start)
    n = recording.tau.shape[1]
    torque, motion, clean = np.zeros(n), np.zeros(n), np.full(n, np.inf)
    if longest.stop - longest.start < 64 or recording.period <= 0.0:
        return _Bands(torque, motion, clean)
    channels = np.hstack([recording.tau[longest], recording.q[longest]])
    _, even = on_even_grid(recording.t[longest], channels, recording.period)
    tau, q = even[:, :n], even[:, n:]
    rate = 1.0 / recording.period
    segment = min(len(tau), int(TOL.segment * rate))
    frequency, power = signal.welch(tau, rate, window="hann", nperseg=segment, detrend="constant", axis=0)
    floor = np.median(power[frequency > 0.25 * rate], axis=0)
    total = np.cumsum(np.where(power > TOL.above_floor * floor, power - floor, 0.0), axis=0)
    noise = 2.0 * _white_variance(q) / rate
    _, power = signal.welch(q, rate, window="hann", nperseg=segment, detrend="linear", axis=0)
    band = frequency < 0.1 * rate
    bend = (2.0 * np.pi * frequency[band, None]) ** 4 * np.where(power[band] > TOL.above_noise * noise, power[band] - noise, 0.0)
    bends = np.cumsum(bend, axis=0)
    for j in range(n):
        if total[-1, j] > 0.0:
            torque[j] = frequency[np.searchsorted(total[:, j], TOL.torque_power * total[-1, j])]
        if bends[-1, j] > 0.0 and np.ptp(q[:, j]) > TOL.moved:
            motion[j] = frequency[band][np.searchsorted(bends[:, j], TOL.motion_power * bends[-1, j])]
            acceleration = float(bends[-1, j]) * (frequency[1] - frequency[0])
            # integral of (2 pi f)^4 times the power gain of the Gaussian low-pass: 1.66 (2 pi)^4 cutoff^5
            gain = 1.66 * (2.0 * np.pi) ** 4 * max(float(noise[j]), 1e-300)
            clean[j] = (TOL.acceleration_bias * acceleration / gain) ** 0.2
    return _Bands(torque, motion, clean)


def _white_variance(q: FloatArray) -> FloatArray:
    """Variance of the white noise of positions, shape (n,), from their sixth differences, in which motion hardly shows."""
    differences = np.diff(q, 6, axis=0)
    # 924 is the sum of the squared coefficients, 0.455 the median of chi-squared with one degree of freedom
    return np.asarray(np.median(differences**2, axis=0) / 0.455 / 924.0)
