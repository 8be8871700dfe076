"""A payload as the difference of two runs, loaded and empty, that some body can have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg

from sysid_ros.effects import Acts
from sysid_ros.exceptions import DataError
from sysid_ros.identification.free_effects import is_body, place_of
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import Fit
from sysid_ros.identification.tolerances import TOL
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.inertial_parameters import project
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel


@dataclass(frozen=True, slots=True)
class PayloadDifference:
    """What the loaded runs carried that the empty ones did not.

    Attributes:
        frame: link that the parameters are given in.
        theta, covariance: shape (10,) and (10, 10), pinocchio's order, about the frame's origin; the nearest body that can exist.
        free: the same without that condition, shape (10,).
        mass, mass_std: [kg]. com, com_std: shape (3,) [m]. inertia_com: shape (3, 3) [kg m^2].
        distance: squared Mahalanobis distance of ``free`` to ``theta``.
        consistent: False where that distance is beyond the 99 % of a chi-squared of 10: the two runs differ by something else.
        from_data: part of the information of each parameter that comes from the runs, shape (10,), 0 (the prior's alone) to 1.
    """

    frame: str
    theta: FloatArray
    covariance: FloatArray
    free: FloatArray
    mass: float
    mass_std: float
    com: FloatArray
    com_std: FloatArray
    inertia_com: FloatArray
    distance: float
    consistent: bool
    from_data: FloatArray


def payload_difference(model: TorqueModel, empty: Fit, loaded: Fit, frame: str = "") -> PayloadDifference:
    """The body that, fixed to ``frame``, turns the arm of the empty runs into that of the loaded ones.

    Both runs share the links theta and the rotors. Friction and offsets may change by d between the runs (load, temperature)::

        phi = (theta_links + T pi, theta_others + d),    min  |theta - .|^2_A_e + |phi - .|^2_A_l + priors

    with the information A of each run and T, which puts a body in ``frame`` into the parameters of the link that carries it.
    The covariance takes the coloured residuals of both runs into account; the estimate goes to the nearest body that can exist
    in its metric (see :func:`sysid_ros.robot.inertial_parameters.project`).

    Args:
        model: free effects of both fits. empty, loaded: fits to runs without and with the payload.
        frame: a link, by default the robot's last.

    Raises:
        DataError: the links are not free in the model. RobotModelError: there is no such frame.
    """
    from scipy.stats import chi2  # takes longer to load than the rest of the package

    robot = model.robot
    frame = frame or robot.flange
    links = next((s for e, s in zip(model.free, model.slices, strict=True) if e.replaces_links), None)
    placed = robot.model.frames[robot.frame_id(frame)]
    if links is None or links.stop - links.start != 10 * robot.n or placed.parentJoint == 0:
        raise DataError(
            f"a payload at '{frame}' needs a model whose links are all free and a frame that some joint moves. Choose another "
            "frame."
        )
    move = _placed(model.p, links.start + 10 * (placed.parentJoint - 1), placed.placement)
    free, covariance, left_to_prior = _difference(model, empty, loaded, move)
    theta, distance = project(free, covariance)
    mass, com, inertia = inertial_parameters.to_com(theta)
    jacobian = inertial_parameters.com_jacobian(theta)
    return PayloadDifference(
        frame=frame,
        theta=theta,
        covariance=covariance,
        free=free,
        mass=mass,
        mass_std=float(np.sqrt(covariance[0, 0])),
        com=com,
        com_std=np.sqrt(np.diag(jacobian @ covariance @ jacobian.T)),
        inertia_com=inertia,
        distance=distance,
        consistent=bool(distance <= chi2.ppf(TOL.payload_confidence, 10)),
        from_data=np.clip(1.0 - left_to_prior, 0.0, 1.0),
    )


def _placed(p: int, start: int, placement: Any) -> FloatArray:
    """T, shape (p, 10): a body in a frame as parameters of the link that carries it, whose own begin at ``start``."""
    move = np.zeros((p, 10))
    for k, unit in enumerate(np.eye(10)):
        body = inertial_parameters.move(unit, np.array(placement.rotation), np.array(placement.translation))
        move[start : start + 10, k] = body
    return move


def _difference(model: TorqueModel, empty: Fit, loaded: Fit, move: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """pi and its covariance, shape (10,) and (10, 10), and the part of its information that is the prior's, shape (10,)."""
    p = model.p
    changes = _changes(model, empty.theta, TOL.friction_change)
    other = np.flatnonzero(changes > 0.0)
    first = np.hstack([np.eye(p), np.zeros((p, len(other) + 10))])
    second = np.hstack([np.eye(p), np.eye(p)[:, other], move])
    prior = Prior.of(model)
    std = np.concatenate([prior.std, changes[other], OnlineSettings().payload_prior])
    mean = np.concatenate([prior.mean, np.zeros(len(other) + 10)])
    # in units of the prior every number is near 1 or a signal-to-noise ratio
    first, second = first * std, second * std
    eye = np.eye(len(std))
    information = first.T @ empty.information @ first + second.T @ loaded.information @ second + eye
    score = first.T @ empty.score + second.T @ loaded.score + mean / std
    noise = [fitted.bag_score_covariance.sum(axis=0) for fitted in (empty, loaded)]
    scatter = first.T @ noise[0] @ first + second.T @ noise[1] @ second + eye
    factor = linalg.cho_factor(information)
    found, inverse = linalg.cho_solve(factor, score), linalg.cho_solve(factor, eye)
    payload = slice(len(std) - 10, len(std))
    covariance = np.outer(std, std)[payload, payload] * (inverse @ scatter @ inverse)[payload, payload]
    return std[payload] * found[payload], 0.5 * (covariance + covariance.T), np.diag(inverse)[payload]


def _changes(model: TorqueModel, theta: FloatArray, part: float) -> FloatArray:
    """Standard deviation of what each parameter may change between the runs, shape (p,); 0 for links and rotors.

    An offset may change by the same part of the joint's dry friction, which it can't be separated from without reversals.
    """
    out = np.zeros(model.p)
    blocks = list(zip(model.free, model.slices, strict=True))
    dry = np.sum([np.abs(effect.as_dry_friction(theta[where])) for effect, where in blocks], axis=0)
    by_joint = dict(zip(model.robot.joint_names, dry.tolist(), strict=True))
    for effect, where in blocks:
        if is_body(effect):
            continue
        out[where] = part * np.abs(theta[where])
        if effect.acts is Acts.MEASUREMENT:
            torques = zip(range(where.start, where.stop), effect.parameter_names, effect.units, strict=True)
            for i, name, unit in torques:
                if unit in ("N m", "N"):
                    out[i] = max(out[i], part * by_joint.get(place_of(name), 0.0))
    return out
