"""Efforts in one unit, with gains of their own on most joints, are efforts with a factor of its own on each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sysid_ros.diagnosis.channel_faults import faults_of_units, faults_to_try, in_newton_metres
from sysid_ros.diagnosis.covariance import Gains
from sysid_ros.diagnosis.evidence import Evidence
from sysid_ros.diagnosis.fault_findings import finding_of, without_gains
from sysid_ros.diagnosis.result import Finding
from sysid_ros.diagnosis.whose.own_factors import odds_of, with_own_factors

JOINTS = ("base", "shoulder", "elbow", "wrist")
FACTOR = 0.101972
UNIT = next(fault for _, fault in faults_of_units(len(JOINTS)) if fault.values[0][2] == FACTOR)
NO_EVIDENCE = Evidence(1.0, 1, 100, 1)


class Found:
    """What a diagnosis says of the gains."""

    def __init__(self, values: list[float], std: float = 0.02, causes: tuple[int, ...] = ()) -> None:
        n = len(values)
        self.found = Gains(tuple(range(n)), np.array(values), std**2 * np.eye(n), frozenset(causes))

    def gains(self, joints: tuple[int, ...], /) -> Gains:
        return self.found


def test_gains_of_most_joints_are_factors_of_their_own() -> None:
    values = [0.9, 1.2, 1.4, 0.7]
    (fault,) = with_own_factors((UNIT,), Found(values, causes=(0, 1, 2, 3)))
    assert fault.own_factors == (0, 1, 2, 3)
    assert [v[2] for v in fault.values] == pytest.approx([FACTOR * x for x in values])
    assert fault.effect.publish(np.ones((1, 4)))[0] == pytest.approx([FACTOR * x for x in values])


def test_one_wrong_gain_beside_another_unit_is_a_cause_of_its_own() -> None:
    assert with_own_factors((UNIT,), Found([1.01, 1.0, 1.4, 0.98], causes=(2,))) == (UNIT,)
    assert with_own_factors((), Found([1.0])) == ()


def test_gains_of_another_sign_are_no_factors_of_units() -> None:
    assert with_own_factors((UNIT,), Found([1.0, -1.0, 1.3, 1.5])) == (UNIT,)
    assert with_own_factors((UNIT,), Found([1.0] * 4, std=5.0)) == (UNIT,)  # none is told


def test_the_more_surely_gains_are_one_the_likelier_is_one_unit() -> None:
    found = [Found([1.0, 1.01, 0.99, 1.0], std).found for std in (0.01, 0.2)]
    near, rough = (units[FACTOR] - each for each, units in (odds_of(np.full(4, FACTOR), x) for x in found))
    assert near > rough > 0.0


def test_factors_of_their_own_that_are_one_unit_are_told_as_it() -> None:
    own = [0.9, 1.2, 1.4, 0.7]
    (fault,) = with_own_factors((UNIT,), Found(own, causes=(0, 1, 2, 3)))
    assert with_own_factors((fault,), Found([1.1] * 4)) == (fault,)  # once only
    (one,) = with_own_factors((replace(fault, refined=False),), Found([1.0 / x for x in own]))
    assert (one.values, one.own_factors) == (UNIT.values, ())
    (again,) = with_own_factors((replace(fault, refined=False),), Found([1.1] * 4))
    assert [v[2] for v in again.values] == pytest.approx([1.1 * FACTOR * x for x in own])


def test_of_a_channel_that_tells_no_factor_none_is_told() -> None:
    (fault,) = with_own_factors((UNIT,), Found([0.9, 1.2, 1.4, 0.7], causes=(0, 1, 2, 3)))
    known = Gains((0, 1, 2), np.array([1.1, 0.95, 0.3]), np.diag([0.02, 0.03, 0.4]) ** 2, frozenset())
    finding = finding_of(fault, JOINTS, NO_EVIDENCE, known)
    told = finding.parameters
    assert "On elbow the efforts do not tell their factor" in finding.remark
    # the wrist did not move, the elbow does not tell it
    assert [p.joint for p in told] == ["base", "shoulder", "wrist"]
    assert [p.value for p in told] == pytest.approx([FACTOR * 0.9 * 1.1, FACTOR * 1.2 * 0.95, FACTOR * 0.7])
    assert [p.std for p in told] == [pytest.approx(FACTOR * 0.9 * 0.02), pytest.approx(FACTOR * 1.2 * 0.03), None]


def test_a_wrong_sign_is_told_on_a_joint_whose_gain_is_not() -> None:
    sign = next(f for _, f in faults_to_try(JOINTS) if f.effect.id == "torque_sign")
    (value,) = finding_of(sign, JOINTS, NO_EVIDENCE, Found([1.0], std=3.0).found).parameters
    assert (value.value, value.std) == (-1.0, None)
    order = next(f for _, f in faults_to_try(JOINTS) if f.effect.id == "joint_order")
    told = finding_of(order, JOINTS, NO_EVIDENCE, Found([1.0] * 4, std=3.0).found).parameters
    assert [p.value for p in told] == ["shoulder", "base"]


@pytest.mark.parametrize(("gain", "told"), [(1.03, FACTOR), (1.2, 1.2 * FACTOR)])
def test_a_factor_is_that_of_a_known_unit_where_the_efforts_do_not_refute_it(gain: float, told: float) -> None:
    (value,) = finding_of(UNIT, JOINTS, NO_EVIDENCE, Found([gain] * 4, 0.04).found).parameters
    assert (value.value, value.std) == pytest.approx((told, FACTOR * 0.02))  # of four joints


def test_wrong_gains_are_in_the_factors_where_each_joint_has_its_own() -> None:
    (fault,) = with_own_factors((UNIT,), Found([0.9, 1.2, 1.4, 0.7], causes=(0, 1, 2, 3)))
    scale, payload = (Finding(id_, id_, JOINTS, (), 0.1, None, None, (), "") for id_ in ("torque_scale", "payload"))
    assert without_gains((fault,), [scale, payload]) == [payload]
    assert without_gains((UNIT,), [scale, payload]) == [scale, payload]


@pytest.mark.parametrize(
    ("factors", "none"),
    [
        ([(1.001, 0.044), (0.943, 0.039), (1.005, 0.016), (1.011, 0.046), (0.942, 0.056), (0.989, 0.039)], True),
        ([(0.101, 0.004), (0.098, 0.004), (0.103, 0.002), (0.102, 0.005)], False),  # kgf m
        ([(3.0, 0.1), (1.02, 0.05), (8.0, 0.2), (14.0, 1.0)], False),  # amperes, one of whose factors happens to be 1
        ([(1.0, 3.0)], False),  # says nothing
        ([(-1.0, 0.01)], False),  # no factor of a unit
        ([], False),
    ],
)
def test_factors_near_one_are_no_unit(factors: list[tuple[float, float]], none: bool) -> None:
    assert (in_newton_metres(factors, 0.05) > 0.95) is none
