"""Measured and predicted torque where a model was not fitted."""

from __future__ import annotations

import numpy as np

from sysid_ros.identification.coloured_noise import on_grid, whiteness
from sysid_ros.identification.least_squares import Fit, residuals, rms
from sysid_ros.identification.result import JointNoise, ResidualSeries, TorqueError, WhitenessTest
from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray


def torque_error(bag: BagRows, theta: FloatArray, nominal: FloatArray, urdf_friction: FloatArray) -> TorqueError:
    """Errors of three models on a recording; each is its parameters, shape (p,)."""
    residual = residuals(bag, theta)
    return TorqueError(
        name=bag.name,
        residual=rms(residual),
        torque=rms(bag.tau),
        nominal=rms(residuals(bag, nominal)),
        urdf_friction=rms(residuals(bag, urdf_friction)),
        residual_moving=rms(residual, bag.moving),
        torque_moving=rms(bag.tau, bag.moving),
    )


def residual_series(bag: BagRows, kind: str, theta: FloatArray, nominal: FloatArray) -> ResidualSeries:
    """Row by row; ``theta`` and ``nominal`` are parameters, shape (p,)."""
    return ResidualSeries(
        name=bag.name,
        kind=kind,
        t=np.array(bag.t),
        period=bag.period,
        q=np.array(bag.q),
        v=np.array(bag.v),
        a=np.array(bag.a),
        tau_measured=np.array(bag.tau),
        tau_predicted=np.array(bag.tau - residuals(bag, theta)),
        tau_nominal=np.array(bag.tau - residuals(bag, nominal)),
        moving=np.array(bag.moving),
    )


def joint_noise(bag: BagRows, b: int, found: Fit, joints: tuple[str, ...]) -> list[JointNoise]:
    """The residual of each joint in the b-th bag that was fitted; joints that never move there are left out."""
    out = []
    for j, joint in enumerate(joints):
        rows = int(np.sum(bag.moving[:, j]))
        square, level = float(found.squares[b, j]), float(found.level[b, j])
        if rows < TOL.fewest_rows or square <= 0.0 or level <= 0.0:
            continue
        density = level * bag.period
        out.append(JointNoise(bag.name, joint, square**0.5, density, density / (2.0 * square), rows * square / level, rows))
    return out


def whiteness_tests(bag: BagRows, theta: FloatArray, joints: tuple[str, ...]) -> list[WhitenessTest]:
    """Of the residual of each joint in a bag, with every second row: between these the low-pass leaves a correlation of 0.03."""
    every = max(1, round(0.5 / bag.cutoff_hz / bag.period))
    residual = on_grid(bag, np.where(bag.moving, residuals(bag, theta), np.nan))[::every]
    out = []
    for j, joint in enumerate(joints):
        lags = min(TOL.white_lags, int(np.isfinite(residual[:, j]).sum()) // 5)
        statistic, p_value, first = whiteness(residual[:, j], lags) if lags > 0 else (np.nan,) * 3
        if np.isfinite(statistic):
            out.append(WhitenessTest(bag.name, joint, statistic, lags, p_value, first, every * bag.period))
    return out
