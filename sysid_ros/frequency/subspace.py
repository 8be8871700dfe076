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

from sysid_ros.frequency.lines import ComplexArray
from sysid_ros.sample import FloatArray

_FAR = 10.0
"""Zeros of larger size come from sampling alone."""
_REGULAR = 1e-9
"""Added to the moments, as a part of their mean: filtered channels have next to nothing at the highest frequencies."""


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A discrete-time model in innovation form.

    Attributes:
        A: (n, n), B: (n, m), C: (l, n), D: (l, m), K: (n, l). period: of a step [s]. noise: covariance of e times the number of
            rows in the moments, (l, l). state: from the past z(k-p) .. z(k-1) to x(k), (n, p (m + l)).
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    K: FloatArray
    period: float
    noise: FloatArray
    state: FloatArray

    @property
    def poles(self) -> ComplexArray:
        """In continuous time, shape (n,) [1/s]; those of the negative real axis are at the Nyquist frequency."""
        values = np.linalg.eigvals(self.A).astype(complex)
        return np.asarray(np.log(np.where(np.abs(values) < 1e-12, 1e-12, values)) / self.period)

    @property
    def zeros(self) -> ComplexArray:
        """Transmission zeros in continuous time, those that are finite [1/s]; of a model with one input and one output."""
        from scipy import linalg

        n = len(self.A)
        system = np.block([[self.A, self.B], [self.C, self.D]])
        shift = np.zeros_like(system)
        shift[:n, :n] = np.eye(n)
        values = linalg.eig(system, shift, right=False)
        finite = values[np.isfinite(values) & (np.abs(values) < _FAR) & (np.abs(values) > 1.0 / _FAR)]
        return np.asarray(np.log(finite.astype(complex)) / self.period)

    def response(self, f: FloatArray) -> ComplexArray:
        """From the first input to the first output at f (K,) [Hz]."""
        z = np.exp(2j * np.pi * f * self.period)
        identity = np.eye(len(self.A))
        through = [(self.C[:1] @ np.linalg.solve(at * identity - self.A, self.B[:, :1]))[0, 0] for at in z]
        return np.asarray(np.array(through) + self.D[0, 0], dtype=np.complex128)


class Moments:
    """Sums over time of products of a window of the past and the present: ``sum_k zeta zeta'``, zeta = [z(k-p) .. z(k)].

    Args:
        p: steps of the past. inputs, outputs: m, l.
    """

    def __init__(self, p: int, inputs: int, outputs: int) -> None:
        self.p, self.m, self.outputs = p, inputs, outputs

    def of(self, u: FloatArray, y: FloatArray) -> FloatArray:
        """Of a stretch without gaps, u (N, m), y (N, l); shape ((p + 1)(m + l), (p + 1)(m + l))."""
        z = np.hstack([u, y])
        width = (self.p + 1) * z.shape[1]
        if len(z) <= self.p:
            return np.zeros((width, width))
        windows = np.lib.stride_tricks.sliding_window_view(z, self.p + 1, axis=0)
        rows = np.ascontiguousarray(np.swapaxes(windows, 1, 2)).reshape(len(windows), width)
        return np.asarray(rows.T @ rows)

    def model(self, G: FloatArray, order: int, period: float, feedthrough: bool = True) -> tuple[StateSpace, FloatArray]:
        """The model of an order from moments G, and all singular values, shape (min(f l, p (m + l)),)."""
        return self.models(G, [order], period, feedthrough)[0]

    def models(
        self, G: FloatArray, orders: list[int], period: float, feedthrough: bool = True
    ) -> list[tuple[StateSpace, FloatArray]]:
        """As :meth:`model`, for several orders."""
        m, outputs, p = self.m, self.outputs, self.p
        r = m + outputs
        past = p * r
        scale = np.sqrt(np.maximum(np.diag(G), 1e-300))
        G = G / np.outer(scale, scale) + _REGULAR * np.eye(len(G))
        G = G * np.outer(scale, scale)
        known = np.arange(past + (m if feedthrough else 0))
        now = slice(past + m, past + r)
        coefficients = np.linalg.solve(G[np.ix_(known, known)], G[known, now]).T
        noise = G[now, now] - coefficients @ G[known, now]
        markov = coefficients[:, :past]
        f = max(p // 2, max(orders))
        gamma = np.zeros((f * outputs, past))
        for i in range(f):
            gamma[i * outputs : (i + 1) * outputs, i * r :] = markov[:, : past - i * r]
        weight = np.linalg.inv(np.linalg.cholesky(noise + 1e-12 * np.trace(noise) / outputs * np.eye(outputs)))
        gamma = np.kron(np.eye(f), weight) @ gamma
        root = np.linalg.cholesky(G[:past, :past])
        left, values, _ = np.linalg.svd(gamma @ root, full_matrices=False)
        return [(self._of_order(G, gamma, left, values, n, period, feedthrough, noise), values) for n in orders]

    def _of_order(
        self,
        G: FloatArray,
        gamma: FloatArray,
        left: FloatArray,
        values: FloatArray,
        n: int,
        period: float,
        feedthrough: bool,
        noise: FloatArray,
    ) -> StateSpace:
        m, outputs, past = self.m, self.outputs, self.p * (self.m + self.outputs)
        r = m + outputs
        to_state = (left[:, :n] / np.sqrt(np.maximum(values[:n], 1e-300))).T @ gamma
        # zeta -> x(k), u(k), y(k), x(k+1)
        T = np.zeros((2 * n + r, len(G)))
        T[:n, :past] = to_state
        T[n : n + r, past:] = np.eye(r)
        T[n + r :, r:] = to_state
        S = T @ G @ T.T
        inputs = np.arange(n + (m if feedthrough else 0))
        CD = np.linalg.solve(S[np.ix_(inputs, inputs)], S[inputs, n + m : n + r]).T
        C = CD[:, :n]
        D = CD[:, n:] if feedthrough else np.zeros((outputs, m))
        # e(k) = y - C x - D u takes the place of y(k)
        E = np.eye(2 * n + r)
        E[n + m : n + r, :n], E[n + m : n + r, n : n + m] = -C, -D
        S = E @ S @ E.T
        every = np.arange(n + r)
        ABK = np.linalg.solve(S[np.ix_(every, every)], S[every, n + r :]).T
        A, B, K = (np.asarray(x, dtype=np.float64) for x in (ABK[:, :n], ABK[:, n : n + m], ABK[:, n + m :]))
        return StateSpace(A, B, np.asarray(C), np.asarray(D), K, period, noise, to_state)
