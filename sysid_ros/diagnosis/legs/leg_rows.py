"""Rows of a robot on legs, free of the forces on its feet, as a problem of the search, with the columns of every candidate.

The six rows of the whole robot are judged, see :class:`.FeetAlong`. The legs' own rows hold while a foot is in the air only, and
so short a time tells next to nothing of a frequency.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sysid_ros.diagnosis.band import CUTOFF, Band
from sysid_ros.diagnosis.fit import Problem
from sysid_ros.diagnosis.legs.corrected import Corrected, bags_of, carried_on_legs, leg_model, places_of
from sysid_ros.diagnosis.legs.leg_mixing import mixing
from sysid_ros.diagnosis.legs.leg_noise import Gait, NoiseOfEach
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared, inexact_links
from sysid_ros.diagnosis.sets.set_prior import Places
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import Effect, Motion, Scope
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.leg_priors import standing_torque
from sysid_ros.identification.channel_checks import CheckedRecording
from sysid_ros.identification.rows import BagRows
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.repetition import step_period
from sysid_ros.signals.shown_gravity import ShownGravity
from sysid_ros.torque.torque_model import TorqueModel

_STAYS = 0.02
"""Part by which the distance of feet that stand changes at most, as they roll and yield: 8 mm of 0.4 m."""
_USUALLY = 0.95
"""Part of the time that feet stand which stand: one that is set anew once or twice keeps no beat."""


class LegLibrary(Library):
    """Candidates of a robot on legs on some recordings: slices of the columns of all that is free.

    Args:
        base: the robot. bags: rows of each stretch. model: whose columns they have. mixed: what the six rows of each recording
            are multiplied by, see :func:`.mixing`. shown: what the accelerometers show beside their motion.

    Attributes:
        prepared: the rows as a problem. gaits: of the recordings, by their names.
    """

    def __init__(
        self,
        base: FloatingBase,
        bags: Sequence[BagRows],
        model: TorqueModel,
        mixed: Mapping[str, FloatArray],
        shown: ShownGravity | None,
    ) -> None:
        robot = base.robot
        found = [Motion(robot, b.t - bags[0].t[0], b.q, b.v, b.a, b.tau) for b in bags]
        for motion, bag in zip(found, bags, strict=True):
            motion.recording = bag.name
        active = np.arange(robot.n) < FREE
        self.gaits = _gaits(base, bags)
        usable = [bag.moving for bag in bags]
        band = Band(
            found, active, min(CUTOFF, bags[0].cutoff_hz), usable, lambda x, rows: NoiseOfEach.of([(x, rows)], self.gaits),
            [mixed[bag.name] for bag in bags],
        )  # fmt: skip
        super().__init__(robot, band)
        self._base, self._bags, self._shown = base, bags, shown
        self._at = {
            (type(e), place): where for e, s in zip(model.free, model.slices, strict=True) for place, where in places_of(e, s)
        }
        self._columns = band.rows([b.Y for b in bags])
        for bag in bags:
            bag.Y.flags.writeable = False
        links = [(where, e.nominal) for e, where in zip(model.free, model.slices, strict=True) if e.replaces_links]
        rest = [b.y - sum((b.Y[:, :, where] @ theta for where, theta in links), 0.0) for b in bags]
        nominal = tuple(b.tau - x for b, x in zip(bags, rest, strict=True))
        problem = Problem(band, band.rows(rest), *self._nuisance(model))
        self.prepared = Prepared(tuple(found), nominal, band, problem, tuple(b.name for b in bags))

    def _nuisance(self, model: TorqueModel) -> tuple[FloatArray, FloatArray, NDArray[np.intp], FloatArray]:
        """What is never known exactly, as :class:`.Problem` has it: columns, size, what that follows, and links."""
        torque, columns, std = standing_torque(self._base.mass), [], []
        for effect, where in zip(model.free, model.slices, strict=True):
            size = effect.usual_on_legs(torque)
            if np.any(size):
                columns.append(self._columns[:, :, where])
                std.append(size + np.zeros(effect.p))
        links = inexact_links(self.robot, floats=True)
        heavy = [10 * j + k for _, j, _ in self._links() for k in range(10)]
        own = np.concatenate([self._columns[:, :, where] for _, _, where in self._links()], axis=2)
        considered = sum(x.shape[2] for x in columns)
        return (
            np.concatenate([*columns, own @ links.basis[heavy]], axis=2),
            np.concatenate([*std, links.std]),
            np.concatenate([np.zeros(considered, dtype=np.intp), links.scaled_by]),
            links.basis,
        )

    def _links(self) -> list[tuple[type[Effect], int, slice]]:
        return [(kind, place, where) for (kind, place), where in self._at.items() if kind.replaces_links and place is not None]

    def candidates(self) -> list[Term]:
        """Every form of every effect in every place."""
        out = []
        for kind, place in self._at:
            if kind.on_legs:
                joints = () if place is None else (place,)
                effect = kind.from_settings(self.robot, self._names(joints), self._settings(kind))
                if self._shown is not None:
                    effect.see_gravity(self._shown)
                out += [self._made(effect, joints, c.basis, c.form) for c in effect.candidates_on_legs()]
        return out

    def places(self) -> Places:
        """Where each effect can be, and in how many forms."""
        out: Places = {}
        for term in self.candidates():
            place = term.joints[0] if term.kind.scope is not Scope.ARM else None
            each = out.setdefault(term.kind, {})
            each[place] = each.get(place, 0) + 1
        return out

    def remake(self, term: Term, **changes: Any) -> Term:
        joints = term.joints if term.kind.scope is not Scope.ARM else ()
        return self._made(term.effect, joints, term.basis, term.form)

    def along(self, term: Term, theta: FloatArray, index: int) -> FloatArray:
        return np.asarray(self._bags[index].Y[:, :, self._where(term)] @ theta)

    def links_along(self, change: FloatArray, index: int) -> FloatArray:
        Y = self._bags[index].Y
        return np.asarray(sum((Y[:, :, where] @ change[10 * j : 10 * j + 10] for _, j, where in self._links()), 0.0))

    def _settings(self, kind: type[Effect]) -> dict[str, Any]:
        return kind.settings_on_legs(self._base.trunk, self._base.contact_frames)

    def _names(self, joints: Sequence[int]) -> list[str]:
        return [self.robot.joint_names[j] for j in joints]

    def _where(self, term: Term) -> slice:
        return self._at[term.kind, term.joints[0] if term.kind.scope is not Scope.ARM else None]

    def _made(self, effect: Effect, joints: tuple[int, ...], basis: FloatArray | None, form: str) -> Term:
        named = joints or tuple(range(FREE, self.robot.n))
        bare = Term(effect, named, None, self._columns[:, :, :0], basis, form, fixed=True)
        columns = self._columns[:, :, self._where(bare)]
        return replace(bare, columns=columns if basis is None else columns @ basis)


def _gaits(base: FloatingBase, bags: Sequence[BagRows]) -> dict[str, Gait]:
    """Of the recordings whose stretches these are. Feet that stand keep their distances, whatever the torques say."""
    out = {}
    for name in dict.fromkeys(bag.name for bag in bags):
        own = [bag for bag in bags if bag.name == name]
        apart = [_distances(base, bag.q) for bag in own]
        usual = np.median(np.concatenate(apart), axis=0)
        moved = np.concatenate(apart) / usual - 1.0
        stands = bool(np.all(np.quantile(np.abs(moved), _USUALLY, axis=0) < _STAYS))
        step = 0.0 if stands else step_period(apart, own[0].period)
        out[name] = Gait(step, sum(len(bag.t) * bag.period for bag in own))
    return out


def _distances(base: FloatingBase, q: FloatArray) -> FloatArray:
    """Of any two feet, shape (N, pairs) [m]."""
    feet = np.stack([base.contacts.origins(x)[0] for x in q])
    first, second = np.triu_indices(feet.shape[1], 1)
    return np.asarray(np.linalg.norm(feet[:, first] - feet[:, second], axis=2))


def leg_libraries(
    base: FloatingBase,
    recordings: tuple[Sequence[CheckedRecording], Sequence[CheckedRecording]],
    cutoff_hz: float,
    shown: ShownGravity | None,
    by: Corrected,
) -> tuple[LegLibrary, LegLibrary]:
    """The candidates on the recordings to fit, and on those to judge on.

    Raises:
        DataError: a recording is too short, or has no IMU.
    """
    usual = leg_model(base, shown)
    model = TorqueModel(base.robot, [*usual.free, *carried_on_legs(base)])
    bags = [bags_of(base, x, cutoff_hz, by, model) for x in recordings]
    mixed = mixing(base, usual, bags[0], bags[1])
    first, second = (LegLibrary(base, own, model, by_name, shown) for own, by_name in zip(bags, mixed, strict=True))
    return first, second
