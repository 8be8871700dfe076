"""The extended model: what was known, and the effects that were found, as a model.yaml."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sysid_ros.diagnosis.covariance import Estimates
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.prepare import Prepared, inexact_links
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS, CoulombFriction, LinkInertia, RotorInertia, ViscousFriction
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.model_file import EffectBlock, ModelFile, urdf_digest


def extended_model(
    robot: RobotModel,
    known: ModelFile | None,
    fit: Fit,
    covariance: dict[Term, Estimates],
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
        blocks.append(_links(robot, fit, links, covariance))
    blocks += [_block(t, fit, covariance[t][1], stamps) for t in fit.terms if not t.effect.replaces_links]
    samples = sum(len(m.t) for m in train.motions)
    variance = np.sum(fit.variance, axis=0) / samples
    at_zero = fit.noise.white + fit.noise.coloured
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


def _links(robot: RobotModel, fit: Fit, links: list[Term], covariance: dict[Term, Estimates]) -> EffectBlock:
    effect = LinkInertia(robot)
    theta = effect.nominal.copy()
    spread = np.zeros((effect.p, effect.p))
    if fit.inexact:
        basis = inexact_links(robot)
        theta += basis @ fit.theta[-basis.shape[1] :]
    for term in links:
        where = slice(10 * term.joints[0], 10 * term.joints[0] + 10)
        theta[where] += term.theta_of_effect(fit.theta_of(term))
        basis = np.eye(10) if term.basis is None else term.basis
        spread[where, where] += basis @ covariance[term][1] @ basis.T
    return EffectBlock(effect.id, effect.joint_names, {}, theta, effect.parameter_names, effect.units, spread)


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
