"""identify: the known part of an arm's torque model from recordings in which it carries nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.identification.advice import record_next
from sysid_ros.identification.base_groups import (
    base_groups,
    base_of_range,
    condition_number,
    group_matrix,
    parameter_table,
    per_bag,
    repeatability,
    spread,
)
from sysid_ros.identification.contradictions import check_contradictions
from sysid_ros.identification.expected_error import error_directions
from sysid_ros.identification.held_out import Folds, Prior, Solvers
from sysid_ros.identification.least_squares import Fit, fit, noise_density
from sysid_ros.identification.payload_difference import payload_difference
from sysid_ros.identification.physical_consistency import PhysicalFit
from sysid_ros.identification.prior_weight import choose_prior, fitted, prior_on_legs
from sysid_ros.identification.result import CutOff, Identification, Knob, PriorChoice, Problem, ResidualSeries, TorqueError
from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.identification.torque_error import joint_noise, residual_series, torque_error, whiteness_tests
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.model_file import EffectBlock, ModelFile, urdf_digest
from sysid_ros.torque.torque_model import TorqueModel


@dataclass(frozen=True, slots=True)
class Choices:
    """How to identify.

    Attributes:
        method: one of :data:`sysid_ros.identification.least_squares.METHODS`. form: one of ``rows.FORMS``, for the record.
        friction: "auto" or a form of dry friction, see :func:`~sysid_ros.identification.free_effects.wishes`.
        effects: ids of effects that become free where they predict better, see
            :func:`~sysid_ros.identification.effect_choice.choose_effects`.
        physical: links that can exist, friction and rotors of 0 or more. prior_weight: None to choose it by held-out error.
        payload_frame: link that carries the payload of loaded runs; the robot's last by default.
        accept_doubts: go on where effort and URDF, or the bags among each other, don't fit, and only say so.
    """

    method: str = "irls"
    form: str = "acceleration"
    friction: str = "auto"
    physical: bool = True
    prior_weight: float | None = None
    accept_doubts: bool = False
    payload_frame: str = ""
    effects: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Solution:
    """The parameters, shape (p,) each: with the weights chosen for the links, and with the URDF's links."""

    folds: Folds
    solvers: Solvers
    prior: PriorChoice
    theta: FloatArray
    physical: PhysicalFit | None
    with_urdf: FloatArray


@dataclass(frozen=True, slots=True)
class _HeldOut:
    """Parts of the bags, the parameters found without each of them, and the torque error there."""

    parts: list[BagRows]
    thetas: list[FloatArray]
    errors: tuple[TorqueError, ...]


def identify(
    model: TorqueModel,
    bags: Sequence[BagRows],
    validation: Sequence[BagRows],
    provenance: dict[str, Any],
    choices: Choices | None = None,
    cutoff: CutOff | None = None,
    problems: Sequence[Problem] = (),
    knobs: Sequence[Knob] = (),
    loaded: Sequence[BagRows] = (),
    base: FloatingBase | None = None,
) -> Identification:
    """Weighted least squares on all recordings; its error from recordings held out in turn (halves, where there is one).

    First the unconstrained fit: it gives the noise of each joint in each bag, the covariance, and the base parameters as the
    data have them. Then, with these weights, the links that can exist and predict best what was not fitted.

    Args:
        model: from :func:`free_model`. bags: rows of recordings without a payload. validation: rows that are never fitted.
        provenance: written into the model file. choices: how. cutoff, problems, knobs: found before, for the record.
        loaded: rows of recordings in which the arm carries a payload at ``choices.payload_frame``.
        base: of a robot on legs, whose rows are those of :class:`.FeetAlong`.

    Raises:
        DataError: a joint hardly moves in all of the recordings, or no physical parameters explain them.
    """
    choices = choices or Choices()
    require_motion(model.robot, bags)
    prior = Prior.of(model, base)
    prior, found = fitted(model, bags, prior, choices.method, base)
    # a gait repeats itself, so that a model of its own follows even what impacts do: there the weight is compared
    doubts = [] if base else check_contradictions(bags, found, prior, model.robot.joint_names, choices.accept_doubts)
    solution = _solve(model, bags, prior, found, choices, base)
    held_out = _hold_out(bags, prior, solution)
    loaded_fit = fit(loaded, prior.mean, prior.std, choices.method) if loaded else None
    described = _describe(model, bags, prior, found, solution.theta)
    return Identification(
        joint_names=model.robot.joint_names,
        bags=tuple(bag.name for bag in bags),
        validation_bags=tuple(bag.name for bag in validation),
        theta=solution.theta,
        covariance=found.covariance,
        names=model.parameter_names,
        units=model.units,
        method=choices.method,
        form=choices.form,
        friction=choices.friction,
        knobs=tuple(knobs),
        cutoff=cutoff or CutOff(bags[0].cutoff_hz, "as given"),
        prior=solution.prior,
        errors=held_out.errors,
        validation=tuple(torque_error(bag, solution.theta, prior.mean, solution.with_urdf) for bag in validation),
        series=_series(validation, held_out, solution.theta, prior.mean),
        problems=(*problems, *doubts),
        physical=solution.physical,
        model=_model_file(model, solution.theta, found, _error_elsewhere(held_out, len(bags)), provenance, base),
        payload=payload_difference(model, found, loaded_fit, choices.payload_frame) if loaded_fit else None,
        **described,
    )


def _describe(model: TorqueModel, bags: Sequence[BagRows], prior: Prior, found: Fit, theta: FloatArray) -> dict[str, Any]:
    """Fields of the identification: how well each parameter is known, in the bags and in each of them, what to record next."""
    base = base_of_range(model)
    matrix = group_matrix(base)
    values, stds = per_bag(found, prior, matrix)
    between = spread(values)
    groups = base_groups(model, base, found, prior, between)
    repeated = repeatability(model, base, matrix, values, stds)
    condition = condition_number(found.information, base)
    joints = model.robot.joint_names
    return {
        "parameters": parameter_table(model, theta, found, prior, dict(zip(base.independent, between, strict=True))),
        "groups": groups,
        "base": base,
        "bags_condition_number": condition,
        "noise": tuple(x for b, bag in enumerate(bags) for x in joint_noise(bag, b, found, joints)),
        "whiteness": tuple(x for bag in bags for x in whiteness_tests(bag, found.theta, joints)),
        "repeatability": repeated,
        "record_next": record_next(model.robot, bags, groups, repeated, condition),
    }


def _solve(
    model: TorqueModel, bags: Sequence[BagRows], prior: Prior, found: Fit, choices: Choices, base: FloatingBase | None
) -> _Solution:
    """The links that can exist and predict best what was not fitted, and all else with them."""
    folds, solvers = Folds.of(bags, found), Solvers.of(model, prior, found, choices.physical)
    given = choices.prior_weight
    chosen = prior_on_legs(solvers, given) if base else choose_prior(bags, folds, solvers, found, given)
    theta, physical = solvers.solve(found.information, found.score, np.array(chosen.link_weights))
    with_urdf, _ = solvers.solve(found.information, found.score, math.inf)
    return _Solution(folds, solvers, chosen, theta, physical, with_urdf)


def _hold_out(bags: Sequence[BagRows], prior: Prior, solution: _Solution) -> _HeldOut:
    """Each bag, or each half where there is one, predicted by what follows from the others."""
    parts = list(bags) if len(bags) > 1 else _halves(bags[0])
    without = [solution.folds.without(fold) for fold in range(len(parts))]
    weights, solvers = np.array(solution.prior.link_weights), solution.solvers
    thetas = [solvers.solve(*data, weights)[0] for data in without]
    with_urdf = [solvers.solve(*data, math.inf)[0] for data in without]
    errors = (torque_error(x, at, prior.mean, urdf) for x, at, urdf in zip(parts, thetas, with_urdf, strict=True))
    return _HeldOut(parts, thetas, tuple(errors))


def _series(
    validation: Sequence[BagRows], held_out: _HeldOut, theta: FloatArray, nominal: FloatArray
) -> tuple[ResidualSeries, ...]:
    if validation:
        return tuple(residual_series(bag, "validation", theta, nominal) for bag in validation)
    parts = zip(held_out.parts, held_out.thetas, strict=True)
    return tuple(residual_series(part, "held out", at, nominal) for part, at in parts)


def require_motion(robot: RobotModel, bags: Sequence[BagRows]) -> None:
    """Check that every joint moves.

    Raises:
        DataError: naming the joints that hardly do.
    """
    share = np.sum([b.moves.sum(axis=0) for b in bags], axis=0) / sum(len(b.t) for b in bags)
    still = [
        f"{name} ({100 * part:.0f} % of the time)"
        for name, part in zip(robot.joint_names, share, strict=True)
        if part < TOL.moves
    ]
    if still:
        raise DataError(
            f"joints that hardly move in these recordings: {', '.join(still)}. "
            f"Each joint must move for at least {100 * TOL.moves:g} % of the time; record a motion that moves all of "
            "them, or leave the joint out of joint_names (--config) and of the URDF."
        )


def _halves(bag: BagRows) -> list[BagRows]:
    middle = len(bag.t) // 2
    return [
        bag.part(s, f"{bag.name} ({word} half)") for word, s in (("first", slice(None, middle)), ("second", slice(middle, None)))
    ]


def _error_elsewhere(held_out: _HeldOut, bags: int) -> tuple[FloatArray, FloatArray]:
    """What the model will leave unexplained on other motions, shape (n,) [N m], and for how long it keeps its sign [s]."""
    seconds = np.array([part.period * part.moving.sum(axis=0) for part in held_out.parts])
    total = np.maximum(seconds.sum(axis=0), 1e-9)
    torque_std = np.sqrt(np.sum([e.residual_moving**2 for e in held_out.errors] * seconds, axis=0) / total)
    if bags == 1:
        # its halves repeat the motion, and a model is always better where it was fitted
        torque_std = torque_std * TOL.one_recording
    density = np.array([noise_density(part, theta) for part, theta in zip(held_out.parts, held_out.thetas, strict=True)])
    return torque_std, np.sum(density * seconds, axis=0) / total / np.maximum(2.0 * torque_std**2, 1e-18)


def _model_file(
    model: TorqueModel,
    theta: FloatArray,
    found: Fit,
    error: tuple[FloatArray, FloatArray],
    provenance: dict[str, Any],
    base: FloatingBase | None,
) -> ModelFile:
    """What is written; ``error``: as of :func:`_error_elsewhere`."""
    robot = model.robot
    blocks = tuple(
        EffectBlock(e.id, e.joint_names, e.settings, theta[s], e.parameter_names, e.units, found.covariance[s, s])
        for e, s in zip(model.free, model.slices, strict=True)
    )
    return ModelFile(
        robot_name=robot.name,
        joints=robot.joint_names,
        urdf_sha256=urdf_digest(base.legs.urdf if base else robot.urdf),
        effects=blocks,
        torque_std=error[0],
        correlation_time=error[1],
        uncertainty=error_directions(model, found.covariance),
        provenance=provenance,
    )
