"""When the values of messages were true: drivers that poll a slower source, and stamps that jitter."""

from __future__ import annotations

import numpy as np
import pytest

from sysid_ros.input_gate.message_faults import at_own_times, find_message_faults
from sysid_ros.input_gate.polled import _evenness, times_of_samples
from sysid_ros.input_gate.stamp_jitter import stamp_jitter
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

SEEDS = range(3)


def motion(t: FloatArray, seed: int) -> FloatArray:
    """Smooth positions of five joints, shape (N, 5) [rad]."""
    rng = np.random.default_rng(seed)
    f, size, phase = rng.uniform(0.1, 0.5, (3, 5)), rng.uniform(0.2, 0.6, (3, 5)), rng.uniform(0.0, 6.0, (3, 5))
    return np.asarray(np.sum(size * np.sin(2.0 * np.pi * f * t[:, None, None] + phase), axis=1))


def polled(source: float, poll: float, seed: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Stamps, positions and efforts of 20 s of messages, and when their values were true."""
    stamps: FloatArray = np.asarray(1.0 + poll * np.arange(round(20.0 / poll)), dtype=np.float64)
    true: FloatArray = np.floor((stamps - 0.3 * source) / source) * source + 0.3 * source
    noise = np.random.default_rng(seed)
    grid, at = np.unique(true, return_inverse=True)
    q = motion(grid, seed) + 2e-5 * noise.standard_normal((len(grid), 5))
    tau = noise.standard_normal((len(grid), 5))
    return stamps, q[at], tau[at], true


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("source", [0.0340, 0.0352, 0.0401])
def test_values_of_a_polled_source_get_their_own_times(source: float, seed: int) -> None:
    poll = 1.0 / 30.0
    stamps, q, tau, true = polled(source, poll, seed)
    faults = find_message_faults(stamps, q, tau)
    assert faults.polled == np.sum(faults.keep) > 0
    assert poll - 1.2 * (source - poll) < faults.age <= 1.001 * poll
    assert "slower source" in faults.in_words()
    # a delay that is the same for all can't be seen, nor does it bend a motion
    left = (faults.times - true)[faults.keep][100:-100]
    assert np.std(left) < 0.35 * (source - poll) + 1e-5  # the newest of two beats are as old as that at most


@pytest.mark.parametrize("seed", SEEDS)
def test_a_message_that_was_sent_twice_moves_no_stamp(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(2000) / 100.0
    q = motion(t, seed) + 2e-5 * rng.standard_normal((len(t), 5))
    repeats = np.zeros(len(t), dtype=np.bool_)
    repeats[rng.choice(np.arange(10, 1990), 20, replace=False)] = True
    q[repeats] = q[np.flatnonzero(repeats) - 1]
    np.testing.assert_array_equal(times_of_samples(t, q, repeats), t)


def test_repeats_at_any_time_are_no_polled_source() -> None:
    """One beat of a driver that polls is as long as another, but for rests and lost messages."""
    period, rng = 0.004, np.random.default_rng(0)
    even: FloatArray = 0.068 + period * rng.integers(-1, 2, 40).astype(np.float64)
    assert _evenness(even, period) > 20.0
    with_rests = np.concatenate([even, [1.3, 2.2, 0.4]])
    assert _evenness(with_rests, period) > 15.0
    for few in ([0.128, 0.008], [0.9, 0.2, 0.03], [5.0, 0.4, 1.1, 0.02]):
        assert _evenness(np.array(few), period) < 0.0


def test_messages_that_hold_nothing_but_zeros_are_left_out() -> None:
    """As a driver sends before it has its first values, or where it lost them."""
    rng = np.random.default_rng(2)
    t = np.arange(3000) / 250.0
    q, tau = motion(t, 2) + 0.3 + 2e-5 * rng.standard_normal((len(t), 5)), rng.standard_normal((len(t), 5))
    gone = np.zeros(len(t), dtype=np.bool_)
    gone[:300] = gone[1700] = gone[2200:2203] = True
    q[gone], tau[gone] = 0.0, 0.0
    faults = find_message_faults(t, q, tau)
    assert faults.empty == gone.sum()
    assert np.array_equal(faults.keep, ~gone)
    assert faults.repeated == faults.late == faults.frozen == 0
    assert "304 hold nothing but zeros and are left out" in faults.in_words()
    cleaned, words = at_own_times(Recording("run", t, q, None, tau))
    assert "304 hold nothing but zeros" in words
    assert np.array_equal(cleaned.t, t[~gone])
    # a robot that stands at zero and holds nothing is no fault
    q, tau = motion(t, 2) - motion(t[:1], 2), rng.standard_normal((len(t), 5))
    q[:200], tau[:200] = 0.0, 0.0
    q[200:] *= np.minimum(np.arange(2800) / 500.0, 1.0)[:, None] ** 3
    assert find_message_faults(t, q, tau).empty == 0


def test_stamps_that_jitter_hide_no_message() -> None:
    rng = np.random.default_rng(1)
    t = np.arange(4000) / 250.0
    q = motion(t, 1) + 2e-5 * rng.standard_normal((len(t), 5))
    tau = rng.standard_normal((len(t), 5))
    stamps = 5.0 + t + rng.uniform(-0.0015, 0.0015, len(t))
    assert np.mean(np.diff(stamps) > 1.6 / 250.0) > 0.005
    faults = find_message_faults(stamps, q, tau)
    assert faults.jitter > 0.0
    assert faults.dropped < 0.005 * len(t)
    some = np.sort(rng.choice(len(t), 3800, replace=False))
    assert find_message_faults(stamps[some], q[some], tau[some]).dropped == pytest.approx(200, rel=0.2)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("size", [0.02, 0.1])
def test_the_positions_of_all_joints_tell_the_stamps_errors(size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(4000) / 100.0
    q = motion(t, seed) + 2e-5 * rng.standard_normal((len(t), 5))
    errors = size / 100.0 * rng.standard_normal(len(t))
    found = stamp_jitter(t + errors, q)
    assert found is not None
    assert found.std == pytest.approx(size / 100.0, rel=0.1)
    np.testing.assert_allclose(found.noise, 2e-5, rtol=0.3)
    # slow errors are a motion like any other: what bends it within a few samples is what has to go
    before, after = (np.std(np.diff(x, 2)) for x in (errors, errors + found.errors))
    assert after < 0.3 * before


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("rate", "acceleration"), [(50.0, 40.0), (100.0, 40.0), (100.0, 5.0), (1000.0, 40.0)])
def test_joints_that_stop_at_once_are_no_error_of_stamps(rate: float, acceleration: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    fine = np.arange(40_000) / 1000.0
    s, at = np.zeros(len(fine)), 0
    while at < len(fine):  # to and fro, all joints together, at 1 rad/s with rests between
        ramp = 1.0 / acceleration
        t = np.arange(0.0, 1.0 + ramp, 1e-3)
        move = np.cumsum(np.minimum(np.minimum(t / ramp, 1.0), np.maximum(1.0 + ramp - t, 0.0) / ramp)) * 1e-3
        move = np.concatenate([move, np.full(300, move[-1]), move[-1] - move, np.zeros(300)])[: len(fine) - at]
        s[at : at + len(move)] = move
        at += len(move)
    t = np.arange(0.0, 39.9, 1.0 / rate)
    q = np.interp(t, fine, s)[:, None] * rng.uniform(-1.0, 1.0, 5) + 2e-5 * rng.standard_normal((len(t), 5))
    found = stamp_jitter(t, q)
    assert found is None or found.std < 0.01 / rate
