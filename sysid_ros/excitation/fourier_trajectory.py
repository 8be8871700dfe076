"""FourierTrajectory: a periodic motion that is at rest at both ends."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray


class FourierBasis:
    """The motions of one joint that a Fourier series can make and that rest at the begin and the end of every period.

    The equation is, with ``w = 2 pi / period``::

        q(t) = c + sum_l a_l sin(l w t) + b_l cos(l w t),   l = 1 .. harmonics
        v(0) = w sum_l l a_l = 0,     a(0) = -w^2 sum_l l^2 b_l = 0

    (Swevers et al. 1997, "Optimal robot excitation and identification", equation 8, with the two conditions added.) The series
    stays periodic and free of frequencies above ``harmonics / period``, as it would not with a polynomial or a blend added. The
    K = 2 harmonics - 1 functions kept are the posture and an orthonormal basis of the rest, scaled so that each has about the
    same velocity.

    Args:
        duration: of the motion, a whole number of periods [s]. period: [s]. harmonics: 2 or more: one alone can't be at rest.
        anchored: the posture is where the motion starts and ends, instead of its mean.

    Raises:
        SettingsError: a number is not allowed.
    """

    def __init__(self, duration: float, period: float, harmonics: int, anchored: bool = False) -> None:
        if not 0.0 < period < np.inf or not 0.0 < duration < np.inf:
            raise SettingsError(f"duration is {duration:g} s and period is {period:g} s; both must be positive.")
        periods = round(duration / period)
        if periods < 1 or abs(periods * period - duration) > 1e-6 * duration:
            raise SettingsError(
                f"period is {period:g} s; the duration of {duration:g} s must be a whole number of periods, or the motion would "
                f"not end at rest. Choose {duration / max(periods, 1):g} s."
            )
        if harmonics < 2:
            raise SettingsError(f"harmonics is {harmonics}; it must be 2 or more: one alone can't start and end at rest.")
        self.duration, self.period, self.harmonics = float(duration), float(period), int(harmonics)
        self.anchored = anchored
        order = np.arange(1, harmonics + 1)
        self.omega: FloatArray = np.asarray(2.0 * np.pi / period * order, dtype=np.float64)
        # in units of velocity over the base frequency, so that no harmonic is favoured
        rest = np.zeros((2, 2 * harmonics))
        rest[0, :harmonics] = 1.0
        rest[1, harmonics:] = order
        null = np.linalg.svd(rest)[2][2:]
        self._mix: FloatArray = null.T / np.tile(order, 2)[:, None]
        self._anchor: FloatArray = self._mix[harmonics:].sum(axis=0) if anchored else np.zeros(2 * harmonics - 2)

    @property
    def size(self) -> int:
        """K, the number of coefficients a joint."""
        return 2 * self.harmonics - 1

    def functions(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value, first and second derivative of the K functions at times t [s], each of shape (len(t), K)."""
        phase = np.multiply.outer(np.asarray(t, dtype=float), self.omega)
        sine, cosine, w = np.sin(phase), np.cos(phase), self.omega
        posture = np.ones((len(phase), 1))
        return (
            np.hstack([posture, np.hstack([sine, cosine]) @ self._mix - self._anchor]),
            np.hstack([0.0 * posture, np.hstack([cosine * w, -sine * w]) @ self._mix]),
            np.hstack([0.0 * posture, np.hstack([-sine * w**2, -cosine * w**2]) @ self._mix]),
        )

    def series(self, coefficients: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """c, shape (n,), a and b, shape (harmonics, n) each, of coefficients of shape (K, n)."""
        both = self._mix @ coefficients[1:]
        return coefficients[0] - self._anchor @ coefficients[1:], both[: self.harmonics], both[self.harmonics :]


@dataclass(frozen=True)
class FourierTrajectory:
    """A motion of n joints in a :class:`FourierBasis`.

    Attributes:
        basis: the functions.
        coefficients: shape (K, n) [rad or m]; the first row is the mean posture, or the start where the basis is anchored.
    """

    basis: FourierBasis
    coefficients: FloatArray

    def __post_init__(self) -> None:
        self.coefficients.setflags(write=False)

    @property
    def duration(self) -> float:
        """[s]"""
        return self.basis.duration

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.coefficients.shape[1])

    @cached_property
    def start(self) -> FloatArray:
        """Where it starts and ends, shape (n,) [rad or m]."""
        return np.asarray(self.sample(np.zeros(1))[0][0])

    def sample(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and acceleration at times t [s], each of shape (len(t), n); the joints rest before and after."""
        value, first, second = self.basis.functions(np.clip(t, 0.0, self.duration))
        c = self.coefficients
        return value @ c, first @ c, second @ c

    def scaled(self, factor: float) -> FourierTrajectory:
        """The same motion with excursions ``factor`` times as large about the posture of the first row."""
        coefficients = np.array(self.coefficients)
        coefficients[1:] *= factor
        return FourierTrajectory(self.basis, coefficients)

    def grid(self, step: float = 1e-3, one_period: bool = False) -> FloatArray:
        """Times from the start to the end [s] (of the first period, which the others repeat), at most ``step`` [s] apart."""
        end = self.basis.period if one_period else self.duration
        return np.asarray(np.linspace(0.0, end, int(np.ceil(end / step - 1e-9)) + 1))
