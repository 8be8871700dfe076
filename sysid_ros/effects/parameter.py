"""Parameter: a number that an engineer knows, with its interval."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid_ros.sample import FloatArray

_95 = 1.959964
CHAIN = 1e-3
"""What the chain itself is off by, as a part of a size, whatever the amount of data: even grid, filters, first order in angles.
Of recordings without noise a tilt of 0.12 rad came out 0.09 % short, and no size further off."""
_NO_SIZES = ("t0", "q0", "harmonic")
"""Instants and origins, of which a part means nothing."""


@dataclass(frozen=True)
class Parameter:
    """A parameter with its 95 % interval; value, std and both ends of the interval are lists where it is a vector.

    What has no spread that could be measured (a name, a sign, an order) has None as std, low and high.
    """

    name: str
    joint: str | None
    value: Any
    unit: str
    std: Any = None
    low: Any = None
    high: Any = None

    def as_dict(self) -> dict[str, Any]:
        """As it stands in diagnosis.json."""
        return {
            "name": self.name,
            "joint": self.joint,
            "value": self.value,
            "unit": self.unit,
            "std": self.std,
            "ci95": None if self.low is None else [self.low, self.high],
        }


def by_delta_method(
    name: str, joint: str | None, unit: str, f: Callable[[FloatArray], float], values: FloatArray, covariance: FloatArray
) -> Parameter:
    """A function of estimated values, to first order in their errors.

    Args:
        values, covariance: shape (k,) and (k, k).
    """
    value = f(values)
    gradient = np.zeros(len(values))
    for i, spread in enumerate(np.sqrt(np.maximum(np.diag(covariance), 0.0))):
        step = np.zeros(len(values))
        step[i] = max(0.1 * float(spread), 1e-9 * max(abs(float(values[i])), 1e-6))
        gradient[i] = (f(values + step) - f(values - step)) / (2.0 * step[i])
    chain = 0.0 if name in _NO_SIZES else CHAIN * value
    std = float(np.sqrt(max(float(gradient @ covariance @ gradient), 0.0) + chain**2))
    return Parameter(name, joint, float(value), unit, std, float(value - _95 * std), float(value + _95 * std))


def vector(
    name: str,
    joint: str | None,
    unit: str,
    f: Callable[[FloatArray], Sequence[float] | FloatArray],
    values: FloatArray,
    covariance: FloatArray,
) -> Parameter:
    """As :func:`by_delta_method`, for a function with several values."""
    count = len(f(values))
    parts = [by_delta_method(name, joint, unit, lambda x, i=i: float(f(x)[i]), values, covariance) for i in range(count)]  # type: ignore[misc]
    columns = ([getattr(p, which) for p in parts] for which in ("value", "std", "low", "high"))
    value, std, low, high = columns
    return Parameter(name, joint, value, unit, std, low, high)
