"""Subspace identification: exact on noise-free data, blind to order of recordings, honest under feedback and about its spread."""

from __future__ import annotations

import numpy as np
import pytest

from sysid_ros.blackbox import Channels, Series, Subspace, mode_estimates, stabilisation
from sysid_ros.blackbox.mode_spread import assurance
from sysid_ros.blackbox.moments import WEIGHTS
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

PERIOD = 0.05
A = np.array([[0.95, 0.25, 0.0], [-0.25, 0.95, 0.1], [0.0, 0.0, 0.6]])
B = np.array([[0.0], [0.3], [1.0]])
C = np.array([[1.0, 0.0, 0.2], [0.0, 1.0, -0.5]])


def record(seed: int, rows: int = 800, noise: float = 0.0, gain: float = 0.0) -> Series:
    """One input, two outputs; feedback of the first output with a gain, noise of both."""
    rng = np.random.default_rng(seed)
    x, u, y = rng.standard_normal(3), np.zeros((rows, 1)), np.zeros((rows, 2))
    for k in range(rows):
        y[k] = C @ x + noise * rng.standard_normal(2)
        u[k] = rng.standard_normal() - gain * y[k, 0]
        x = A @ x + B @ u[k] + noise * 0.3 * rng.standard_normal(3)
    return Series(u, y, PERIOD, f"seed {seed}")


def eigenvalues(A: FloatArray) -> FloatArray:
    return np.asarray(np.sort_complex(np.linalg.eigvals(A).astype(complex)))


@pytest.mark.parametrize("weights", WEIGHTS)
def test_exact_where_there_is_no_noise(weights: str) -> None:
    model = Subspace(3, past=12, weights=weights).fit([record(0), record(1)])
    assert np.allclose(eigenvalues(model.as_state_space().A), eigenvalues(A), atol=1e-4)
    other = record(7, 200)
    assert np.max(np.abs(model.predict(other) - other.y)) < 1e-2 * np.std(other.y)
    f = np.array([0.1, 1.0, 3.0])
    true = C @ np.linalg.solve(np.exp(2j * np.pi * f * PERIOD)[:, None, None] * np.eye(3) - A, np.broadcast_to(B, (3, 3, 1)))
    assert np.allclose(model.as_state_space().response(f), true, rtol=2e-3)


@pytest.mark.parametrize("weights", ["pbsid", "ssarx"])
def test_feedback_does_not_bias_predictor_based_methods(weights: str) -> None:
    def error(name: str) -> float:
        found = [
            Subspace(3, past=15, weights=name, feedthrough=False).fit([record(s, 3000, 0.5, -0.25)]).as_state_space().A
            for s in range(6)
        ]
        mean = np.mean([eigenvalues(x) for x in found], axis=0)
        return float(np.max(np.abs(mean - eigenvalues(A))[np.abs(eigenvalues(A)) > 0.9]))

    assert error(weights) < 0.01


def test_order_of_recordings_does_not_matter_and_gaps_are_not_bridged() -> None:
    one, two = record(2, noise=0.1), record(3, noise=0.1)
    a = Subspace(3, past=12).fit([one, two]).as_state_space()
    b = Subspace(3, past=12).fit([two, one]).as_state_space()
    assert np.allclose(eigenvalues(a.A), eigenvalues(b.A), atol=1e-8)
    # one series of both behind each other has a jump in it, which tells on the noise
    both = Series(np.concatenate([one.u, two.u]), np.concatenate([one.y, two.y + 50.0]), PERIOD)
    assert np.trace(Subspace(3, past=12).fit([both]).as_state_space().noise) > 1.5 * np.trace(a.noise)


@pytest.mark.parametrize("criterion", ["heldout", "bic"])
def test_order_is_found(criterion: str) -> None:
    found = [Subspace(past=12, criterion=criterion, feedthrough=False).fit([record(s, 2000, 0.05)]).order for s in range(5)]
    assert sorted(found)[2] == 3, found


def test_choice_has_all_criteria() -> None:
    model = Subspace(past=12, highest=6).fit([record(0, 2000, 0.1)])
    assert model.choice is not None
    assert model.choice.orders == tuple(range(7))
    assert len(model.choice.aic) == len(model.choice.bic) == len(model.choice.heldout) == 7
    assert model.choice.heldout[0] == pytest.approx(1.0)
    assert model.choice.heldout[3] < 0.5
    assert model.choice.singular_values[0] == 1.0


def test_intervals_hold_the_truth_and_shrink_with_data() -> None:
    pole = np.log(0.95 + 0.25j) / PERIOD
    f, damping = abs(pole) / (2.0 * np.pi), -pole.real / abs(pole)
    held = []
    for seed in range(20):
        (mode,) = mode_estimates(Subspace(3, past=15, feedthrough=False).fit([record(seed, 1500, 0.2)]), draws=60)
        assert mode.frequency_ci95 is not None
        assert mode.damping_ci95 is not None
        held += [mode.frequency_ci95[0] < f < mode.frequency_ci95[1], mode.damping_ci95[0] < damping < mode.damping_ci95[1]]
    assert sum(held) >= 32
    (long,) = mode_estimates(Subspace(3, past=15).fit([record(1, 12000, 0.2)]), draws=60)
    assert long.frequency_std is not None
    assert mode.frequency_std is not None
    assert long.frequency_std < 0.6 * mode.frequency_std


def test_mode_has_the_shape_of_the_outputs() -> None:
    (mode,) = mode_estimates(Subspace(3, past=12).fit([record(0), record(1)]), draws=20)
    values, vectors = np.linalg.eig(A)
    true = C @ vectors[:, int(np.argmax(values.imag))]
    assert assurance(mode.shape, true) > 0.999


def test_true_mode_stays_as_the_order_grows_and_others_do_not() -> None:
    model = Subspace(8, past=20).fit([record(4, 4000, 0.3)])
    assert model.moments is not None
    found = stabilisation(model.moments, model.blocks.sum(axis=0), range(2, 15), PERIOD)
    true = abs(np.log(0.95 + 0.25j)) / PERIOD / (2.0 * np.pi)
    own = [abs(m.pair.frequency - true) < 0.05 * true for m in found if m.stays]
    assert sum(own) >= 8
    assert sum(own) > 2 * (len(own) - sum(own))


def test_recordings_are_predicted_at_their_own_stamps() -> None:
    s = record(5, 1200)
    recording = Recording("bag", s.t, s.y, None, np.hstack([s.u, np.zeros_like(s.u)]))
    # the first effort is the input; the second one rests
    model = Subspace(3, past=12, channels=Channels(("tau",), ("q",))).fit([recording])
    predicted = model.predict(recording)
    assert predicted.shape == (1200, 2)
    assert np.nanmax(np.abs(predicted - s.y)) < 0.05 * np.std(s.y)


def test_what_can_not_be_is_said() -> None:
    with pytest.raises(SettingsError, match="weights"):
        Subspace(2, weights="best").fit([record(0)])
    with pytest.raises(DataError, match="too few"):
        Subspace(2, past=20).fit([record(0, 40)])
    with pytest.raises(SettingsError, match="not fitted"):
        Subspace(2).predict(record(0))
    with pytest.raises(SettingsError, match="channel"):
        Channels(("current",), ("q",))
    with pytest.raises(DataError, match="no number"):
        Series(np.zeros((30, 1)), np.full((30, 1), np.nan), 0.1)
