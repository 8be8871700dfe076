"""Koopman models: exact where the dictionary holds the motion, chosen by what was left out, and honest about their horizon."""

from __future__ import annotations

import numpy as np
import pytest

from sysid_ros.blackbox import Series
from sysid_ros.blackbox.dictionary import linear, polynomial, robot, thin_plates
from sysid_ros.blackbox.koopman import Koopman, horizon
from sysid_ros.exceptions import DataError, SettingsError


def linear_run(seed: int, rows: int = 200) -> Series:
    rng = np.random.default_rng(seed)
    x, Y, U = rng.standard_normal(2), [], []
    for _ in range(rows):
        u = rng.standard_normal(1)
        Y.append(x)
        U.append(u)
        x = np.array([[0.9, 0.2], [-0.2, 0.9]]) @ x + np.array([0.0, 0.5]) * u
    return Series(np.array(U), np.array(Y), 0.1)


def slow_manifold(seed: int, rows: int = 120) -> Series:
    """x1' = a x1, x2' = b x2 + (a^2 - b) x1^2 + u in steps: linear in x1, x2, x1^2 (Brunton et al. 2016)."""
    rng = np.random.default_rng(seed)
    x, Y, U = rng.uniform(-1.0, 1.0, 2), [], []
    for _ in range(rows):
        u = 0.3 * rng.standard_normal(1)
        Y.append(x)
        U.append(u)
        x = np.array([0.95 * x[0], 0.8 * x[1] + (0.95**2 - 0.8) * x[0] ** 2 + u[0]])
    return Series(np.array(U), np.array(Y), 0.1)


def test_dmd_with_control_is_exact_on_a_linear_motion() -> None:
    model = Koopman().fit([linear_run(s) for s in range(4)])
    other = linear_run(9)
    assert np.max(np.abs(model.predict(other) - other.y)) < 1e-6
    found = model.as_state_space()
    assert found is None or np.allclose(np.sort(np.abs(found.poles.imag))[-2:], abs(np.angle(0.9 + 0.2j)) / 0.1, atol=1e-6)


def test_dictionary_makes_the_motion_linear_and_the_state_space_says_the_same() -> None:
    runs = [slow_manifold(s) for s in range(8)]
    model = Koopman(polynomial(2), relift=False).fit(runs)
    other = slow_manifold(50)
    assert np.max(np.abs(model.predict(other) - other.y)) < 1e-4
    assert np.max(np.abs(Koopman(linear(), relift=False).fit(runs).predict(other) - other.y)) > 0.02
    space = model.as_state_space()
    assert space is not None
    psi = polynomial(2)(other.y[:1])[0]
    assert np.allclose(space.simulate(other.u, psi), model.predict(other), atol=1e-6)
    assert Koopman(polynomial(2), relift=True).fit(runs).as_state_space() is None


def test_delays_make_up_for_what_is_not_seen() -> None:
    half = [Series(s.u, s.y[:, :1], s.period) for s in (linear_run(k) for k in range(5))]
    blind, other = Koopman(delays=1).fit(half[:4]), half[4]
    seeing = Koopman(delays=2).fit(half[:4])
    assert np.sqrt(np.mean((seeing.predict(other) - other.y) ** 2)) < 1e-5
    assert np.sqrt(np.mean((blind.predict(other) - other.y) ** 2)) > 0.1
    assert np.allclose(seeing.predictions(other, np.array([20]), 30)[1][0], other.y[20:50])


def test_ridge_is_larger_where_noise_is() -> None:
    def ridge(noise: float) -> float:
        rng = np.random.default_rng(0)
        runs = [Series(s.u, s.y + noise * rng.standard_normal(s.y.shape), s.period) for s in map(slow_manifold, range(4))]
        found = Koopman(thin_plates(runs[0].y[:60:2])).fit(runs).ridge
        assert found is not None
        return found

    assert ridge(0.2) > ridge(0.0)


def test_robot_dictionary_is_that_of_a_pendulum() -> None:
    d = robot(1, 2)
    x = np.array([[0.3, 2.0]])
    lifted = d(x)[0]
    for value in (0.3, 2.0, 1.0, np.sin(0.3), np.cos(0.3), np.sin(0.6), np.cos(0.6), 4.0, 2.0 * np.sin(0.3), 2.0 * np.cos(0.3)):
        assert np.min(np.abs(lifted - value)) < 1e-12


@pytest.mark.parametrize("starts", [30, 300])
def test_stated_horizon_is_kept_on_other_starts(starts: int) -> None:
    rng = np.random.default_rng(1)
    kept = []
    for _ in range(60):
        errors = np.cumsum(rng.standard_normal((starts + 2000, 60, 1)), axis=1)
        told = horizon(errors[:starts], np.array([8.0]), 0.1)
        kept.append(horizon(errors[starts:], np.array([8.0]), 0.1).within[told.steps - 1] if told.steps else 1.0)
    # no more than one statement in ten is too long
    assert np.mean(np.array(kept) < 0.9) <= 0.16
    assert np.mean(kept) < 0.995


def test_horizon_says_when_another_model_is_better() -> None:
    own = np.ones((20, 30, 1)) * np.arange(1, 31)[:, None]
    assert horizon(own, np.array([100.0]), 0.5, others=np.full_like(own, 10.5)).passes == pytest.approx(5.5)
    assert horizon(own, np.array([100.0]), 0.5, others=np.full_like(own, 99.0)).passes is None
    assert horizon(own, np.array([0.5]), 0.5).seconds == 0.0


def test_what_can_not_be_is_said() -> None:
    with pytest.raises(SettingsError, match="delays"):
        Koopman(delays=0)
    with pytest.raises(SettingsError, match="degree"):
        polynomial(1)
    with pytest.raises(DataError, match="stretches"):
        Koopman(delays=5).fit([linear_run(0, 22)])
    with pytest.raises(SettingsError, match="not fitted"):
        Koopman().predict(linear_run(0))
