"""Recordings into smooth motions: an encoder's steps make no inertia, and what a fine one sees stays as it is."""

from __future__ import annotations

import numpy as np
import pytest

from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import SMOOTHING
from sysid_ros.signals.seen_motion import clear_band, seen_band, what_is_seen
from sysid_ros.signals.zero_phase import low_passed

RATE, SECONDS, CUTOFF = 250.0, 30.0, 10.0


def moved(seed: int) -> tuple[FloatArray, FloatArray]:
    """Position and acceleration of one joint in sines below 1.5 Hz, shape (N, 1) each."""
    rng, t = np.random.default_rng(seed), np.arange(round(SECONDS * RATE)) / RATE
    omega, phase = 2.0 * np.pi * rng.uniform(0.1, 1.5, 6), rng.uniform(0.0, 6.3, 6)
    size = 0.05 / omega
    waves = np.sin(np.outer(t, omega) + phase)
    return (waves @ size)[:, None], -(waves @ (size * omega**2))[:, None]


def accelerated(q: FloatArray, seen: bool) -> FloatArray:
    """Twice differentiated in the band that is judged, without the ends that are cut off, shape (N,)."""
    smooth, period = low_passed(q, SMOOTHING, 1.0 / RATE), 1.0 / RATE
    smooth = what_is_seen(smooth, RATE, 2.0 * clear_band(q, RATE)) if seen else smooth
    return low_passed(np.gradient(np.gradient(smooth, period, axis=0), period, axis=0), CUTOFF, period)[63:-63, 0]


def true_band(a: FloatArray) -> FloatArray:
    return low_passed(a, CUTOFF, 1.0 / RATE)[63:-63, 0]


@pytest.mark.parametrize("seed", range(4))
def test_steps_of_an_encoder_make_no_inertia(seed: int) -> None:
    """Of torques J a that are known exactly a fit on accelerations finds J; on those of the raw steps it finds less."""
    q, a = moved(seed)
    steps, torque = 0.0015 * np.round(q / 0.0015), 0.2 * true_band(a)
    found = [float(x @ torque / (x @ x)) for x in (accelerated(steps, True), accelerated(steps, False))]
    assert found[0] == pytest.approx(0.2, rel=0.02)
    assert found[1] < 0.18


@pytest.mark.parametrize("noise", [1e-4, 1e-5, 1e-6])
def test_an_acceleration_is_never_worse_for_it(noise: float) -> None:
    for seed in range(3):
        q, a = moved(seed)
        q = q + noise * np.random.default_rng(seed).normal(size=q.shape)
        off = [accelerated(q, seen) - true_band(a) for seen in (True, False)]
        assert np.std(off[0]) < 0.5 * np.std(off[1])
        assert max(np.abs(off[0][:100]).max(), np.abs(off[0][-100:]).max()) < max(np.abs(off[1]).max(), 0.01)


def test_coarse_is_what_biases() -> None:
    q, _ = moved(0)
    steps = [x * np.round(q / x) if x else q for x in (0.0015, 2.5e-5, 0.0)]
    kept = seen_band(np.hstack(steps), RATE)
    assert np.isfinite(kept).tolist() == [True, False, False]
    assert kept[0] == 2.0 * clear_band(steps[0], RATE)[0]


def test_a_position_that_is_known_exactly_and_one_that_stands_stay_as_they_are() -> None:
    q, _ = moved(2)
    both = np.hstack([q, np.full_like(q, 0.7)])
    np.testing.assert_array_equal(what_is_seen(both, RATE, seen_band(both, RATE)), both)
    np.testing.assert_allclose(what_is_seen(both, RATE, np.array([4.0, 4.0]))[:, 1], 0.7, atol=1e-9)
    assert what_is_seen(both[:6], RATE, np.array([4.0, 4.0])).shape == (6, 2)


def test_the_noise_of_a_joint_that_stands_is_no_motion() -> None:
    still = 0.3 + 1e-3 * np.random.default_rng(1).normal(size=(2000, 1))
    smooth = what_is_seen(still, RATE, seen_band(still, RATE))
    assert np.abs(np.gradient(np.gradient(smooth[:, 0], 1.0 / RATE), 1.0 / RATE)).max() < 0.01


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("cutoff", [0.04, 0.5, 8.0])
def test_a_motion_far_below_the_cut_off_passes_at_any_rate(rate: float, cutoff: float) -> None:
    t = np.arange(round(20.0 * rate)) / rate
    q = np.sin(0.4 * np.pi * cutoff * t)[:, None]
    np.testing.assert_allclose(what_is_seen(q, rate, np.array([cutoff])), q, atol=3e-3)


@pytest.mark.parametrize("slower", [10.0, 20.0, 40.0])
def test_a_slow_motion_is_seen_as_far_as_its_own_acceleration(slower: float) -> None:
    """A fine encoder whose noise is far above a slow joint's acceleration: a mean over a hertz had made that look large."""
    omega = 2.0 * np.pi * np.array([0.2, 0.5]) / slower
    t = np.arange(round(40.0 * RATE)) / RATE
    q = (np.sin(np.outer(t, omega)) @ [0.8, 0.3])[:, None]
    a = -(np.sin(np.outer(t, omega)) @ (np.array([0.8, 0.3]) * omega**2))
    noisy = q + 1e-5 * np.random.default_rng(3).normal(size=q.shape)
    seen = seen_band(noisy, RATE)
    assert seen[0] < 5.0
    smooth = what_is_seen(low_passed(noisy, SMOOTHING, 1.0 / RATE), RATE, seen)
    found = np.gradient(np.gradient(smooth[:, 0], 1.0 / RATE), 1.0 / RATE)[250:-250]
    assert np.std(found - a[250:-250]) < 0.5 * np.std(a)
