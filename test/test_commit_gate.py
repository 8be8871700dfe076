"""What may be committed, and when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sysid_ros.exceptions import SettingsError
from sysid_ros.online.live_estimation import CommitGate
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.online_settings import CommitSettings
from sysid_ros.robot.inertial_parameters import from_com

SETTINGS = CommitSettings(mass_std=0.1, com_std=0.02, dwell=1.0, mass_dead_band=0.05, com_dead_band=0.01)


def estimate(t: float, mass: float = 1.5, com_x: float = 0.05, status: str = "ok", std: float = 0.01) -> PayloadEstimate:
    theta = from_com(mass, np.array([com_x, 0.0, 0.1]), 0.01 * np.eye(3))
    covariance = np.diag(np.r_[std, np.full(3, 0.1 * std), np.full(6, 1e-3)] ** 2)
    return PayloadEstimate(t, "tool", theta, covariance, status, "why", np.ones(10, dtype=bool), np.zeros(4), np.zeros(4))


def offered(gate: CommitGate, duration: float, start: float = 0.0, **what: object) -> list[float]:
    """Times of the commits while the same estimate comes at 50 Hz."""
    times = start + np.arange(round(duration * 50)) / 50
    return [float(t) for t in times if gate.offer(estimate(float(t), **what)) is not None]  # type: ignore[arg-type]


def test_commits_once_after_the_dwell() -> None:
    gate = CommitGate(SETTINGS)
    assert offered(gate, 5.0) == [1.0]
    assert gate.committed is not None
    assert gate.committed.mass == pytest.approx(1.5)


def test_small_change_stays_and_large_change_is_committed_after_a_new_dwell() -> None:
    gate = CommitGate(SETTINGS)
    offered(gate, 2.0)
    assert offered(gate, 3.0, start=2.0, mass=1.54) == []
    assert offered(gate, 3.0, start=5.0, mass=2.0) == [6.0]
    assert offered(gate, 3.0, start=8.0, mass=2.0, com_x=0.07) == [9.0]


def test_what_is_known_much_better_is_committed_anew_and_seldom() -> None:
    gate = CommitGate(SETTINGS)
    assert offered(gate, 2.0, std=0.03) == [1.0]
    assert offered(gate, 2.0, start=2.0, mass=1.51, std=0.015) == []
    assert offered(gate, 2.0, start=4.0, mass=1.509, std=0.009) == [4.0]
    assert gate.committed is not None
    assert gate.committed.mass == pytest.approx(1.509)
    assert offered(gate, 2.0, start=6.0, mass=1.511, std=0.006) == []
    kept = CommitGate(replace(SETTINGS, refinement=0.0))
    assert offered(kept, 2.0, std=0.03) == [1.0]
    assert offered(kept, 2.0, start=2.0, std=0.003) == []


def test_drop_commits_that_nothing_is_carried() -> None:
    gate = CommitGate(SETTINGS)
    offered(gate, 2.0)
    assert offered(gate, 3.0, start=2.0, mass=0.01, status="no_payload") == [3.0]
    assert gate.committed is not None
    assert gate.committed.is_empty


@pytest.mark.parametrize("status", ["warming_up", "not_excited", "not_physical", "stale", "inconsistent"])
def test_other_status_is_never_committed(status: str) -> None:
    gate = CommitGate(SETTINGS)
    assert offered(gate, 5.0, status=status) == []
    assert status in gate.reason
    assert gate.commit_now(estimate(5.0, status=status)) == (False, gate.reason)


@pytest.mark.parametrize(
    ("settings", "word"), [(replace(SETTINGS, mass_std=0.005), "mass_std"), (replace(SETTINGS, com_std=1e-4), "com_std")]
)
def test_uncertain_estimate_is_not_committed(settings: CommitSettings, word: str) -> None:
    gate = CommitGate(settings)
    assert offered(gate, 5.0) == []
    assert f"commit.{word}" in gate.reason


def test_not_finite_covariance_is_not_committed() -> None:
    gate = CommitGate(SETTINGS)
    assert offered(gate, 5.0, std=float("nan")) == []


def test_estimate_that_moves_is_not_committed() -> None:
    gate = CommitGate(SETTINGS)
    assert all(gate.offer(estimate(k / 50, mass=1.0 + 0.01 * k)) is None for k in range(500))


def test_interruption_starts_the_dwell_anew() -> None:
    gate = CommitGate(SETTINGS)
    offered(gate, 0.9)
    gate.interrupt("samples were missing")
    assert offered(gate, 2.0, start=0.9) == [pytest.approx(1.9, abs=0.03)]


def test_time_that_runs_back_starts_the_dwell_anew() -> None:
    gate = CommitGate(SETTINGS)
    offered(gate, 0.9, start=100.0)
    assert offered(gate, 2.0, start=50.0) == [51.0]


def test_commit_now_skips_dwell_and_dead_band() -> None:
    gate = CommitGate(SETTINGS)
    assert gate.commit_now(None)[0] is False
    done, sentence = gate.commit_now(estimate(0.0))
    assert done
    assert "1.500 kg" in sentence
    assert gate.commit_now(estimate(0.1))[0]


@pytest.mark.parametrize("value", [-1.0, float("nan"), True, "x", 1e9])
def test_settings_out_of_range_are_refused(value: object) -> None:
    with pytest.raises(SettingsError, match=r"commit\.dwell"):
        CommitSettings(dwell=value)  # type: ignore[arg-type]
