"""Hypotheses: by how much what is known of an arm may be further off than is said."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid_ros.sample import FloatArray

_SCALES = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 64.0])
"""By how many times what is known of the arm may be further off than is said."""
_RARER = math.log(4.0)
"""Logarithm of how much rarer twice as far off is."""
_OWN_FACTOR = 16.0
"""Efforts whose gains are so many times further off are not torques with an error, but have their own factor on each joint."""
_SELDOM = math.log(1000.0)
"""How rare it is that efforts are not what they are said to be."""


class Hypotheses(NamedTuple):
    """By how much links and gains may be further off than is said, and whether efforts are what they are said to be.

    Attributes:
        priors: of the c errors of the links, of the part that is missing, and of the n gains: inverse variances, shape
            (m, c + 1 + n); the last is the widest. chance: logarithm of that of each, but for what is common, shape (m,).
        links, gains: s^2 and g^2, shape (m,). other: where efforts are something else, shape (m,).
    """

    priors: FloatArray
    chance: FloatArray
    links: FloatArray
    gains: FloatArray
    other: NDArray[np.bool_]

    @classmethod
    def of(cls, c: int, n: int, gain: float) -> Hypotheses:
        """Of c errors of links and n joints; ``gain``: standard deviation of each effort's, as a part of it, and of what all have
        in common."""
        missing, links, gains = (x.ravel() for x in np.meshgrid([False, True], _SCALES, _SCALES, indexing="ij"))
        columns = (
            np.repeat(links[:, None] ** -2, c, axis=1),
            np.where(missing, 1.0, (gain * gains) ** -2),
            np.repeat(gains[:, None] ** -2, n, axis=1),
        )
        chance = -_RARER * np.log2(links * gains) - _SELDOM * missing
        return cls(np.column_stack(columns), chance, links**2, gains**2, missing | (gains >= _OWN_FACTOR))
