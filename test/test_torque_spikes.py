"""Torques that fit neither their neighbours: taken out of a recording, said, and no cause of anything."""

from __future__ import annotations

import numpy as np
import pytest

from sysid_ros.diagnosis.fault_findings import message_finding
from sysid_ros.input_gate.message_faults import at_own_times, despiked, in_order
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.spikes import without_spikes

RATE, N = 250.0, 3000


def recording(seed: int = 0) -> Recording:
    rng = np.random.default_rng(seed)
    t = np.arange(N) / RATE
    q = np.stack([np.sin(2.0 * np.pi * f * t) for f in (0.3, 0.4, 0.5)], axis=1)
    tau = 5.0 * np.roll(q, 1, axis=1) + np.sign(np.gradient(q, axis=0)) + 0.05 * rng.normal(size=q.shape)
    return Recording("run", t, q, None, tau)


def spiked(tau: FloatArray, part: float, size: float, seed: int = 1) -> tuple[FloatArray, np.ndarray]:
    """Some torques of one joint a message are off, none of the first half second."""
    rng = np.random.default_rng(seed)
    where = np.zeros(tau.shape, dtype=bool)
    rows = np.flatnonzero(rng.random(N) < part)
    where[rows, rng.integers(tau.shape[1], size=len(rows))] = True
    where[:125] = where[-2:] = False
    return tau + np.where(where, size * rng.choice([-1.0, 1.0], tau.shape), 0.0), where


@pytest.mark.parametrize("size", [2.0, 20.0, 500.0])
def test_spikes_are_found_and_give_way_to_the_middle_of_their_neighbours(size: float) -> None:
    clean = recording().tau
    tau, where = spiked(clean, 0.004, size)
    out, found = without_spikes(tau)
    assert where.sum() > 5
    assert np.mean(found[where]) > 0.95
    assert not found[~where].any()
    assert np.abs(out - clean)[found].max() < 0.5
    assert np.array_equal(out[~found], tau[~found])


def test_a_step_an_impact_and_a_torque_that_is_missing_are_no_spikes() -> None:
    tau = recording().tau
    tau[1000:] += 30.0
    tau[2000] += 30.0
    tau[1500, 1] = np.nan
    out, found = without_spikes(tau)
    assert not found.any()
    np.testing.assert_array_equal(out, tau)


def test_the_top_of_a_curve_without_noise_is_no_spike() -> None:
    """Torques of a simulation turn over within a few samples, where most of the time they hardly bend."""
    t = np.arange(4000) / 200.0
    tau = np.column_stack([np.sin(t) + 0.03 * np.exp(-0.5 * ((t % 4.0 - 2.0) / w) ** 2) for w in (0.004, 0.01, 0.03)])
    kinked = np.abs(np.sin(0.7 * t))[:, None]
    assert not without_spikes(np.hstack([tau[:, 1:], kinked]))[1].any()


def test_a_recording_without_spikes_is_left_as_it_is() -> None:
    whole = recording()
    ordered, faults = despiked(*in_order(whole))
    assert ordered is whole
    assert faults.spiked == 0
    assert at_own_times(whole) == (whole, "")


def test_one_spike_changes_nothing_else_of_the_messages() -> None:
    """A message that repeats another is for the checks of who asks, with a spike as without."""
    whole = recording()
    twice = np.sort(np.append(np.arange(N), [700, 1400]))
    repeated = whole.at(twice)
    assert at_own_times(repeated) == (repeated, "")
    tau = repeated.tau.copy()
    tau[2000, 1] += 50.0
    cleaned, words = at_own_times(Recording("run", repeated.t, repeated.q, None, tau))
    assert (
        words
        == f"Of {len(twice)} messages 1 hold a torque far from those before and after it, which gave way to the middle of these."
    )
    assert np.array_equal(cleaned.t, repeated.t)
    assert np.flatnonzero((cleaned.tau != tau).any(axis=1)).tolist() == [2000]


def test_spikes_are_said_and_are_a_finding_of_their_own_where_they_are_many() -> None:
    whole = recording()
    for part, named in ((0.004, False), (0.03, True)):
        tau, where = spiked(whole.tau, part, 20.0)
        ordered, faults = despiked(*in_order(Recording("run", whole.t, whole.q, None, tau)))
        messages = int(np.sum(where.any(axis=1)))
        assert 0.8 * messages <= faults.spiked <= messages
        assert ("spiked" in faults.named()) is named
        findings = message_finding([faults], ("a", "b", "c"))
        assert len(findings) == named
        for finding in findings:
            assert "gave way to the middle" in finding.remark
            assert "order of their stamps" not in finding.remark
        assert f"{faults.spiked} hold a torque far from those before and after it" in faults.in_words()
        assert np.sqrt(np.mean((ordered.tau - whole.tau) ** 2)) < 0.3 * np.sqrt(np.mean((tau - whole.tau) ** 2))


@pytest.mark.parametrize("step", [0.2, 1.0, 3.0])
def test_torques_that_are_rounded_coarsely_have_no_spikes(step: float) -> None:
    """Between two steps a value goes up and down by one."""
    rounded = step * np.round(recording().tau / step)
    assert not without_spikes(rounded)[1].any()


def test_a_torque_far_off_is_a_spike_of_rounded_ones_too() -> None:
    tau, where = spiked(0.2 * np.round(recording().tau / 0.2), 0.004, 6.0)
    found = without_spikes(tau)[1]
    assert np.mean(found[where]) > 0.95
    assert not found[~where].any()
