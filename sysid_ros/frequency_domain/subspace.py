"""State-space models from input and output in closed loop, by predictor-based subspace identification (PBSID-opt).

    x(k+1) = A x(k) + B u(k) + K e(k),      y(k) = C x(k) + D u(k) + e(k)

With the past of inputs and outputs as instruments (Chiuso 2007; van der Veen, van Wingerden, Verhaegen et al. 2013)::

    1. y(k) = sum_i  C At^(i-1) [Bt K] z(k-i) + D u(k) + e(k),  i = 1..p,  At = A - K C:  least squares, no noise left in z
    2. stack the coefficients to  Gamma Kp,  i.e. what the past does to the future; weighted singular values give the order
    3. states x(k) = S^(-1/2) U' Gamma Kp z_past(k), then A, B, C, D, K by least squares

Ordinary methods (N4SID, PO-MOESP) assume inputs that do not know the noise; under feedback they are biased. Everything is worked
out from one matrix of moments, so that blocks of time can be added, left out, and drawn again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.frequency_domain.lines import ComplexArray
from sysid_ros.sample import FloatArray

_FAR = 10.0
"""Zeros of larger size come from sampling alone."""
_REGULAR = 1e-9
"""Added to the moments, as a part of their mean: filtered channels have next to nothing at the highest frequencies."""


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A discrete-time model of one input and one output.

    Attributes:
        A: (n, n), B: (n, 1), C: (1, n), D: (1, 1). period: of a step [s]. state: from the past z(k-p) .. z(k-1) to x(k).
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    period: float
    state: FloatArray

    @property
    def poles(self) -> ComplexArray:
        """In continuous time, shape (n,) [1/s]; those of the negative real axis are at the Nyquist frequency."""
        values = np.linalg.eigvals(self.A).astype(complex)
        return np.asarray(np.log(np.where(np.abs(values) < 1e-12, 1e-12, values)) / self.period)

    @property
    def zeros(self) -> ComplexArray:
        """Transmission zeros in continuous time, those that are finite [1/s]."""
        from scipy import linalg

        n = len(self.A)
        system = np.block([[self.A, self.B], [self.C, self.D]])
        shift = np.zeros_like(system)
        shift[:n, :n] = np.eye(n)
        values = linalg.eig(system, shift, right=False)
        finite = values[np.isfinite(values) & (np.abs(values) < _FAR) & (np.abs(values) > 1.0 / _FAR)]
        return np.asarray(np.log(finite.astype(complex)) / self.period)


class Moments:
    """Sums over time of products of a window of the past and the present: ``sum_k zeta zeta'``, zeta = [z(k-p) .. z(k)].

    Args:
        p: steps of the past.
    """

    def __init__(self, p: int) -> None:
        self.p = p

    def of(self, u: FloatArray, y: FloatArray) -> FloatArray:
        """Of a stretch without gaps, u and y of shape (N,); shape (2 (p + 1), 2 (p + 1))."""
        width = 2 * (self.p + 1)
        if len(u) <= self.p:
            return np.zeros((width, width))
        windows = np.lib.stride_tricks.sliding_window_view(np.stack([u, y], axis=1), self.p + 1, axis=0)
        rows = np.ascontiguousarray(np.swapaxes(windows, 1, 2)).reshape(len(windows), width)
        return np.asarray(rows.T @ rows)

    def model(self, G: FloatArray, order: int, period: float) -> tuple[StateSpace, FloatArray]:
        """The model of an order from moments G, and all singular values, shape (f,)."""
        return self.models(G, [order], period)[0]

    def models(self, G: FloatArray, orders: list[int], period: float) -> list[tuple[StateSpace, FloatArray]]:
        """As :meth:`model`, for several orders."""
        past = 2 * self.p
        scale = np.sqrt(np.maximum(np.diag(G), 1e-300))
        G = G / np.outer(scale, scale) + _REGULAR * np.eye(len(G))
        G = G * np.outer(scale, scale)
        known, now = slice(past + 1), past + 1
        coefficients = np.linalg.solve(G[known, known], G[known, now])
        noise = G[now, now] - coefficients @ G[known, now]
        f = max(self.p // 2, max(orders))
        gamma = np.zeros((f, past))
        for i in range(f):
            gamma[i, 2 * i :] = coefficients[: past - 2 * i] / np.sqrt(noise)
        root = np.linalg.cholesky(G[:past, :past])
        left, values, _ = np.linalg.svd(gamma @ root, full_matrices=False)
        states = [(left[:, :n] / np.sqrt(np.maximum(values[:n], 1e-300))).T @ gamma for n in orders]
        return [(_with_states(G, to_state, period), values) for to_state in states]


def _with_states(G: FloatArray, to_state: FloatArray, period: float) -> StateSpace:
    """The model with the states that a map from the past, shape (n, 2 p), makes."""
    n, past = to_state.shape
    # zeta -> x(k), u(k), y(k), x(k+1)
    T = np.zeros((2 * n + 2, len(G)))
    T[:n, :past] = to_state
    T[n : n + 2, past:] = np.eye(2)
    T[n + 2 :, 2:] = to_state
    S = T @ G @ T.T
    CD = np.asarray(np.linalg.solve(S[: n + 1, : n + 1], S[: n + 1, n + 1]), dtype=np.float64)
    # e(k) = y - C x - D u takes the place of y(k)
    E = np.eye(2 * n + 2)
    E[n + 1, : n + 1] = -CD
    S = E @ S @ E.T
    ABK = np.asarray(np.linalg.solve(S[: n + 2, : n + 2], S[: n + 2, n + 2 :]).T, dtype=np.float64)
    return StateSpace(ABK[:, :n], ABK[:, n : n + 1], CD[None, :n], CD[None, n:], period, to_state)
