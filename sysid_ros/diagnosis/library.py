"""Library: every candidate effect as terms on the recordings at hand."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.term import Term, depends_on_torques, same_low_pass
from sysid_ros.effects import EFFECTS, Effect, LinkInertia, Motion, Scope
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_INSIDE = 1.0
"""A change that is looked for lies inside of a recording by so much [s]."""


class Library:
    """Terms of the effects, computed once for each setting of their knobs.

    Args:
        band: the frequency domain, with its motions.
        inside: a change lies inside of a recording by so much [s]; below 0 it may have been before it, or never.
        not_away: effects, with a joint each, of which no form is a candidate that takes measured torque away.

    Attributes:
        free: what effects of single joints have in the drive torque, shape (N, n) a motion; empty for none.
        apart: a gain of a joint's own torque is one of the rest alone. As long as sets of terms are compared, what rubs may leave
            one, and then its torque is nothing that has a gain; what stays has taken the gain into its own size.
    """

    def __init__(
        self, robot: RobotModel, band: Band, inside: float = _INSIDE, not_away: Collection[tuple[str, int]] = ()
    ) -> None:
        self.robot, self.band, self.inside, self._not_away = robot, band, inside, frozenset(not_away)
        self.free: tuple[FloatArray, ...] = ()
        self.apart = True
        self._curves: dict[tuple[str, str], FloatArray] = {}
        self._options: dict[tuple[str, int], list[Term]] = {}
        self._leans: list[FloatArray] = []
        self._leans_anew = False
        self._behind: Effect | None = None
        self._lost_links: FloatArray = np.zeros(0)

    def update(
        self,
        link_torque: Sequence[FloatArray],
        drive_torque: Sequence[FloatArray],
        free: Sequence[FloatArray] = (),
        held_torque: Sequence[FloatArray] | None = None,
        sensor_torque: Sequence[FloatArray] | None = None,
    ) -> None:
        """Take in what is now known of the torques on both sides of the gears; terms that depend on them are made anew.

        Args:
            free: part of the drive torque that is of effects of single joints, shape (N, n) a motion; empty for none.
            held_torque: the drive torque, and what was measured where a joint stands; None where that is not known.
            sensor_torque: what the sensor adds to the drive torque; None for nothing.
        """
        added = sensor_torque or [np.zeros_like(x) for x in drive_torque]
        self.free, known = tuple(free), zip(link_torque, drive_torque, held_torque or drive_torque, added, strict=True)
        self.band.motions = tuple(m.with_torques(*x) for m, x in zip(self.band.motions, known, strict=True))
        self._curves = {k: x for k, x in self._curves.items() if not depends_on_torques(EFFECTS[k[0]])}
        self._options = {k: x for k, x in self._options.items() if not depends_on_torques(EFFECTS[k[0]])}

    @property
    def motions(self) -> tuple[Motion, ...]:
        """The recordings."""
        return self.band.motions

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the recordings, of which each has one motion or several."""
        return tuple(dict.fromkeys(m.recording for m in self.motions))

    def times(self, recording: str = "") -> tuple[float, float]:
        """First and last time of a recording, of all without a name [s]."""
        motions = [m for m in self.motions if not recording or m.recording == recording] or self.motions
        return float(min(m.t[0] for m in motions)), float(max(m.t[-1] for m in motions))

    def _curves_of(self, effect: Effect) -> FloatArray:
        key = effect.id, repr(effect.settings)
        if key not in self._curves:
            self._curves[key] = self.band.curves(
                [self._published(effect, np.asarray(effect.curves_along(m)), 1) for m in self._seen_by(effect)]
            )
        return self._curves[key]

    def _seen_by(self, effect: Effect) -> Sequence[Motion]:
        """The recordings, with the drive torque that has a gain in what an effect says of it."""
        if not (effect.of_own_torque and self.apart and self.free):
            return self.motions
        each = zip(self.motions, self.free, strict=True)
        return [m.with_torques(m.link_torque, m.drive_torque - free) for m, free in each]

    def local(self, effect_id: str, joint: int, **settings: Any) -> Term:
        """A term that loads one joint."""
        columns = self._curves_of(self._make(effect_id, (), settings))[:, :, joint].T
        effect = self._make(effect_id, (joint,), settings)
        return self._of_joint(effect, joint, columns)

    def _of_joint(self, effect: Effect, joint: int, columns: FloatArray) -> Term:
        load, behind = effect.reference_torque(self.motions), self._behind_of(effect)
        return Term(effect, effect.concerned, joint, np.ascontiguousarray(columns), form=effect.form, load=load, behind=behind)

    def _alone(self, effect_id: str, joint: int, settings: dict[str, Any]) -> Term:
        """As :meth:`local`, for settings that no other joint is likely to have."""
        effect = self._make(effect_id, (joint,), settings)
        if not effect.alone or (effect.id, repr(effect.settings)) in self._curves:
            return self.local(effect_id, joint, **settings)
        return self._of_joint(effect, joint, self.column(effect_id, joint, settings))

    def column(self, effect_id: str, joint: int, settings: dict[str, Any]) -> FloatArray:
        """Columns of a term that loads one joint, shape (K, p), computed for that joint alone where nothing else is needed."""
        effect = self._make(effect_id, (joint,), settings)
        motions = self._seen_by(effect)
        seen, at = ([m.of_joint(joint) for m in motions], 0) if effect.alone else (motions, joint)
        each = [self._published(effect, np.asarray(effect.curves_along(m))[:, :, at], 1) for m in seen]
        return self.band.joint_curves(joint, each)

    def whole(
        self, effect_id: str, joints: Sequence[int] = (), basis: FloatArray | None = None, form: str = "", **settings: Any
    ) -> Term:
        """A term that loads several joints.

        Args:
            joints: that it is named with; empty for all. basis: combinations of the effect's columns, shape (effect.p, p).
        """
        effect = self._make(effect_id, joints, self._within(effect_id, settings))
        return self._term(effect, joints, self._rows(effect), basis, form)

    def _within(self, effect_id: str, settings: Mapping[str, Any]) -> dict[str, Any]:
        """Settings with an event inside of its recording: what changes before or after it has not changed."""
        instant = EFFECTS[effect_id].instant
        if not instant:
            return dict(settings)
        start, end = self.times(settings.get("recording", ""))
        return {**settings, instant: float(np.clip(settings[instant], start + self.inside, end - self.inside))}

    def _rows(self, effect: Effect) -> FloatArray:
        rows = self.band.rows([self._published(effect, effect.columns_along(m), 0) for m in self.motions])
        if not self._leans or not (links := _of_links(effect)).any():
            return rows
        return rows + self.leaning(links)

    def _term(self, effect: Effect, joints: Sequence[int], rows: FloatArray, basis: FloatArray | None, form: str) -> Term:
        columns = rows if basis is None else rows @ basis
        load = effect.reference_torque(self.motions) if joints else 0.0
        of = tuple(joints) or tuple(range(self.robot.n))
        return Term(effect, of, None, columns, basis, form, load, behind=self._behind_of(effect))

    def _make(self, effect_id: str, joints: Sequence[int], settings: dict[str, Any]) -> Effect:
        return EFFECTS[effect_id].from_settings(self.robot, [self.robot.joint_names[j] for j in joints], settings)

    def _behind_of(self, effect: Effect) -> Effect | None:
        """The low-pass that an effect's torque passes: not what makes efforts late itself, in its place."""
        return None if self._behind is None or effect.excludes(self._behind) else self._behind

    def _published(self, effect: Effect | None, values: FloatArray, axis: int) -> FloatArray:
        """Torques on the grid of a motion, along an axis, as they are published: behind the low-pass of the efforts."""
        behind = self._behind_of(effect) if effect else self._behind
        return behind.published(values, self.motions[0].period, axis) if behind else values

    def correction(self, terms: Sequence[Term], nominal: Sequence[FloatArray] = ()) -> FloatArray | None:
        """What terms change of the rows that were measured, shape (K, n); None for nothing.

        Behind a low-pass the columns are low-passed, and what that takes of the torque as it is known stands in the rows: the
        lag's own column has it all.

        Args:
            nominal: torque of the nominal model, shape (N, n) a motion, which is no column's.
        """
        if not any(t.effect.corrects for t in terms) and not self._behind:
            return None
        nothing = [np.zeros_like(m.tau) for m in self.motions]
        if self._behind:
            for out, motion, known in zip(nothing, self.motions, nominal, strict=True):
                beside = motion.drive_torque + motion.sensor_torque - known
                out += self._published(None, beside, 0) - beside
        for effect in (t.effect for t in terms if t.effect.corrects):
            for out, motion in zip(nothing, self.motions, strict=True):
                out += 0.0 if (more := effect.correction_along(motion)) is None else more
        return self.band.rows(nothing)

    def lean(self, terms: Sequence[Term], thetas: Sequence[FloatArray]) -> None:
        """Take in what terms with parameters of their columns make of the links, and of all columns: on a tilted base links have
        gravity from another side, behind a low-pass all torque is published late."""
        late = [(t, theta[0]) for t, theta in zip(terms, thetas, strict=True) if t.effect.low_passes and theta[0] > 0.0]
        self._stand_behind(*late[0] if late else (None, 0.0))
        before, self._leans = self._leans, []
        for term, theta in zip(terms, thetas, strict=True):
            each = [term.effect.links_along(m, term.theta_of_effect(theta)) for m in self.motions]
            if found := [x for x in each if x is not None]:
                before_it = self._leans or [np.zeros_like(x) for x in found]
                self._leans = [a + b for a, b in zip(before_it, found, strict=True)]
        self._leans_anew = bool(before or self._leans)

    def _stand_behind(self, term: Term | None, lag: float) -> None:
        """Take in the low-pass of the efforts; one that is nearly the one before is that."""
        new = None if term is None else self._make(term.id, (), {**term.effect.settings, "around": float(lag)})
        if not same_low_pass(self._behind, new):
            self._behind, self._lost_links, self._curves, self._options = new, np.zeros(0), {}, {}

    def follows(self, term: Term) -> bool:
        """True where the columns of a term depend on what was taken in last, of torques or of the links."""
        return (
            term.on_torques
            or term.behind is not self._behind_of(term.effect)
            or (self._leans_anew and bool(_of_links(term.effect).any()))
        )

    def newest(self, terms: Sequence[Term]) -> list[Term]:
        """Terms, of which those are made anew whose columns depend on what was taken in."""
        return [self.remake(t) if self.follows(t) else t for t in terms]

    @property
    def leans(self) -> bool:
        """Whether links have another torque because of terms that are there."""
        return bool(self._leans)

    def leaning(self, links: FloatArray) -> FloatArray:
        """Rows of the torque that changes of the links' inertials, shape (10 n,) or (10 n, l), have because of those terms."""
        return self.band.rows([self._published(None, x @ links, 0) for x in self._leans])

    def moved(self, links: FloatArray) -> FloatArray | None:
        """What columns of such changes, shape (10 n, l), have more because of those terms, shape (K, n, l); None for nothing."""
        if self._behind and not self._lost_links.size:
            own = [m.regressor @ links for m in self.motions]
            self._lost_links = self.band.rows([self._published(None, x, 0) - x for x in own])
        leaning = self.leaning(links) if self.leans else None
        return leaning if not self._behind else self._lost_links if leaning is None else self._lost_links + leaning

    def remake(self, term: Term, **changes: Any) -> Term:
        """The same term on the library's motions, with some settings changed."""
        settings = {**term.effect.settings, **changes}
        if term.row is not None:
            return self._alone(term.id, term.row, settings)
        joints = term.joints if len(term.joints) < self.robot.n else ()
        return self.whole(term.id, joints, term.basis, term.form, **settings)

    def along(self, term: Term, theta: FloatArray, index: int) -> FloatArray:
        """Torque of a term with parameters of its effect on the grid of one motion, shape (N, n) [N m]."""
        return term.effect.torque_along(self.motions[index], theta)

    def links_along(self, change: FloatArray, index: int) -> FloatArray:
        """Torque of a change of the links' inertials, shape (10 n,), on the grid of one motion, shape (N, n) [N m]."""
        return LinkInertia(self.robot).torque_along(self.motions[index], change)

    def lasts(self, term: Term) -> float:
        """Part of the time in which a term that loads one joint loads it."""
        loads = [np.any(term.effect.curves_along(m)[:, :, term.row] != 0.0, axis=0) for m in self._seen_by(term.effect)]
        return float(np.mean(np.concatenate(loads)))

    @property
    def of_joints(self) -> tuple[str, ...]:
        """Effects that load one joint at a time."""
        return tuple(e.id for e in EFFECTS.values() if e.scope is Scope.JOINT)

    def local_options(self, effect_id: str, joint: int) -> list[Term]:
        """One term for each form of an effect on a joint that a search starts from."""
        key = effect_id, joint
        if key not in self._options:
            candidates = EFFECTS[effect_id].candidates(self.motions, joint)
            terms = [self.local(effect_id, joint, **c.settings) for c in candidates]
            self._options[key] = [t for t in terms if not (t.effect.from_measured and key in self._not_away)]
        return self._options[key]

    def with_companion(self, term: Term, present: Sequence[Term]) -> list[Term]:
        """A term with the effect that comes with it on its joint, where that is not there yet."""
        other, joint = term.effect.companion, term.joints[0]
        if not other or any(t.kind is EFFECTS[other] and t.row == joint for t in present):
            return [term]
        return [term, self.local(other, joint)]

    def whole_options(self, which: Callable[[type[Effect]], bool] = lambda kind: True) -> list[Term]:
        """Terms that load several joints, in every form that a search starts from; deflections are searched apart."""
        terms = []
        for kind in EFFECTS.values():
            if kind.scope is Scope.JOINT or kind.deflection or not which(kind):
                continue
            for joint in range(self.robot.n) if kind.scope is Scope.LINK else (None,):
                joints, before, rows = () if joint is None else (joint,), None, None
                for c in kind.candidates(self.motions, joint):
                    if rows is None or c.settings != before:
                        effect, before = self._make(kind.id, joints, self._within(kind.id, c.settings)), c.settings
                        rows = self._rows(effect)
                    terms.append(self._term(effect, joints, rows, c.basis, c.form))
        return terms


def _of_links(effect: Effect) -> FloatArray:
    """What each parameter of an effect changes of the links' inertials all the time, shape (10 n, p)."""
    nothing = effect.as_links(np.zeros(effect.p))
    return np.stack([(effect.as_links(unit) - nothing).ravel() for unit in np.eye(effect.p)], axis=1)
