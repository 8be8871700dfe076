"""DeePC: the same inputs as with the model where there is no noise, limits kept, and honest about data that tell too little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sysid_ros.blackbox import Series, StateSpace, Subspace
from sysid_ros.control.data_enabled import DeePC, PredictiveSettings, SubspacePredictive
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.friction_joint import follow

A = np.array([[0.9, 0.2, 0.0], [-0.2, 0.9, 0.1], [0.0, 0.0, 0.7]])
B = np.array([[0.0, 0.1], [0.3, 0.0], [1.0, 0.5]])
C = np.array([[1.0, 0.0, 0.2], [0.0, 1.0, -0.5]])
TRUE = StateSpace(A, B, C, np.zeros((2, 2)), np.zeros((3, 2)), 0.1, np.zeros((3, 0)), np.zeros((2, 2)))
EXACT = PredictiveSettings(past=4, horizon=10, input_weight=0.01, solver="CLARABEL")


def recorded(seed: int, rows: int = 150, noise: float = 0.0) -> Series:
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((rows, 2))
    return Series(u, TRUE.simulate(u, rng.standard_normal(3)) + noise * rng.standard_normal((rows, 2)), 0.1)


def asked(law: DeePC | SubspacePredictive, seed: int) -> FloatArray:
    s, rng = recorded(seed), np.random.default_rng(seed)
    return law.inputs(s.u[:4], s.y[:4], rng.standard_normal((10, 2)))


@pytest.mark.parametrize("limit", [np.inf, 0.8])
def test_same_as_with_the_model_on_noise_free_data(limit: float) -> None:
    settings = replace(EXACT, limit=limit)
    data, model = DeePC([recorded(0), recorded(1)], settings), SubspacePredictive(TRUE, settings)
    for seed in range(5, 10):
        u = asked(data, seed)
        assert np.max(np.abs(u - asked(model, seed))) < 1e-6
        assert np.max(np.abs(u)) <= limit + 1e-7


def test_same_as_subspace_identification_and_predictive_control() -> None:
    found = Subspace(3, past=8, feedthrough=False, weights="n4sid").fit([recorded(0, 600), recorded(1, 600)]).as_state_space()
    data, model = DeePC([recorded(0), recorded(1)], EXACT), SubspacePredictive(found, EXACT)
    for seed in range(5, 8):
        assert np.max(np.abs(asked(data, seed) - asked(model, seed))) < 1e-3


def test_solvers_agree_and_the_horizon_follows_the_reference() -> None:
    fast = DeePC([recorded(0), recorded(1)], replace(EXACT, solver="OSQP"))
    assert np.max(np.abs(asked(fast, 6) - asked(DeePC([recorded(0), recorded(1)], EXACT), 6))) < 1e-4
    cheap = DeePC([recorded(0), recorded(1)], replace(EXACT, input_weight=1e-8))
    s, wanted = recorded(9), np.tile([1.0, 0.0], (10, 1))
    u = cheap.inputs(s.u[:4], s.y[:4], wanted)
    y = TRUE.simulate(np.concatenate([s.u[:4], u]), TRUE.first_state(s.u[:40], s.y[:40]))[4:]
    assert np.max(np.abs(y[5:] - wanted[5:])) < 0.05


def test_noise_makes_it_worse_but_not_wild() -> None:
    exact = asked(SubspacePredictive(TRUE, EXACT), 7)
    noisy = asked(DeePC([recorded(k, 400, 0.02) for k in range(3)], EXACT), 7)
    assert 1e-6 < np.sqrt(np.mean((noisy - exact) ** 2)) < 0.3 * np.sqrt(np.mean(exact**2))


def test_what_can_not_be_is_said() -> None:
    with pytest.raises(DataError, match="stretches"):
        DeePC([recorded(0, 40)], EXACT)
    still = Series(np.zeros((300, 2)), recorded(0, 300).y, 0.1)
    with pytest.raises(DataError, match="excite"):
        DeePC([still], EXACT)
    with pytest.raises(SettingsError, match="solver"):
        PredictiveSettings(solver="best")
    with pytest.raises(SettingsError, match="above 0"):
        PredictiveSettings(limit=0.0)


def test_joint_with_friction_is_followed_better_than_by_a_model_without_it() -> None:
    found = {run.law: run for run in follow(seed=3, seconds=3.0)}
    assert set(found) == {"pd", "computed_torque", "deepc"}
    assert found["deepc"].rms < 0.2 * found["computed_torque"].rms
    assert found["pd"].rms > 0.0
