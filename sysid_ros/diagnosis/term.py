"""Term: one effect on one joint (or on the whole arm) with its columns, the unit that selection adds and removes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.effects import Effect
from sysid_ros.sample import FloatArray

DRY = (
    "coulomb_friction",
    "asymmetric_coulomb_friction",
    "stribeck_friction",
    "load_dependent_friction",
    "presliding_hysteresis",
    "friction_drift",
)
"""Forms of dry friction, of which a joint has at most one; the simpler ones first."""


@dataclass(frozen=True, eq=False)
class Term:
    """An effect of some joints, as columns in the band.

    Attributes:
        effect: made for these joints with its knobs.
        joints: indices of the joints that it is named with.
        row: the joint that it loads where it loads only one, else None.
        columns: shape (K, p) where it loads one joint, else (K, n, p).
        basis: the effect's parameters are ``basis @ theta``, shape (effect.p, p); None for the identity.
        form: which of several forms with the same name it is, for messages.
    """

    effect: Effect
    joints: tuple[int, ...]
    row: int | None
    columns: FloatArray
    basis: FloatArray | None = None
    form: str = ""

    @property
    def id(self) -> str:
        """The effect's name."""
        return self.effect.id

    @property
    def key(self) -> tuple[str, tuple[int, ...]]:
        """Name and joints."""
        return self.effect.id, self.joints

    @property
    def p(self) -> int:
        """Number of columns."""
        return int(self.columns.shape[-1])

    @property
    def cost(self) -> int:
        """Number of parameters with the nonlinear ones."""
        return self.p + len(self.effect.knobs)

    def theta_of_effect(self, theta: FloatArray) -> FloatArray:
        """Parameters of the effect, shape (effect.p,)."""
        return theta if self.basis is None else self.basis @ theta

    def fill(self, out: FloatArray) -> None:
        """Write the columns into ``out`` of shape (K, n, p)."""
        if self.row is None:
            out[:] = self.columns
        else:
            out[:, self.row] = self.columns

    def excludes(self, other: Term) -> bool:
        """True where the two can't stand side by side: forms of one thing on the same joint."""
        if self.joints != other.joints and not (self.row is not None and self.row == other.row):
            return False
        if self.id == other.id:
            return self.id != "joint_coupling" or self.joints == other.joints
        pair = {self.id, other.id}
        if self.row is not None and self.row == other.row:
            if self.id in DRY and other.id in DRY:
                return True
            return pair == {"friction_drift", "viscous_friction"}
        return False


def design(terms: list[Term], count: int, n: int) -> FloatArray:
    """Columns of terms side by side, shape (K, n, m)."""
    out = np.zeros((count, n, sum(term.p for term in terms)))
    start = 0
    for term in terms:
        term.fill(out[:, :, start : start + term.p])
        start += term.p
    return out
