"""What the demo asks of the estimate before the drop, and the comparison with the truth that it shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.pages import TruthSegment
from sysid_ros.pages.payload_curves import inertia_diagonal_jacobian
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray

MASS_PART = 0.05
COM_ERROR = 0.01
EVENT_DELAY = 0.5
_JOINT_REGION = 18.47
"""99.9 % quantile of chi-squared with 4 degrees of freedom: a right estimator fails one demo in a thousand by it."""
_QUANTILE = 1.96

CRITERION = (
    f"Before the drop the status is ok, the mass is within {100 * MASS_PART:.0f} % and the centre of mass within "
    f"{1e3 * COM_ERROR:.0f} mm of the truth, the truth of both lies in the 99.9 % region of the stated covariance, and "
    f"pick and drop were found, dated within {EVENT_DELAY} s."
)


@dataclass(frozen=True, slots=True)
class Comparison:
    """One quantity against its truth, in the unit of ``unit``; ``half`` is half of the 95 % interval."""

    name: str
    unit: str
    truth: float
    estimate: float
    half: float

    @property
    def error(self) -> float:
        return self.estimate - self.truth

    @property
    def inside(self) -> bool:
        """The truth lies in the 95 % interval."""
        return abs(self.error) <= self.half


def compare(estimate: PayloadEstimate, truth: TruthSegment) -> list[Comparison]:
    """Mass, and where the arm carries something also centre of mass and the inertia's diagonal."""
    rows = [Comparison("mass", "kg", truth.mass, estimate.mass, _QUANTILE * estimate.mass_std)]
    if truth.mass == 0.0 or estimate.mass <= 3.0 * estimate.mass_std:
        return rows
    jacobian = inertia_diagonal_jacobian(estimate.theta)
    inertia_std = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, estimate.covariance, jacobian))
    found, true = np.diag(estimate.inertia_com), np.diag(truth.inertia_com)
    for i, axis in enumerate("xyz"):
        rows.append(_scaled(f"com {axis}", "mm", truth.com[i], estimate.com[i], estimate.com_std[i]))
    for i, axis in enumerate("xyz"):
        rows.append(_scaled(f"I{axis}{axis}", "g m²", true[i], found[i], inertia_std[i]))
    return rows


def objections(estimate: PayloadEstimate | None, truth: TruthSegment, events: Sequence[PayloadEvent]) -> list[str]:
    """What speaks against the estimate by :data:`CRITERION`, one sentence each; empty where nothing does.

    Args:
        estimate: the last one before the drop. truth: what was carried then, from pick to drop.
        events: that the estimator found.
    """
    if estimate is None:
        return ["There is no estimate between pick and drop."]
    against = []
    if estimate.status != "ok":
        against.append(f"The status before the drop is {estimate.status}, not ok. {estimate.reason}".strip())
    error = estimate.mass - truth.mass
    if abs(error) > MASS_PART * truth.mass:
        against.append(f"The mass is wrong by {error:+.3f} kg, {100 * error / truth.mass:+.1f} %.")
    com_error = float(np.abs(estimate.com - truth.com).max())
    if not com_error <= COM_ERROR:
        against.append(f"The centre of mass is wrong by {1e3 * com_error:.1f} mm.")
    distance = _distance(estimate, truth)
    if not distance <= _JOINT_REGION:
        against.append(
            f"The stated covariance is too small: the truth of mass and centre is {distance:.0f} away by it; "
            f"{_JOINT_REGION} is allowed."
        )
    for kind, when in (("pick", truth.start), ("drop", truth.end)):
        if not any(e.kind == kind and abs(e.t - when) <= EVENT_DELAY for e in events):
            against.append(f"The {kind} was not found within {EVENT_DELAY} s.")
    return against


def _distance(estimate: PayloadEstimate, truth: TruthSegment) -> float:
    """Squared distance of the true mass and first moments, in standard deviations of the estimate."""
    true: FloatArray = inertial_parameters.from_com(truth.mass, truth.com, truth.inertia_com)
    error = estimate.theta[:4] - true[:4]
    return float(error @ np.linalg.solve(estimate.covariance[:4, :4], error))


def _scaled(name: str, unit: str, truth: float, estimate: float, std: float) -> Comparison:
    return Comparison(name, unit, 1e3 * truth, 1e3 * estimate, 1e3 * _QUANTILE * std)
