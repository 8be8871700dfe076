"""What of an estimate may be believed, for every status, and what is told of the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")

from diagnostic_msgs.msg import DiagnosticStatus

from sysid_ros.nodes.believed import LEVEL_OF_STATUS, Believed, EstimateMessage, inertia_message, is_believed
from sysid_ros.nodes.messages import stamp_of
from sysid_ros.online.payload_estimate import STATUSES, PayloadEstimate
from sysid_ros.robot.inertial_parameters import from_com

COM = np.array([0.03, -0.02, 0.1])
THETA = from_com(1.5, COM, np.diag([0.004, 0.005, 0.006]))


def estimate(status: str, observable: bool | np.ndarray = True) -> PayloadEstimate:
    return PayloadEstimate(
        t=12.5,
        frame="flange",
        theta=THETA,
        covariance=np.diag(np.arange(1.0, 11.0)) * 1e-6,
        status=status,
        reason="As told.",
        observable=np.full(10, observable) if isinstance(observable, bool) else observable,
        residual=np.zeros(2),
        payload_effort=np.ones(2),
    )


def numbers_of(status: str, observable: bool | np.ndarray = True) -> Believed:
    return Believed.of(estimate(status, observable), status)


def test_every_status_has_a_level() -> None:
    assert set(LEVEL_OF_STATUS) == set(STATUSES)
    assert [s for s in STATUSES if is_believed(s)] == ["ok", "no_payload"]
    assert not is_believed("a status of tomorrow")


@pytest.mark.parametrize("status", STATUSES)
def test_numbers_are_finite_only_where_they_may_be_believed(status: str) -> None:
    n = numbers_of(status)
    assert np.isfinite(n.mass) == is_believed(status)
    assert np.isfinite(n.theta).all() == is_believed(status)
    assert np.isfinite(n.com).all() == (status == "ok")
    message = inertia_message(n, "flange", stamp_of(12.5)).inertia
    values = [message.m, message.com.x, message.com.y, message.com.z, message.ixx, message.ixz, message.izz]
    assert np.isfinite(values).all() == is_believed(status)
    assert np.isnan(values).all() != is_believed(status)


@pytest.mark.parametrize("status", STATUSES)
def test_uncertainty_is_told_while_it_is_the_reason(status: str) -> None:
    e = estimate(status)
    (told,) = EstimateMessage().of(e, status, "", numbers_of(status), stamp_of(0.0)).status
    std = [float(pair.value) for pair in told.values if pair.key.startswith(("std.", "covariance.")) or pair.key == "mass_std"]
    assert len(std) == 66
    assert np.isnan(std).all() != np.isfinite(std).all()
    assert np.isfinite(std).all() == (status in ("ok", "no_payload", "warming_up", "not_excited"))


def test_what_a_motion_leaves_open_is_no_number() -> None:
    seen = np.array([True, True, True, False, *[False] * 6])
    n = numbers_of("ok", seen)
    assert n.mass == pytest.approx(1.5)
    assert n.com[:2] == pytest.approx(COM[:2])
    assert np.isnan(n.com[2])
    assert np.isnan(n.inertia).all()
    assert np.isnan(numbers_of("ok", False).mass)


def test_a_newer_status_takes_the_numbers_back() -> None:
    assert np.isnan(Believed.of(estimate("ok"), "stale").mass)


def test_names_are_in_the_order_of_the_messages() -> None:
    e = estimate("ok")
    n = Believed.of(e, "ok")
    (told,) = EstimateMessage().of(e, "ok", "As told.", n, stamp_of(12.5)).status
    values = {pair.key: pair.value for pair in told.values}
    assert float(values["parameter.Ixz"]) == pytest.approx(THETA[7])
    assert float(values["parameter.Iyy"]) == pytest.approx(THETA[6])
    assert float(values["covariance.Iyy.Iyy"]) == pytest.approx(7e-6)
    assert float(values["ixx"]) == pytest.approx(0.004)
    assert (told.name, told.hardware_id, told.level, told.message) == ("payload", "", DiagnosticStatus.OK, "ok: As told.")
    for status, level in (
        ("inconsistent", DiagnosticStatus.ERROR),
        ("stale", DiagnosticStatus.STALE),
        ("?", DiagnosticStatus.WARN),
    ):
        assert EstimateMessage().of(replace(e, status=status), status, "", n, stamp_of(0.0)).status[0].level == level


def test_the_message_has_stamp_and_frame() -> None:
    e = estimate("warming_up")
    header = EstimateMessage().of(e, "warming_up", "", numbers_of("warming_up"), stamp_of(e.t)).header
    assert (header.stamp.sec, header.stamp.nanosec, header.frame_id) == (12, 500_000_000, "flange")
