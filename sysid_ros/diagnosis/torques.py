"""Torques on both sides of the gears, with what a fit has found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import inexact_links
from sysid_ros.effects import Acts
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


def torques(
    library: Library, fit: Fit, links: Sequence[FloatArray], nominal: Sequence[FloatArray]
) -> tuple[list[FloatArray], list[FloatArray], list[FloatArray]]:
    """Torque on the link side and on the motor side of the joints with the effects of a fit, and what effects of single joints
    have in the latter, shape (N, n) a motion. Links as inexact as the fit has them are a part of both."""
    link, drive, free = ([x.copy() for x in links], [x.copy() for x in nominal], [np.zeros_like(x) for x in nominal])
    for term in fit.terms:
        theta = term.theta_of_effect(fit.theta_of(term))
        if term.effect.acts is Acts.MEASUREMENT:
            continue
        for i, motion in enumerate(library.motions):
            torque = term.effect.torque_along(motion, theta)
            drive[i] += torque
            if term.row is not None:
                free[i] += torque
            if term.effect.acts is Acts.LINK:
                link[i] += torque
    if fit.inexact:
        off = _off(library.robot, fit)
        for i, motion in enumerate(library.motions):
            torque = motion.regressor @ off
            link[i] += torque
            drive[i] += torque
    return link, drive, free


def before_gains(fit: Fit) -> Fit:
    """A fit whose gains are of the links' torque alone, with what single joints have beside it as it is before those gains."""
    theta = fit.theta.copy()
    for gain in (t for t in fit.terms if t.effect.of_own_torque):
        factor = 1.0 + float(fit.theta_of(gain)[0])
        for term, where in zip(fit.terms, fit.slices, strict=True):
            if term.row == gain.row and term.effect.acts is not Acts.MEASUREMENT:
                theta[where] /= factor
    return replace(fit, theta=theta)


def links_changed(robot: RobotModel, fit: Fit) -> FloatArray:
    """What a fit adds to the links' inertials all the time, payload included, shape (10 n,)."""
    change = _off(robot, fit) if fit.inexact else np.zeros(10 * robot.n)
    for term in fit.terms:
        theta = term.theta_of_effect(fit.theta_of(term))
        # a term of links is a change of them already
        nothing = term.effect.as_links(np.zeros(term.effect.p))
        change += (term.effect.as_links(theta) - nothing).ravel()
    return change


def _off(robot: RobotModel, fit: Fit) -> FloatArray:
    """By how much the links are inexact, shape (10 n,)."""
    basis = inexact_links(robot)
    return np.asarray(basis @ fit.theta[-basis.shape[1] :])
