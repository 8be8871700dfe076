"""NormalEquations: all rows so far, a joint at a time, so that they can be weighted anew when their noise is known better."""

from __future__ import annotations

import numpy as np

from sysid_ros.estimators import kernels
from sysid_ros.sample import FloatArray


class NormalEquations:
    """``P^-1 = L + sum_i A_i / r_i`` and ``P^-1 theta = h + sum_i b_i / r_i``, with the noise r_i of row i left open.

    A recursion weighs a row by the noise that is known when it comes. In this form the same rows can be weighted by the noise
    that is known later; what the considered errors z do to theta, ``S = -P (H + sum_i C_i / r_i)``, goes along.

    Args:
        prior_variance: diagonal of P0, shape (p,). m: rows of an update.
    """

    def __init__(self, prior_variance: FloatArray, m: int) -> None:
        self._std = np.sqrt(prior_variance)
        self._p, self._m = prior_variance.size, m
        self.start(np.diag(prior_variance), np.zeros(self._p), np.zeros((self._p, 0)))

    def start(self, P: FloatArray, theta: FloatArray, S: FloatArray) -> None:
        """Begin from what is known: estimate (p,), covariance (p, p) and sensitivity (p, c)."""
        self._L = self._invert(P, self._std)
        self._h = self._L @ theta
        self._H = -self._L @ S
        self._A = np.zeros((self._m, self._p, self._p))
        self._b = np.zeros((self._m, self._p))
        self._C = np.zeros((self._m, self._p, S.shape[1]))

    def add(self, Y: FloatArray, tau: FloatArray, Z: FloatArray, weight: FloatArray) -> None:
        """Take in rows (m, p), (m,), (m, c) with a weight each, relative to the row's noise, shape (m,)."""
        if Z.shape[1] != self._H.shape[1]:
            self._H = np.zeros((self._p, Z.shape[1]))
            self._C = np.zeros((self._m, self._p, Z.shape[1]))
        kernels.accumulate_normal_equations(Y, tau, Z, weight, self._A, self._b, self._C)

    def forget(self, epsilon: float, theta: FloatArray, S: FloatArray) -> None:
        """The information of ``P <- P + eps (P - P P0^-1 P)``: a part eps of it is exchanged for the prior around theta."""
        keep = 1.0 - epsilon
        prior = epsilon / self._std**2
        self._L *= keep
        self._L.flat[:: self._p + 1] += prior
        self._h = keep * self._h + prior * theta
        self._H = keep * self._H - prior[:, None] * S if S.shape == self._H.shape else keep * self._H
        self._A *= keep
        self._b *= keep
        self._C *= keep

    def solve(self, variance: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Estimate (p,), covariance (p, p) and sensitivity (p, c) for rows of this noise, shape (m,)."""
        weight = 1.0 / variance
        lower = np.tensordot(weight, self._A, axes=1)
        P = self._invert(self._L + lower + np.tril(lower, -1).T, 1.0 / self._std)
        return P @ (self._h + weight @ self._b), P, -P @ (self._H + np.tensordot(weight, self._C, axes=1))

    @staticmethod
    def _invert(matrix: FloatArray, scale: FloatArray) -> FloatArray:
        """Inverse of a symmetric positive definite matrix whose diagonal is of the size of ``scale^2``."""
        inverse = np.linalg.inv(matrix / np.outer(scale, scale)) / np.outer(scale, scale)
        return np.asarray(0.5 * (inverse + inverse.T))
