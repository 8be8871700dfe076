"""Faults of units, signs and order: looked for first, since every other effect would soak them up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from sysid_ros.diagnosis.effort_factors import EffortFactors
from sysid_ros.effects import ChannelEffect, Channels, JointOrder, JointSign, TorqueSign, TorqueUnit
from sysid_ros.signals.recording import Recording

UNITS = {
    1000.0: "N mm",
    100.0: "N cm",
    0.737562: "lbf ft",
    8.850746: "lbf in",
    0.001: "kN m",
    57.29578: "N m, times 180 / pi",
    0.101972: "kgf m",
}
"""Factors of units that efforts are published in by mistake."""


@dataclass(frozen=True)
class Fault:
    """A fault.

    Attributes:
        effect: how it is undone. joints: indices.
        values: (name, joint or None, value, unit, std) of each parameter; std is None where none was measured.
        parameters: free numbers among them. candidates: other faults that were tried, and itself.
        probability: that the channels have it, rather than another fault or none; None before it was weighed.
    """

    effect: ChannelEffect
    joints: tuple[int, ...]
    values: tuple[tuple[str, int | None, float | str, str, float | None], ...]
    parameters: int = 0
    candidates: int = 1
    probability: float | None = None


def undo(recording: Recording, effect: ChannelEffect) -> Recording:
    """The recording without the fault."""
    channels = effect.undo(Channels(recording.q, recording.v, recording.tau))
    return replace(recording, q=channels.q, v=channels.v, tau=channels.tau)


def faults_of_signs_and_order(names: Sequence[str]) -> Iterator[tuple[str, Fault]]:
    """With the kind of each: one effort, or one joint, with the wrong sign; efforts, or all channels, of two joints swapped."""
    n = len(names)
    for j in range(n):
        yield "effort", Fault(TorqueSign([j]), (j,), (("gain", j, -1.0, "1", None),))
        yield "joint", Fault(JointSign([j]), (j,), (("sign", j, -1.0, "1", None),))
    for i, j in combinations(range(n), 2):
        source = np.arange(n)
        source[[i, j]] = j, i
        values = (("takes_from", i, names[j], "", None), ("takes_from", j, names[i], "", None))
        yield "efforts' order", Fault(JointOrder(source.tolist(), True), (i, j), values)
        yield "order", Fault(JointOrder(source.tolist(), False), (i, j), values)


def faults_of_units(n: int) -> Iterator[tuple[str, Fault]]:
    """One unit for all efforts."""
    for factor in UNITS:
        yield "unit", Fault(TorqueUnit([factor] * n), tuple(range(n)), (("factor", None, factor, "1", None),), 1)


def fault_of_factors(found: EffortFactors) -> Fault:
    """A factor of its own on each effort."""
    n = len(found.values)
    values = tuple(("factor", j, float(found.values[j]), "1", None) for j in range(n))
    return Fault(TorqueUnit(found.values.tolist()), tuple(range(n)), values, n)
