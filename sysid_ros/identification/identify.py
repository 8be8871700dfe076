"""identify: the known part of an arm's torque model from recordings in which it carries nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sysid_ros.effects import CoulombFriction, Effect, LinkInertia, RotorInertia, TorqueOffset, ViscousFriction
from sysid_ros.exceptions import DataError
from sysid_ros.identification.base_parameters import BaseParameters
from sysid_ros.identification.error_directions import error_directions
from sysid_ros.identification.least_squares import Fit, fit, noise_density, residuals, rms
from sysid_ros.identification.rows import BagRows
from sysid_ros.model_file import EffectBlock, ModelFile, urdf_digest
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque_model import TorqueModel

_ONE_RECORDING = 1.4
"""Factor on the error that is expected elsewhere, where only the halves of one recording could be held out."""


@dataclass(frozen=True, slots=True)
class TorqueError:
    """How well a model predicts a recording that it was not fitted to, a joint, shape (n,) each [N m].

    Attributes:
        name: the recording. residual: rms of the residual. torque: rms of the torque. nominal: rms of the residual of the URDF
            alone.
    """

    name: str
    residual: FloatArray
    torque: FloatArray
    nominal: FloatArray


@dataclass(frozen=True, slots=True)
class Identification:
    """What identification found.

    Attributes:
        theta, covariance: of all effects side by side, shape (p,) and (p, p). names, units: p each.
        base: which combinations of the parameters the recordings determine.
        errors: torque error on recordings held out in turn. validation: on those that were never fitted.
        model: to be written to model.yaml.
    """

    theta: FloatArray
    covariance: FloatArray
    names: tuple[str, ...]
    units: tuple[str, ...]
    base: BaseParameters
    errors: tuple[TorqueError, ...]
    validation: tuple[TorqueError, ...]
    model: ModelFile


def free_model(robot: RobotModel) -> TorqueModel:
    """Links, friction, rotors and offsets of the arm, all free."""
    effects: list[Effect] = [
        LinkInertia(robot),
        ViscousFriction(robot),
        CoulombFriction(robot),
        RotorInertia(robot),
        TorqueOffset(robot),
    ]
    return TorqueModel(robot, effects)


def identify(
    model: TorqueModel, bags: Sequence[BagRows], validation: Sequence[BagRows], provenance: dict[str, Any]
) -> Identification:
    """Weighted least squares on all recordings; its error from recordings held out in turn (halves, where there is one).

    Args:
        model: from :func:`free_model`. bags: rows of recordings without a payload. validation: rows that are never fitted.
        provenance: written into the model file.

    Raises:
        DataError: a joint hardly moves in all of the recordings.
    """
    _require_motion(model.robot, bags)
    mean, std = _prior(model)
    parts = list(bags) if len(bags) > 1 else _halves(bags[0])
    whole = fit(bags, mean, std)
    errors, density, square = [], [], []
    seconds = [part.period * part.moving.sum(axis=0) for part in parts]
    for i, part in enumerate(parts):
        rest = fit([p for k, p in enumerate(parts) if k != i], mean, std)
        errors.append(_error(model, part, rest.theta, mean))
        density.append(noise_density([part], rest.theta) * seconds[i])
        square.append(errors[-1].residual ** 2 * seconds[i])
    torque_std = np.sqrt(np.sum(square, axis=0) / np.sum(seconds, axis=0))
    if len(bags) == 1:
        # its halves repeat the motion, and a model is always better where it was fitted
        torque_std = torque_std * _ONE_RECORDING
    correlation_time = np.sum(density, axis=0) / np.sum(seconds, axis=0) / (2.0 * torque_std**2)
    return Identification(
        theta=whole.theta,
        covariance=whole.covariance,
        names=model.parameter_names,
        units=model.units,
        base=BaseParameters(_information(bags)),
        errors=tuple(errors),
        validation=tuple(_error(model, bag, whole.theta, mean) for bag in validation),
        model=_model_file(model, whole, torque_std, correlation_time, provenance),
    )


def _require_motion(robot: RobotModel, bags: Sequence[BagRows]) -> None:
    share = np.sum([b.moving.sum(axis=0) for b in bags], axis=0) / sum(len(b.t) for b in bags)
    still = [
        f"{name} ({100 * part:.0f} % of the time)" for name, part in zip(robot.joint_names, share, strict=True) if part < 0.05
    ]
    if still:
        raise DataError(
            f"joints that hardly move in these recordings: {', '.join(still)}. "
            "Each joint must move for at least 5 % of the time; record a motion that moves all of them, or leave the joint out "
            "of the URDF."
        )


def _prior(model: TorqueModel) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation before any data: the URDF's links, friction and rotors of the size of the effort limits."""
    robot = model.robot
    mean, std = np.zeros(model.p), np.zeros(model.p)
    limit = np.where(np.isfinite(robot.effort_limit), robot.effort_limit, 100.0)
    for effect, where in zip(model.free, model.slices, strict=True):
        if isinstance(effect, LinkInertia):
            mean[where] = effect.nominal
            mass = np.maximum(effect.nominal[::10], 0.5)
            std[where] = np.concatenate([np.array([0.5] + [0.1] * 3 + [0.03] * 6) * m for m in mass])
        elif isinstance(effect, RotorInertia):
            std[where] = 0.05 * limit
        else:
            std[where] = 0.2 * limit
    return mean, std


def _halves(bag: BagRows) -> list[BagRows]:
    middle = len(bag.t) // 2
    return [
        replace(bag, name=f"{bag.name} ({word} half)", t=bag.t[s], Y=bag.Y[s], y=bag.y[s], tau=bag.tau[s], moving=bag.moving[s])
        for word, s in (("first", slice(None, middle)), ("second", slice(middle, None)))
    ]


def _error(model: TorqueModel, bag: BagRows, theta: FloatArray, nominal: FloatArray) -> TorqueError:
    return TorqueError(
        bag.name, rms(residuals(bag, theta), bag.moving), rms(bag.tau, bag.moving), rms(residuals(bag, nominal), bag.moving)
    )


def _information(bags: Sequence[BagRows]) -> FloatArray:
    information: FloatArray = np.sum([np.einsum("tja,tjb->ab", bag.Y, bag.Y) for bag in bags], axis=0)
    return information


def _model_file(
    model: TorqueModel, whole: Fit, torque_std: FloatArray, correlation_time: FloatArray, provenance: dict[str, Any]
) -> ModelFile:
    robot = model.robot
    blocks = tuple(
        EffectBlock(e.id, e.joint_names, e.settings, whole.theta[s], e.parameter_names, e.units, whole.covariance[s, s])
        for e, s in zip(model.free, model.slices, strict=True)
    )
    return ModelFile(
        robot_name=robot.name,
        joints=robot.joint_names,
        urdf_sha256=urdf_digest(robot.urdf),
        effects=blocks,
        torque_std=torque_std,
        correlation_time=correlation_time,
        uncertainty=error_directions(model, whole.covariance),
        provenance=provenance,
    )
