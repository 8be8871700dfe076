"""Rows of a robot on legs, free of the forces on its feet, as a problem of the search, with the columns of every candidate.

The six rows of the whole robot are judged, see :class:`.FeetAlong`. The legs' own rows hold while a foot is in the air only, and
so short a time tells next to nothing of a frequency.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from sysid_ros.diagnosis.band import CUTOFF, Band
from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library, Places
from sysid_ros.diagnosis.prepare import INEXACT, Prepared, inexact_links
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS, TRUNK_EFFECTS, Depends, Effect, Motion, Scope
from sysid_ros.exceptions import DataError
from sysid_ros.floating.feet_along import STANDS
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.leg_priors import standing_torque
from sysid_ros.identification.channel_checks import CheckedRecording
from sysid_ros.identification.free_effects import free_model_on_legs
from sysid_ros.identification.from_legs import check_weight, learned, rows_on_legs
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import fit
from sysid_ros.identification.rows import BagRows
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.shown_gravity import ShownGravity
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.torque.torque_model import TorqueModel

_NO_GAIN, _DELAY = 1e-6, 0.01
"""Usual sizes of wrong gains, of which none is believed yet, and of a delay [s], where the rows are made."""
_MOVED_GAIN, _MOVED_DELAY = 0.02, 1e-3
"""Changes of a gain and of a delay [s] for which rows are made again."""

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Corrected:
    """By what recordings are corrected, exactly, before they are rows, in which the same counts as torques again.

    Attributes:
        setup: of IMU and feet. known: the torques by which feet in the air are told from feet that stand; None: of the URDF's
            links. theta: of the effects that follow the measured torque, 0 of others, shape (p,). gain, delay: what these say of
            the torques of the legs, shape (n - 6,) and [s].
    """

    setup: TrunkSetup
    known: TorqueModel | None
    theta: FloatArray
    gain: FloatArray
    delay: float = 0.0

    @classmethod
    def nothing(cls, model: TorqueModel) -> Corrected:
        """Of what is said of the robot."""
        return cls(TrunkSetup(), None, np.zeros(model.p), np.ones(model.robot.n - FREE))

    @classmethod
    def by(cls, base: FloatingBase, model: TorqueModel, theta: FloatArray) -> Corrected:
        """By the parameters of a model, shape (p,)."""
        own, gain, delay, rest, rest_theta = np.zeros(model.p), np.ones(base.robot.n), 0.0, [], []
        for effect, where in zip(model.free, model.slices, strict=True):
            if Depends.DRIVE not in effect.depends_on:
                rest.append(effect)
                rest_theta.append(theta[where])
                continue
            own[where] = theta[where]
            gain, delay = gain * effect.as_gain(theta[where]), delay + effect.as_delay(theta[where])
        setup, known = learned(TorqueModel(base.robot, rest), np.concatenate(rest_theta))
        return cls(setup, known, own, np.maximum(gain[FREE:], 0.1), delay)

    def of(self, recording: Recording) -> Recording:
        """A recording with the torques that acted."""
        t = recording.t
        moved = np.stack([np.interp(t + self.delay, t, x) for x in recording.tau.T], axis=1)
        return replace(recording, tau=moved / self.gain)


def leg_model(base: FloatingBase, shown: ShownGravity | None) -> TorqueModel:
    """What is free while the rows are made: all that :func:`.free_model_on_legs` has, and what follows the measured torque."""
    usual = free_model_on_legs(base, shown).free
    kinds = {type(effect) for effect in usual}
    legs = base.legs.joint_names
    more = [x(base.robot, legs) for x in EFFECTS.values() if x.on_legs and x not in kinds and not x.carried]
    return TorqueModel(base.robot, [*usual, *more])


def corrections(
    base: FloatingBase,
    recordings: Sequence[CheckedRecording],
    cutoff_hz: float,
    shown: ShownGravity | None,
    progress: Progress = lambda sentence: None,
) -> Corrected:
    """What recordings are to be corrected by: all that is free is fitted to them in turns.

    Raises:
        DataError: a recording is too short, has no IMU, or its torques do not carry the robot.
    """
    model = leg_model(base, shown)
    prior = Prior.of(model, base)
    for effect, where in zip(model.free, model.slices, strict=True):
        if Depends.DRIVE in effect.depends_on:
            # with gains of all joints the measured torques would explain themselves
            prior.std[where] = _NO_GAIN if effect.of_own_torque else _DELAY
    found = Corrected.nothing(model)
    for turn, stands in enumerate(STANDS[:-1]):
        progress(f"filtering, round {turn + 1} of {len(STANDS)}")
        bags = _bags(base, recordings, cutoff_hz, found, model, stands)
        if turn == 0 and (problem := check_weight(bags, prior.mean)):
            raise DataError(problem.text)
        found = Corrected.by(base, model, fit(bags, prior.mean, prior.std).theta)
    return found


def _bags(
    base: FloatingBase,
    recordings: Sequence[CheckedRecording],
    cutoff_hz: float,
    by: Corrected,
    model: TorqueModel,
    stands: float = STANDS[-1],
) -> list[BagRows]:
    """Rows of each stretch of recordings."""
    corrected = [replace(c, recording=by.of(c.recording)) for c in recordings]
    out = []
    for smooth in rows_on_legs(base, corrected, cutoff_hz, setup=by.setup, known=by.known, stands=stands).smooth:
        bag = smooth.rows(model)
        bag.y[:] += bag.Y[:, :, : len(by.theta)] @ by.theta
        ends = list(accumulate((len(m) for m in smooth.middles), initial=0))
        out += [bag.part(slice(a, b), smooth.name) for a, b in pairwise(ends) if b - a > 2]
    return out


class LegLibrary(Library):
    """Candidates of a robot on legs on some recordings: slices of the columns of all that is free.

    Args:
        base: the robot. bags: rows of each stretch. model: whose columns they have.

    Attributes:
        prepared: the rows as a problem.
    """

    def __init__(self, base: FloatingBase, bags: Sequence[BagRows], model: TorqueModel) -> None:
        robot = base.robot
        found = [Motion(robot, b.t - bags[0].t[0], b.q, b.v, b.a, b.tau) for b in bags]
        for motion, bag in zip(found, bags, strict=True):
            motion.recording = bag.name
        active = np.arange(robot.n) < FREE
        band = Band(found, active, min(CUTOFF, bags[0].cutoff_hz))
        super().__init__(robot, band)
        self._base, self._bags = base, bags
        self._at = {
            (type(e), place): where for e, s in zip(model.free, model.slices, strict=True) for place, where in _each(e, s)
        }
        self._columns = band.rows([b.Y for b in bags])
        for bag in bags:
            bag.Y.flags.writeable = False
        links = [(where, e.nominal) for e, where in zip(model.free, model.slices, strict=True) if e.replaces_links]
        rest = [b.y - sum((b.Y[:, :, where] @ theta for where, theta in links), 0.0) for b in bags]
        nominal = tuple(b.tau - x for b, x in zip(bags, rest, strict=True))
        nuisance, std, considered = self._nuisance(model)
        problem = Problem(band, band.rows(rest), nuisance, std, considered)
        self.prepared = Prepared(tuple(found), nominal, band, problem, tuple(b.name for b in bags))

    def _nuisance(self, model: TorqueModel) -> tuple[FloatArray, FloatArray, int]:
        """Columns of what is never known exactly, shape (K, n, c), its size (c,), and how many of them are no links'."""
        torque, columns, std = standing_torque(self._base.mass), [], []
        for effect, where in zip(model.free, model.slices, strict=True):
            size = effect.usual_on_legs(torque)
            if np.any(size):
                columns.append(self._columns[:, :, where])
                std.append(size + np.zeros(effect.p))
        basis = inexact_links(self.robot)
        heavy = [10 * j + k for _, j, _ in self._links() for k in range(10)]
        own = np.concatenate([self._columns[:, :, where] for _, _, where in self._links()], axis=2)
        considered = sum(x.shape[2] for x in columns)
        return (
            np.concatenate([*columns, own @ basis[heavy]], axis=2),
            np.concatenate([*std, np.full(basis.shape[1], INEXACT)]),
            considered,
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


def _each(effect: Effect, where: slice) -> list[tuple[int | None, slice]]:
    """Where the columns of an effect stand for each of its joints or links; for None, all of them, where it is the whole
    robot's."""
    if effect.scope is Scope.ARM:
        return [(None, where)]
    size = effect.p // len(effect.joints)
    return [(int(j), slice(where.start + k * size, where.start + (k + 1) * size)) for k, j in enumerate(effect.joints)]


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
    carried = [
        kind.from_settings(base.robot, [], kind.settings_on_legs(base.trunk, base.contact_frames))
        for kind in {**EFFECTS, **TRUNK_EFFECTS}.values()
        if kind.on_legs and kind.carried
    ]
    model = TorqueModel(base.robot, [*leg_model(base, shown).free, *carried])
    first, second = (LegLibrary(base, _bags(base, x, cutoff_hz, by, model), model) for x in recordings)
    return first, second


def corrected_again(model: TorqueModel, by: Corrected, fit: Fit) -> tuple[Corrected, bool]:
    """The same with the gains and the delay that a fit has, and whether that moves the torques by more than is usual."""
    theta, gain, delay = np.zeros_like(by.theta), np.ones(model.robot.n), 0.0
    for term in fit.terms:
        if Depends.DRIVE not in term.effect.depends_on:
            continue
        own = fit.theta_of(term)
        for effect, where in zip(model.free, model.slices, strict=True):
            if type(effect) is term.kind:
                places = dict(_each(effect, where))
                theta[places[term.joints[0] if term.kind.scope is not Scope.ARM else None]] = own
        gain, delay = gain * term.effect.as_gain(own), delay + term.effect.as_delay(own)
    new = replace(by, theta=theta, gain=np.maximum(gain[FREE:], 0.1), delay=delay)
    moved = np.any(np.abs(new.gain / by.gain - 1.0) > _MOVED_GAIN) or abs(delay - by.delay) > _MOVED_DELAY
    return new, bool(moved)
