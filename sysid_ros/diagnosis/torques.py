"""Torques on both sides of the gears, with what a fit has found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.library import LINK_SIDE, MEASUREMENT, Library
from sysid_ros.effects import LinkInertia, Payload
from sysid_ros.robot.inertial_parameters import move
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


def torques(
    library: Library, fit: Fit, links: Sequence[FloatArray], nominal: Sequence[FloatArray]
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Torque on the link side and on the motor side of the joints with the effects of a fit, shape (N, n) a motion."""
    link, drive = [x.copy() for x in links], [x.copy() for x in nominal]
    for term in fit.terms:
        theta = term.theta_of_effect(fit.theta_of(term))
        if term.id in MEASUREMENT:
            continue
        for i, motion in enumerate(library.motions):
            torque = term.effect.torque_along(motion, theta)
            drive[i] += torque
            if term.id in LINK_SIDE:
                link[i] += torque
    return link, drive


def links_changed(robot: RobotModel, fit: Fit) -> FloatArray:
    """What a fit adds to the links' inertials all the time, payload included, shape (10 n,)."""
    change = np.zeros(10 * robot.n)
    for term in fit.terms:
        theta = term.theta_of_effect(fit.theta_of(term))
        if isinstance(term.effect, LinkInertia):
            change.reshape(-1, 10)[term.effect.joints] += theta.reshape(-1, 10)
        elif type(term.effect) is Payload:
            frame = robot.model.frames[term.effect.frame_index]
            j = frame.parentJoint - 1
            change[10 * j : 10 * j + 10] += move(theta, np.array(frame.placement.rotation), np.array(frame.placement.translation))
    return change
