"""Effects that are asked for become free where they predict what was not fitted better than the model does without them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid_ros.effects import Effect
from sysid_ros.identification.bag_sums import BagSums
from sysid_ros.identification.free_effects import add_effects, free_model, own_knobs, places, wishes
from sysid_ros.identification.held_out import Folds, Prior, Solvers
from sysid_ros.identification.knob_search import KnobSearch
from sysid_ros.identification.least_squares import Fit, fit
from sysid_ros.identification.result import Knob as FoundKnob
from sysid_ros.identification.rows import BagRows, SmoothRecording
from sysid_ros.identification.tolerances import TOL
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel

_WEIGHTS = (1.0, 10.0, 100.0, 1e3, 1e4, math.inf)
"""Weights of the prior of the links, all alike, that the joints are judged with: the best of them."""

_NONE = 1e-9
"""Part of its prior standard deviation to which a parameter is held that does not take part: zero, to rounding."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """A candidate in a model that holds it beside what it would replace.

    Attributes:
        added, replaced: indices of parameters. nonnegative: what must not be below zero, rows times the added ones.
    """

    added: tuple[int, ...]
    replaced: tuple[int, ...]
    nonnegative: FloatArray


def alternatives(model: TorqueModel, candidates: Sequence[Effect]) -> list[Alternative]:
    """Each candidate with the parameters of its family that its joints have without it."""
    blocks = list(zip(model.free, model.slices, strict=True))
    out = []
    for candidate in candidates:
        added = next(range(s.start, s.stop) for e, s in blocks if e is candidate)
        replaced = []
        for effect, where in blocks:
            if effect not in candidates and effect.family and effect.family == candidate.family:
                each = effect.p // len(effect.joints)
                replaced += [
                    where.start + each * k + i for k, j in enumerate(effect.joints) if j in candidate.joints for i in range(each)
                ]
        out.append(Alternative(tuple(added), tuple(replaced), candidate.nonnegative_rows))
    return out


def those_that_gain(
    model: TorqueModel, bags: Sequence[BagRows], asked: Sequence[Alternative], tried: int, method: str = "irls"
) -> list[int]:
    """The alternatives that differ from what they replace for certain, and improve the torque where it was not fitted.

    An alternative is judged on all joints that it loads at once, by the product of the parts of their errors that it leaves: the
    likelihood of the torque that was held out.

    Args:
        model: with all alternatives among its free effects. bags: its rows. asked: the alternatives, each judged by itself.
        tried: settings of the knobs that were searched for each. method: of the least squares.

    Returns:
        Indices of ``asked``, ascending.
    """
    added = [i for a in asked for i in a.added]
    prior = _without(Prior.of(model), added)
    plain = fit(bags, prior.mean, prior.std, method)
    folds = Folds.of(bags, replace(plain, sums=BagSums.of(bags, plain.rows)))
    solvers = Solvers.of(model, prior, plain, physical=False)
    parts = [folds.without(part) for part in range(len(folds.fitted))]

    def errors(solvers: Solvers, weight: float) -> FloatArray:
        return np.maximum(folds.errors([solvers.approximate(*data, weight) for data in parts]), 1e-300)

    by_weight = [errors(solvers, weight) for weight in _WEIGHTS]
    best = int(np.argmin([np.mean(np.log(e.mean(axis=0))) for e in by_weight]))
    before, found = by_weight[best], []
    for k, one in enumerate(asked):
        freed = _without(Prior.of(model), [*(i for i in added if i not in one.added), *one.replaced])
        after = errors(replace(solvers, prior=freed), _WEIGHTS[best])
        loaded = np.any([plain.sums.normal[:, :, i, i].sum(axis=0) > 0.0 for i in one.added], axis=0)
        ratio = np.sqrt(np.prod((after / before)[:, loaded], axis=1))
        pooled = math.sqrt(float(np.prod((after.mean(axis=0) / before.mean(axis=0))[loaded])))
        if pooled <= TOL.better and ratio.max() <= TOL.not_worse and _is_sure(plain, prior, freed, one, tried):
            found.append(k)
    return found


def _is_sure(plain: Fit, before: Prior, after: Prior, one: Alternative, tried: int) -> bool:
    """Whether the likelihood ratio of the fit is beyond chance, and nothing below zero for certain that can't be.

    A gain that is the best of many settings is that much likelier by chance (Bonferroni).
    """
    from scipy.stats import chi2, norm  # takes longer to load than the rest of the package

    gain = _explained(plain, after) - _explained(plain, before)
    chance = 2.0 * float(norm.sf(TOL.sure))
    if gain <= chi2.isf(chance / tried, max(len(one.added) - len(one.replaced), 1)):
        return False
    A = plain.information + np.diag(after.precision())
    theta, inverse = np.linalg.solve(A, plain.score + after.precision() * after.mean), np.linalg.inv(A)
    where = list(one.added)
    values, covariance = one.nonnegative @ theta[where], one.nonnegative @ inverse[np.ix_(where, where)] @ one.nonnegative.T
    return bool(np.all(values >= -TOL.sure * np.sqrt(np.diag(covariance))))


def _explained(found: Fit, prior: Prior) -> float:
    """Weighted sum of squares that the parameters explain, the prior's cost counted."""
    side = found.score + prior.precision() * prior.mean
    explained = side @ np.linalg.solve(found.information + np.diag(prior.precision()), side)
    return float(explained)


def _without(prior: Prior, parameters: Sequence[int]) -> Prior:
    """The prior that holds some parameters to their mean."""
    std = prior.std.copy()
    std[list(parameters)] *= _NONE
    return replace(prior, std=std)


_SEARCHED = 6000
"""Rows from twice of which on knobs are searched for on each second or later one: those of two minutes at 10 Hz tell them."""
_ROUNDS = 3
"""Times that effects are asked for beside each other at most."""


def choose_effects(
    robot: RobotModel,
    friction: str,
    effects: Sequence[str],
    method: str,
    recordings: Sequence[SmoothRecording],
    progress: Callable[[str], None],
) -> tuple[list[Effect], list[FoundKnob]]:
    """Effects that are free beside the usual ones or in their place, and the knobs that were searched for.

    Each effect that is asked for becomes free on the joints, or for the whole arm, where it predicts what was not fitted better
    than the model does without it, see :func:`~sysid_ros.identification.effect_choice.those_that_gain`.

    Where several are asked for, each is asked for again beside what was chosen of the others, until that changes no more. The
    knobs minimise the weighted sum of squares that is left when all linear parameters are solved for (variable projection: Golub,
    Pereyra 1973), first on a grid over their range, then on finer ones around the best. Joints whose columns share no row are
    searched in turn until none changes, others each by itself.

    Args:
        friction, effects: as of :func:`~sysid_ros.identification.free_effects.wishes`. method: of the least squares.
        recordings: to find them in.
    """
    asked = wishes(friction, effects)
    chosen = [wish.effect(robot) for wish in asked if wish.everywhere]
    knobs: dict[type[Effect], list[FoundKnob]] = {}
    for _ in range(_ROUNDS):
        before = [(type(e), e.joint_names, e.settings) for e in chosen]
        for wish in (w for w in asked if not w.everywhere):
            progress(f"asking the recordings for {wish.effect.label}")
            others = [e for e in chosen if type(e) is not wish.effect]
            candidates, found, tried = _candidates(robot, wish.effect, others, recordings, method)
            model = TorqueModel(robot, [*free_model(robot, others).free, *candidates])
            bags = [recording.rows(model) for recording in recordings]
            gaining = those_that_gain(model, bags, alternatives(model, candidates), tried, method)
            chosen = add_effects(others, _joined([candidates[k] for k in gaining]))
            knobs[wish.effect] = [knob for k in gaining for knob in found[k]]
        # what one effect explained may be another's, which was not there when it was asked for, or was hidden by it
        if len(asked) < 2 or [(type(e), e.joint_names, e.settings) for e in chosen] == before:
            break
    there = {(type(e), joint) for e in chosen for joint in ("", *e.joint_names)}
    return chosen, [k for kind, found in knobs.items() for k in found if (kind, k.joint) in there]


def _joined(effects: Sequence[Effect]) -> list[Effect]:
    """The same effects, joints with the same settings in one."""
    out: list[Effect] = []
    for effect in effects:
        same = next((e for e in out if e.settings == effect.settings), None)
        if same is None:
            out.append(effect)
        else:
            joints = [*same.joint_names, *effect.joint_names]
            out[out.index(same)] = type(same).from_settings(same.robot, joints, same.settings)
    return out


def _candidates(
    robot: RobotModel, effect: type[Effect], chosen: Sequence[Effect], recordings: Sequence[SmoothRecording], method: str
) -> tuple[list[Effect], list[list[FoundKnob]], int]:
    """The effect at each of its places with the best setting, what was found of its knobs, and how many settings were tried."""
    where, knobs = places(effect, robot), own_knobs(effect)
    if not knobs:
        return [effect(robot, joints) for joints in where], [[] for _ in where], 1
    rest = [e for e in free_model(robot, chosen).free if not e.family or e.family != effect.family]
    step = max(1, sum(recording.count for recording in recordings) // _SEARCHED)
    search = KnobSearch(
        TorqueModel(robot, rest), effect, where, knobs, [recording.every(step) for recording in recordings], method
    )
    settings, determined = search.run()
    out = [search.effect(u, setting) for u, setting in enumerate(settings)]
    found = [
        [
            FoundKnob(knob.name, ", ".join(joints), float(value), search.unit(joints, knob), sure)
            for knob, value, sure in zip(knobs, setting, certain, strict=True)
        ]
        for joints, setting, certain in zip(where, settings, determined, strict=True)
    ]
    return out, found, search.tried
