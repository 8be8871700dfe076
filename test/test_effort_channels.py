"""Efforts that do not measure the motion beside them are refused, or left out, with the reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_diagnosis_short import ROBOT, swing

from sysid_ros.diagnosis.diagnose import diagnose
from sysid_ros.input_gate.effort_channels import same_efforts, standing_still, wrapping_counts
from sysid_ros.input_gate.message_faults import in_order


@pytest.mark.parametrize("bits", [8, 16, 32])
def test_counts_that_wrap_are_refused(bits: int) -> None:
    r = swing(6.0)
    counts = np.round(r.tau / np.abs(r.tau).max() * 2.0 ** (bits - 2)) % 2.0**bits
    found = diagnose(ROBOT, [replace(r, tau=counts)])
    assert found.verdict == "refused"
    assert f"count of {bits} bits" in (found.refusal or "")
    assert "effort_scale" in (found.refusal or "")


def test_counts_that_do_not_wrap_are_none() -> None:
    r = swing(6.0)
    for tau in (np.round(100.0 * r.tau), np.round(100.0 * np.abs(r.tau)), r.tau):
        assert wrapping_counts(ROBOT, [replace(r, tau=tau)]) is None


def test_efforts_of_another_run_are_refused() -> None:
    first, second = swing(6.0, "first"), swing(6.0, "second", seed=1)
    assert same_efforts(ROBOT, [first, second]) is None
    copied = replace(second, tau=first.tau.copy())
    found = diagnose(ROBOT, [first], [copied])
    assert found.verdict == "refused"
    assert "first and second: the efforts of servo are the same" in (found.refusal or "")


def test_one_recording_given_twice_has_its_own_efforts_twice() -> None:
    assert same_efforts(ROBOT, [swing(6.0), swing(6.0)]) is None


def test_efforts_that_stand_still_while_the_arm_moves_are_left_out_and_told() -> None:
    r = swing(12.0)
    tau = r.tau.copy()
    tau[1000:1400] = tau[1000]
    kept, faults = in_order(replace(r, tau=tau))
    assert faults.frozen == 399
    assert len(kept.t) == len(r.t) - 399
    assert "efforts of long before" in faults.in_words()
    found = diagnose(ROBOT, [replace(r, tau=tau)])
    fault = next(e for e in found.as_dict()["effects"] if e["name"] == "message_faults")
    assert {p["name"]: p["value"] for p in fault["parameters"]}["frozen"] == pytest.approx(399 / len(r.t))


def test_a_recording_with_the_drives_off_for_most_of_the_time_is_refused() -> None:
    r = swing(12.0)
    tau = r.tau.copy()
    tau[600:] = 0.0
    found = diagnose(ROBOT, [replace(r, tau=tau)])
    assert found.verdict == "refused"
    assert "75 % of its messages no effort has changed" in (found.refusal or "")


def test_efforts_of_an_arm_at_rest_or_in_steps_are_not_left_out() -> None:
    r = swing(6.0)
    assert not standing_still(r.t, np.zeros_like(r.q), np.zeros_like(r.tau)).any()
    assert not standing_still(r.t, r.q, np.round(r.tau / 0.5) * 0.5).all()
    assert not standing_still(r.t, r.q, r.tau).any()
