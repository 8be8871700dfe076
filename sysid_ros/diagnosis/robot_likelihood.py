"""How likely a hypothesis about a robot makes torques of a half of the joint space when it has seen the other half.

The torques of joint j, of a hypothesis with columns X_j of parameters that all joints share::

    y_j = m_j + X_j theta + d_j,    theta ~ N(0, I),    d_j ~ N(0, A_j + u_j^2 (O_j + kappa_j^2 D + s_j^2 I))

with the usual torque u_j, what the joint has of its own O_j, the discrepancy D that any model leaves and white noise. The sizes
kappa_j and s_j are those that make the joint's rows likeliest, given what the other joints say of theta. What is judged is what the
bodies say of one joint from the torques of the others, where the arm has not been.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize

from sysid_ros.diagnosis.robot_kernels import Prior
from sysid_ros.sample import FloatArray

_KAPPA, _SPREAD = np.log(0.05), np.log(3.0)
"""What a model leaves of a torque, before any data: mean and standard deviation of its logarithm."""
_LOW, _HIGH = np.log([1e-4, 1e-3]), np.log([2.0, 2.0])
"""Ranges of noise and discrepancy over the usual torque."""
_STARTS = [np.log([s, k]) for s in (0.01, 0.05, 0.3) for k in (0.02, 0.1, 0.5)]
USUAL = np.log([0.05, 0.1])
"""Noise and discrepancy with which many hypotheses are compared coarsely."""
_STEPS, _FEW = 10, 4


@dataclass(frozen=True, eq=False)
class JointTorques:
    """One joint's rows under a hypothesis.

    Attributes:
        residual: y - m of each of g forms of the hypothesis, shape (N, g). prior: X and A. own: O. pattern: D. usual: u.
    """

    residual: FloatArray
    prior: Prior
    own: FloatArray
    pattern: FloatArray
    usual: float

    def fixed(self) -> FloatArray:
        """A + u^2 O, shape (N, N)."""
        return self.prior[1] + self.usual**2 * self.own

    def precision(self, sizes: FloatArray) -> FloatArray:
        """Inverse of the covariance of d for logarithms of s and kappa, shape (N, N)."""
        s, kappa = np.exp(sizes) * self.usual
        out, _ = linalg.lapack.dpotrf(self.fixed() + kappa**2 * self.pattern + s**2 * np.eye(len(self.own)), lower=1)
        out, _ = linalg.lapack.dpotri(out, lower=1)
        return np.asarray(np.tril(out) + np.tril(out, -1).T)

    def information(self, precision: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What the joint says of the shared parameters: X'PX, shape (p, p), and X'P r of the first form, shape (p,)."""
        weighted = precision @ self.prior[0]
        return self.prior[0].T @ weighted, weighted.T @ self.residual[:, 0]

    def sizes(
        self, mean: FloatArray, fixed: FloatArray, start: FloatArray | None = None, step: int = 1
    ) -> tuple[FloatArray, float]:
        """Logarithms of s and kappa that make rows likeliest, shape (2,), and their log-likelihood.

        Args:
            mean: y less what is expected, shape (N,). fixed: covariance beside discrepancy and noise, shape (N, N). step: each of
                so many rows is taken.
        """
        loss = _Loss(mean[::step], fixed[::step, ::step], self.usual**2 * self.pattern[::step, ::step], self.usual**2)
        if start is None:
            few = _Loss(mean[::_FEW], fixed[::_FEW, ::_FEW], self.usual**2 * self.pattern[::_FEW, ::_FEW], self.usual**2)
            start = min(_STARTS, key=lambda x: few(x)[0])
        bounds, options = list(zip(_LOW, _HIGH, strict=True)), {"maxiter": _STEPS, "ftol": 1e-5}
        found = optimize.minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
        return np.asarray(found.x), -float(found.fun)


class _Loss:
    """Negative log-likelihood of rows by the logarithms of s and kappa, with its slope."""

    def __init__(self, mean: FloatArray, fixed: FloatArray, pattern: FloatArray, unit: float) -> None:
        self.mean, self.fixed, self.pattern, self.unit = mean, fixed, pattern, unit

    def __call__(self, x: FloatArray) -> tuple[float, FloatArray]:
        noise, kappa = self.unit * float(np.exp(2.0 * x[0])), float(np.exp(2.0 * x[1]))
        K = self.fixed + kappa * self.pattern
        K[np.diag_indices_from(K)] += noise
        root, failed = linalg.lapack.dpotrf(K.T, lower=1, overwrite_a=1)
        if failed:
            return np.inf, np.zeros(2)
        alpha = linalg.lapack.dpotrs(root, self.mean, lower=1)[0]
        z = (x[1] - _KAPPA) / _SPREAD
        value = 0.5 * float(self.mean @ alpha) + float(np.log(np.diag(root)).sum()) + 0.5 * z**2
        inverse = linalg.lapack.dpotri(root, lower=1, overwrite_c=1)[0]  # its lower half, below zeros
        diagonal = np.diag(inverse)
        trace = 2.0 * float(np.vdot(inverse, self.pattern)) - float(diagonal @ np.diag(self.pattern))
        slope = [noise * (diagonal.sum() - alpha @ alpha), kappa * (trace - alpha @ self.pattern @ alpha) + z / _SPREAD]
        return value, np.array(slope)


def halves(q: FloatArray) -> NDArray[np.bool_]:
    """True in one half of the joint space, shape (N,): cut across the direction in which a motion reaches furthest. On a path that
    repeats, a model that remembers it would have seen any stretch of time that is left out."""
    x = (q - q.mean(axis=0)) / np.maximum(q.std(axis=0), 1e-9)
    along = x @ np.linalg.svd(x, full_matrices=False)[2][0]
    return np.asarray(along > np.median(along))


def left_out(joints: Sequence[JointTorques], half: NDArray[np.bool_], sizes: FloatArray | None = None) -> FloatArray:
    """Log-likelihood of each row, given those of the other half and those before it in its own, over all joints, shape (g, N).

    Args:
        sizes: of noise and discrepancy; None for those of each joint that make the first form's rows likeliest.
    """
    if sizes is not None:
        return _left_out(joints, [x.precision(sizes) for x in joints], half)
    found, alone = [], []
    for x in joints:
        broad = x.fixed() + x.prior[0] @ x.prior[0].T
        found.append(x.sizes(x.residual[:, 0], broad, step=2)[0])
        alone.append(x.information(x.precision(found[-1])))
    unit = np.eye(joints[0].prior[0].shape[1])
    precisions = []
    for j, x in enumerate(joints):
        X = x.prior[0]
        others = linalg.cho_factor(unit + sum(H for i, (H, _) in enumerate(alone) if i != j), check_finite=False)
        theta = linalg.cho_solve(others, np.sum([h for i, (_, h) in enumerate(alone) if i != j], axis=0) + np.zeros(len(unit)))
        spread = x.fixed() + X @ linalg.cho_solve(others, X.T, check_finite=False)
        precisions.append(x.precision(x.sizes(x.residual[:, 0] - X @ theta, spread, found[j])[0]))
    return _left_out(joints, precisions, half)


def _left_out(joints: Sequence[JointTorques], precisions: Sequence[FloatArray], half: NDArray[np.bool_]) -> FloatArray:
    g, p = joints[0].residual.shape[1], joints[0].prior[0].shape[1]
    z = [P @ x.residual for P, x in zip(precisions, joints, strict=True)]
    Z = [P @ x.prior[0] for P, x in zip(precisions, joints, strict=True)]
    H = np.eye(p) + sum(x.prior[0].T @ W for x, W in zip(joints, Z, strict=True))
    h = sum(x.prior[0].T @ w for x, w in zip(joints, z, strict=True))
    out = np.zeros((g, len(half)))
    for rows in (np.flatnonzero(half), np.flatnonzero(~half)):
        # the inverse of a block of a precision is the covariance of its rows given all others
        spread = [linalg.inv(P[np.ix_(rows, rows)], check_finite=False) for P in precisions]
        seen = linalg.cho_factor(H - sum(W[rows].T @ S @ W[rows] for S, W in zip(spread, Z, strict=True)), check_finite=False)
        theta = linalg.cho_solve(seen, h - sum(W[rows].T @ S @ w[rows] for S, W, w in zip(spread, Z, z, strict=True)))
        for S, W, w in zip(spread, Z, z, strict=True):
            X = S @ W[rows]
            root = linalg.cholesky(S + X @ linalg.cho_solve(seen, X.T), lower=True, check_finite=False)
            white = linalg.solve_triangular(root, S @ w[rows] - X @ theta, lower=True)
            out[:, rows] -= (0.5 * white**2 + np.log(np.diag(root))[:, None] + 0.5 * np.log(2.0 * np.pi)).T
    return out
