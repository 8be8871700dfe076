"""FrontEnd and what stands beside it: the filtered equation holds, rows come when due, noise is read from the torques."""

from __future__ import annotations

import numpy as np
import pytest
from motions import Motion, measurements
from robots import random_body, robot

from sysid_ros.effects import CoulombFriction, LinkInertia, Payload, TorqueOffset, ViscousFriction
from sysid_ros.online.free_parameters import white_noise_variance
from sysid_ros.online.front_end import FrontEnd
from sysid_ros.online.model_check import ModelCheck
from sysid_ros.online.payload_events import EventLog
from sysid_ros.online.rows import Rows
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import Measurement
from sysid_ros.torque.torque_model import TorqueModel


def rows_of(front_end: FrontEnd, stream: list[Measurement]) -> list[Rows]:
    return [r for m in stream for r in front_end.push(m)]


@pytest.mark.parametrize(("rate", "jitter"), [(1000.0, 0.0), (250.0, 0.0), (100.0, 0.0), (250.0, 0.2)])
@pytest.mark.parametrize("robot_name", ["iiwa", "small_arm"])
def test_the_filtered_equation_holds(robot_name: str, rate: float, jitter: float) -> None:
    """F(tau - tau_known) = F(Y) theta, with one F on both sides, whatever the filter delays."""
    model = robot(robot_name)
    theta = inertial_parameters.from_com(*random_body(np.random.default_rng(0)))
    payload, offset = Payload(model), TorqueOffset(model)
    motion = Motion(model, seed=1)
    stream = measurements(motion, 6.0, rate, [(payload, theta), (offset, np.ones(model.n))], jitter=jitter)
    rows = rows_of(FrontEnd(TorqueModel(model, [payload, offset]), 1.0 / rate, 100.0), stream)
    expected = np.concatenate((theta, np.ones(model.n)))
    for r in rows:
        np.testing.assert_allclose(r.y, r.Y @ expected, atol=0.02 * np.abs(r.y).max() + 0.02)


@pytest.mark.parametrize(("rate", "update_rate", "period"), [(1000.0, 100.0, 0.01), (250.0, 100.0, 0.008), (100.0, 200.0, 0.01)])
def test_rows_come_at_the_rate_of_the_estimator(rate: float, update_rate: float, period: float) -> None:
    model = robot("small_arm")
    front_end = FrontEnd(TorqueModel(model, [Payload(model)]), 1.0 / rate, update_rate)
    stream = measurements(Motion(model), 3.0, rate, [])
    rows = rows_of(front_end, stream)
    assert front_end.period == pytest.approx(period)
    assert front_end.rate == pytest.approx(rate)
    np.testing.assert_allclose(np.diff([r.t for r in rows]), period, rtol=1e-6)
    assert rows[0].t >= stream[0].t + front_end.memory - period  # the filters are full


def test_shapes_and_channels() -> None:
    model = robot("iiwa")
    effects = [Payload(model), CoulombFriction(model), ViscousFriction(model)]
    front_end = FrontEnd(TorqueModel(model, effects), 0.004, 100.0)
    motion = Motion(model)
    rows = rows_of(front_end, measurements(motion, 3.0, 250.0, []))
    for r in rows:
        assert r.Y.shape == (7, 24)
        for array in (r.y, r.speed, r.acceleration, r.tau):
            assert array.shape == (7,)
        assert np.all(r.speed >= 0.0)
        _, v, a = (x[0] for x in motion(np.array([r.t - front_end.delay])))
        np.testing.assert_allclose(r.speed, np.abs(v), atol=0.05)
        np.testing.assert_allclose(r.acceleration, a, atol=0.6)


def test_rows_are_values() -> None:
    model = robot("small_arm")
    front_end = FrontEnd(TorqueModel(model, [Payload(model)]), 0.004, 250.0)
    stream = measurements(Motion(model), 2.0, 250.0, [])
    first = rows_of(front_end, stream)
    again = rows_of(FrontEnd(TorqueModel(model, [Payload(model)]), 0.004, 250.0), stream)
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.Y, b.Y)
        np.testing.assert_array_equal(a.y, b.y)
    assert not np.array_equal(first[0].Y, first[-1].Y)


def test_links_that_are_settled_under_way_are_as_if_they_had_been_from_the_start() -> None:
    """Filters, history and model alike: rows of after it, and those that are made again since a change."""
    model, rng = robot("small_arm"), np.random.default_rng(0)
    directions, payload = 0.1 * rng.normal(size=(10 * model.n, 3)), Payload(model)
    mean, root = rng.normal(size=13), rng.normal(size=(13, 5))
    columns = payload.link_columns()
    assert columns is not None
    loads = np.hstack([columns, directions])
    first = FrontEnd(TorqueModel(model, [payload], inexact=directions), 0.004, 100.0)
    known = TorqueModel(model, [payload], inexact=directions)
    known.settle_links(loads @ mean, loads @ root, np.zeros((model.n, 5)))
    second = FrontEnd(known, 0.004, 100.0)
    recording = measurements(Motion(model), 3.0, 250.0, [], torque_noise=0.1)
    rows_of(second, recording[:500])
    rows_of(first, recording[:500])
    first.settle_links(loads, mean, root)
    variance, prior, theta = np.full(model.n, 0.01), np.ones(10), np.zeros(10)
    after = rows_of(first, recording[500:]) + first.since_change(theta, variance, prior)[1]
    straight = rows_of(second, recording[500:]) + second.since_change(theta, variance, prior)[1]
    assert len(after) > 100
    for a, b in zip(after, straight, strict=True):
        for one, other in ((a.Y, b.Y), (a.y, b.y), (a.considered, b.considered), (a.tau, b.tau)):
            np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("rate", [250.0, 1000.0])
def test_the_first_rows_hold_nothing_of_a_noisy_first_acceleration(rate: float) -> None:
    """A second difference of noisy positions is off by hundreds of rad/s^2, which only cancels with those that follow."""
    model, rng = robot("iiwa"), np.random.default_rng(0)
    front_end = FrontEnd(TorqueModel(model, [Payload(model)]), 1.0 / rate, 100.0, noise=5e-4)
    still = np.array(0.3 * np.arange(model.n))
    torque = model.gravity_torque(still)
    stream = [Measurement(1.0 + k / rate, still + 5e-4 * rng.normal(size=model.n), None, torque) for k in range(int(2.0 * rate))]
    rows = rows_of(front_end, stream)
    assert len(rows) > 80
    left = np.array([row.y for row in rows])
    assert np.abs(left[:20]).max() < 3.0 * np.abs(left[60:]).max()


def test_a_change_right_after_a_rest_begins_with_all_there_is() -> None:
    model = robot("iiwa")
    front_end = FrontEnd(TorqueModel(model, [Payload(model)]), 1e-3, 100.0)
    stream = measurements(Motion(model), 2.0, 1000.0, [])
    rows_of(front_end, stream[:1500])
    front_end.rest()
    (row,) = rows_of(front_end, stream[1500:1510])
    t, rows = front_end.since_change(np.zeros(10), np.ones(model.n), np.ones(10))
    assert len(rows) == 1
    assert t <= row.t
    np.testing.assert_allclose(rows[0].Y, row.Y, atol=1e-12)


def test_what_the_noise_of_accelerations_does_to_the_rows_is_told() -> None:
    model, rng = robot("iiwa"), np.random.default_rng(0)
    front_end = FrontEnd(TorqueModel(model, [Payload(model)]), 1e-3, 100.0, noise=2e-4)
    still, none = np.array(0.3 * np.arange(model.n)), np.zeros(model.n)
    torque = model.gravity_torque(still)
    stream = [Measurement(1.0 + 1e-3 * k, still + 2e-4 * rng.normal(size=model.n), None, torque) for k in range(40_000)]
    rows = rows_of(front_end, stream)
    told = [row.noise for row in rows if row.noise is not None]
    assert len(rows) / 11 < len(told) < len(rows) / 9
    Y, tau, _ = told[-1]
    at_rest = model.payload_regressor(still, none, none, model.frame_id(model.default_frame))
    seen_Y = sum(((row.Y - at_rest)[:, :4].T @ (row.Y - at_rest)[:, :4] for row in rows), np.zeros((4, 4))) / len(rows)
    seen_tau = np.mean([row.y**2 for row in rows], axis=0)
    expected_Y = np.einsum("kmp,kmq->pq", Y[:, :, :4], Y[:, :, :4])
    np.testing.assert_allclose(np.sqrt(seen_Y.diagonal()[1:4]), np.sqrt(expected_Y.diagonal()[1:4]), rtol=0.35)
    np.testing.assert_allclose(np.sqrt(seen_tau), np.sqrt((tau**2).sum(axis=0)), rtol=0.35)


def test_links_that_are_free_leave_all_of_the_torque() -> None:
    model = robot("small_arm")
    links = LinkInertia(model)
    rows = rows_of(FrontEnd(TorqueModel(model, [links]), 0.004, 50.0), measurements(Motion(model), 3.0, 250.0, []))
    for r in rows:
        np.testing.assert_allclose(r.y, r.tau, atol=1e-9)
        np.testing.assert_allclose(r.Y @ links.nominal, r.y, atol=0.02 * np.abs(r.y).max() + 0.01)


@pytest.mark.parametrize("rate", [1000.0, 250.0])
def test_white_noise_is_read_from_moving_torques(rate: float) -> None:
    model = robot("iiwa")
    stream = measurements(Motion(model), 3.0, rate, [], torque_noise=0.2)
    estimates = [white_noise_variance(stream[k : k + 100]) for k in range(0, len(stream) - 100, 100)]
    assert np.median(estimates) == pytest.approx(0.2**2, rel=0.25)


def check(part: float, noise: float, floor: float, count: int = 500, residual: float = 1.0) -> str:
    model = robot("small_arm")
    rng = np.random.default_rng(0)
    model_check, nothing = ModelCheck(model), np.zeros((model.n, 1))
    for _ in range(count):
        torque = 10.0 * rng.normal(size=4)
        model_check.add(torque, nothing, part * torque, np.zeros(1))
    return model_check.verdict(np.full(4, noise), np.full(4, residual), np.full(4, floor))


def test_a_model_is_wrong_where_much_is_left_that_can_not_be_noise() -> None:
    wrong = check(part=0.5, noise=25.0, floor=1e-3)
    assert any(name in wrong for name in robot("small_arm").joint_names)
    assert "50 %" in wrong
    assert "sysid identify" in wrong
    assert check(part=0.02, noise=0.04, floor=1e-3) == ""  # little is left
    assert check(part=0.5, noise=25.0, floor=20.0) == ""  # it is noise
    assert check(part=0.5, noise=25.0, floor=1e-3, count=20) == ""  # too early
    # noise that is slow, beside friction that the model lacks but the estimator finds
    assert check(part=0.5, noise=25.0, floor=1e-3, residual=0.01) == ""


def test_a_joint_that_carries_nothing_does_not_make_the_model_wrong() -> None:
    model = robot("small_arm")
    model_check, nothing = ModelCheck(model), np.zeros((model.n, 1))
    for sign in np.random.default_rng(0).choice([-1.0, 1.0], 500):
        torque = sign * np.array([0.01, 20.0, 10.0, 5.0])
        model_check.add(torque, nothing, np.array([0.01, 0.2, 0.1, 0.05]) * sign, np.zeros(1))
    assert model_check.verdict(np.full(4, 1.0), np.full(4, 1.0), np.full(4, 1e-4)) == ""
    assert model_check.part[0] < 0.2


def kinds(log: EventLog) -> list[str]:
    return [e.kind for e in log.events]


@pytest.mark.parametrize(
    ("before", "after", "kind"),
    [
        (0.0, 1.0, "pick"),
        (0.05, 0.3, "pick"),
        (1.0, 0.0, "drop"),
        (2.0, -0.1, "drop"),
        (1.0, 2.0, "change"),
        (2.0, 1.0, "change"),
        (0.0, -1.5, "external_force"),
        (1.0, -0.8, "external_force"),
    ],
)
def test_kinds_of_events(before: float, after: float, kind: str) -> None:
    log = EventLog(0.15)
    log.add(5.0, before, after)
    (event,) = log.events
    assert (event.t, event.kind, event.mass_before, event.mass_after) == (5.0, kind, before, after)


def test_an_event_is_refined_while_it_settles() -> None:
    log = EventLog(0.15, settle_time=1.0)
    log.add(5.0, 0.0, -0.5)
    log.refine(5.5, 1.2)
    log.refine(5.9, 1.3)
    log.refine(6.5, 9.0)
    (event,) = log.events
    assert (event.kind, event.mass_after, event.t) == ("pick", 1.3, 5.0)


def test_jumps_in_quick_succession_are_one_event() -> None:
    log = EventLog(0.15, same=0.5)
    log.add(5.0, 0.0, 1.0)
    log.add(5.3, 1.0, 1.2)
    log.add(6.0, 1.2, 0.0)
    assert kinds(log) == ["pick", "drop"]
    log.force(6.0, 1.2)  # the newest was a push
    assert kinds(log) == ["pick", "external_force"]
    log.body(6.0, 9.0, 1.2, 0.0)  # or was it
    assert kinds(log) == ["pick", "drop"]


def test_what_pulls_at_a_robot_before_it_is_lifted_is_no_event() -> None:
    log = EventLog(0.15, settle_time=3.0)
    log.add(1.0, 0.0, 2.0)
    for t in np.arange(1.1, 9.5, 0.1):
        log.refine(t, 2.0)
    log.add(9.6, 2.0, 1.2)
    log.lift(10.5)
    assert kinds(log) == ["pick"]
    log.set_down(14.0, 2.05, 0.02)
    assert kinds(log) == ["pick"]


@pytest.mark.parametrize(("after", "kind"), [(0.0, "drop"), (3.0, "change")])
def test_what_was_changed_in_the_air_is_an_event_once_it_is_known(after: float, kind: str) -> None:
    log = EventLog(0.15, settle_time=3.0)
    for t in np.arange(0.0, 9.5, 0.1):
        log.refine(t, 2.0)
    log.add(9.6, 2.0, 1.2)
    log.lift(10.5)
    log.set_down(14.0, after, 0.02)
    (event,) = log.events
    assert (event.kind, event.t, event.mass_before, event.mass_after) == (kind, 14.0, 2.0, after)
    log.set_down(15.0, 9.0, 0.02)
    assert len(log.events) == 1


def test_nothing_to_refine() -> None:
    log = EventLog(0.15)
    log.refine(1.0, 2.0)
    assert log.events == []
