"""What else explains the rows as well as a finding does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.compliance_screen import BOTH_SIDES, WIDEST
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.selection import EXPECTED, Selection
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import Backlash, JointOffset

_TOLD = 5.0
"""Log-likelihood by which a rival must be worse to be told from a finding."""
_ASYMMETRIC, _PLAIN, _OFFSET = "asymmetric_coulomb_friction", "coulomb_friction", "torque_offset"


def rivals(selection: Selection, terms: Sequence[Term], search: bool = True) -> tuple[str, ...]:
    """Ids of the effects that explain the rows as well as the terms of a finding do, the likeliest first.

    Args:
        terms: of the finding, all of them in the selection's fit. search: False asks only what is the same while a joint moves.
    """
    names = [*_same_while_moving(selection, terms), *_same_on_one_flank(selection, terms)]
    if search and not (terms[0].id in EXPECTED and len(terms) > 2):
        names += [
            p.terms[0].id
            for p in selection.rivals(terms)
            if p.terms and p.fit.loglik > selection.fit.loglik - _TOLD and p.terms[0].id != terms[0].id
        ]
    return tuple(dict.fromkeys(names))


def _same_while_moving(selection: Selection, terms: Sequence[Term]) -> tuple[str, ...]:
    """A level forward and another one backward are their mean and a constant, ``F+ = Fc + o``, ``F- = Fc - o``.

    A rest does not tell either: dry friction is anything between ``-F-`` and ``F+`` there, which is ``o - Fc`` to ``o + Fc``.
    """
    fit, local = selection.fit, selection.library.local
    if terms[0].id == _ASYMMETRIC:
        other = [local(_PLAIN, t.joints[0], **t.effect.settings) for t in terms] + [local(_OFFSET, t.joints[0]) for t in terms]
        other = [t for t in other if not any(t.key == x.key for x in fit.terms)]
        return (_PLAIN, _OFFSET) if _as_likely(selection, terms, other) else ()
    if terms[0].id not in (_PLAIN, _OFFSET):
        return ()
    both = [
        (a, b) for a in fit.terms if a.id == _PLAIN for b in fit.terms if b.id == _OFFSET and b.row == a.row and {a, b} & {*terms}
    ]
    if not both:
        return ()
    other = [local(_ASYMMETRIC, a.joints[0], **a.effect.settings) for a, _ in both]
    return (_ASYMMETRIC,) if _as_likely(selection, [t for pair in both for t in pair], other) else ()


def _same_on_one_flank(selection: Selection, terms: Sequence[Term]) -> tuple[str, ...]:
    """A play whose one flank bears all the time is a wrong zero by half the gap, the motor ahead of the link under the load."""
    if terms[0].id != JointOffset.id or len(terms) > 1:
        return ()
    joint, offset = terms[0].joints[0], float(selection.fit.theta_of(terms[0])[0])
    load = np.concatenate([m.link_torque[:, joint] for m in selection.library.motions])
    ahead = float(np.mean(load * offset > 0.0))
    return (Backlash.id,) if ahead > 1.0 - BOTH_SIDES and abs(offset) <= 0.5 * WIDEST else ()


def _as_likely(selection: Selection, terms: Sequence[Term], others: Sequence[Term]) -> bool:
    fit = selection.fit
    rest = [t for t in fit.terms if t not in terms]
    trial: Fit = selection.problem.fit([*rest, *others], fit.noise, inexact=fit.inexact)
    return trial.loglik > fit.loglik - _TOLD
