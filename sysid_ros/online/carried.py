"""Carried: what was carried in a recording, one entry for each thing, from the estimates and events of its replay."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sysid_ros.files import whole
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.robot.inertial_parameters import to_com
from sysid_ros.sample import FloatArray

_ALIKE = 18.5
"""99.9 % quantile of chi-squared with 4 degrees of freedom: mass and first moments that differ by less are of the same thing."""
_TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, slots=True)
class Carried:
    """Something that was carried.

    Attributes:
        t0, t1: from when to when [s], by the stamps.
        estimate: the last one that was believed of it; where none was, the last one.
    """

    t0: float
    t1: float
    estimate: PayloadEstimate

    @property
    def inertia_std(self) -> FloatArray:
        """Standard deviation of the inertia about the centre of mass, shape (3, 3) [kg m^2], by the delta method."""
        theta, step = self.estimate.theta, 1e-6
        columns = []
        for unit in np.eye(10):
            ahead, behind = (to_com(theta + sign * step * unit)[2] for sign in (1.0, -1.0))
            columns.append((ahead - behind) / (2.0 * step))
        jacobian = np.stack(columns, axis=-1)
        return np.asarray(np.sqrt(np.einsum("ijk,kl,ijl->ij", jacobian, self.estimate.covariance, jacobian)))


def carried(series: Sequence[PayloadEstimate], events: Sequence[PayloadEvent], end: float) -> list[Carried]:
    """What was carried, in order.

    A recording is divided where a payload was picked up, dropped or changed; a force that passes divides nothing, nor does a
    change after which the same thing is carried, as far as is known.

    Args:
        series: estimates in the order of time. events: of the same replay. end: last stamp of the recording [s].
    """
    if not series:
        return []
    changes = [e.t for e in events if not e.passes]
    bounds = [series[0].t, *changes, end]
    found: list[Carried] = []
    for t0, t1 in itertools.pairwise(bounds):
        part = [e for e in series if t0 <= e.t < t1 or e.t == t1 == end]
        believed = [e for e in part if e.status in ("ok", "no_payload")]
        last = believed[-1] if believed else part[-1] if part else None
        if last is None or last.is_empty or not last.mass > 1.96 * last.mass_std:
            continue
        if found and found[-1].t1 == t0 and _same(found[-1].estimate, last):
            t0, last = found[-1].t0, min(found.pop().estimate, last, key=lambda e: (e.status != "ok", e.mass_std))
        found.append(Carried(t0, t1, last))
    return found


def _same(one: PayloadEstimate, other: PayloadEstimate) -> bool:
    off = (one.theta - other.theta)[:4]
    return float(off @ np.linalg.solve((one.covariance + other.covariance)[:4, :4], off)) < _ALIKE


def write_carried(path: Path, found: Sequence[Carried]) -> None:
    """One row a payload: from, to, mass, com, inertia about the com, each with its standard deviation; status."""
    tensor = [f"I{'xyz'[i]}{'xyz'[j]}" for i, j in _TENSOR]
    values = ["mass", "com_x", "com_y", "com_z", *tensor]
    with whole(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["t0", "t1", *values, *(f"{name}_std" for name in values), "status"])
        for c in found:
            e, std = c.estimate, c.inertia_std
            numbers = [c.t0, c.t1, e.mass, *e.com, *(e.inertia_com[at] for at in _TENSOR)]
            numbers += [e.mass_std, *e.com_std, *(std[at] for at in _TENSOR)]
            writer.writerow([*(repr(float(x)) for x in numbers), e.status])
