"""What else explains the rows as well as a finding does."""

from __future__ import annotations

from collections.abc import Sequence

from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.posterior import Posterior
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS

_NAMED = 0.05
"""Part of the probability from which a rival is named."""
_DISTINCT = 5.0
"""Log-likelihood by which a rival must be worse to be distinct from a finding."""


def rivals(selection: Selection, posterior: Posterior, terms: Sequence[Term]) -> tuple[str, ...]:
    """Ids of the effects that explain the rows as well as the terms of a finding do, the likeliest first.

    Args:
        terms: of the finding, all of them in the selection's fit.
    """
    names = _same_while_moving(selection, terms)
    if len(terms) == 1:
        names += terms[0].effect.same_torque(selection.fit.theta_of(terms[0]), selection.library.motions)
    shares: dict[str, float] = {}
    for term in terms:
        for name, share in posterior.instead.get(term, {}).items():
            shares[name] = max(shares.get(name, 0.0), share)
    names += [name for name in sorted(shares, key=lambda x: -shares[x]) if shares[name] > _NAMED]
    return tuple(dict.fromkeys(names))


def _same_while_moving(selection: Selection, terms: Sequence[Term]) -> list[str]:
    """Effects whose torques add up to that of the terms while the joints move, and those to which they add with others.

    A level forward and another one backward are their mean and a constant, ``F+ = Fc + o``, ``F- = Fc - o``. A rest does not tell
    either: dry friction is anything between ``-F-`` and ``F+`` there, which is ``o - Fc`` to ``o + Fc``.
    """
    fit, kind = selection.fit, terms[0].kind
    out: list[str] = []
    if parts := kind.sum_of:
        other = [_in_place(selection, t, part) for part in parts for t in terms]
        other = [t for t in other if not any(t.key == x.key for x in fit.terms)]
        out += parts if _as_likely(selection, terms, other) else ()
    for whole in EFFECTS.values():
        kinds = [EFFECTS[part] for part in whole.sum_of]
        if kind not in kinds:
            continue
        rows = dict.fromkeys(t.row for t in terms)
        groups = [[t for t in fit.terms if t.row == row and t.kind in kinds] for row in rows]
        groups = [sorted(g, key=lambda t: kinds.index(t.kind)) for g in groups if len(g) == len(kinds)]
        other = [_in_place(selection, g[0], whole.id) for g in groups]
        if groups and _as_likely(selection, [t for g in groups for t in g], other):
            out.append(whole.id)
    return out


def _in_place(selection: Selection, term: Term, name: str) -> Term:
    """Another effect on the joint of a term, with those of its settings that are the other's knobs too."""
    knobs = {k.name for k in EFFECTS[name].knobs}
    settings = {k: x for k, x in term.effect.settings.items() if k in knobs}
    return selection.library.local(name, term.joints[0], **settings)


def _as_likely(selection: Selection, terms: Sequence[Term], others: Sequence[Term]) -> bool:
    fit = selection.fit
    rest = [t for t in fit.terms if t not in terms]
    trial: Fit = selection.problem.fit([*rest, *others], fit.noise, inexact=fit.inexact)
    return trial.loglik > fit.loglik - _DISTINCT
