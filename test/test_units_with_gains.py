"""Efforts in one unit, with gains of their own on most joints, are efforts with a factor of its own on each."""

from __future__ import annotations

import pytest

from sysid_ros.diagnosis.channel_faults import faults_of_units, in_newton_metres
from sysid_ros.diagnosis.evidence import interval
from sysid_ros.diagnosis.fault_findings import with_scales
from sysid_ros.diagnosis.result import Finding
from sysid_ros.effects import Parameter

JOINTS = ("base", "shoulder", "elbow", "wrist")
UNIT = next(fault for _, fault in faults_of_units(len(JOINTS)) if fault.values[0][2] == 0.101972)


def gains(**of: float) -> Finding:
    values = tuple(Parameter("gain", joint, x, "", 0.01, *interval(x, 0.01)) for joint, x in of.items())
    return Finding("torque_scale", "wrong gain", tuple(of), values, 0.1, None, None, (), "")


OTHER = Finding("payload", "payload", JOINTS, (), 0.5, None, None, (), "")


def test_gains_of_most_joints_are_factors_of_the_unit() -> None:
    (fault,), rest = with_scales([UNIT], [OTHER, gains(base=0.9, shoulder=1.2, wrist=1.05)], JOINTS)
    assert [f.id for f in rest] == ["payload"]
    assert [v[1] for v in fault.values] == [0, 1, 2, 3]
    assert [v[2] for v in fault.values] == pytest.approx([0.101972 * x for x in (0.9, 1.2, 1.0, 1.05)])
    assert fault.values[0][4] == pytest.approx(0.101972 * 0.01)
    assert fault.values[2][4] is None


def test_one_wrong_gain_beside_another_unit_is_a_cause_of_its_own() -> None:
    findings = [OTHER, gains(elbow=1.4)]
    assert with_scales([UNIT], findings, JOINTS) == ([UNIT], findings)
    assert with_scales([], findings, JOINTS) == ([], findings)


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
