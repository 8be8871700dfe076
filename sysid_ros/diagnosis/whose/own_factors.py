"""Whether efforts in another unit are all in one, or each joint's in its own, as currents are: by the gains that are left once
all else was found."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np
from scipy import stats

from sysid_ros.diagnosis.channel_faults import FAULT, OWN_FACTORS, UNITS, Fault, usual_factors
from sysid_ros.diagnosis.covariance import Gains
from sysid_ros.diagnosis.whose.robot_kernels import GAIN
from sysid_ros.effects import EFFECTS, TorqueUnit

_TOLD = 2.0
"""Standard deviations that a factor is from that of a channel that holds nothing, to be told."""


class OfGains(Protocol):
    """What was found, with what it says of the gains of some joints."""

    def gains(self, joints: tuple[int, ...], /) -> Gains: ...


class Odds(NamedTuple):
    """Log-densities of gains."""

    each: float
    one: float


def with_own_factors(faults: tuple[Fault, ...], found: OfGains) -> tuple[Fault, ...]:
    """Faults with a factor of its own on each joint in place of one on all, where the gains are likelier so, and with factors of
    their own that were found without knowing what else is wrong as the gains have them now."""
    return tuple(_better(f, found.gains(f.joints)) if f.effect.absorbs and not f.refined else f for f in faults)


def _better(fault: Fault, gains: Gains) -> Fault:
    told = {j: x for i, j in enumerate(gains.joints) if (x := float(gains.values[i])) > _TOLD * np.sqrt(gains.covariance[i, i])}
    (name, _, factor, unit), *_ = fault.values
    factors = fault.effect.publish(np.ones(len(fault.joints)))
    if fault.own_factors:
        if all(abs(told[j] - 1.0) < np.sqrt(gains.covariance[i, i]) for i, j in enumerate(gains.joints) if j in told):
            return fault
        names = {j for _, j, _, _ in fault.values if j is not None}
    else:
        assert not isinstance(factor, str)
        odds = odds_of(factor, gains)
        if odds is None or odds.each < odds.one:
            return fault
        names = set(gains.joints)
    for j, x in told.items():
        factors[j] *= x
    values = tuple((name, j, float(factors[j]), unit) for j in sorted(names))
    return replace(fault, effect=TorqueUnit(factors.tolist()), values=values, parameters=len(values), refined=True)


def odds_of(factor: float, gains: Gains) -> Odds | None:
    """How likely gains are beside one unit of all efforts with this factor, one of several, and wrong gains on those joints on
    which they were found; and where each joint has a factor of its own. None where some have another sign, or none is known."""
    if not gains.joints or np.any(gains.values <= 0.0):
        return None
    logs, part = np.log(gains.values), gains.covariance / np.outer(gains.values, gains.values)
    wrong = np.array([j in gains.causes for j in gains.joints])
    (cause,) = (EFFECTS[id_] for id_ in EFFECTS if TorqueUnit.takes(id_))
    usual = np.where(wrong, cause.size, GAIN)
    beside = float(np.sum(np.where(wrong, np.log(cause.usual), np.log1p(-cause.usual))))
    one = stats.multivariate_normal.logpdf(logs, cov=np.diag(usual**2) + part) + beside + np.log(FAULT / len(UNITS))
    each = stats.multivariate_normal.logpdf(logs + np.log(factor), cov=usual_factors(len(logs)) + part) + np.log(OWN_FACTORS)
    return Odds(float(each), float(one))
