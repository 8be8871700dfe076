"""Whether efforts in another unit are all in one, or each joint's in its own, as currents are: by the gains that are left once
all else was found."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy import stats

from sysid_ros.diagnosis.channel_faults import FAULT, OWN_FACTORS, UNITS, Fault, usual_factors
from sysid_ros.diagnosis.covariance import Gains
from sysid_ros.diagnosis.whose.robot_kernels import GAIN
from sysid_ros.effects import EFFECTS, TorqueUnit
from sysid_ros.sample import FloatArray

_FAR = 3.0
"""Standard deviations from which a gain is another one than that of the unit."""


class OfGains(Protocol):
    """What was found, with what it says of the gains of some joints."""

    def gains(self, joints: tuple[int, ...], /) -> Gains: ...


def with_own_factors(faults: tuple[Fault, ...], found: OfGains) -> tuple[Fault, ...]:
    """Faults with a factor of its own on each joint in place of one on all, or the other way round, where the gains are likelier
    so, and with factors of their own as the gains have them: they were found without knowing what else is wrong."""
    return tuple(_better(f, found.gains(f.joints)) if f.effect.absorbs and not f.refined else f for f in faults)


def _better(fault: Fault, gains: Gains) -> Fault:
    (name, _, _, unit), *_ = fault.values
    gains, n = gains.told(), len(fault.joints)
    factors = fault.effect.publish(np.ones(n))
    at = list(gains.joints)
    if not at or np.any(gains.values <= 0.0):
        return fault
    each, of_units = odds_of(factors[at], gains)
    factor = max(of_units, key=lambda x: of_units[x])
    if of_units[factor] > each:
        same = not fault.own_factors and factors[0] == factor
        of_one = TorqueUnit([factor] * n), ((name, None, factor, unit),)
        return fault if same else replace(fault, effect=of_one[0], values=of_one[1], parameters=1, refined=True)
    if fault.own_factors and np.all(np.abs(gains.values - 1.0) < np.sqrt(np.diag(gains.covariance))):
        return fault
    factors[at] *= gains.values
    names = sorted({j for _, j, _, _ in fault.values if j is not None} | set(at))
    values = tuple((name, j, float(factors[j]), unit) for j in names)
    return replace(fault, effect=TorqueUnit(factors.tolist()), values=values, parameters=len(values), refined=True)


def odds_of(factors: FloatArray, gains: Gains) -> tuple[float, dict[float, float]]:
    """Log-density of factors times gains where each joint has a factor of its own, and where all have one of :data:`.UNITS`, but
    for joints with a wrong gain."""
    part = gains.covariance / np.outer(gains.values, gains.values)
    logs = np.log(factors) + np.log(gains.values)
    each = stats.multivariate_normal.logpdf(logs, cov=usual_factors(len(logs)) + part) + np.log(OWN_FACTORS)
    (cause,) = (EFFECTS[id_] for id_ in EFFECTS if TorqueUnit.takes(id_))
    found, of_units = np.array([j in gains.causes for j in gains.joints]), {}
    for factor in UNITS:
        off = logs - np.log(factor)
        wrong = found | (np.abs(off) > _FAR * np.sqrt(GAIN**2 + np.diag(part)))
        usual = np.where(wrong, cause.size, GAIN)
        beside = float(np.sum(np.where(wrong, np.log(cause.usual), np.log1p(-cause.usual))))
        density = stats.multivariate_normal.logpdf(off, cov=np.diag(usual**2) + part)
        of_units[factor] = float(density) + beside + float(np.log(FAULT / len(UNITS)))
    return float(each), of_units
