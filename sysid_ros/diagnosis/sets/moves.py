"""Moves from one set of terms to others that no single term more or less leads to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, product

from sysid_ros.diagnosis.term import Term, best_of_each_joint, overlap
from sysid_ros.effects import forms_of

_USUAL = 3
"""Most usual terms that come at once in place of an unusual one."""
Moves = dict[frozenset[int], list[list[int]]]
"""What leaves a set, and each of the groups of terms that may come in its place; terms are indices of a pool."""


def several(pool: Sequence[Term], against: Sequence[set[int]], before: Sequence[int], most_pairs: int) -> Moves:
    """An effect on all joints or on none, one term in place of another or of two, two in place of one, less two, and what every
    joint has in place of an unusual term with one beside it.

    Args:
        against: of each term of the pool those that can't stand beside it. before: members of the set.
        most_pairs: unusual terms up to which two of them may leave at once.
    """
    out: Moves = {}
    members = set(before)

    def moved(gone: set[int], new: set[int]) -> None:
        out.setdefault(frozenset(gone), []).append(sorted(new))

    for kind in dict.fromkeys(t.kind for t in pool if t.joint is not None):
        own = {i for i in best_of_each_joint(pool, kind, members) if not against[i] & members}
        if len(own - members) > 1:
            moved(set(), own - members)
        present = {i for i in members if pool[i].kind is kind and pool[i].joint is not None}
        if len(present) > 1:
            moved(present, set())
        for other in forms_of(kind.family):
            rows = {pool[i].joint for i in present}
            others = {i for i in best_of_each_joint(pool, other, members) if pool[i].joint in rows}
            if other is not kind and len(others) > 1:
                replaced = {i for i in present if pool[i].joint in {pool[k].joint for k in others}}
                moved(replaced, {i for i in others if not against[i] & (members - replaced)})
    few = [k for k in before if not pool[k].expected]
    for k in few:
        for i in instead_of(pool, against, before, k):
            moved({k}, {i})
        beside = [m for m in before if m != k and pool[m].row == pool[k].row is not None]
        forms = [i for i, t in enumerate(pool) if i != k and t.key == pool[k].key]
        for i, m in product(forms, beside):
            moved({k, m}, {i})
        for gone, new in _usual_instead(pool, against, members, k, beside):
            moved(gone, new)
    for k in members:
        apart = [i for i in against[k] if pool[i].row == pool[k].row is not None]
        alone = [i for i in apart if not against[i] & (members - {k})]
        for a, b in combinations(alone, 2):
            if pool[a].kind is not pool[b].kind and b not in against[a]:
                moved({k}, {a, b})
    for a, b in combinations(few, 2):
        if len(few) <= most_pairs and overlap(pool[a], pool[b]):
            moved({a, b}, set())
    return out


def _usual_instead(
    pool: Sequence[Term], against: Sequence[set[int]], members: set[int], k: int, beside: Sequence[int]
) -> Iterator[tuple[set[int], set[int]]]:
    """What leaves and what comes where usual terms of a joint are in place of an unusual one and of none or one beside it: it may
    stand for what another form of these would show."""
    usual = [i for i, t in enumerate(pool) if t.expected and t.row == pool[k].row is not None and i not in members]
    for gone in [{k}, *({k, m} for m in beside)]:
        free = [i for i in usual if not against[i] & (members - gone)]
        for n in range(2, _USUAL + 1):
            for new in combinations(free, n):
                if not any(b in against[a] for a, b in combinations(new, 2)):
                    yield gone, set(new)


def instead_of(pool: Sequence[Term], against: Sequence[set[int]], before: Sequence[int], k: int) -> list[int]:
    """Terms that may stand in place of one of a set and load the same joints; arguments as :func:`several` has them."""
    rest = set(before) - {k}
    free = [i for i in range(len(pool)) if i not in rest | {k} and not against[i] & rest]
    return [i for i in free if overlap(pool[i], pool[k])]
