"""Term: one effect on one joint (or on the whole arm) with its columns, the unit that selection adds and removes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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

_ONE_EVENT = 1.5
"""Changes of the payload nearer to one another are one [s]."""
_BODIES = ("payload", "payload_change", "link_inertia")


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
        load: rms torque on the joint's links, where the effect is a deflection under it; where it is a motor's limit, the effort
            that is not often exceeded [N m].
    """

    effect: Effect
    joints: tuple[int, ...]
    row: int | None
    columns: FloatArray
    basis: FloatArray | None = None
    form: str = ""
    load: float = 0.0

    @property
    def id(self) -> str:
        """The effect's name."""
        return self.effect.id

    @property
    def key(self) -> tuple[str, tuple[int, ...]]:
        """Name and joints; an event's recording is part of its name."""
        return f"{self.effect.id} {self.effect.settings.get('recording', '')}".rstrip(), self.joints

    @property
    def p(self) -> int:
        """Number of columns."""
        return int(self.columns.shape[-1])

    @property
    def prior(self) -> FloatArray:
        """Inverse variance of the columns' parameters before any data, shape (p,): for what a motion does not show of a body."""
        if self.id not in _BODIES or self.form == "scale":
            return np.zeros(self.p)
        return np.asarray(1.0 / np.array([30.0] + [10.0] * 3 + [3.0] * 6)[: self.p] ** 2)

    @property
    def cost(self) -> int:
        """Number of parameters with the nonlinear ones."""
        return self.p + len(self.effect.knobs)

    def theta_of_effect(self, theta: FloatArray) -> FloatArray:
        """Parameters of the effect, shape (effect.p,)."""
        return theta if self.basis is None else self.basis @ theta

    def excludes(self, other: Term) -> bool:
        """True where the two can't stand side by side: forms of one thing on the same joint, or one event."""
        if self.joints != other.joints and not (self.row is not None and self.row == other.row):
            return False
        if self.id == other.id == "payload_change":
            mine, its = self.effect.settings, other.effect.settings
            return mine.get("recording") == its.get("recording") and abs(mine["t0"] - its["t0"]) < _ONE_EVENT
        if self.id == other.id:
            return self.id != "joint_coupling" or self.joints == other.joints
        pair = {self.id, other.id}
        if pair == set(COMPANIONS):
            return True
        if self.row is not None and self.row == other.row:
            if self.id in DRY and other.id in DRY:
                return True
            return pair == {"friction_drift", "viscous_friction"}
        return False


COMPANIONS = {"joint_elasticity": "rotor_inertia", "backlash": "rotor_inertia"}
"""What an effect brings along on its joint: behind a spring or a play turns a motor, which the URDF does not know."""


def joined(terms: Sequence[Term]) -> Term:
    """One term with the columns of several, to score them together."""
    first = terms[0]
    if len(terms) == 1:
        return first
    blocks = [first.columns]
    for term in terms[1:]:
        if term.row is None:
            blocks.append(term.columns)
        else:
            block = np.zeros((*first.columns.shape[:2], term.p))
            block[:, term.row] = term.columns
            blocks.append(block)
    return replace(first, columns=np.concatenate(blocks, axis=2))


def best_of_each(groups: Sequence[tuple[float, list[Term]]]) -> list[tuple[float, list[Term]]]:
    """Groups with their gains, the largest first; of one compliance with several settings only the best."""
    out: list[tuple[float, list[Term]]] = []
    seen: set[tuple[str, tuple[int, ...]]] = set()
    for gain, terms in sorted(groups, key=lambda g: -g[0]):
        key = terms[0].key
        if terms[0].id in COMPANIONS and key in seen:
            continue
        seen.add(key)
        out.append((gain, terms))
    return out
