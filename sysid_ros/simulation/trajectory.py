"""ExcitingTrajectory: a random Fourier motion within the limits of an arm, plain numpy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray

_POSITION_MARGIN = 0.9
_EFFORT_MARGIN = 0.8


class ExcitingTrajectory:
    """Fourier series that starts at rest, and ends at rest where it ends.

    The equation, per joint, with ``w = 2 pi base_frequency`` and a blend s from 0 to 1 (and back before the end) by a quintic::

        q(t) = centre + s(t) x(t),    x(t) = sum_l a_l sin(l w t) + b_l cos(l w t),   l = 1 .. harmonics

    The coefficients are random, drawn so that every harmonic has about the same velocity, and each joint is scaled until its
    position, velocity and acceleration, blends included, touch the first of their limits. Reference: Swevers et al. 1997,
    "Optimal robot excitation and identification", section III (the series); the coefficients here are random, not optimised.

    Args:
        centre: posture that the motion swings about, shape (n,) [rad].
        lower, upper: position limits, shape (n,) [rad]; a tenth of the way to them is kept free.
        rng: where the coefficients come from.
        velocity_limit: per joint or one for all [rad/s].
        acceleration_limit: per joint or one for all [rad/s^2].
        base_frequency: [Hz].
        harmonics: number of harmonics.
        amplitude_limit: a joint's largest excursion from the centre [rad].
        duration: the motion ends at rest then [s]; infinite: it never ends.
        blend: time to blend in and out [s]; a quarter of the duration at most.

    Raises:
        SettingsError: the centre is not within the position limits, or a number is not positive.
    """

    def __init__(
        self,
        centre: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        rng: np.random.Generator,
        velocity_limit: float | FloatArray = 1.5,
        acceleration_limit: float | FloatArray = 6.0,
        base_frequency: float = 0.2,
        harmonics: int = 5,
        amplitude_limit: float = 1.2,
        duration: float = np.inf,
        blend: float = 1.5,
    ) -> None:
        self.centre = np.array(centre, dtype=float)
        if np.any(self.centre <= lower) or np.any(self.centre >= upper):
            raise SettingsError(
                f"the centre {self.centre} is not within the position limits {lower} to {upper}. Choose another posture."
            )
        if min(base_frequency, harmonics, duration, blend) <= 0.0:
            raise SettingsError(
                f"base_frequency {base_frequency} Hz, harmonics {harmonics}, duration {duration} s and blend {blend} s "
                "must be positive."
            )
        self.duration = float(duration)
        self.blend = min(blend, duration / 4.0)
        self._omega = 2.0 * np.pi * base_frequency * np.arange(1, harmonics + 1)
        coefficients = rng.uniform(-1.0, 1.0, (2, harmonics, self.centre.size)) / np.arange(1, harmonics + 1)[:, None]
        self._sine, self._cosine = coefficients
        room = np.minimum(np.minimum(self.centre - lower, upper - self.centre) * _POSITION_MARGIN, amplitude_limit)
        q, v, a = self.sample(self.grid())
        use = np.max(
            [
                np.abs(q - self.centre).max(axis=0) / room,
                np.abs(v).max(axis=0) / velocity_limit,
                np.abs(a).max(axis=0) / acceleration_limit,
            ],
            axis=0,
        )
        self._sine, self._cosine = self._sine / use, self._cosine / use

    def limit_effort(self, torque: Callable[[FloatArray, FloatArray, FloatArray], FloatArray], effort_limit: FloatArray) -> float:
        """Shrink the excursions until the torque stays below 80 % of its limit, and return the factor.

        Args:
            torque: inverse dynamics q, v, a -> (n,) [N m], of the heaviest load.
            effort_limit: shape (n,) [N m].

        Raises:
            SettingsError: not even holding the centre stays below.
        """
        factor = 1.0
        grid = self.grid()[::10]
        for _ in range(20):
            worst = np.max([np.abs(torque(*state)) / effort_limit for state in zip(*self.sample(grid), strict=True)])
            if worst <= _EFFORT_MARGIN:
                return factor
            factor *= 0.8
            self._sine, self._cosine = 0.8 * self._sine, 0.8 * self._cosine
        raise SettingsError(
            f"the motion needs {100 * worst:.0f} % of the effort limit even when it hardly moves; "
            f"{100 * _EFFORT_MARGIN:.0f} % is allowed. "
            "Take a lighter payload or one with its centre of mass nearer to the flange."
        )

    def grid(self) -> FloatArray:
        """Times at 100 Hz that show every extreme of the motion [s]: both blends and a period."""
        period = 2.0 * np.pi / self._omega[0]
        if np.isinf(self.duration):
            return np.arange(0.0, self.blend + period, 0.01)
        return np.arange(0.0, self.duration + 0.01, 0.01)

    def sample(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and acceleration, each of shape (len(t), n), at the times t [s]; before and after, the arm rests."""
        phase = np.multiply.outer(t, self._omega)
        sine, cosine, w = np.sin(phase), np.cos(phase), self._omega
        x = sine @ self._sine + cosine @ self._cosine
        dx = (cosine * w) @ self._sine - (sine * w) @ self._cosine
        ddx = -(sine * w**2) @ self._sine - (cosine * w**2) @ self._cosine
        s, ds, dds = self._blend(np.asarray(t, dtype=float))
        q = self.centre + s[:, None] * x
        v = ds[:, None] * x + s[:, None] * dx
        a = dds[:, None] * x + 2.0 * ds[:, None] * dx + s[:, None] * ddx
        return q, v, a

    def _blend(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        rising = np.clip(t / self.blend, 0.0, 1.0)
        falling = np.clip((self.duration - t) / self.blend, 0.0, 1.0)
        u = np.minimum(rising, falling)
        sign = np.where(rising <= falling, 1.0, -1.0)
        s = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        ds = sign * 30.0 * u**2 * (1.0 - u) ** 2 / self.blend
        dds = 60.0 * u * (1.0 - 3.0 * u + 2.0 * u**2) / self.blend**2
        return s, ds, dds
