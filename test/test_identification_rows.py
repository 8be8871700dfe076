"""Rows of the equation: zero phase, the two forms, gaps, memory, and base parameters in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from arm_recordings import START, hidden_parameters, recorded
from robots import ROBOTS, random_sample, robot

from sysid_ros.exceptions import DataError
from sysid_ros.identification import Recording, bag_sums, collect_rows, free_model, rows
from sysid_ros.identification.base_groups import base_of_range, determined_by, group_matrix, in_words
from sysid_ros.signals.zero_phase import GaussianLowPass, KinematicFilter, on_even_grid

MODEL = robot("iiwa")
TRUTH = hidden_parameters(MODEL, 2)


@pytest.mark.parametrize("rate", [95.0, 250.0, 1000.0])
@pytest.mark.parametrize("frequency", [0.3, 2.0, 5.0])
def test_derivatives_have_neither_phase_nor_gain_below_the_cut_off(rate: float, frequency: float) -> None:
    t = START + np.arange(int(12 * rate)) / rate
    w = 2.0 * np.pi * frequency
    q = 7.0 + np.sin(w * t)[:, None]
    motion = KinematicFilter(1.0 / rate, 5.0).apply(t, q, None, 3.0 * q)
    assert motion is not None
    angle = w * motion.t[:, None]
    np.testing.assert_allclose(motion.q, 7.0 + np.sin(angle), atol=1e-3)
    np.testing.assert_allclose(motion.v, w * np.cos(angle), atol=1e-3 * w)
    np.testing.assert_allclose(motion.a, -(w**2) * np.sin(angle), atol=1e-3 * w**2)
    np.testing.assert_allclose(motion.tau, 3.0 * motion.q, atol=1e-9)


def test_a_measured_velocity_is_used_where_it_is_asked_for() -> None:
    t = np.arange(3000) / 500.0
    q, v = np.sin(t)[:, None], 2.0 * np.cos(t)[:, None]
    of_message = KinematicFilter(0.002, 5.0).apply(t, q, v, q)
    assert of_message is not None
    np.testing.assert_allclose(of_message.v, 2.0 * np.cos(of_message.t)[:, None], atol=1e-4)
    np.testing.assert_allclose(of_message.a, -2.0 * np.sin(of_message.t)[:, None], atol=1e-4)


@pytest.mark.parametrize("cutoff", [2.0, 5.0, 12.0])
def test_the_low_pass_is_3_db_down_at_its_cut_off(cutoff: float) -> None:
    period = 1.0 / 250.0
    low_pass = GaussianLowPass(cutoff, period)
    times = period * np.arange(-low_pass.half, low_pass.half + 1)
    assert low_pass.kernel.sum() == pytest.approx(1.0)
    gain = low_pass.kernel @ np.cos(2.0 * np.pi * cutoff * times)
    assert gain == pytest.approx(np.sqrt(0.5), rel=0.01)
    assert low_pass.slope @ (3.0 + 2.0 * times) == pytest.approx(2.0)


def test_an_even_grid_changes_nothing_on_even_stamps_and_is_cubic_on_others() -> None:
    rng = np.random.default_rng(0)
    t = START + np.arange(500) / 100.0
    x = np.sin(3.0 * t)[:, None]
    even, same = on_even_grid(t, x, 0.01)
    np.testing.assert_array_equal(same, x)
    uneven = np.sort(t + 0.003 * rng.uniform(-1.0, 1.0, 500))
    even, values = on_even_grid(uneven, np.sin(3.0 * uneven)[:, None], 0.01)
    np.testing.assert_allclose(values, np.sin(3.0 * even)[:, None], atol=1e-5)
    assert np.allclose(np.diff(even), 0.01)


@pytest.mark.parametrize("robot_name", ROBOTS)
@pytest.mark.parametrize("form", rows.FORMS)
def test_both_forms_explain_the_torque(robot_name: str, form: str) -> None:
    model = robot(robot_name)
    truth = hidden_parameters(model, 4)
    recording = recorded(model, truth, 4, seconds=6.0, torque_noise=0.0, encoder_noise=0.0)
    bag = collect_rows(free_model(model), recording, "exact", 5.0, form=form)
    residual = bag.y - bag.Y @ truth
    assert np.sqrt(np.mean(residual**2)) < 1e-3 * np.sqrt(np.mean(bag.tau**2))


def test_the_forms_agree_row_by_row() -> None:
    recording = recorded(MODEL, TRUTH, 1, seconds=6.0)
    by_acceleration, by_momentum = (collect_rows(free_model(MODEL), recording, "", 5.0, form=form) for form in rows.FORMS)
    np.testing.assert_array_equal(by_acceleration.y, by_momentum.y)
    size = np.abs(by_acceleration.Y).max(axis=(0, 1))
    np.testing.assert_allclose(by_momentum.Y / (size + 1e-9), by_acceleration.Y / (size + 1e-9), atol=0.02)


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_the_momentum_without_acceleration_is_the_inverse_dynamics(robot_name: str) -> None:
    """d/dt(Y_p pi) + Y_r pi along a motion, the derivative by differences, equals RNEA."""
    model, step = robot(robot_name), 1e-6
    rng = np.random.default_rng(0)
    for _ in range(5):
        s = random_sample(model, rng)
        before, after = (
            model.momentum_regressors(s.q + h * s.v + 0.5 * h * h * s.a, s.v + h * s.a)[0] @ model.pi for h in (-step, step)
        )
        tau = (after - before) / (2.0 * step) + model.momentum_regressors(s.q, s.v)[1] @ model.pi
        expected = model.rnea(s.q, s.v, s.a)
        np.testing.assert_allclose(tau, expected, atol=1e-6 * np.abs(expected).max() + 1e-6)
    np.testing.assert_allclose(np.linalg.norm(model.gravity), 9.81)


def test_long_recordings_keep_their_rows_in_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = recorded(MODEL, TRUTH, 1, seconds=5.0)
    inside = collect_rows(free_model(MODEL), recording, "", 5.0)
    monkeypatch.setattr(bag_sums, "_IN_MEMORY", 1e5)
    outside = collect_rows(free_model(MODEL), recording, "", 5.0)
    assert isinstance(outside.Y, np.memmap)
    np.testing.assert_array_equal(outside.Y, inside.Y)


def test_pieces_do_not_change_the_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = recorded(MODEL, TRUTH, 1, seconds=5.0)
    whole = collect_rows(free_model(MODEL), recording, "", 5.0)
    monkeypatch.setattr(rows, "_CHUNK", 7)
    np.testing.assert_allclose(collect_rows(free_model(MODEL), recording, "", 5.0).Y, whole.Y, atol=1e-12)


def test_what_is_spoiled_does_not_count() -> None:
    recording = recorded(MODEL, TRUTH, 1, seconds=8.0)
    spoiled = np.zeros(recording.tau.shape, dtype=bool)
    spoiled[800:900, 2] = True
    tau = recording.tau.copy()
    tau[spoiled] = 1e4
    bag = collect_rows(free_model(MODEL), replace(recording, tau=tau), "", 5.0, spoiled=spoiled)
    assert np.abs((bag.y - bag.Y @ TRUTH)[bag.moving]).max() < 3.0
    assert not bag.moving[(bag.t > START + 3.2) & (bag.t < START + 3.6), 2].any()


def test_a_recording_is_gathered_in_the_order_of_its_measurements() -> None:
    from sysid_ros.sample import Measurement

    stream = [Measurement(0.01 * k, np.array([k, 0.0]), None, np.array([0.0, k])) for k in range(20_000)]
    seen: list[int] = []
    recording = Recording.from_measurements("x", iter(stream), seen.append)
    assert sum(seen) == 20_000
    np.testing.assert_array_equal(recording.q[:, 0], np.arange(20_000.0))
    assert recording.v is None
    assert recording.period == pytest.approx(0.01)
    with pytest.raises(DataError, match="nothing"):
        Recording.from_measurements("nothing", [])


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_groups_make_the_torque_of_all_parameters(robot_name: str) -> None:
    """With friction, rotors and offsets in: two sets of parameters with the same groups make the same torque."""
    model = free_model(robot(robot_name))
    base = base_of_range(model)
    T = group_matrix(base)
    rng = np.random.default_rng(0)
    theta = rng.normal(size=model.p)
    null = np.linalg.svd(T)[2][base.rank :]
    other = theta + rng.normal(size=len(null)) @ null
    np.testing.assert_allclose(T @ other, T @ theta, atol=1e-9)
    for _ in range(20):
        Y, _ = model.split(random_sample(robot(robot_name), rng))
        np.testing.assert_allclose(Y @ other, Y @ theta, atol=2e-4 * np.abs(Y @ theta).max())
    assert base.rank == np.linalg.matrix_rank(T)


def test_groups_of_an_arm_that_is_known_by_heart() -> None:
    """small_arm: a column, two links that turn about parallel axes 0.4 m apart, and a slide."""
    model = free_model(robot("small_arm"))
    base = base_of_range(model)
    T = group_matrix(base)
    words = [
        in_words(model.parameter_names[i], [(T[g, d], model.parameter_names[d]) for d in base.dependent if abs(T[g, d]) > 1e-4])
        for g, i in enumerate(base.independent)
    ]
    assert "mc_x[upper_arm] + 0.4 m[forearm]" in words
    assert "Fc[slide]" in words
    assert "offset[turn]" in words


def test_words() -> None:
    assert in_words("a", [(1.0, "b"), (-1.0, "c"), (0.25, "d")]) == "a + b - c + 0.25 d"
    assert [determined_by(x) for x in (0.99, 0.6, 0.1)] == ["bags", "bags and prior", "prior"]
