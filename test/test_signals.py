"""Derivatives and low-pass: exact where mathematics says so, on the stamps as they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from sysid_ros.sample import FloatArray, Measurement, Sample
from sysid_ros.signals.causal_filters import CausalDerivative
from sysid_ros.signals.cutoff import default_cutoff, window_half_width
from sysid_ros.signals.low_pass import LowPassBank, butterworth_sections
from sysid_ros.signals.window_weights import slope_weights, value_weights

PERIOD = 0.004


def cubic(t: FloatArray, order: int = 0) -> FloatArray:
    """Two cubics, or a derivative of them, shape (len(t), 2)."""
    polynomials = [np.polynomial.Polynomial(c) for c in ([0.3, -1.0, 2.0, -1.5], [-0.5, 0.7, -3.0, 2.0])]
    return np.column_stack([p.deriv(order)(t) if order else p(t) for p in polynomials])


def stamps(count: int, jitter: float = 0.0, lost: float = 0.0, seed: int = 0) -> FloatArray:
    rng = np.random.default_rng(seed)
    t = PERIOD * (np.arange(count) + jitter * rng.uniform(-1.0, 1.0, count))
    kept: FloatArray = t[rng.uniform(size=count) >= lost]
    return kept


def push_all(derivative: CausalDerivative, t: FloatArray, q: FloatArray, v: FloatArray | None = None) -> list[Sample]:
    tau = np.column_stack([np.sin(t), np.cos(t)])
    return [s for k in range(len(t)) for s in derivative.push(Measurement(t[k], q[k], None if v is None else v[k], tau[k]))]


IRREGULAR = pytest.mark.parametrize(("jitter", "lost"), [(0.0, 0.0), (0.4, 0.0), (0.0, 0.2), (0.3, 0.3)])


@IRREGULAR
@pytest.mark.parametrize("half_width", [2, 3, 10])
def test_position_velocity_and_acceleration_of_a_cubic_are_exact_on_any_stamps(
    jitter: float, lost: float, half_width: int
) -> None:
    t = stamps(200, jitter, lost)
    samples = push_all(CausalDerivative(2, PERIOD, half_width), t, cubic(t))
    at = np.array([s.t for s in samples])
    np.testing.assert_allclose([s.q for s in samples], cubic(at), atol=1e-12)
    np.testing.assert_allclose([s.v for s in samples], cubic(at, 1), atol=1e-9)
    np.testing.assert_allclose([s.a for s in samples], cubic(at, 2), atol=1e-7)


@IRREGULAR
@pytest.mark.parametrize("half_width", [2, 10])
def test_samples_are_even_in_time_and_late_by_the_window(jitter: float, lost: float, half_width: int) -> None:
    t = stamps(200, jitter, lost)
    derivative = CausalDerivative(2, PERIOD, half_width)
    times: list[float] = []
    for k in range(len(t)):
        new = derivative.push(Measurement(t[k], cubic(t[k : k + 1])[0], None, np.zeros(2)))
        times += [s.t for s in new]
        if new:
            assert half_width * PERIOD <= t[k] - new[-1].t <= (half_width + 3) * PERIOD + max(np.diff(t))
    np.testing.assert_allclose(np.diff(times), PERIOD, rtol=1e-6)
    assert len(times) >= 200 - 2 * half_width - 8


def test_even_stamps_are_left_as_they_are() -> None:
    t, rng = stamps(300), np.random.default_rng(0)
    q = rng.normal(size=(300, 2))
    by_time = {round(x / PERIOD): k for k, x in enumerate(t)}
    derivative = CausalDerivative(2, PERIOD, 4)
    for sample in push_all(derivative, t, q):
        k = by_time[round(sample.t / PERIOD)]
        np.testing.assert_allclose(sample.q, value_weights(4) @ q[k - 4 : k + 5], atol=1e-9)
        np.testing.assert_allclose(sample.tau, [np.sin(t[k]), np.cos(t[k])], atol=1e-9)
        np.testing.assert_allclose(sample.a, (q[k + 1] - 2 * q[k] + q[k - 1]) / PERIOD**2, atol=1e-3)
        slope = signal.savgol_coeffs(9, 3, deriv=1, delta=PERIOD, use="dot") @ q[k - 4 : k + 5]
        np.testing.assert_allclose(sample.v, slope, atol=1e-6)
    assert derivative.filled == 0


@pytest.mark.parametrize("half_width", [2, 3, 10])
def test_noise_of_the_position_does_not_correlate_with_the_accelerations(half_width: int) -> None:
    weights = value_weights(half_width)
    x = np.arange(-half_width, half_width + 1.0)
    for power in range(4):
        np.testing.assert_allclose(weights @ x**power, 1.0 if power == 0 else 0.0, atol=1e-9 * half_width**power)
    middle = slice(half_width - 1, half_width + 2)
    np.testing.assert_allclose(weights[middle] @ [1.0, -2.0, 1.0], 0.0, atol=1e-12)
    assert np.sum(weights**2) < 1.0


@IRREGULAR
def test_every_channel_belongs_to_the_same_instant(jitter: float, lost: float) -> None:
    t = stamps(200, jitter, lost)
    for sample in push_all(CausalDerivative(2, PERIOD, 4), t, cubic(t)):
        np.testing.assert_allclose(sample.tau, [np.sin(sample.t), np.cos(sample.t)], atol=1e-4)


def test_what_was_filled_over_gaps_is_counted() -> None:
    t = np.delete(stamps(200), [50, 100, 101, 102])
    derivative = CausalDerivative(2, PERIOD, 4)
    push_all(derivative, t, cubic(t))
    assert derivative.filled == 4


def test_the_torque_in_a_gap_is_a_straight_line() -> None:
    """A cubic through its noise would swing out."""
    t = np.delete(stamps(60), range(30, 36))
    rng = np.random.default_rng(0)
    derivative = CausalDerivative(1, PERIOD, 2)
    tau = rng.normal(size=len(t))
    samples = [s for k in range(len(t)) for s in derivative.push(Measurement(t[k], np.zeros(1), None, tau[k : k + 1]))]
    for sample in samples:
        assert sample.t < t[29] or sample.t > t[30] or min(tau[29:31]) - 1e-9 <= sample.tau[0] <= max(tau[29:31]) + 1e-9


def test_stamps_of_today_cost_no_accuracy() -> None:
    """Seconds since 1970 leave 0.2 microseconds of the 4 milliseconds."""
    t = 1.7e9 + stamps(100)
    for sample in push_all(CausalDerivative(2, PERIOD, 5), t, cubic(t - 1.7e9)):
        at = np.array([sample.t - 1.7e9])
        np.testing.assert_allclose(sample.v, cubic(at, 1)[0], atol=2e-3)
        np.testing.assert_allclose(sample.a, cubic(at, 2)[0], atol=0.1)


def test_the_velocity_is_smoother_than_a_difference() -> None:
    rng = np.random.default_rng(0)
    t = stamps(3000)
    samples = push_all(CausalDerivative(2, PERIOD, 5), t, 1e-4 * rng.normal(size=(3000, 2)))
    difference = 1e-4 / (np.sqrt(2.0) * PERIOD)  # standard deviation of a central difference
    assert np.std([s.v for s in samples]) < 0.7 * difference


def test_velocity_of_the_message_where_it_has_one() -> None:
    t = stamps(60)
    samples = push_all(CausalDerivative(2, PERIOD, 5, use_message_velocity=True), t, cubic(t), cubic(t, 1) + 7.0)
    assert samples
    for sample in samples:
        np.testing.assert_allclose(sample.v, cubic(np.array([sample.t]), 1)[0] + 7.0, atol=1e-9)
    ignored = push_all(CausalDerivative(2, PERIOD, 5), t, cubic(t), cubic(t, 1) + 7.0)
    without = push_all(CausalDerivative(2, PERIOD, 5, use_message_velocity=True), t, cubic(t), None)
    for sample in (*ignored, *without):
        np.testing.assert_allclose(sample.v, cubic(np.array([sample.t]), 1)[0], atol=1e-9)


def test_samples_are_values() -> None:
    t = stamps(40)
    samples = push_all(CausalDerivative(2, PERIOD, 3), t, cubic(t))
    np.testing.assert_allclose([s.q for s in samples], cubic(np.array([s.t for s in samples])), atol=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        samples[0].q[0] = 1.0


@pytest.mark.parametrize(("cutoff", "rate"), [(10.0, 1000.0), (10.0, 250.0), (5.0, 100.0), (0.5, 10.0)])
def test_low_pass_is_scipys_primed_with_the_first_input(cutoff: float, rate: float) -> None:
    x = np.random.default_rng(0).normal(size=(300, 2, 3)) + 5.0
    sections = signal.butter(4, cutoff, output="sos", fs=rate)
    state = signal.sosfilt_zi(sections)[:, :, None, None] * x[0]
    expected, _ = signal.sosfilt(sections, x, axis=0, zi=state)
    bank = LowPassBank((2, 3), cutoff, rate)
    np.testing.assert_allclose([bank.push(row).copy() for row in x], expected, rtol=1e-9, atol=1e-9)
    bank.reset()
    np.testing.assert_allclose([bank.push(row).copy() for row in x], expected, rtol=1e-9, atol=1e-9)


def test_low_pass_has_unit_gain_from_the_first_sample() -> None:
    constant = np.array([[3.0, -7.0]])
    bank = LowPassBank((1, 2), 10.0, 500.0)
    for _ in range(200):
        np.testing.assert_allclose(bank.push(constant), constant, rtol=1e-9)


def test_low_pass_treats_every_channel_alike_and_is_linear() -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(100, 4))
    mix = rng.normal(size=(4, 4))
    one, other = LowPassBank((4,), 8.0, 200.0), LowPassBank((4,), 8.0, 200.0)
    for row in x:
        np.testing.assert_allclose(other.push(mix @ row), mix @ one.push(row), atol=1e-9)


@pytest.mark.parametrize(("cutoff", "rate"), [(10.0, 1000.0), (10.0, 250.0), (5.0, 100.0)])
def test_delay_is_the_group_delay(cutoff: float, rate: float) -> None:
    bank = LowPassBank((1,), cutoff, rate)
    t = np.arange(0.0, 3.0, 1.0 / rate)
    out = np.array([bank.push(np.array([value]))[0] for value in t])  # a ramp comes out as late as the group delay
    assert t[-1] - out[-1] == pytest.approx(bank.delay, rel=0.02)


@pytest.mark.parametrize(("cutoff", "rate"), [(10.0, 1000.0), (5.0, 100.0)])
def test_an_input_has_left_after_the_memory(cutoff: float, rate: float) -> None:
    bank = LowPassBank((1,), cutoff, rate)
    bank.push(np.zeros(1))
    for _ in range(round(1.0 * rate)):
        last = bank.push(np.ones(1))[0]
    assert last == pytest.approx(1.0, abs=1e-3)
    count = round(bank.memory * rate)
    after = [bank.push(np.zeros(1))[0] for _ in range(count + 1)][-1]
    assert abs(after) < 0.02


@pytest.mark.parametrize(
    ("rate", "half_width", "cutoff"), [(1000.0, 10, 10.0), (250.0, 2, 10.0), (100.0, 2, 5.0), (4000.0, 15, 10.0), (10.0, 2, 0.5)]
)
def test_filters_for_a_rate(rate: float, half_width: int, cutoff: float) -> None:
    assert window_half_width(rate) == half_width
    assert default_cutoff(rate) == cutoff


@pytest.mark.parametrize("order", [2, 4, 6])
@pytest.mark.parametrize("part", [0.001, 0.05, 0.4])
def test_sections_are_a_butterworth_low_pass(order: int, part: float) -> None:
    """The same answer to an impulse as scipy's, and each section lets pass what is constant."""
    rate, impulse = 250.0, np.eye(1, 2000)[0]
    sections = butterworth_sections(order, part * rate, rate)
    expected = signal.sosfilt(signal.butter(order, part * rate, output="sos", fs=rate), impulse)
    np.testing.assert_allclose(signal.sosfilt(sections, impulse), expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(sections[:, :3].sum(axis=1), sections[:, 3:].sum(axis=1), rtol=1e-9)


@pytest.mark.parametrize("half_width", [2, 3, 10, 15])
def test_slope_weights_are_those_of_savitzky_and_golay(half_width: int) -> None:
    expected = signal.savgol_coeffs(2 * half_width + 1, 3, deriv=1, delta=PERIOD, use="dot")
    np.testing.assert_allclose(slope_weights(half_width, PERIOD), expected, rtol=1e-9, atol=1e-9 / PERIOD)


def test_single_torques_that_fit_no_neighbour_are_taken_out_and_counted() -> None:
    """Steps, noise and what is quiet are left alone."""
    rng = np.random.default_rng(0)
    t = PERIOD * np.arange(3000)
    clean = np.stack([5.0 * np.sin(t), 10.0 * (t > 6.0) + np.cos(3.0 * t)], axis=1) + 0.05 * rng.normal(size=(3000, 2))
    hit = rng.uniform(size=clean.shape) < 0.002
    hit[:100] = False
    hit[1:] &= ~hit[:-1]
    spiked, plain = CausalDerivative(2, PERIOD, 3), CausalDerivative(2, PERIOD, 3)
    of_spiked, of_plain = [], []
    for k, row in enumerate(clean):
        of_plain += plain.push(Measurement(t[k], np.zeros(2), None, row))
        of_spiked += spiked.push(Measurement(t[k], np.zeros(2), None, row + 30.0 * hit[k]))
    assert plain.spikes == 0
    assert spiked.spikes == hit.sum() > 5
    far = np.array([a.tau - b.tau for a, b in zip(of_spiked, of_plain, strict=True)])
    assert np.abs(far).max() < 0.3
