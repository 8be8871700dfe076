"""Evidence: what speaks for a finding, each number by one function that is the same for every cause and every fault of the data.

All of them start from one thing, by how much a cause makes the recordings likelier: ``rise = 2 (log L_with - log L_without)``,
with the noise found anew on both sides and correlated rows counted as the few that they are. What can't be measured is None.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

_95 = 1.959964


@dataclass(frozen=True)
class Evidence:
    """What the recordings say of a cause.

    Attributes:
        rise: of the likelihood, as above. parameters: free numbers that it brings. rows: independent values that were explained.
        candidates: causes that were tried. gain: share of the held-out error, None for what has none.
    """

    rise: float
    parameters: int
    rows: float
    candidates: int
    gain: float | None = None

    @property
    def delta_bic(self) -> float:
        """As :func:`bic_difference` has it."""
        return bic_difference(self.rise, self.parameters, self.rows)

    @property
    def log10_p(self) -> float:
        """Decimal logarithm of the p-value, also where that is smaller than a number can be."""
        return log_p_value(self.rise, self.parameters, self.candidates) / float(np.log(10.0))

    @property
    def p_value(self) -> float:
        """As :func:`log_p_value` has it."""
        return float(np.exp(log_p_value(self.rise, self.parameters, self.candidates)))


def together(found: Sequence[Evidence]) -> Evidence:
    """Of several independent parts of one finding."""
    gains = [e.gain for e in found if e.gain is not None]
    return Evidence(
        sum(e.rise for e in found),
        sum(e.parameters for e in found),
        sum(e.rows for e in found),
        max(e.candidates for e in found),
        sum(gains) if gains else None,
    )


def bic_difference(rise: float, parameters: int, rows: float) -> float:
    """By how much a cause lowers Schwarz' criterion: ``rise - k log(rows)``; above 10 is very strong (Kass, Raftery 1995)."""
    return rise - parameters * float(np.log(max(rows, 1.0)))


def log_p_value(rise: float, parameters: int, candidates: int = 1) -> float:
    """Natural logarithm of the probability that chance alone makes one of several candidates look so well, at most 0.

    With free numbers the rise of a cause that is none has a chi-squared distribution (Wilks 1938). Without any, as for a sign or
    an order, the bound ``exp(-rise / 2)`` of every likelihood ratio holds (Wald 1945), which is chi-squared with two degrees.
    """
    a, x = 0.5 * (parameters or 2), 0.5 * max(rise, 0.0)
    tail = float(special.gammaincc(a, x))
    if tail > 1e-290:
        log_tail = float(np.log(tail))
    else:  # the asymptotic series of the incomplete gamma function, where x is far beyond a
        series = term = 1.0
        for i in range(1, 20):
            term *= (a - i) / x
            series += term
        log_tail = (a - 1.0) * float(np.log(x)) - x - float(special.gammaln(a)) + float(np.log(series))
    return min(0.0, log_tail + float(np.log(max(candidates, 1))))


def interval(value: float, std: float) -> tuple[float, float]:
    """Ends of the 95 % interval of a value with normal errors."""
    return float(value - _95 * std), float(value + _95 * std)


def count_interval(count: int, total: int) -> tuple[float, float, float]:
    """Standard deviation and both ends of the 95 % interval of ``count / total``, exact for a Poisson count (Garwood 1936)."""
    low = float(special.gammaincinv(count, 0.025)) if count else 0.0
    high = float(special.gammaincinv(count + 1, 0.975))
    return float(np.sqrt(count)) / total, low / total, high / total
