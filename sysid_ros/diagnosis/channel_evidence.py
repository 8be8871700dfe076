"""Evidence for a fault of units, signs or order, and how well the efforts tell the factor that they were published with."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.block_scatter import BlockScatter
from sysid_ros.diagnosis.channel_faults import Fault, undo
from sysid_ros.diagnosis.evidence import Evidence
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.torque_noise import Noise
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.recording import Recording

_ROUNDS = 3
_SEEN = 1e-6
"""Part of a column that all others leave of it, from which its parameter is determined."""

Deviation = Callable[[Sequence[int]], tuple[float, float] | None]
"""Of some joints: by what part the efforts are larger than the model's, with its standard deviation."""


def fault_evidence(robot: RobotModel, published: Sequence[Recording], faults: Sequence[Fault]) -> list[Evidence]:
    """Of each fault: how much likelier the published efforts are with it than without it, the others undone, where the URDF and
    each joint's own friction and offset predict them."""
    n = robot.n
    factor = np.ones((1, n))
    for fault in reversed(faults):
        factor = fault.effect.publish(factor)
    out = []
    whole, rows = _likelihood(robot, published, faults, factor)
    for fault in faults:
        others = [f for f in faults if f is not fault]
        factor = np.ones((1, n))
        for other in reversed(others):
            factor = other.effect.publish(factor)
        rise = 2.0 * (whole - _likelihood(robot, published, others, factor)[0])
        out.append(Evidence(rise, fault.parameters, rows, fault.candidates))
    return out


def _likelihood(
    robot: RobotModel,
    published: Sequence[Recording],
    faults: Sequence[Fault],
    factor: FloatArray,
) -> tuple[float, float]:
    """Log-likelihood of the published efforts and how many rows it is of.

    Args:
        factor: what the faults publish of 1 N m, shape (1, n).
    """
    for fault in faults:
        published = [undo(r, fault.effect) for r in published]
    parts = [m for r in published for m in motions(robot, r)]
    band = Band(parts)
    y = band.rows([m.tau - m.link_torque for m in parts])
    out = 0.0
    for j in np.flatnonzero(band.active):
        X = band.joint_curves(int(j), [np.stack([smoothed_sign(m.v[:, j]), m.v[:, j], np.ones(len(m.t))]) for m in parts])
        residual = y[:, j]
        for _ in range(_ROUNDS):
            variance = Noise.of(band.f, residual[:, None] ** 2).variance(band.f)[:, 0]
            weighted = X / variance[:, None]
            residual = y[:, j] - X @ np.linalg.lstsq(weighted.T @ X, weighted.T @ y[:, j], rcond=None)[0]
        variance = Noise.of(band.f, residual[:, None] ** 2).variance(band.f)[:, 0]
        out -= 0.5 * float(np.sum(np.log(variance) + residual**2 / variance))
        out -= len(y) * float(np.log(np.abs(factor[0, j])))
    return out, float(len(y) * band.active.sum())


def deviation_of(train: Prepared, fit: Fit) -> Deviation:
    """How far one factor on the efforts of some joints is from 1, all parameters of a fit adjusted to it: one step of Newton's.

    The standard deviation holds the scatter from one stretch of time to the next. None where the fit has that factor already."""
    root = 1.0 / np.sqrt(fit.variance)
    modelled = (train.band.rows([m.tau for m in train.motions]) - fit.residual) * root
    residual = fit.residual * root

    def deviation(joints: Sequence[int]) -> tuple[float, float] | None:
        active = [j for j in joints if j in fit.blocks]
        whitened = {j: fit.blocks[j][1] * root[:, j, None] for j in active}
        shared = np.zeros(len(fit.theta))
        for j in active:
            np.add.at(shared, fit.blocks[j][0], whitened[j].T @ modelled[:, j])
        adjusted = fit.inverse @ shared
        own = float(np.sum(modelled[:, active] ** 2))
        information = own - float(shared @ adjusted)
        if information <= _SEEN * own:
            return None
        scatter, score = BlockScatter(train.band, 1), 0.0
        for j in fit.blocks:
            X = fit.blocks[j][1] * root[:, j, None]
            column = (modelled[:, j] if j in active else 0.0) - X @ adjusted[fit.blocks[j][0]]
            score += float(column @ residual[:, j])
            scatter.add(column[:, None], residual[:, j], np.array([0]))
        variance = scatter.ratios(np.array([[1.0 / information]]))[0] / information
        return score / information, float(np.sqrt(variance))

    return deviation
