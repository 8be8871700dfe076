"""The plain baseline: the URDF with an offset, Coulomb and viscous friction on every joint, by least squares.

Whatever is told must not predict held-out recordings worse than that on any joint. Where it does, the baseline is what is told.
"""

from __future__ import annotations

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS
from sysid_ros.sample import FloatArray

_USUAL = 0.5
"""Effects that so many joints have, but for those of inertia, are what every model of a joint has."""
_WORSE = 1.05
"""Held-out error, over that of the baseline, from which a joint is worse."""


def plain_terms(library: Library, joint: int) -> list[Term]:
    """Offset, Coulomb and viscous friction of a joint."""
    kinds = [EFFECTS[name] for name in library.of_joints]
    return [library.local(kind.id, joint) for kind in kinds if kind.usual >= _USUAL and not kind.inertial]


def no_worse(problem: Problem, library: Library, fit: Fit, held: HeldOut) -> Fit:
    """The fit where it predicts no joint of the held-out recordings worse than the baseline does, else one that does not.

    All of it gives way where it predicts worse in all. A joint that is worse gets the baseline's terms in place of its own, or
    none, or links that are exact, whichever leaves the least of it and harms no other.
    """
    plain = {int(j): plain_terms(library, int(j)) for j in problem.active}
    held.add([t for terms in plain.values() for t in terms])
    floor = np.maximum(held.rms(np.sqrt(fit.noise.variance(held.prepared.band.f))), 1e-9)
    active = held.prepared.band.active & problem.band.active

    def error(x: Fit) -> FloatArray:
        return np.where(active, held.rms(held.residual(x)) / floor, 0.0)

    def made(terms: list[Term], inexact: bool) -> Fit:
        return problem.fit(terms, fit.noise, 0, inexact)

    baseline, nothing = made([t for terms in plain.values() for t in terms], False), made([], False)
    simpler = min((baseline, nothing), key=lambda x: float(np.sum(error(x) ** 2)))
    if np.linalg.norm(error(fit)) > _WORSE * np.linalg.norm(error(simpler)):
        return simpler
    limit = _WORSE * error(baseline)
    for j in np.argsort(-error(fit) / np.maximum(limit, 1e-9)):
        if error(fit)[j] <= limit[j] or int(j) not in plain:
            continue
        others = [t for t in fit.terms if t.row != j]
        options = [made([*others, *plain[int(j)]], fit.inexact), made(others, fit.inexact), made(list(fit.terms), False)]
        allowed = np.maximum(error(fit), limit)
        options = [x for x in options if np.all(error(x) <= allowed) and error(x)[j] < error(fit)[j]]
        fit = min(options, key=lambda x: float(error(x)[j]), default=fit)
    return fit
