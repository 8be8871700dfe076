"""Efforts in which what the arm itself weighs does not show: said, and never believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from motions import Motion, measurements
from robots import robot

from sysid_ros.effects import Payload
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import Measurement

MODEL = robot("iiwa")


def carried(mass: float) -> list[Measurement]:
    body = inertial_parameters.from_com(mass, np.array([0.02, 0.01, 0.08]), 0.003 * mass * np.eye(3))
    return measurements(Motion(MODEL, seed=3), 8.0, 250.0, [(Payload(MODEL), body)], 0.1, 1e-5, velocity=False)


def without_gravity(m: Measurement) -> Measurement:
    return replace(m, tau=m.tau - MODEL.gravity_torque(m.q))


def estimates(recording: list[Measurement]) -> list[PayloadEstimate]:
    online = OnlineEstimation(MODEL, OnlineSettings())
    return [e for e in map(online.step, recording) if e is not None]


@pytest.mark.parametrize("mass", [0.0, 1.5, 6.0])
def test_efforts_in_another_unit_are_said(mass: float) -> None:
    found = estimates([replace(m, tau=0.1 * m.tau) for m in carried(mass)])
    assert found[-1].status == "inconsistent"
    assert "The efforts show only" in found[-1].reason
    assert "effort_scale" in found[-1].reason
    assert not any(e.status == "ok" for e in found)


def test_efforts_without_gravity_are_said() -> None:
    found = estimates([without_gravity(m) for m in carried(0.0)])
    assert found[-1].status == "inconsistent"
    assert "effort_type" in found[-1].reason


@pytest.mark.parametrize("mass", [1.5, 6.0])
def test_efforts_without_gravity_but_for_a_payload_are_never_believed(mass: float) -> None:
    """What is carried asks for torques like those of the arm: they show in place of them, the more the heavier it is."""
    found = estimates([without_gravity(m) for m in carried(mass)])
    assert not any(e.status in ("ok", "no_payload") for e in found)
    assert found[-1].status == "inconsistent"


@pytest.mark.parametrize("mass", [0.0, 1.5, 6.0])
@pytest.mark.parametrize("factor", [0.8, 1.0, 1.2])
def test_of_torques_it_is_never_said(factor: float, mass: float) -> None:
    assert not any(
        "The efforts show only" in e.reason for e in estimates([replace(m, tau=factor * m.tau) for m in carried(mass)])
    )
