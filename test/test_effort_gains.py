"""Efforts that are off by a factor of their own on each joint, and friction that the model has not: on streams of known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from motions import Motion, measurements
from robots import robot
from test_changes import Wakes

from sysid_ros.effects import Payload
from sysid_ros.effects.stribeck_friction import StribeckFriction
from sysid_ros.online.change_trial import ChangeTrial, Verdict
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import Measurement

RATE = 250.0
MODEL = robot("iiwa")
MASS = 1.5


def last(recording: list[Measurement], **settings: float) -> tuple[PayloadEstimate, OnlineEstimation]:
    """The last estimate of links that are told to be exact."""
    exact = {"link_mass_error": 0.0, "link_com_error": 0.0, "base_tilt_std": 0.0, **settings}
    online = OnlineEstimation(MODEL, OnlineSettings(**exact))  # type: ignore[arg-type]
    estimate = [e for e in map(online.step, recording) if e is not None][-1]
    return estimate, online


def off(seed: int, mass: float = MASS) -> list[Measurement]:
    """A payload, and efforts that are off by 1 % (std) each."""
    gain = 1.0 + 0.01 * np.random.default_rng(seed).normal(size=MODEL.n)
    body = inertial_parameters.from_com(mass, np.array([0.03, -0.02, 0.08]), mass * np.diag([0.003, 0.004, 0.0035]))
    stream = measurements(Motion(MODEL, seed=seed), 6.0, RATE, [(Payload(MODEL), body)], 0.1, 1e-5, velocity=False)
    return [replace(m, tau=gain * m.tau) for m in stream]


@pytest.mark.slow
def test_the_interval_knows_that_efforts_may_be_off() -> None:
    recordings = [off(seed) for seed in range(12)]

    def errors(gain: float) -> np.ndarray:
        found = [last(r, effort_gain_error=gain)[0] for r in recordings]
        return np.array([(e.theta[0] - MASS) / e.mass_std for e in found])

    assert np.sqrt(np.mean(errors(0.0) ** 2)) > 3.0
    assert 0.4 < np.sqrt(np.mean(errors(0.01) ** 2)) < 1.6


def test_the_mass_need_not_be_known_better_than_the_efforts_tell() -> None:
    recording = off(1, 0.5)
    estimate, _ = last(recording, effort_gain_error=0.01, mass_std_limit=0.001)
    assert estimate.status == "ok"
    assert 0.05 * estimate.mass < estimate.mass_std < 0.01 * float(np.sum(MODEL.pi[::10]))


def tared(seed: int, gain: float) -> float:
    """Error of the mass over its standard deviation, after a tare on another motion, where links and efforts are off."""
    rng = np.random.default_rng(seed)
    true = MODEL.with_links(np.repeat(0.02 * rng.choice([-1.0, 1.0], MODEL.n), 10) * MODEL.pi)
    factor = 1.0 + 0.01 * rng.normal(size=MODEL.n)
    body = inertial_parameters.from_com(MASS, np.array([0.03, -0.02, 0.08]), MASS * np.diag([0.003, 0.004, 0.0035]))
    stream = measurements(Wakes(true, seed), 12.0, RATE, [(Payload(true), body, 6.0, np.inf)], 0.1, 1e-5, velocity=False)
    online = OnlineEstimation(MODEL, OnlineSettings(effort_gain_error=gain))
    last = None
    for m in stream:
        if m.t - stream[0].t == 5.5:
            assert "Tared" in online.tare()
        last = online.step(replace(m, tau=factor * m.tau)) or last
    assert last is not None
    return float((last.theta[0] - MASS) / last.mass_std)


@pytest.mark.slow
def test_after_a_tare_the_interval_knows_that_efforts_may_be_off() -> None:
    errors = {gain: np.array([tared(seed, gain) for seed in range(8)]) for gain in (0.0, 0.01)}
    assert np.abs(errors[0.0]).max() > 3.5
    assert np.abs(errors[0.01]).max() < 2.5
    assert 0.3 < np.sqrt(np.mean(errors[0.01] ** 2)) < 1.4


def stribeck(seed: int) -> list[Measurement]:
    """An empty arm whose dry friction is a third higher at low speed."""
    effect = StribeckFriction(MODEL, vs=0.1)
    theta = np.tile([6.0, 8.0], MODEL.n)
    return measurements(Motion(MODEL, seed=seed), 12.0, RATE, [(effect, theta)], 0.3, 1e-5, velocity=False)


@pytest.mark.slow
def test_bumps_of_friction_are_no_changes_of_the_payload(monkeypatch: pytest.MonkeyPatch) -> None:
    recordings = [stribeck(seed) for seed in range(2)]
    assert [e for r in recordings for e in last(r)[1].events] == []
    monkeypatch.setattr(ChangeTrial, "_against_before", lambda self, estimator: Verdict.BODY)
    assert [e for r in recordings for e in last(r)[1].events] != []
