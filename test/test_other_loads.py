"""What one recording carries and the others don't: in those that are fitted a cause, in those that judge taken away and said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from robots import robot
from test_diagnosis import ARM, record
from test_diagnosis_events import changes, named
from unsimulated import unsimulated as unsimulated

from sysid_ros.diagnosis import diagnose
from sysid_ros.diagnosis.heldout import split
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.sets.other_loads import other_loads, without_loads
from sysid_ros.effects import OtherPayload
from sysid_ros.signals.recording import Recording

ALWAYS = -1.0
"""Carried from before the recording begins [s]."""


def carrying(name: str, mass: float, seed: int, seconds: float = 12.0) -> Recording:
    return named(name, record(changes((ALWAYS, mass), friction=0.8), seed, seconds, colour=0.3))


def test_what_a_recording_that_judges_carries_more_is_said_and_judged_without() -> None:
    result = diagnose(robot(ARM), [carrying("empty", 0.0, 1, 21.0)], [carrying("loaded", 1.2, 2)])
    assert [f.id for f in result.findings] == ["coulomb_friction"]
    assert result.verdict == "explained"
    (said,) = [x for x in result.notes if "carries" in x]
    assert said.startswith("In loaded the robot carries 1.")
    assert "more than in the other recordings" in said
    assert result.torque is not None
    assert np.all(result.torque.after < 1.3 * result.torque.noise_floor)


def test_what_it_carries_has_the_size_and_the_place_of_the_body() -> None:
    model = robot(ARM)
    train, held = (prepare(model, [r], []) for r in (carrying("loaded", 1.2, 1, 21.0), carrying("other", 0.5, 2)))
    selection = Selection(train.problem, Library(model, train.band), train.nominal)
    selection.run()
    (load,) = other_loads(model, train, selection, held)
    assert load.theta[0] == pytest.approx(-0.7, abs=0.05)
    np.testing.assert_allclose(load.theta[1:4], -0.7 * np.array([0.02, 0.01, 0.05]), atol=0.02)
    assert "less than in the other recordings" in load.in_words()
    (before,), (after,) = held.motions, without_loads(held, [load]).motions
    expected = OtherPayload(model, recording="other").torque_along(before, load.theta)
    np.testing.assert_allclose(after.tau, before.tau - expected)
    assert without_loads(held, []) is held


def test_recordings_that_carry_the_same_and_a_constant_in_one_of_them_say_nothing() -> None:
    """Where an arm hardly moves, what is wrong with its model in that posture is a constant."""
    model = robot(ARM)
    fitted, same, still = carrying("empty", 0.0, 1, 21.0), carrying("same", 0.0, 2), carrying("still", 0.0, 3)
    middle = still.q.mean(axis=0)
    q = middle + 0.02 * (still.q - middle)
    off = np.array([0.0, 1.5, 0.0, 0.0])[: model.n]
    slow = 0.02 * np.gradient(still.q, still.t, axis=0)
    tau = model.rnea_along(q, slow, np.zeros_like(q)) + off + 0.8 * np.tanh(slow / 0.005)
    tau += 0.02 * np.random.default_rng(1).normal(size=tau.shape)
    still = Recording("still", still.t, q, None, tau)
    train = prepare(model, [fitted], [])
    selection = Selection(train.problem, Library(model, train.band), train.nominal)
    selection.run()
    for recording in (same, still):
        assert other_loads(model, train, selection, prepare(model, [recording], [])) == []


@pytest.mark.slow
def test_among_fitted_recordings_it_is_a_cause_of_its_own() -> None:
    bags = [carrying("empty", 0.0, 1, 16.0), carrying("loaded", 1.2, 2, 16.0)]
    result = diagnose(robot(ARM), bags)
    assert {f.id for f in result.findings} == {"coulomb_friction", "other_payload"}
    (found,) = [f for f in result.findings if f.id == "other_payload"]
    told = {p.name: p for p in found.parameters}
    assert told["mass"].low < 1.2 < told["mass"].high
    assert told["recording"].value == "loaded"
    assert "In loaded the robot carries 1." in found.sentence
    assert result.verdict == "explained"


def test_the_parts_of_a_recording_are_of_that_recording() -> None:
    whole = carrying("run", 0.0, 1, 16.0)
    (first,), (last,) = split([whole])
    assert (first.name, last.name) == ("run (first part)", "run (held-out part)")
    assert first.whole == last.whole == whole.whole == "run"
    assert last.at(slice(0, 10)).whole == "run"
    motions = prepare(robot(ARM), [first, last], []).motions
    assert {m.recording for m in motions} == {"run"}


@pytest.mark.slow
def test_a_body_that_is_picked_up_in_one_of_two_recordings_has_the_stamps_of_that_one() -> None:
    """Both are split: what happens in a part is told of the recording, and counted from its first stamp."""
    still, picks = carrying("still", 0.0, 1, 20.0), named("picks", record(changes((6.0, 1.2), friction=0.8), 2, 20.0, colour=0.3))
    picks = replace(picks, t=picks.t + 500.0)
    result = diagnose(robot(ARM), [still, picks])
    assert {f.id for f in result.findings} == {"coulomb_friction", "payload_change"}
    assert result.model is not None
    (block,) = [b for b in result.model.effects if b.effect == "payload_change"]
    assert block.settings["recording"] == "picks"
    assert block.settings["t0"] == pytest.approx(picks.t[0] + 6.0, abs=0.1)
