"""channels_on_legs: which channels of a robot on legs are not what they are named, by how likely that makes what it publishes.

Each hypothesis makes the torques of a few instants likely to some degree. The feet carry the robot by any torques whose forces
add up to its weight and its motion, so that six of the n values of an instant say something, ``A tau = b`` with the rows of
:class:`.FeetAlong`; and errors of torques are what makes them wrong::

    r = L^-1 (A tau - b) = L^-1 (C eta + B beta) + d,   L L' = A A',   eta, beta ~ N(0, I),   d ~ N(0, u^2 (s^2 I + kappa^2 D))

with what is never known exactly of links and sensors, and of drives, as columns C, a body that may be carried as B, and D the
discrepancy that any model leaves of the torques, alike for a while. How inexact links and drives are, and the sizes of noise and
discrepancy, are those that make it likeliest.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid_ros.diagnosis.channel_faults import FAULT, Fault
from sysid_ros.diagnosis.evidence import Evidence
from sysid_ros.diagnosis.legs.corrected import carried_on_legs, leg_model
from sysid_ros.diagnosis.legs.leg_hypotheses import Hypothesis, ImuFault, hypotheses
from sysid_ros.diagnosis.legs.leg_instants import Instants, middles
from sysid_ros.diagnosis.legs.leg_kinematics import feet_push, gravity_likelihood, gyro_likelihood, pairs_that_stand
from sysid_ros.diagnosis.legs.leg_sizes import Sizes
from sysid_ros.diagnosis.prepare import inexact_links
from sysid_ros.diagnosis.whose.robot_likelihood import probabilities
from sysid_ros.effects import Depends, Effect, Motion
from sysid_ros.effects.wording import of_joints
from sysid_ros.estimators.one_thread import on_one_thread
from sysid_ros.floating.feet_along import FeetAlong, balanced
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.leg_priors import DRY, standing_torque
from sysid_ros.identification.channel_checks import CheckedRecording
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.torque.torque_model import TorqueModel

_ROUGH, _FINE = 20, 80
"""Instants on which all hypotheses are compared, and those on which the likeliest are; exact likelihoods cost their cube."""
_BEST = 4
"""Hypotheses of the first comparison that come to the second, beside that nothing is wrong."""
_MOST = 6
"""Most faults that are undone, one on another."""
_LINKS, _DRIVES, _GAIN, _DELAY = 5.0, 3.0, 0.1, 0.01
"""How many times further than those of a usual robot links and drives are off where their size is 1; parts by which gains are off
there, and delays [s]."""
_NOISE, _DISCREPANCY, _OFF, _OFF_DRIVES = (
    np.log([low, high]) for low, high in ((0.05, 2.0), (1e-3, 2.0), (0.01, 3.0), (0.01, 30.0))
)
"""Where noise, discrepancy, how inexact links and sensors and how inexact drives are is searched. Faults of channels are gross:
that a hypothesis makes less of the noise of an IMU on a robot that stands says nothing. No link has a negative mass."""
_CARRIED = 0.3
"""Part of a robot's mass that it may carry."""
_DELAYS = [
    (0.0, 0.0),
    *((sign * d, 0.0) for d in (0.015, 0.03) for sign in (1.0, -1.0)),
    (0.015, 0.015),
    (0.03, 0.03),
    (0.0, 0.03),
]
"""Delays of IMU and torques [s], in which signals are no others than they are said to be."""
_STAND = 0.2
"""Part of the weight from which on a foot stands, whatever its leg's friction."""
_PULLS = np.log(0.003)
"""Logarithm of the probability that a robot hangs on its feet."""
_SURE = 0.95
"""Probability from which a fault is undone: one that is none makes all else wrong."""
_MEMORY = 1.0
"""Time for which what any model leaves stays alike [s]."""
_SMALL = 1e-6
"""Part of their mean by which rows are kept from being none: where a leg is stretched."""


class LegChannels:
    """How likely hypotheses about the channels make the torques of some instants.

    Args:
        base: the robot.
    """

    def __init__(self, base: FloatingBase) -> None:
        self.base = base
        self._torque = standing_torque(base.mass)
        self._model = TorqueModel(base.robot, [*leg_model(base, None).free, *carried_on_legs(base)])
        prior, links = Prior.of(self._model, base), inexact_links(base.robot, floats=True)
        self._std = np.where(prior.is_link, 0.0, _DRIVES * prior.std)
        self._links, self._carried = np.zeros((self._model.p, links.basis.shape[1])), np.zeros(self._model.p, dtype=bool)
        self._each, self._ranges = list[tuple[Effect, slice]](), [_NOISE, _DISCREPANCY, _OFF]
        for effect, where in zip(self._model.free, self._model.slices, strict=True):
            follows_torque = Depends.DRIVE in effect.depends_on
            if effect.replaces_links:
                own = np.concatenate([np.arange(10 * j, 10 * j + 10) for j in effect.joints])
                self._links[where] = _LINKS * links.basis[own] * links.std
                continue
            if effect.carried:
                self._std[where] = effect.prior_std() * _CARRIED * base.mass / effect.prior_std()[0]
                self._carried[where] = True
                continue
            if follows_torque:
                self._std[where] = _GAIN if effect.of_own_torque else _DELAY
            of_sensor = effect.of_setup(TrunkSetup()) is not None
            self._each.append((effect, where))
            self._ranges.append(_OFF if follows_torque or of_sensor else _OFF_DRIVES)

    def densities(self, instants: Instants, few: bool = False) -> FloatArray:
        """Log-density of each published row given those before it, shape (6 N,), with the likeliest sizes of noise, discrepancy
        and all that is inexact; ``few``: after a few steps of their search."""
        return self._sizes(instants).likeliest(few)

    def _sizes(self, instants: Instants) -> Sizes:
        """What a hypothesis leaves of its instants, and what may be there."""
        three, robot = instants.at_trunk, self.base.robot
        motion, n = middles(three), robot.n
        feet = FeetAlong.of(self.base, motion, 0.0)
        count, A = len(motion.t), feet.matrix
        rigid = robot.rnea_along(three.q, three.v, three.a)
        drive = balanced(np.repeat(A, 3, axis=0), three.tau, rigid)
        along = Motion(robot, three.t - three.t[0], three.q, three.v, three.a, three.tau, drive_torque=drive)
        along.by_radius = np.repeat(feet.by_radius, 3, axis=0)
        columns = np.concatenate([e.columns_along(along)[1::3] for e in self._model.free], axis=2)
        rest = motion.tau - rigid[1::3]
        rows = np.concatenate([rest[:, :, None], columns], axis=2)
        rows = rows[:, :FREE] + A @ rows[:, FREE:]
        square = A @ np.swapaxes(A, 1, 2)
        square += _SMALL * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(FREE)
        root = np.linalg.cholesky(square)
        white, levers = np.linalg.solve(root, rows), np.linalg.solve(root, A).reshape(FREE * count, n - FREE)
        white = white.reshape(FREE * count, -1)
        columns = white[:, 1:] * self._std
        apart = np.abs(motion.t[:, None] - motion.t) + np.where(instants.run[:, None] == instants.run, 0.0, np.inf)
        alike = np.repeat(np.repeat(np.exp(-apart / _MEMORY), FREE, axis=0), FREE, axis=1)
        u, body, links = instants.scale * self._torque, columns[:, self._carried], white[:, 1:] @ self._links
        # dry friction that holds a joint which stands is anything below its level
        stands = np.maximum(1.0 - np.abs(motion.v[:, FREE:]) / TOL.slow, 0.0)
        stuck = levers * np.repeat(_DRIVES * DRY * self._torque * stands, FREE, axis=0)
        parts = [u**2 * np.eye(len(white)), u**2 * (levers @ levers.T) * alike, links @ links.T]
        for effect, where in self._each:
            own = columns[:, where] @ columns[:, where].T
            if effect.jumps:
                rubs = columns[:, where], len(parts)
                own += (stuck @ stuck.T) * alike
            parts.append(own)
        also = gyro_likelihood(self.base, motion, instants.pairs, instants.gain)
        also += gravity_likelihood(instants.motion.a[1::3, :3], instants.force)
        also += 0.0 if feet_push(self.base, motion, feet.forces) else _PULLS
        scale = float(np.log(instants.scale)) + also / len(white)
        return Sizes(white[:, 0], np.asarray(body @ body.T), parts, self._ranges, scale, rubs)

    def standing(self, instants: Instants) -> Instants:
        """With which feet stand in each moment: by the legs alone, since the gyro may show anything."""
        motion = middles(instants.motion)
        v, a = motion.v.copy(), motion.a.copy()
        v[:, 3:FREE] = a[:, 3:FREE] = 0.0
        feet = FeetAlong.of(self.base, replace(motion, v=v, a=a), 0.0)
        return replace(instants, pairs=tuple(pairs_that_stand(feet.forces, _STAND * self.base.mass * 9.81)))


@dataclass(frozen=True, eq=False)
class Channelled:
    """What channels are found to be.

    Attributes:
        faults: of the joints, in the order in which they are undone, each with its probability. evidence: of each.
        refusal: why nothing can be told; empty where something can.
    """

    faults: tuple[Fault, ...] = ()
    evidence: tuple[Evidence, ...] = ()
    refusal: str = ""


@on_one_thread
def channels_on_legs(base: FloatingBase, recordings: Sequence[CheckedRecording], cutoff_hz: float, max_gap: float) -> Channelled:
    """The likeliest faults of channels that are surely there, one on another."""
    timed, found = Instants.of(recordings, cutoff_hz, max_gap, _FINE, _DELAYS), Channelled()
    if not timed:
        return found
    likelihoods, asked = LegChannels(base), list(hypotheses(base))
    of_kind = Counter(kind for kind, _ in asked)
    prior = [float(np.log(FAULT / of_kind[kind])) for kind, _ in asked]
    none = float(np.log1p(-FAULT * len(of_kind)))
    for _ in range(_MOST):
        instants = likelihoods.standing(max(timed, key=lambda x: float(np.sum(likelihoods.densities(x, few=True)))))
        few = instants.every(_FINE // _ROUGH)
        score = [
            w + float(np.sum(likelihoods.densities(few.undone(h), few=True))) for (_, h), w in zip(asked, prior, strict=True)
        ]
        best = [int(k) for k in np.argsort(score)[: -_BEST - 1 : -1]]
        rows = [likelihoods.densities(instants), *(likelihoods.densities(instants.undone(asked[k][1])) for k in best)]
        weights = [none, *(prior[k] for k in best)]
        shares = probabilities([x + w / len(x) for x, w in zip(rows, weights, strict=True)])
        first = int(np.argmax(shares[1:]))
        hypothesis, likely = asked[best[first]][1], float(shares[1 + first])
        if shares[0] > 1.0 - _SURE:
            break  # perhaps nothing
        if likely < _SURE or isinstance(hypothesis, ImuFault):
            named = [(asked[k][1], float(p)) for k, p in zip(best, shares[1:], strict=True) if p > 1.0 - _SURE]
            return replace(found, refusal=_in_words(base, sorted(named, key=lambda x: -x[1])))
        rise = 2.0 * float(np.sum(rows[1 + first]) - np.sum(rows[0]))
        evidence = Evidence(rise, hypothesis.parameters, float(len(rows[0])), len(asked))
        fault = replace(hypothesis, probability=likely)
        found = replace(found, faults=(*found.faults, fault), evidence=(*found.evidence, evidence))
        timed = [x.undone(hypothesis) for x in timed]
    return found


def _in_words(base: FloatingBase, named: Sequence[tuple[Hypothesis, float]]) -> str:
    """That channels are not what they are named, by what may be wrong in place, each with its probability."""
    parts, cures = [], list[str]()
    for hypothesis, likely in named:
        if isinstance(hypothesis, ImuFault):
            words, cure = hypothesis.words, hypothesis.cure
        else:
            joints = tuple(base.legs.joint_names[j] for j in hypothesis.joints)
            words = f"{hypothesis.effect.label} ({of_joints(joints, base.legs.n)})"
            cure = f"correct {hypothesis.effect.label} in the driver, or in --config"
        parts.append(f"{words} (probability {likely:.2g})")
        cures.append(cure)
    return (
        f"By the torques of the legs, their joints and the IMU the channels are not what they are named: {'; or '.join(parts)}. "
        f"Nothing else can be told beside it. Cure: {'; or '.join(dict.fromkeys(cures))}."
    )
