"""How inexact masses and centres of mass of all links of a URDF may be.

Either may be so without the other. With one size for both, masses that were all 2 % off were told as one link that was 5 % off:
three coordinates a link that are exact cost a prediction more than one wrong link does.
"""

from __future__ import annotations

from itertools import product

_MASSES, _PLACES = (0.3, 1.0, 4.0), (0.05, 0.3, 1.0, 4.0)

INEXACT = ((0.0, 0.0), *product(_MASSES, _PLACES))
"""Of masses and of places, in units of the usual inexactness; first links that are exact."""


def _step(sizes: tuple[float, ...], a: float, b: float) -> bool:
    order = (0.0, *sizes)
    return abs(order.index(a) - order.index(b)) <= 1


BESIDE = tuple(
    tuple(k for k, b in enumerate(INEXACT) if b != a and _step(_MASSES, a[0], b[0]) and _step(_PLACES, a[1], b[1]))
    for a in INEXACT
)
"""Those that are a step from each."""
