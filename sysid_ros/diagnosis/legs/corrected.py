"""By what recordings of a robot on legs are corrected before they are rows: IMU, feet, gains and delays of the torques."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import numpy as np

from sysid_ros.diagnosis.fit import Fit
from sysid_ros.effects import EFFECTS, TRUNK_EFFECTS, Depends, Effect, Scope
from sysid_ros.exceptions import DataError
from sysid_ros.floating.feet_along import STANDS
from sysid_ros.floating.floating_base import FloatingBase
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


def carried_on_legs(base: FloatingBase) -> list[Effect]:
    """What a robot may carry, an effect each."""
    every = {**EFFECTS, **TRUNK_EFFECTS}.values()
    settings = base.trunk, base.contact_frames
    return [x.from_settings(base.robot, [], x.settings_on_legs(*settings)) for x in every if x.on_legs and x.carried]


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
        bags = bags_of(base, recordings, cutoff_hz, found, model, stands)
        if turn == 0 and (problem := check_weight(bags, prior.mean)):
            raise DataError(problem.text)
        found = Corrected.by(base, model, fit(bags, prior.mean, prior.std).theta)
    return found


def bags_of(
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


def places_of(effect: Effect, where: slice) -> list[tuple[int | None, slice]]:
    """Where the columns of an effect stand for each of its joints or links; for None, all of them, where it is the whole
    robot's."""
    if effect.scope is Scope.ARM:
        return [(None, where)]
    size = effect.p // len(effect.joints)
    return [(int(j), slice(where.start + k * size, where.start + (k + 1) * size)) for k, j in enumerate(effect.joints)]


def corrected_again(model: TorqueModel, by: Corrected, fit: Fit, torque: float) -> tuple[Corrected, bool]:
    """The same with the IMU, the feet, the gains and the delay that a fit has, and whether that moves any by more than is usual.

    The first correction has all free at once, and divides what looks alike, such as a bias and a tilt, between them. Counted as
    torques again, to first order, the parts that were corrected in vain would leave errors of the second, which look like links.

    Args:
        torque: what a joint of a leg holds while the robot stands [N m], by which the usual sizes are told.
    """
    theta, gain, delay, setup = np.zeros_like(by.theta), np.ones(model.robot.n), 0.0, TrunkSetup()
    for term in fit.terms:
        own = fit.theta_of(term)
        setup = setup + (term.effect.as_setup(term.theta_of_effect(own)) or TrunkSetup())
        if Depends.DRIVE not in term.effect.depends_on:
            continue
        for effect, where in zip(model.free, model.slices, strict=True):
            if type(effect) is term.kind:
                places = dict(places_of(effect, where))
                theta[places[term.joints[0] if term.kind.scope is not Scope.ARM else None]] = own
        gain, delay = gain * term.effect.as_gain(own), delay + term.effect.as_delay(own)
    new = replace(by, setup=setup, theta=theta, gain=np.maximum(gain[FREE:], 0.1), delay=delay)
    moved = np.any(np.abs(new.gain / by.gain - 1.0) > _MOVED_GAIN) or abs(delay - by.delay) > _MOVED_DELAY
    return new, bool(moved or _moves(model, by.setup, setup, torque))


def _moves(model: TorqueModel, old: TrunkSetup, new: TrunkSetup, torque: float) -> bool:
    """Whether two setups differ by more than what no robot is free of."""
    for effect in model.free:
        before, after = effect.of_setup(old), effect.of_setup(new)
        if before is not None and after is not None and np.any(np.abs(after - before) > effect.usual_on_legs(torque)):
            return True
    return False
