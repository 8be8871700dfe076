"""Bodies that are picked up and set down: when, how heavy, in which recording; and that they are no contacts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from robots import robot
from test_diagnosis import ARM, record
from unsimulated import unsimulated as unsimulated

from sysid_ros.diagnosis import diagnose
from sysid_ros.diagnosis.contacts import find_contacts
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.diagnosis.result import Diagnosis
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

BODY = np.array([1.0, 0.02, 0.01, 0.05, 0.004, 0.0, 0.004, 0.0, 0.0, 0.003])
"""Mass, first moment and inertia about the tool for each kilogram."""
Change = Callable[..., FloatArray]


def changes(*events: tuple[float, float], friction: float = 0.0) -> Change:
    """Torque with a body whose mass changes by so much [kg] at times [s], and with dry friction."""

    def torque(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
        frame = model.frame_id(model.default_frame)
        carried = np.array([model.payload_regressor(*state, frame) @ BODY for state in zip(q, v, a, strict=True)])
        mass = np.sum([np.zeros_like(t), *(change * (t >= at) for at, change in events)], axis=0)
        return np.asarray(tau + carried * mass[:, None] + friction * np.tanh(v / 0.005))

    return torque


def found(fitted: Sequence[Recording], judged: Sequence[Recording]) -> tuple[Diagnosis, list[dict[str, Any]]]:
    """The diagnosis, and name and value of each parameter of each event, with the interval of its time."""
    result = diagnose(robot(ARM), fitted, judged)
    events: list[dict[str, Any]] = [{p.name: p.value for p in f.parameters} for f in result.findings if f.id == "payload_change"]
    for event, finding in zip(events, (f for f in result.findings if f.id == "payload_change"), strict=True):
        event["between"] = next((p.low, p.high) for p in finding.parameters if p.name == "t0")
    return result, events


def named(name: str, recording: Recording) -> Recording:
    return replace(recording, name=name)


@pytest.mark.slow
def test_pick_and_place_are_two_events_dated_in_the_fitted_recording_alone() -> None:
    fitted = record(changes((6.0, 1.5), (13.0, -1.5), friction=0.8), 1, 21.0)
    judged = record(changes((3.0, 1.5), (6.5, -1.5), friction=0.8), 2, 10.0)
    result, events = found([fitted], [judged])
    assert {f.id for f in result.findings} == {"payload_change", "coulomb_friction"}
    (picked, placed) = sorted(events, key=lambda e: float(e["t0"]))
    assert picked["mass"] == pytest.approx(1.5, rel=0.03)
    assert placed["mass"] == pytest.approx(-1.5, rel=0.03)
    assert (picked["t0"], placed["t0"]) == (pytest.approx(6.0, abs=0.03), pytest.approx(13.0, abs=0.03))
    assert result.verdict == "explained"


@pytest.mark.parametrize(("until", "seed"), [(7.1, 3), (7.2, 1)])
def test_a_payload_that_is_set_down_early_stays_one(until: float, seed: int) -> None:
    """The moment that it is carried in the second segment tells too little to predict the first; the third tells nothing."""
    model = robot(ARM)
    train = prepare(model, [record(changes((-1.0, 0.3), (until, -0.3)), seed, 21.0, colour=0.5)], [])
    library = Library(model, train.band)
    terms = [library.whole("payload"), library.whole("payload_change", t0=until)]
    selection = Selection(train.problem, library, train.nominal)
    selection.fit = train.problem.fit(terms)
    selection.climb()
    kept = {t.id: t for t in selection.fit.terms}
    assert set(kept) == {"payload", "payload_change"}
    assert selection.fit.theta_of(kept["payload"])[0] == pytest.approx(0.3, abs=0.05)


def test_two_events_that_come_together_are_one() -> None:
    """Looked for from two sides, a change is found twice; dated anew, both are at the same moment."""
    model = robot(ARM)
    train = prepare(model, [record(changes((7.6, 1.2)), 1, 14.0)], [])
    selection = Selection(train.problem, Library(model, train.band), train.nominal)
    terms = [selection.library.whole("payload_change", t0=t0) for t0 in (6.7, 8.5)]
    selection.fit = train.problem.fit(terms)
    selection.date()
    (event,) = selection.fit.terms
    assert event.effect.settings["t0"] == pytest.approx(7.6, abs=0.03)
    assert selection.fit.theta_of(event)[0] == pytest.approx(1.2, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("second", [10.0, None], ids=["in both", "in one"])
def test_each_recording_has_its_own_event(second: float | None) -> None:
    other = changes((second, 1.5)) if second else changes()
    fitted = [named("first", record(changes((7.0, 1.5)), 1, 14.0)), named("second", record(other, 2, 14.0, start=90.0))]
    result, events = found(fitted, [record(changes((4.0, 1.5)), 3, 9.0)])
    assert {f.id for f in result.findings} == {"payload_change"}
    expected = {"first": 7.0} | ({"second": second} if second else {})
    between = {e["recording"]: e["between"] for e in events}
    assert set(between) == set(expected)
    assert all(low <= expected[name] <= high for name, (low, high) in between.items())
    assert all(high - low < 0.3 for low, high in between.values())
    assert result.model is not None
    stamps = {b.settings["recording"]: b.settings["t0"] for b in result.model.effects if b.effect == "payload_change"}
    assert stamps == {r.name: pytest.approx(r.t[0] + expected[r.name], abs=0.03) for r in fitted if r.name in expected}
    for event in events:
        assert event["mass"] == pytest.approx(1.5, rel=0.03)


@pytest.mark.slow
def test_an_event_in_a_rest_was_at_any_time_of_it() -> None:
    fitted = record(changes((9.0, 1.5)), 1, 18.0, rests=(8.0, 9.6))
    _, (event,) = found([fitted], [record(changes((4.0, 1.5)), 3, 9.0)])
    low, high = event["between"]
    assert 7.5 < low < 9.0 < high < 10.1
    assert high - low > 0.8


WHEN = {"before it": (-1.0, "before it begins"), "within it": (4.0, "at 4.0"), "after it": (99.0, "never")}


@pytest.mark.slow
@pytest.mark.parametrize(("at", "words"), WHEN.values(), ids=WHEN)
def test_the_event_may_be_anywhere_in_the_recording_that_judges_and_that_is_said(at: float, words: str) -> None:
    result, events = found([record(changes((7.0, 1.5)), 1, 14.0)], [record(changes((at, 1.5)), 3, 9.0)])
    assert len(events) == len(result.findings) == 1
    assert any("found anew" in note and words in note for note in result.notes)
    torque = result.torque
    assert torque is not None
    np.testing.assert_array_less(torque.after, 1.5 * torque.noise_floor)


@pytest.mark.slow
def test_a_body_that_is_carried_for_a_short_while_is_no_contact() -> None:
    """Its last seconds look like a force of one direction until the body is allowed for."""
    result, events = found(
        [record(changes((9.5, 1.5), friction=0.8), 4, 14.0)], [record(changes((5.0, 1.5), friction=0.8), 5, 9.0)]
    )
    assert {f.id for f in result.findings} == {"payload_change", "coulomb_friction"}
    assert events[0]["t0"] == pytest.approx(9.5, abs=0.03)


def test_a_contact_is_what_each_joint_shows_of_the_force_that_the_others_tell() -> None:
    """A push on the last link is one; errors of as much energy on the same joints at once, each in its own way, are none."""
    model, rng = robot(ARM), np.random.default_rng(0)
    (motion,) = prepare(model, [record(changes(), 1, 12.0)], []).problem.band.motions
    at = np.exp(-(((motion.t - 6.0) / 0.3) ** 2))[:, None]
    jacobian = model.frame_jacobian_along(motion.q, model.frame_id(model.default_frame))[:, :3]
    pushed = -np.einsum("kxj,x->kj", jacobian, [20.0, -10.0, 15.0]) * at
    size = np.sqrt(np.mean(pushed**2, axis=0) / np.mean(at**2))
    apart = np.sin(2.0 * np.pi * np.array([1.1, 2.3, 3.1, 4.7]) * motion.t[:, None] + rng.uniform(0.0, 6.0, 4)) * at * size * 1.4
    moves, found = np.ones(motion.q.shape, dtype=np.bool_), []
    for wrong in (pushed, apart):
        residual = 0.02 * rng.normal(size=motion.q.shape) + wrong
        found.append(find_contacts(model, ["one"], [motion], [residual], [motion.tau - wrong], [moves]))
    (contact,) = found[0]
    assert contact.start < 6.0 < contact.end
    np.testing.assert_allclose(contact.force, np.array([20.0, -10.0, 15.0]) * 0.9, rtol=0.15)  # its mean above half of its peak
    assert found[1] == []


def test_a_push_is_no_elastic_joint_however_much_of_it_one_joint_takes() -> None:
    """Nearly all of the energy may be on one joint, by the push or by how well its torque is known: the others tell."""
    model, rng = robot(ARM), np.random.default_rng(0)
    (motion,) = prepare(model, [record(changes(), 1, 12.0)], []).problem.band.motions
    at = np.exp(-(((motion.t - 6.0) / 0.3) ** 2))
    jacobian = model.frame_jacobian_along(motion.q, model.frame_id(model.default_frame))[:, :3]
    pushed = -np.einsum("kxj,x->kj", jacobian, [12.0, 5.0, -20.0]) * at[:, None]
    moves, found = np.ones(motion.q.shape, dtype=np.bool_), []
    noise = np.array([0.015, 0.003, 0.015, 0.08]) * rng.normal(size=motion.q.shape)
    for wrong in (pushed, *(motion.sensitivity[2][:, :, m] * 20.0 * at[:, None] for m in range(4))):
        found.append(find_contacts(model, ["one"], [motion], [noise + wrong], [motion.tau - wrong], [moves]))
    (contact,) = found[0]
    np.testing.assert_allclose(contact.force, np.array([12.0, 5.0, -20.0]) * 0.9, rtol=0.15)
    assert found[1:] == [[], [], [], []]
