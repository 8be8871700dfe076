"""Term: one effect on one joint (or on the whole arm) with its columns, the unit that selection adds and removes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, combinations, product

import numpy as np
from numpy.typing import NDArray

from sysid_ros.effects import EFFECTS, Depends, Effect, Scope, forms_of
from sysid_ros.sample import FloatArray

_EXPECTED = 0.15
"""Share of all joints of real arms from which an effect is expected on every joint, large or small."""

_SAME = 0.02
"""Part of a lag by which it changes before columns are low-passed anew: one that is nearly as slow takes nearly as much."""


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
        load: the effect's reference torque on the recordings [N m].
        fixed: its knobs stay as they are.
        behind: the low-pass of the efforts that its columns have passed; None: there is none.
    """

    effect: Effect
    joints: tuple[int, ...]
    row: int | None
    columns: FloatArray
    basis: FloatArray | None = None
    form: str = ""
    load: float = 0.0
    fixed: bool = False
    behind: Effect | None = None

    @cached_property
    def id(self) -> str:
        """The effect's name."""
        return self.effect.id

    @cached_property
    def key(self) -> tuple[str, tuple[int, ...]]:
        """Name and joints; an event's recording is part of its name."""
        return f"{self.effect.id} {self.recording}".rstrip(), self.joints

    @cached_property
    def p(self) -> int:
        """Number of columns."""
        return int(self.columns.shape[-1])

    @cached_property
    def kind(self) -> type[Effect]:
        """Which effect it is."""
        return type(self.effect)

    @cached_property
    def expected(self) -> bool:
        """True for what every arm has on every joint, large or small."""
        return self.joint is not None and self.effect.usual > _EXPECTED

    @cached_property
    def joint(self) -> int | None:
        """The joint that it belongs to where it belongs to one, else None. On a robot on legs it loads the whole robot, too."""
        return self.joints[0] if self.row is None and self.kind.scope is Scope.JOINT else self.row

    @property
    def simplest(self) -> type[Effect] | None:
        """The simplest form of what this is a richer form of on its joint; None where it is none."""
        forms = forms_of(self.effect.family) if self.row is not None else ()
        return forms[0] if forms and forms[0] is not self.kind else None

    @cached_property
    def instant(self) -> float | None:
        """When it happens [s], None where it is there all the time."""
        return float(self.effect.settings[self.effect.instant]) if self.effect.instant else None

    @cached_property
    def recording(self) -> str:
        """The recording in which it happens, where there are several."""
        return str(self.effect.settings.get("recording", ""))

    @property
    def on_torques(self) -> bool:
        """True where its columns depend on torques, of which more becomes known."""
        return depends_on_torques(self.kind)

    @cached_property
    def prior(self) -> FloatArray:
        """Inverse variance of the columns' parameters before any data, shape (p,): for what a motion does not show of a body."""
        known = 1.0 / self.effect.prior_std(self.form)[: self.p] ** 2
        return np.concatenate([known, np.zeros(self.p - len(known))])

    @cached_property
    def usual_size(self) -> FloatArray:
        """How large the columns' parameters are where robots have it, shape (p,); infinite where that is not known."""
        known = self.effect.usual_size(self.form)[: self.p]
        return np.concatenate([known, np.full(self.p - len(known), np.inf)])

    def sizes_that_make(self, torque: float) -> FloatArray:
        """How large each of the parameters is, shape (p,), if its column alone makes such a torque (rms) [N m]."""
        return np.asarray(torque / np.sqrt(np.maximum(np.mean(self.columns.reshape(-1, self.p) ** 2, axis=0), 1e-300)))

    @cached_property
    def cost(self) -> int:
        """Number of parameters that data have to tell, with the nonlinear ones."""
        return self.effect.free_parameters(self.form, self.p) + (0 if self.fixed else len(self.effect.knobs))

    def rows(self, theta: FloatArray) -> FloatArray:
        """Rows of all joints that parameters of its columns make, shape (K, n)."""
        torque = self.columns @ theta
        if self.row is None:
            return np.asarray(torque)
        out = np.zeros((len(torque), self.effect.robot.n))
        out[:, self.row] = torque
        return out

    def std_alone(self, variance: FloatArray, active: NDArray[np.intp]) -> FloatArray:
        """Standard deviations that rows of this variance, shape (K, n), leave of its columns' parameters if there are no others,
        shape (p,). Args: active: joints that count."""
        on = active if self.row is None else [self.row]
        columns = self.columns[:, on] if self.row is None else self.columns[:, None]
        information = np.sum(columns**2 / variance[:, on, None], axis=(0, 1))
        return np.asarray(1.0 / np.sqrt(np.maximum(information, 1e-300)))

    @property
    def of_links(self) -> FloatArray:
        """Change of the inertials of all links by the parameters of a term of one, shape (10 n, p)."""
        out = np.zeros((10 * self.effect.robot.n, self.p))
        out[10 * self.joints[0] : 10 * self.joints[0] + 10] = np.eye(10)[:, : self.p] if self.basis is None else self.basis
        return out

    def theta_of_effect(self, theta: FloatArray) -> FloatArray:
        """Parameters of the effect, shape (effect.p,)."""
        return theta if self.basis is None else self.basis @ theta

    def possible(self, theta: FloatArray, std: FloatArray) -> bool:
        """True where physics allows parameters of its columns, shape (p,), within twice their standard deviation, with what the
        URDF has of them already."""
        own = theta if self.row is None or self.basis is not None else theta + self.effect.stated
        return self.effect.possible(own, std, self.form, self.load)

    @cached_property
    def exact_key(self) -> tuple[tuple[str, tuple[int, ...]], str]:
        """Name, joints, form and knobs."""
        return self.key, f"{self.form} {sorted(self.effect.settings.items())!r}"

    def same(self, other: Term) -> bool:
        """True for the same effect on the same joints, and of events the same one."""
        return self.key == other.key and (self.instant is None or self.excludes(other))

    def excludes(self, other: Term) -> bool:
        """True where the two can't stand side by side: forms of one thing on the same joint, or one event."""
        if self.joints != other.joints and not (self.row is not None and self.row == other.row):
            return False
        return self.effect.excludes(other.effect) or other.effect.excludes(self.effect)


def one_on_each(gains: Sequence[tuple[float, Term]]) -> list[tuple[float, list[Term]]]:
    """The best term of each joint together, with what they gain; none where they are all of one effect."""
    best: dict[int, tuple[float, Term]] = {}
    for gain, term in gains:
        if gain > best.get(term.joints[0], (0.0, term))[0]:
            best[term.joints[0]] = gain, term
    terms = [term for _, term in best.values()]
    return [(sum(gain for gain, _ in best.values()), terms)] if len({t.kind for t in terms}) > 1 else []


def depends_on_torques(kind: type[Effect]) -> bool:
    """True where an effect's columns depend on the torque of the links or of the drives."""
    return bool(kind.depends_on & {Depends.LOAD, Depends.DRIVE})


def replaces_any(term: Term, present: Sequence[Term]) -> bool:
    """True where a term can only stand in place of another one."""
    return any(term.excludes(other) for other in present)


def joined(terms: Sequence[Term]) -> Term:
    """One term with the columns of several, to score them at once."""
    first = terms[0]
    if len(terms) == 1:
        return first
    blocks = [first.columns]
    for term in terms[1:]:
        blocks.append(np.stack([term.rows(unit) for unit in np.eye(term.p)], axis=2))
    return replace(first, columns=np.concatenate(blocks, axis=2))


def best_of_each(groups: Sequence[tuple[float, list[Term]]]) -> list[tuple[float, list[Term]]]:
    """Groups with their gains, the largest first; of one deflection with several sizes only the best."""
    out: list[tuple[float, list[Term]]] = []
    seen: set[tuple[str, tuple[int, ...]]] = set()
    for gain, terms in sorted(groups, key=lambda g: -g[0]):
        key = terms[0].key
        if terms[0].effect.deflection and key in seen:
            continue
        seen.add(key)
        out.append((gain, terms))
    return out


def best_of_each_joint(pool: Sequence[Term], kind: type[Effect], members: Collection[int]) -> list[int]:
    """Of the terms of an effect on each joint the one that is in the set, else the last that was proposed."""
    out: dict[int, int] = {}
    for i, t in enumerate(pool):
        if t.kind is kind and t.joint is not None and (t.joint not in out or out[t.joint] not in members):
            out[t.joint] = i
    return list(out.values())


def overlap(term: Term, other: Term) -> bool:
    """True where two terms load the same joint."""
    return term.row is None or other.row is None or term.row == other.row


def conflicts(pool: Sequence[Term]) -> list[set[int]]:
    """Of each term those that can't stand beside it."""
    out: list[set[int]] = [set() for _ in pool]
    loads = {row: [i for i, t in enumerate(pool) if t.row == row] for row in {t.row for t in pool}}
    whole = loads.get(None, [])
    alone = [combinations(own, 2) for own in loads.values()]
    beside = [product(whole, own) for row, own in loads.items() if row is not None]
    for i, k in chain(*alone, *beside):
        if conflict(pool[i], pool[k]):
            out[i].add(k)
            out[k].add(i)
    return out


def conflict(term: Term, other: Term) -> bool:
    """True where two terms can't stand in one set."""
    if term.row is not None and other.row is not None and term.row != other.row:
        return False
    same = term.same(other)
    part = term.row is not None and term.row == other.row and (_includes(term, other) or _includes(other, term))
    return same or part or term.excludes(other) or other.excludes(term)


def _includes(term: Term, other: Term) -> bool:
    return any(EFFECTS[x] is other.kind for x in term.kind.includes)


def same_low_pass(one: Effect | None, other: Effect | None) -> bool:
    """Whether two low-passes are nearly the same."""
    if one is None or other is None:
        return one is other
    a, b = one.settings, other.settings
    near = abs(a["around"] - b["around"]) <= _SAME * b["around"]
    return near and all(a[name] == b[name] for name in a if name != "around")
