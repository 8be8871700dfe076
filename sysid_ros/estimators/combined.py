"""Two estimates of the same parameters in one."""

from __future__ import annotations

import numpy as np

from sysid_ros.sample import FloatArray


def combine_in(
    theta: FloatArray, P: FloatArray, S: FloatArray, where: slice, other: tuple[FloatArray, FloatArray, FloatArray]
) -> None:
    """Take in, in place, what other rows say of some parameters: a measurement update in Joseph form.

    Where both are further apart than their noise and the considered errors explain, both covariances are as many times larger
    (the ratio of Birge 1932).

    Args:
        theta, P, S: estimate (p,), covariance (p, p) and derivative by the considered errors (p, c). where: of k parameters.
        other: the same of those, shapes (k,), (k, k) and (k, c).
    """
    value, covariance, sensitivity = other
    if sensitivity.shape[1] != S.shape[1]:  # of other errors, which are noise to these
        covariance, sensitivity = covariance + sensitivity @ sensitivity.T, np.zeros((value.size, S.shape[1]))
    apart, differs = value - theta[where], sensitivity - S[where]
    either = P[where, where] + covariance
    ratio = max(float(apart @ np.linalg.solve(either + differs @ differs.T, apart)) / apart.size, 1.0)
    K = np.linalg.solve(either, P[where]).T
    left = np.eye(theta.size)
    left[:, where] -= K
    theta += K @ apart
    S += K @ differs
    joined = left @ P @ left.T + K @ covariance @ K.T
    scale = np.ones(theta.size)
    scale[where] = np.sqrt(ratio)
    P[:] = 0.5 * (joined + joined.T) * np.outer(scale, scale)
