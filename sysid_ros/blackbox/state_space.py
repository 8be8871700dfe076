"""StateSpace: a linear model in discrete time, its poles, zeros and modes, and what it predicts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sysid_ros.sample import FloatArray

ComplexArray = NDArray[np.complex128]

_FAR = 10.0
"""Zeros of larger size come from sampling alone."""


@dataclass(frozen=True, slots=True)
class ModalPair:
    """A lightly damped pair of poles.

    Attributes:
        frequency: undamped [Hz]. damping: relative. shape: of the outputs, the largest 1, shape (p,), complex.
        pole: in continuous time, the one of positive imaginary part [1/s].
    """

    frequency: float
    damping: float
    shape: ComplexArray
    pole: complex


@dataclass(frozen=True, eq=False)
class StateSpace:
    """``x(k+1) = A x(k) + B u(k) + K e(k)``, ``y(k) = C x(k) + D u(k) + e(k)``.

    Attributes:
        A: (n, n), B: (n, m), C: (p, n), D: (p, m), K: (n, p). period: of a step [s].
        state: from the past z(k-s) .. z(k-1), z = [u, y], to x(k), shape (n, s (m + p)); without columns where it is not known.
        noise: covariance of e, shape (p, p).
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    K: FloatArray
    period: float
    state: FloatArray
    noise: FloatArray

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)

    @property
    def past(self) -> int:
        """Steps that the state is taken from."""
        return int(self.state.shape[1]) // (int(self.B.shape[1]) + len(self.C))

    @property
    def poles(self) -> ComplexArray:
        """In continuous time, shape (n,) [1/s]; those of the negative real axis are at the Nyquist frequency."""
        return continuous(np.linalg.eigvals(self.A), self.period)

    @property
    def zeros(self) -> ComplexArray:
        """Transmission zeros of a model with as many inputs as outputs, in continuous time, those that are finite [1/s]."""
        from scipy import linalg

        n = len(self.A)
        system = np.block([[self.A, self.B], [self.C, self.D]])
        shift = np.zeros_like(system)
        shift[:n, :n] = np.eye(n)
        values = linalg.eig(system, shift, right=False)
        finite = values[np.isfinite(values) & (np.abs(values) < _FAR) & (np.abs(values) > 1.0 / _FAR)]
        return continuous(finite, self.period)

    def modes(self, lowest: float = 0.0, highest: float = np.inf, light: float = 1.0) -> list[ModalPair]:
        """Pairs of poles with frequencies [Hz] and relative damping in a range, by frequency."""
        values, vectors = np.linalg.eig(self.A)
        out = []
        for pole, vector in zip(continuous(values, self.period), vectors.T, strict=True):
            f, damping = abs(pole) / (2.0 * np.pi), -pole.real / max(abs(pole), 1e-300)
            if pole.imag <= 1e-9 or not (lowest <= f <= highest) or abs(damping) >= light:
                continue
            shape = np.asarray(self.C @ vector, dtype=complex)
            out.append(ModalPair(float(f), float(damping), shape / _largest(shape), complex(pole)))
        return sorted(out, key=lambda m: m.frequency)

    def response(self, f: FloatArray) -> ComplexArray:
        """Frequency response at f [Hz], shape (F, p, m)."""
        z = np.exp(2j * np.pi * f * self.period)
        inner = np.linalg.solve(z[:, None, None] * np.eye(self.order) - self.A, np.broadcast_to(self.B, (len(f), *self.B.shape)))
        return np.asarray(self.C @ inner + self.D)

    def simulate(self, u: FloatArray, x: FloatArray | None = None) -> FloatArray:
        """Outputs, shape (N, p), of inputs, shape (N, m), from a state, shape (n,), without noise."""
        state = np.zeros(self.order) if x is None else x
        drive, out = u @ self.B.T, np.empty((len(u), self.order))
        for k in range(len(u)):
            out[k] = state
            state = self.A @ state + drive[k]
        return np.asarray(out @ self.C.T + u @ self.D.T)

    def first_state(self, u: FloatArray, y: FloatArray) -> FloatArray:
        """The state that explains outputs, shape (N, p), of inputs, shape (N, m), best, by least squares."""
        free = y - self.simulate(u)
        rows, power = [], np.eye(self.order)
        for _ in range(len(u)):
            rows.append(self.C @ power)
            power = self.A @ power
        return np.asarray(np.linalg.lstsq(np.concatenate(rows), free.ravel(), rcond=1e-9)[0])


def continuous(values: NDArray[Any], period: float) -> ComplexArray:
    """Eigenvalues of a step as poles in continuous time [1/s]."""
    values = np.asarray(values).astype(complex)
    return np.asarray(np.log(np.where(np.abs(values) < 1e-12, 1e-12, values)) / period)


def _largest(shape: ComplexArray) -> complex:
    largest = complex(shape[int(np.argmax(np.abs(shape)))])
    return largest if abs(largest) > 0.0 else 1.0
