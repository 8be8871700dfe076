"""The extended model: what was known, and the effects that were found, as a model.yaml; and what a URDF can hold of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sysid_ros.diagnosis.covariance import Uncertainty
from sysid_ros.diagnosis.evidence import interval
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS, CoulombFriction, LinkInertia, RotorInertia, ViscousFriction
from sysid_ros.exceptions import DataError
from sysid_ros.identification.physical_consistency import PhysicalProblem
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.model_file import EffectBlock, ModelFile, urdf_digest
from sysid_ros.torque.torque_model import TorqueModel

_ROWS = 1500
_PRIOR = 1.0
"""Weight of the URDF's own links in directions that no motion shows: about as if each were known to a part of 1."""


def extended_model(
    robot: RobotModel,
    known: ModelFile | None,
    fit: Fit,
    covariance: Uncertainty,
    train: Prepared,
    stamps: dict[str, float],
    provenance: dict[str, Any],
) -> ModelFile:
    """Known effects and the terms of a fit.

    Args:
        covariance: of each term, as :func:`sysid_ros.diagnosis.covariance.with_knobs` gives it.
        stamps: first one of each recording, which the times of drifts and events are counted from [s].
    """
    blocks = list(known.effects) if known else []
    links = [t for t in fit.terms if t.effect.replaces_links]
    if links or fit.inexact:
        if not has_links(blocks):
            blocks += urdf_dynamics(robot)
        blocks.append(_links(robot, fit, links, covariance.links))
    blocks += [_block(t, fit, covariance.of[t].covariance, stamps) for t in fit.terms if not t.effect.replaces_links]
    samples = sum(len(m.t) for m in train.motions)
    variance = np.sum(fit.variance, axis=0) / samples
    at_zero = fit.noise.at_zero
    period = train.motions[0].period
    return ModelFile(
        robot_name=robot.name,
        joints=robot.joint_names,
        urdf_sha256=urdf_digest(robot.urdf),
        effects=tuple(blocks),
        torque_std=np.sqrt(variance),
        correlation_time=at_zero * period / (2.0 * np.maximum(variance, 1e-30)),
        provenance=provenance,
    )


def _block(term: Term, fit: Fit, covariance: FloatArray, stamps: dict[str, float]) -> EffectBlock:
    effect = term.effect
    settings = dict(effect.settings)
    for name in effect.times:
        if name in settings:
            settings[name] = float(settings[name]) + stamps.get(settings.get("recording", ""), next(iter(stamps.values())))
    own = covariance[: term.p, : term.p]
    spread = own if term.basis is None else term.basis @ own @ term.basis.T
    theta = term.theta_of_effect(fit.theta_of(term))
    return EffectBlock(effect.id, effect.joint_names, settings, theta, effect.parameter_names, effect.units, spread)


def _links(robot: RobotModel, fit: Fit, links: list[Term], covariance: FloatArray) -> EffectBlock:
    effect = LinkInertia(robot)
    theta = effect.nominal + fit.links_off
    for term in links:
        theta += term.of_links @ fit.theta_of(term)
    return EffectBlock(effect.id, effect.joint_names, {}, theta, effect.parameter_names, effect.units, covariance)


def has_links(blocks: Sequence[EffectBlock]) -> bool:
    """True where the links are not the URDF's."""
    return any(EFFECTS[b.effect].replaces_links for b in blocks)


def urdf_dynamics(robot: RobotModel) -> list[EffectBlock]:
    """The URDF's ``<dynamics>``, which a model with links of its own replaces."""
    out = []
    stated = (
        (ViscousFriction(robot), robot.damping),
        (CoulombFriction(robot), robot.friction),
        (RotorInertia(robot), np.array(robot.model.armature)),
    )
    for effect, values in stated:
        if np.any(values):
            out.append(
                EffectBlock(effect.id, effect.joint_names, effect.settings, values, effect.parameter_names, effect.units, None)
            )
    return out


def urdf_part(robot: RobotModel, model: ModelFile, train: Prepared) -> tuple[ModelFile, tuple[str, ...]]:
    """The model with payload and links in one, physical set of link inertials, and what had to be changed, in words.

    Where links with their errors are bodies that can't exist, the nearest that can are taken: nearest in the torque along the
    recordings, ``min sum |W (Y pi - Y pi_found)|^2``, over links with positive definite pseudo-inertias (Traversaro et al. 2016;
    Wensing, Kim, Slotine 2018), with the URDF's own where the motion shows nothing. It is said where their torque is outside of
    the 95 % interval of that which was found: within it, what was found may as well be these bodies.
    """
    known = list(zip(model.effects, model.known_effects(robot), strict=True))
    parts = [(b, k.effect.as_links(k.theta)) for b, k in known if k.effect.replaces_links or k.effect.as_links(k.theta).any()]
    if not parts:
        return model, ()
    blocks = [b for b in model.effects if not any(b is other for other, _ in parts)]
    links = robot.pi + sum((part for _, part in parts), np.zeros((robot.n, 10))).ravel()
    notes: list[str] = []
    bad = [
        name
        for name, body in zip(robot.body_names, links.reshape(-1, 10), strict=True)
        if np.any(body) and not inertial_parameters.is_physical(body)  # nothing hangs on what only lets a trunk float
    ]
    if bad:
        nothing = np.zeros((len(links), len(links)))
        spread = sum(
            (b.covariance for b, _ in parts if b.covariance is not None and b.covariance.shape == nothing.shape), nothing
        )
        found = _nearest(robot, model, train, links, spread)
        if found is None:
            links = robot.pi.copy()
            notes.append(f"extended.urdf has the URDF's own links: those found for {', '.join(bad)} are near no body.")
        else:
            links, lost = found
            if lost:
                notes.append(
                    f"The inertials found for {', '.join(bad)} belong to no body that can exist; extended.urdf has the nearest "
                    f"that can, which changes the torque along the recordings by {lost}. model.yaml has what was found."
                )
            else:
                bad = []
    if len(bad) > 1:
        notes.append(
            f"{len(bad)} links that no body can be are what another robot's URDF leads to as well: check that --urdf is that of "
            "the robot that was recorded."
        )
    for block, k in known:
        if not k.effect.replaces_links and any(block is other for other, _ in parts):
            carriers = np.flatnonzero(k.effect.as_links(k.theta).any(axis=1))
            names = ", ".join(robot.body_names[j] for j in carriers)
            notes.append(f"The {k.effect.label} is part of link {names} in extended.urdf.")
    effect = LinkInertia(robot)
    own = EffectBlock(effect.id, effect.joint_names, {}, links, effect.parameter_names, effect.units, None)
    if not has_links(model.effects):
        blocks += urdf_dynamics(robot)
    return replace(model, effects=(own, *blocks), uncertainty=None), tuple(notes)


def _nearest(
    robot: RobotModel, model: ModelFile, train: Prepared, links: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, str] | None:
    """Physical links nearest to ``links`` in torque, and how much torque that changes, in words, empty where it is no more than
    their covariance, shape (10 n, 10 n), leaves open; None where there are none."""
    Y = np.concatenate([m.regressor[:: max(1, len(m.t) * len(train.motions) // _ROWS)] for m in train.motions])
    weight = 1.0 / np.maximum(model.torque_std, 1e-9)
    rows = (Y * weight[:, None]).reshape(-1, Y.shape[2])
    information = rows.T @ rows
    try:
        problem = PhysicalProblem(TorqueModel(robot, [LinkInertia(robot)]), information, information @ links)
        theta = problem.solve(_PRIOR).theta
    except DataError:
        return None
    lost = np.sqrt(np.mean((Y @ (theta - links)) ** 2, axis=0))
    left_open = np.sqrt(np.einsum("tji,ik,tjk->j", Y, covariance, Y, optimize=True) / len(Y))
    if all(x <= interval(0.0, std)[1] for x, std in zip(lost, left_open, strict=True)):
        return theta, ""
    worst = int(np.argmax(lost / np.maximum(model.torque_std, 1e-9)))
    return theta, f"{lost[worst]:.2g} N m (rms) at {robot.joint_names[worst]} at most"
