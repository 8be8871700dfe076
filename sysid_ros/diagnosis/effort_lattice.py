"""Efforts in coarse steps: the lattice that their raw values lie on, and how sure it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

from sysid_ros.diagnosis.evidence import Evidence
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

_LATTICE = 0.02
_COARSE = 1.2


@dataclass(frozen=True)
class Lattice:
    """Values ``x = x_0 + step k`` of the effort of one joint.

    Attributes:
        joint: its index. step, std: of the line of the values over their numbers k [N m]. evidence: against a continuous effort.
    """

    joint: int
    step: float
    std: float
    evidence: Evidence


def lattices(recordings: Sequence[Recording]) -> list[Lattice]:
    """The joints whose raw efforts lie on a lattice that is coarser than their noise."""
    out = []
    for j in range(recordings[0].tau.shape[1]):
        parts = [r.tau[:, j] for r in recordings]
        if step := _step(np.concatenate(parts)):
            rate = recordings[0].rate
            sections = signal.butter(4, min(30.0, rate / 5.0), "high", fs=rate, output="sos")
            fast = np.concatenate([signal.sosfiltfilt(sections, x) for x in parts])
            if step > _COARSE * float(np.std(fast)):
                out.append(lattice_of(j, parts, step, recordings[0].tau.shape[1]))
    return out


def _step(tau: FloatArray) -> float:
    """Usual gap between neighbouring values, of which all others are multiples [N m]; 0 where they are not."""
    values = np.unique(tau)
    if not 3 <= len(values) <= len(tau) // 4:
        return 0.0
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-6 * np.ptp(values)]
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    multiples = gaps / step
    off = float(np.max(np.abs(multiples - np.round(multiples))))
    return 0.0 if off > _LATTICE * max(1.0, float(multiples.max())) else step


def lattice_of(joint: int, parts: Sequence[FloatArray], step: float, candidates: int) -> Lattice:
    """The lattice of about this step through the efforts of one joint in several recordings, shape (N,) each [N m].

    Each value is judged by the one before, so that slow torques count for no more than they tell. A continuous effort moves on
    by a normal number; one on a lattice by so many steps, each number of steps as often as it was seen, and off it by what the
    values scatter about the line, or what a double can't hold.
    """
    tau = np.concatenate(parts).astype(np.longdouble)
    about = tau - tau.mean()
    k = np.round((tau - tau[0]) / step)
    about_k = k - k.mean()
    span = float(np.sum(about_k**2))
    exact = np.sum(about_k * about) / np.sum(about_k**2)
    rounding = float(np.spacing(float(np.abs(tau).max())))
    off = float(np.mean((about - exact * about_k) ** 2)) + rounding**2 / 12.0
    starts = np.cumsum([0, *(len(x) for x in parts[:-1])])
    moved, steps = (np.delete(np.diff(x), starts[1:] - 1) for x in (tau, k))
    continuous = 0.5 * np.log(max(float(np.mean(moved**2)), off)) * len(steps)
    times = np.unique(steps, return_counts=True)[1]
    on_lattice = 0.5 * np.log(off) * len(steps) - float(np.sum(times * np.log(times / len(steps))))
    # the step, what the values scatter, and how often each number of steps is, against one variance
    evidence = Evidence(2.0 * float(continuous - on_lattice), len(times) + 1, float(len(steps)), candidates)
    return Lattice(joint, float(exact), float(np.sqrt(off / span + float(np.spacing(float(exact))) ** 2)), evidence)
