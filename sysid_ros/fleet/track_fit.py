"""The one least squares of ``track``: all of a bag's parameters together, weighed by the noise that the bag itself shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.effects.payload import COMPACT_STD
from sysid_ros.fleet.known_robot import KnownRobot
from sysid_ros.fleet.track_noise import score_covariance
from sysid_ros.fleet.track_rows import DELAY, DRY, EACH, GAIN, OFFSET, ROTOR, VISCOUS, ZERO, TrackRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray

GAIN_STD = 0.2
"""Of a gain before any data: a sensor or a torque constant drifts by some per cent, and with a URDF alone is off by a fifth."""
ZERO_STD = 0.1
"""Of a zero [rad or m]: six degrees, as after a crash or a wrong homing."""
DELAY_STD = 0.05
"""Of a delay [s]: some periods of the slowest driver."""
_ITERATIONS = 8
_REACH = 3.0
"""A payload farther than so many of its standard deviations from that with which the zeros' columns were made needs new ones."""


@dataclass(frozen=True)
class TrackFit:
    """What a bag says.

    Attributes:
        rows: that were fitted. theta: shape (p,), see :class:`.TrackRows`. covariance: honest for coloured residuals, (p, p).
        prior_std: before any data, shape (p,). level: variance of the noise of a row where it matters, shape (n,) [(N m)^2].
        inverse: of the information, shape (p, p). weight: of each row, shape (N, n).
        Y, left: derivatives and residual at theta, shapes (N, n, p) and (N, n).
    """

    rows: TrackRows
    theta: FloatArray
    covariance: FloatArray
    prior_std: FloatArray
    level: FloatArray
    inverse: FloatArray
    weight: FloatArray
    Y: FloatArray
    left: FloatArray

    @property
    def std(self) -> FloatArray:
        """Shape (p,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


def prior_std(known: KnownRobot, payloads: int) -> FloatArray:
    """Standard deviations before any data about the model's values, shape (p,): of friction and offset a fifth of the effort
    limit, of a rotor a twentieth [s^2] (see :class:`.Tolerances` of the identification), of a payload those of a compact body."""
    robot = known.robot
    effort = np.where(np.isfinite(robot.effort_limit), robot.effort_limit, TOL.usual_effort)
    each = np.zeros((EACH, robot.n))
    each[[DRY, VISCOUS, OFFSET]] = TOL.torque_std * effort
    each[ROTOR] = TOL.inertia_std * effort
    each[GAIN], each[ZERO], each[DELAY] = GAIN_STD, ZERO_STD, DELAY_STD
    return np.concatenate([each.ravel(), np.tile(COMPACT_STD, payloads)])


def fit(rows: TrackRows, start: FloatArray | None = None) -> TrackFit:
    """Gauss-Newton from the model's values, the noise of each joint learned from what is left.

    The equation is linear but for products of a gain or a delay with the rest, which are small: it settles in a few steps. The
    covariance is that of weighted least squares under the noise as it is, see :func:`.score_covariance`.

    Args:
        start: where to begin, shape (p,).
    """
    std = prior_std(rows.known, rows.payloads)
    prior = np.diag(1.0 / std**2)
    theta = np.zeros(rows.p) if start is None else start
    bodies = theta[EACH * rows.n :].copy()
    moving = rows.rows.moving.astype(float)
    delay, weight = np.zeros(rows.n), moving / _power(rows.rows.y, moving)
    previous = np.inf
    for iteration in range(_ITERATIONS):
        Y, left = rows.linear(theta, delay)
        inverse: FloatArray = np.asarray(np.linalg.inv(prior + _information(Y, weight)), dtype=np.float64)
        step = inverse @ (np.einsum("tjk,tj->k", Y, weight * left, optimize=True) - prior @ theta)
        theta, left = np.asarray(theta + step, dtype=np.float64), left - Y @ step
        noise, level = score_covariance(rows.rows, Y, left, weight, _root(inverse))
        weight = moving / np.where(level > 0.0, level, _power(left, moving))
        moved = float(step @ np.linalg.solve(inverse, step))
        if iteration >= 2 and (moved < TOL.converged or moved > previous):
            break
        previous = moved
        delay = theta[DELAY * rows.n : (DELAY + 1) * rows.n].copy()
        if _elsewhere(theta[EACH * rows.n :] - bodies, inverse[EACH * rows.n :, EACH * rows.n :]):
            bodies = theta[EACH * rows.n :].copy()
            rows = rows.around(theta)
    covariance: FloatArray = inverse @ (noise + prior) @ inverse
    return TrackFit(rows, theta, 0.5 * (covariance + covariance.T), std, level, inverse, weight, Y, left)


def _information(Y: FloatArray, weight: FloatArray) -> FloatArray:
    out = np.zeros((Y.shape[2], Y.shape[2]))
    for j in range(Y.shape[1]):
        here = np.flatnonzero(Y[:, j].any(axis=0))
        columns = Y[:, j][:, here]
        out[np.ix_(here, here)] += (columns.T * weight[:, j]) @ columns
    return out


def _power(left: FloatArray, moving: FloatArray) -> FloatArray:
    """Mean square of each joint where it moves, shape (n,)."""
    return np.asarray(np.maximum((moving * left**2).sum(axis=0) / np.maximum(moving.sum(axis=0), 1.0), 1e-12))


def _root(inverse: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.cholesky(0.5 * (inverse + inverse.T)))


def _elsewhere(bodies: FloatArray, covariance: FloatArray) -> bool:
    """Whether masses or first moments are clearly others."""
    first = np.arange(len(bodies)) % 10 < 4
    return bool(np.any(np.abs(bodies[first]) > _REACH * np.sqrt(np.diag(covariance)[first])))
