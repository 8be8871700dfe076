"""Subspace identification in one frame of weights, all of it from one matrix of moments.

    x(k+1) = A x(k) + B u(k) + K e(k),      y(k) = C x(k) + D u(k) + e(k)

Every method asks what the past z(k-p) .. z(k-1), z = [u, y], does to the future y(k) .. y(k+f-1), a matrix Theta, and takes the
states from a weighted singular value decomposition ``W Theta R = U S V'``, R R' the moments of the past::

    n4sid   Theta beside the future inputs (oblique projection)   W = 1              R of the past
    moesp   the same                                              W = 1              R of the past less u_f
    cva     the same                                              W = cov(y_f)^-1/2  R of the past less u_f
    ssarx   y_f less what inputs and outputs since k did to it    W = cov(y_f)^-1/2  R of the past
    pbsid   stacked from the coefficients of one step             W = cov(e)^-1/2    R of the past

(Van Overschee, De Moor 1994; Verhaegen 1994; Larimore 1990; Jansson 2003; Chiuso 2007.)

The first three assume inputs that do not know the noise; under feedback they are biased, the last two are not. Then states
``x(k) = S^(-1/2) U' W Theta z_past(k)``, and A, B, C, D, K by least squares. Sums over blocks of time can be added, left out and
drawn again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sysid_ros.blackbox.state_space import StateSpace
from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray

_REGULAR = 1e-9
"""Added to the moments, as a part of their mean: filtered channels have next to nothing at the highest frequencies."""
WEIGHTS = ("pbsid", "ssarx", "n4sid", "moesp", "cva")


class Moments:
    """Sums over time of products of a window of the past and the present: ``sum_k zeta zeta'``, zeta = [z(k-p) .. z(k+f-1)].

    Args:
        p: steps of the past. inputs, outputs: their numbers. weights: one of :data:`WEIGHTS`.
        future: steps f of the window; those of "pbsid" follow from one.
        feedthrough: whether y(k) may depend on u(k); a controller that answers within the step allows no such term.

    Raises:
        SettingsError: there are no such weights.
    """

    def __init__(
        self, p: int, inputs: int = 1, outputs: int = 1, weights: str = "pbsid", future: int = 0, feedthrough: bool = True
    ) -> None:
        if weights not in WEIGHTS:
            raise SettingsError(f"the weights are {weights!r}; they must be one of {', '.join(WEIGHTS)}.")
        self.p, self.inputs, self.outputs, self.weights, self.feedthrough = p, inputs, outputs, weights, feedthrough
        self.window = p + (1 if weights == "pbsid" else max(future or p // 2, 2))
        self._of_one = inputs + outputs
        self._past = p * self._of_one

    def of(self, u: FloatArray, y: FloatArray) -> FloatArray:
        """Of a stretch without gaps, u and y of shape (N,) or (N, m) and (N, outputs); shape (w, w)."""
        z = np.column_stack([u, y])
        width = self._of_one * self.window
        if len(z) < self.window:
            return np.zeros((width, width))
        windows = np.lib.stride_tricks.sliding_window_view(z, self.window, axis=0)
        rows = np.ascontiguousarray(np.swapaxes(windows, 1, 2)).reshape(len(windows), width)
        return np.asarray(rows.T @ rows)

    def model(self, G: FloatArray, order: int, period: float) -> tuple[StateSpace, FloatArray]:
        """The model of an order from moments G, and all singular values, shape (f outputs,)."""
        return self.models(G, [order], period)[0]

    def models(
        self, G: FloatArray, orders: Sequence[int], period: float, rows: float = 1.0
    ) -> list[tuple[StateSpace, FloatArray]]:
        """As :meth:`model`, for several orders.

        Args:
            rows: number of windows in G, over which the noise is a mean.
        """
        scale = np.sqrt(np.where(np.diag(G) > 0.0, np.diag(G), 1.0))
        G = G / np.outer(scale, scale) + _REGULAR * np.eye(len(G))
        G = G * np.outer(scale, scale)
        gamma, root = self._of_one_step(G, max(orders)) if self.weights == "pbsid" else self._of_window(G)
        left, values, _ = np.linalg.svd(gamma @ root, full_matrices=False)
        states = [(left[:, :n] / np.sqrt(np.maximum(values[:n], 1e-300))).T @ gamma for n in orders]
        own = G[: self._past + self._of_one, : self._past + self._of_one]
        return [(self._with_states(own, to_state, period, rows), values) for to_state in states]

    @property
    def most(self) -> int:
        """Highest order that the window tells."""
        return self.outputs * (max(self.p // 2, 1) if self.weights == "pbsid" else self.window - self.p)

    def _coefficients(self, G: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Of y(k) on the past and u(k), shape (outputs, past + inputs), and the covariance of what is left times the rows."""
        known = np.arange(self._past + (self.inputs if self.feedthrough else 0))
        now = self._past + self.inputs + np.arange(self.outputs)
        found = np.linalg.solve(G[np.ix_(known, known)], G[np.ix_(known, now)]).T
        left = G[np.ix_(now, now)] - found @ G[np.ix_(known, now)]
        out = np.zeros((self.outputs, self._past + self.inputs))
        out[:, : len(known)] = found
        return out, left

    def _of_one_step(self, G: FloatArray, highest: int) -> tuple[FloatArray, FloatArray]:
        """W Theta with the coefficients of one step put below each other, and R."""
        coefficients, left = self._coefficients(G)
        white = np.linalg.inv(_root(left + 1e-12 * np.trace(left) * np.eye(len(left))))
        f = max(self.p // 2, -(-highest // self.outputs))
        gamma = np.zeros((f * self.outputs, self._past))
        for i in range(f):
            own = slice(i * self.outputs, (i + 1) * self.outputs)
            gamma[own, self._of_one * i :] = white @ coefficients[:, : self._past - self._of_one * i]
        return gamma, _root(G[: self._past, : self._past])

    def _of_window(self, G: FloatArray) -> tuple[FloatArray, FloatArray]:
        """W Theta from the window's future, and R."""
        f, past = self.window - self.p, np.arange(self._past)
        at = self._past + self._of_one * np.arange(f)[:, None]
        future_u = (at + np.arange(self.inputs)).ravel()
        future_y = (at + self.inputs + np.arange(self.outputs)).ravel()
        if self.weights == "ssarx":
            T = self._since_then(G, f, future_y)
            S, across = T @ G @ T.T, T @ G[:, past]
            theta = np.linalg.solve(G[np.ix_(past, past)], across.T).T
            return _inverse_root(S) @ theta, _root(G[np.ix_(past, past)])
        known = np.concatenate([past, future_u])
        theta = np.linalg.solve(G[np.ix_(known, known)], G[np.ix_(known, future_y)]).T[:, : self._past]
        own = G[np.ix_(past, past)]
        theta_z: FloatArray = np.asarray(theta, dtype=np.float64)
        if self.weights == "n4sid":
            return theta_z, _root(own)
        less = G[np.ix_(past, future_u)] @ np.linalg.solve(G[np.ix_(future_u, future_u)], G[np.ix_(future_u, past)])
        root = _root(own - less + 1e-12 * np.trace(own) * np.eye(len(own)))
        if self.weights == "moesp":
            return theta_z, root
        uu, uy = G[np.ix_(future_u, future_u)], G[np.ix_(future_u, future_y)]
        S = G[np.ix_(future_y, future_y)] - uy.T @ np.linalg.solve(uu, uy)
        return _inverse_root(S) @ theta_z, root

    def _since_then(self, G: FloatArray, f: int, future_y: NDArray[np.intp]) -> FloatArray:
        """From the window to the future outputs less what inputs and outputs since k did to them by the one-step coefficients."""
        coefficients, _ = self._coefficients(G)
        T = np.zeros((f * self.outputs, len(G)))
        T[np.arange(len(T)), future_y] = 1.0
        for i in range(f):
            own = slice(i * self.outputs, (i + 1) * self.outputs)
            here = self._past + self._of_one * i
            T[own, here : here + self.inputs] -= coefficients[:, self._past :]
            for back in range(1, min(i, self.p) + 1):
                block = slice(self._past - self._of_one * back, self._past - self._of_one * (back - 1))
                T[own, here - self._of_one * back : here - self._of_one * (back - 1)] -= coefficients[:, block]
        return T

    def _with_states(self, G: FloatArray, to_state: FloatArray, period: float, rows: float) -> StateSpace:
        """The model with the states that a map from the past, shape (n, past), makes."""
        n, m, p = len(to_state), self.inputs, self.outputs
        past = self._past
        # zeta -> x(k), u(k), y(k), x(k+1)
        T = np.zeros((2 * n + m + p, len(G)))
        T[:n, :past] = to_state
        T[n : n + m + p, past:] = np.eye(m + p)
        T[n + m + p :, m + p :] = to_state
        S = T @ G @ T.T
        known = n + m if self.feedthrough else n
        CD = np.zeros((p, n + m))
        CD[:, :known] = np.linalg.solve(S[:known, :known], S[:known, n + m : n + m + p]).T
        # e(k) = y - C x - D u takes the place of y(k)
        E = np.eye(len(S))
        E[n + m : n + m + p, : n + m] = -CD
        S = E @ S @ E.T
        own = slice(n + m + p)
        ABK = np.asarray(np.linalg.solve(S[own, own], S[own, n + m + p :]).T, dtype=np.float64)
        noise = S[n + m : n + m + p, n + m : n + m + p] / rows
        return StateSpace(ABK[:, :n], ABK[:, n : n + m], CD[:, :n], CD[:, n:], ABK[:, n + m :], period, to_state, noise)


def _root(S: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.cholesky(S), dtype=np.float64)


def _inverse_root(S: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(S)
    kept = np.maximum(values, 1e-12 * values[-1])
    return np.asarray((vectors / np.sqrt(kept)) @ vectors.T)
