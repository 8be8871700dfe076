"""Linear benchmark systems of the literature as discrete state-space models, and recordings of them in open and closed loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, signal

from sysid_ros.blackbox import Series
from sysid_ros.sample import FloatArray


@dataclass(frozen=True)
class System:
    """A system of one input and one output, or two, sampled with a hold.

    Attributes:
        name; A, B, C: in continuous time; period: [s]; gain: of the output feedback in closed loop; steps: of a recording.
    """

    name: str
    A: FloatArray
    B: FloatArray
    C: FloatArray
    period: float
    gain: float
    steps: int = 2000

    @property
    def discrete(self) -> tuple[FloatArray, FloatArray]:
        A, B, *_ = signal.cont2discrete((self.A, self.B, self.C, np.zeros((len(self.C), self.B.shape[1]))), self.period)
        return A, B

    @property
    def poles(self) -> np.ndarray:
        """With a positive imaginary part [1/s], in closed loop too: the plant's."""
        values = np.linalg.eigvals(self.A)
        return np.array(sorted(values[values.imag > 1e-9], key=abs))

    def record(self, rng: np.random.Generator, closed: bool, noise: float = 0.2) -> Series:
        """White excitation, white noise of the output of a part of its rms, coloured disturbance of half of that."""
        A, B = self.discrete
        n, m, p = len(A), B.shape[1], len(self.C)
        w = rng.standard_normal((self.steps, m))
        scale = _rms(A, B, self.C)
        Q = 0.5 * noise * rng.standard_normal((self.steps, m))
        e = noise * scale * rng.standard_normal((self.steps, p))
        x, U, Y = np.zeros(n), np.empty((self.steps, m)), np.empty((self.steps, p))
        for k in range(self.steps):
            Y[k] = self.C @ x + e[k]
            U[k] = w[k] - (self.gain / scale[:m] * Y[k, :m] if closed else 0.0)
            x = A @ x + B @ (U[k] + Q[k])
        return Series(U, Y, self.period, self.name)


def _rms(A: FloatArray, B: FloatArray, C: FloatArray) -> FloatArray:
    P = linalg.solve_discrete_lyapunov(A, B @ B.T)
    return np.sqrt(np.diag(C @ P @ C.T))


def mechanical(M: FloatArray, D: FloatArray, K: FloatArray, force: FloatArray, seen: FloatArray) -> tuple[FloatArray, ...]:
    """``M x'' + D x' + K x = force u``, y = seen x: A, B, C."""
    n = len(M)
    inverse = np.linalg.inv(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K, -inverse @ D]])
    B = np.concatenate([np.zeros((n, force.shape[1])), inverse @ force])
    return A, B, seen


def systems() -> list[System]:
    """Mass-spring-damper of two masses (Van Overschee, De Moor 1996), the two-mass drive (velocity of the motor) and the flexible
    arm of the subspace literature (three bending modes)."""
    one = mechanical(np.eye(2), 0.3 * np.array([[2.0, -1.0], [-1.0, 1.0]]), np.array([[40.0, -20.0], [-20.0, 20.0]]),
                     np.array([[1.0], [0.0]]), np.array([[0.0, 1.0, 0.0, 0.0]]))  # fmt: skip
    J, L, k, d = 0.4, 1.2, 2000.0, 1.5
    # twist, speed of the motor, speed of the load: the angle itself would only add an integrator
    A = np.array([[0.0, 1.0, -1.0], [-k / J, -(d + 4.0) / J, d / J], [k / L, d / L, -(d + 1.0) / L]])
    two = A, np.array([[0.0], [1.0 / J], [0.0]]), np.array([[0.0, 1.0, 0.0]])
    w = 2.0 * np.pi * np.array([2.0, 6.5, 14.0])
    zeta, gains = np.array([0.02, 0.015, 0.02]), np.array([[1.0], [-0.8], [0.6]])
    three = mechanical(np.eye(3), np.diag(2 * zeta * w), np.diag(w**2), gains, np.zeros((1, 6)))
    flexible = np.array([[0.0, 0.0, 0.0, 1.0, -0.8, 0.6]])
    return [
        System("mass-spring-damper", one[0], one[1], one[2], 0.1, 0.5),
        System("two-mass drive", two[0], two[1], two[2], 0.01, 0.5),
        System("flexible arm", three[0], three[1], flexible, 0.012, 0.4, 3000),
    ]
