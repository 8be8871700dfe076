"""OnlineEstimation on simulated measurements: what is carried is found with honest intervals, and no stream stops it."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from motions import Motion, measurements
from robots import random_body, robot, urdf

from sysid_ros.effects import CoulombFriction, Effect, Payload, TorqueOffset, ViscousFriction
from sysid_ros.exceptions import ModelFileError, RobotModelError
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import STATUSES, PayloadEstimate
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.torque.model_file import EffectBlock, ModelFile

RATE = 250.0
START = 100.0
BODY = inertial_parameters.from_com(1.5, np.array([0.03, -0.02, 0.08]), np.diag([0.004, 0.006, 0.005]))
NOISE: dict[str, Any] = {"torque_noise": 0.1, "encoder_noise": 1e-5}
MODEL = robot("iiwa")


def estimation(model: RobotModel = MODEL, **settings: object) -> OnlineEstimation:
    return OnlineEstimation(model, OnlineSettings(**{"publish_rate": 10.0, **settings}))  # type: ignore[arg-type]


def run(online: OnlineEstimation, stream: list[Measurement]) -> list[PayloadEstimate]:
    return [e for e in map(online.step, stream) if e is not None]


def payload_stream(seconds: float = 12.0, pick: float = 0.0, drop: float = np.inf, **options: Any) -> list[Measurement]:
    effects = [(Payload(MODEL), BODY, pick, drop)]
    return measurements(Motion(MODEL, seed=1), seconds, RATE, effects, **{**NOISE, **options})


@pytest.fixture(scope="module")
def carried() -> list[Measurement]:
    """A payload from the start."""
    return payload_stream()


@pytest.fixture(scope="module")
def pick_and_drop() -> list[Measurement]:
    """Empty, picked up at 8 s, dropped at 16 s."""
    return payload_stream(24.0, 8.0, 16.0)


def assert_found(estimate: PayloadEstimate, theta: FloatArray = BODY) -> None:
    mass, com, _ = inertial_parameters.to_com(theta)
    assert estimate.status == "ok", estimate.reason
    assert abs(estimate.mass - mass) < min(4.0 * estimate.mass_std, 0.03 * mass)
    assert np.all(np.abs(estimate.com - com) < np.minimum(4.0 * estimate.com_std, 0.01))


def test_a_payload_is_found_within_its_interval(carried: list[Measurement]) -> None:
    series = run(estimation(), carried)
    assert_found(series[-1])
    final = series[-1]
    assert final.frame == MODEL.default_frame
    assert 0.03 < final.mass_std < 0.1  # mostly what the URDF's links may be wrong by
    assert np.all(np.abs(final.theta - BODY) < 5.0 * final.std)
    assert final.observable[:4].all()
    assert inertial_parameters.is_physical(final.theta)


def test_values_have_the_shapes_that_are_stated(carried: list[Measurement]) -> None:
    for e in run(estimation(), carried[:2000]):
        assert e.theta.shape == (10,)
        assert e.covariance.shape == (10, 10)
        np.testing.assert_allclose(e.covariance, e.covariance.T)
        assert np.linalg.eigvalsh(e.covariance / np.outer(e.std, e.std))[0] > 0.0
        assert e.observable.shape == (10,)
        assert e.observable.dtype == bool
        assert e.residual.shape == e.payload_effort.shape == (7,)
        assert e.com.shape == e.com_std.shape == (3,)
        assert e.body.com_covariance.shape == e.inertia_com.shape == (3, 3)
        assert e.status in STATUSES
        assert e.reason or e.status == "ok"
        assert np.isfinite(e.theta).all()


def test_before_it_knows_it_says_so(carried: list[Measurement]) -> None:
    online = estimation()
    prior = online.prior()
    assert prior.status == "warming_up"
    assert not prior.observable.any()
    assert prior.mass_std == OnlineSettings().prior_mass_std
    series = run(online, carried)
    assert series[0].status == "warming_up"
    for e in series:
        assert e.status != "ok" or e.mass_std < 0.2


def test_estimates_come_at_the_rate_that_is_set(carried: list[Measurement]) -> None:
    for rate in (10.0, 25.0):
        online = estimation(publish_rate=rate)
        times = [e.t for e in run(online, carried[:2500])]
        np.testing.assert_allclose(np.diff(times)[1:], 1.0 / rate, rtol=0.1)
        assert set(times) <= {m.t for m in carried}
        assert online.rate == pytest.approx(RATE)


def test_the_payload_effort_is_what_the_payload_costs(carried: list[Measurement]) -> None:
    e = run(estimation(), carried)[-1]
    q, v, a = (x[0] for x in Motion(MODEL, seed=1)(np.array([e.t - 0.05])))
    cost = MODEL.payload_regressor(q, v, a, MODEL.frame_id(MODEL.default_frame)) @ BODY
    np.testing.assert_allclose(e.payload_effort, cost, atol=0.1 * np.abs(cost).max() + 0.1)
    assert np.abs(e.residual).max() < 0.5


def test_the_payload_in_another_frame(carried: list[Measurement]) -> None:
    e = run(estimation(frame_id="lbr_iiwa_link_6"), carried)[-1]
    assert e.frame == "lbr_iiwa_link_6"
    assert abs(e.mass - BODY[0]) < 0.05


@pytest.mark.parametrize("velocity_source", ["position", "message"])
def test_velocity_from_either_source(velocity_source: str, carried: list[Measurement]) -> None:
    assert_found(run(estimation(velocity_source=velocity_source), carried)[-1])


def test_without_velocity_in_the_messages(carried: list[Measurement]) -> None:
    bare = [Measurement(m.t, m.q, None, m.tau) for m in carried]
    assert_found(run(estimation(), bare)[-1])
    assert_found(run(estimation(velocity_source="message"), bare)[-1])


def test_an_empty_arm_carries_nothing() -> None:
    stream = measurements(Motion(MODEL, seed=2), 14.0, RATE, [], **NOISE)
    online = estimation()
    final = run(online, stream)[-1]
    assert final.status == "no_payload"
    assert abs(final.mass) < 0.1
    assert online.events == []


@pytest.mark.parametrize("seed", range(4))
def test_pick_and_drop_are_found_in_time(seed: int) -> None:
    rng = np.random.default_rng(seed)
    theta = inertial_parameters.from_com(rng.uniform(0.6, 3.0), 0.08 * rng.normal(size=3), 0.004 * np.eye(3))
    stream = measurements(
        Motion(MODEL, seed=seed),
        22.0,
        RATE,
        [(Payload(MODEL), theta, 8.0, 15.0)],
        **NOISE,
        seed=seed,
    )
    online = estimation()
    series = run(online, stream)
    assert [e.kind for e in online.events] == ["pick", "drop"]
    for event, t in zip(online.events, (8.0, 15.0), strict=True):
        assert abs(event.t - START - t) < 0.3
    pick, drop = online.events
    assert abs(pick.mass_before) < 0.15
    assert abs(pick.mass_after - theta[0]) < 0.15 * theta[0]
    assert abs(drop.mass_after) < 0.15
    at = {round(e.t - START, 2): e for e in series}
    settled = at[min(at, key=lambda t: abs(t - 11.0))]
    assert_found(settled, theta)
    assert series[-1].status == "no_payload"


def test_no_event_where_there_is_none() -> None:
    stream = measurements(Motion(MODEL, seed=5), 40.0, RATE, [(Payload(MODEL), BODY)], **NOISE)
    online = estimation()
    run(online, stream)
    assert online.events == []


def test_a_gap_restarts_the_filters_and_keeps_the_estimate(carried: list[Measurement]) -> None:
    online = estimation()
    before = run(online, carried[:2500])[-1]
    after = run(online, [m for m in carried[2500:] if m.t - carried[2500].t > 0.7])
    assert after
    assert after[0].t - carried[2500].t > 0.7 + 0.1  # the filters fill first
    assert after[0].mass == pytest.approx(before.mass, abs=4.0 * before.mass_std)
    assert online.events == []
    assert_found(after[-1])


@pytest.mark.parametrize("rate", [250.0, 1000.0])
def test_gaps_leave_no_trace(rate: float) -> None:
    """Differences taken across a gap, or filters that start on noise, would be wrong by far more than the torque's noise."""
    stream = measurements(Motion(MODEL, seed=0), 14.0, rate, [(Payload(MODEL), BODY)], **NOISE)
    online = estimation()
    series = run(online, [m for m in stream if m.t < START + 3.0 or (m.t - START) % 1.5 > 0.2])
    assert online.events == []
    assert max(np.abs(e.residual).max() for e in series if e.status == "ok") < 1.0
    assert_found(series[-1])


@pytest.mark.parametrize("shift", [-5000.0, 1e6])
def test_a_clock_that_jumps_restarts_the_filters(shift: float, carried: list[Measurement]) -> None:
    online = estimation()
    run(online, carried[:2500])
    later = [Measurement(m.t + shift, m.q, m.v, m.tau) for m in carried[2500:]]
    series = run(online, later)
    assert series[0].t > later[0].t + 0.1
    assert_found(series[-1])
    assert online.events == []


def test_the_same_bag_again_and_again(carried: list[Measurement]) -> None:
    online = estimation()
    for _ in range(2):
        series = run(online, carried[:2500])
        assert series
    assert_found(series[-1])


def test_lost_and_jittered_messages() -> None:
    stream = payload_stream(jitter=0.3)
    kept = [m for m, u in zip(stream, np.random.default_rng(0).uniform(size=len(stream)), strict=True) if u > 0.1]
    assert_found(run(estimation(), kept)[-1])


def test_while_it_stands_nothing_is_learned_and_nothing_drifts(carried: list[Measurement]) -> None:
    online = estimation()
    before = run(online, carried)[-1]
    last = carried[-1]
    rng = np.random.default_rng(0)
    tau = (
        MODEL.gravity_torque(last.q)
        + MODEL.payload_regressor(last.q, np.zeros(7), np.zeros(7), MODEL.frame_id(before.frame)) @ BODY
    )
    still = [
        Measurement(last.t + 1.0 + k / RATE, last.q + 1e-5 * rng.normal(size=7), None, tau + 0.1 * rng.normal(size=7))
        for k in range(8_000)
    ]
    series = run(online, still)
    assert_found(series[-1])
    assert series[-1].mass_std <= 1.5 * before.mass_std
    assert np.all(np.abs(series[-1].theta - before.theta) < 3.0 * before.std)
    assert online.events == []


def test_an_arm_that_never_moved_does_not_know() -> None:
    q = np.zeros(7)
    still = [Measurement(START + k / RATE, q, q, MODEL.gravity_torque(q)) for k in range(3000)]
    series = run(estimation(), still)
    assert {e.status for e in series} <= {"warming_up", "not_excited"}
    assert series[-1].status == "not_excited"
    assert "Move" in series[-1].reason


def test_disabled_it_gives_nothing_and_goes_on_where_it_was(carried: list[Measurement]) -> None:
    online = estimation()
    before = run(online, carried[:2000])[-1]
    online.set_enabled(False)
    assert run(online, carried[2000:2500]) == []
    assert online.latest is before
    online.set_enabled(True)
    after = run(online, carried[2500:])
    assert after[0].mass == pytest.approx(before.mass, abs=4.0 * before.mass_std)
    assert_found(after[-1])
    assert online.events == []


def test_tare_makes_what_is_carried_zero(carried: list[Measurement]) -> None:
    online = estimation(effort_gain_error=0.0)
    before = run(online, carried[:2500])[-1]
    sentence = online.tare()
    assert re.search(r"Tared at 1\.(49|50)\d kg", sentence)
    after = run(online, carried[2500:])
    assert abs(after[-1].mass) < 0.1
    assert after[-1].status == "no_payload"
    assert after[-1].mass_std < 0.1 * before.mass_std  # what the links are wrong by is in both


def test_tare_before_anything_is_known_says_so() -> None:
    assert "nothing was tared" in estimation().tare()


def test_after_a_tare_the_mass_before_a_pick_is_counted_from_it() -> None:
    tool, body = BODY, inertial_parameters.from_com(1.0, np.array([0.0, 0.05, 0.1]), 0.003 * np.eye(3))
    effects = [(Payload(MODEL), tool), (Payload(MODEL), body, 12.0, np.inf)]
    stream = measurements(Motion(MODEL, seed=1), 20.0, RATE, effects, **NOISE)  # type: ignore[arg-type,arg-type]
    online = estimation()
    run(online, stream[:2500])
    online.tare()
    final = run(online, stream[2500:])[-1]
    assert abs(final.mass - 1.0) < 0.06
    (event,) = online.events
    assert event.kind == "pick"
    assert abs(event.mass_before) < 0.15
    assert abs(event.mass_after - 1.0) < 0.15


def test_reset_forgets_and_says_why(carried: list[Measurement]) -> None:
    online = estimation()
    run(online, carried)
    online.reset("the gripper was changed")
    assert online.latest is None
    assert any("the gripper was changed" in w for w in online.warnings)
    shifted = [Measurement(m.t + 50.0, m.q, m.v, m.tau) for m in carried[:2500]]
    series = run(online, shifted)
    fresh = run(estimation(), carried[:2500])
    assert series[0].status == "warming_up"
    assert np.all(np.abs(series[-1].theta - fresh[-1].theta) < 0.05 * fresh[-1].std)
    np.testing.assert_allclose(series[-1].std, fresh[-1].std, rtol=0.05)


def test_the_same_stream_gives_the_same_estimates(carried: list[Measurement]) -> None:
    one, other = run(estimation(), carried[:1200]), run(estimation(), carried[:1200])
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.theta, b.theta)
        np.testing.assert_array_equal(a.covariance, b.covariance)


def test_robots_that_publish_external_torque() -> None:
    stream = payload_stream(links=False)
    assert_found(run(estimation(effort_type="external"), stream)[-1])
    assert run(estimation(), stream)[-1].status != "ok"


def friction() -> list[tuple[Effect, FloatArray]]:
    return [
        (CoulombFriction(MODEL), np.array([1.5, 1.5, 1.0, 1.0, 0.6, 0.4, 0.3])),
        (ViscousFriction(MODEL), np.array([2.0, 2.0, 1.5, 1.5, 0.8, 0.5, 0.3])),
        (TorqueOffset(MODEL), np.array([0.4, -0.3, 0.2, -0.2, 0.1, 0.0, 0.05])),
    ]


def test_friction_is_estimated_beside_the_payload() -> None:
    stream = measurements(Motion(MODEL, seed=1), 20.0, RATE, [(Payload(MODEL), BODY), *friction()], **NOISE)
    assert_found(run(estimation(), stream)[-1])


def test_without_friction_there_are_ten_parameters(carried: list[Measurement]) -> None:
    online = estimation(estimate_friction=False, base_tilt_std=0.0)
    assert_found(run(online, carried)[-1])
    assert online.estimator is not None
    assert online.estimator.p == 10


def test_the_constant_estimator_finds_it_too(carried: list[Measurement]) -> None:
    online = estimation(estimator="constant", torque_std=(0.1,), forgetting_time=20.0)
    final = run(online, carried)[-1]
    assert final.status == "ok"
    assert abs(final.mass - 1.5) < 0.05
    assert online.events == []


def known_model(effects: list[tuple[Effect, FloatArray]], std: float = 0.05) -> ModelFile:
    blocks = tuple(EffectBlock(e.id, e.joint_names, e.settings, theta, e.parameter_names, e.units, None) for e, theta in effects)
    return ModelFile(MODEL.name, MODEL.joint_names, "", blocks, np.full(7, std), np.full(7, 0.05))


def test_a_known_model_is_taken_off_the_torque() -> None:
    stream = measurements(Motion(MODEL, seed=1), 14.0, RATE, [(Payload(MODEL), BODY), *friction()], **NOISE)
    online = OnlineEstimation(MODEL, OnlineSettings(), known_model(friction()))
    assert_found(run(online, stream)[-1])


def test_a_model_whose_urdf_is_another_is_noted() -> None:
    model = known_model(friction())
    online = OnlineEstimation(MODEL, OnlineSettings(), ModelFile(**{**_fields(model), "urdf_sha256": "0" * 64}))
    assert any("URDF" in w for w in online.warnings)


def _fields(model: ModelFile) -> dict[str, Any]:
    return {name: getattr(model, name) for name in ("robot_name", "joints", "effects", "torque_std", "correlation_time")}


@pytest.mark.parametrize("estimate_friction", [True, False])
def test_a_model_that_does_not_explain_the_torques_is_inconsistent(estimate_friction: bool) -> None:
    """The URDF's masses are wrong by 40 %: no payload can explain that, and it must not be called one. Where friction is not
    estimated its torques are noise, which hides even that; then nothing is known."""
    heavy = urdf("iiwa")
    for value in ("4", "3", "2.7", "1.7", "1.8", "0.3"):
        heavy = heavy.replace(f'<mass value="{value}"', f'<mass value="{float(value) * 1.4}"')
    wrong = RobotModel.from_urdf(heavy)
    stream = measurements(
        Motion(MODEL, seed=1),
        20.0,
        RATE,
        [(Payload(MODEL), BODY), *((e, 6.0 * t) for e, t in friction())],
        **NOISE,
    )
    online = OnlineEstimation(wrong, OnlineSettings(estimate_friction=estimate_friction))
    found = run(online, stream)
    final = found[-1]
    assert not any(e.status in ("ok", "no_payload") for e in found)
    if not estimate_friction:
        return
    assert final.status == "inconsistent"
    share, std = map(int, re.findall(r"(\d+) % \(std (\d+)\)", final.reason)[0])
    assert abs(share - 100.0 / 1.4) < 2.0 * std <= 6.0
    assert "sysid identify" in final.reason
    assert final.reason in online.warnings


def test_slow_messages_are_warned_of() -> None:
    stream = measurements(Motion(MODEL, seed=1, speed=0.3), 30.0, 12.0, [(Payload(MODEL), BODY)])
    online = estimation()
    run(online, stream)
    assert any("12.0 Hz" in w for w in online.warnings)


def test_a_robot_with_slides() -> None:
    model = robot("tree_robot")
    theta = inertial_parameters.from_com(*random_body(np.random.default_rng(3)))
    frame = "right_tip"
    stream = measurements(Motion(model, seed=3), 20.0, RATE, [(Payload(model, frame=frame), theta)], **NOISE)
    undamped = RobotModel.from_urdf(urdf("tree_robot").replace('<dynamics damping="0.7" friction="0.4"/>', ""))
    final = run(estimation(undamped, frame_id=frame), stream)[-1]
    assert final.status == "ok", final.reason
    assert abs(final.mass - theta[0]) < 4.0 * final.mass_std


def test_a_frame_or_a_model_that_does_not_fit() -> None:
    with pytest.raises(RobotModelError, match="gripper"):
        estimation(frame_id="gripper")
    with pytest.raises(ModelFileError, match="joints"):
        OnlineEstimation(robot("small_arm"), OnlineSettings(), known_model(friction()))


SMALL = robot("small_arm")
GOOD = measurements(Motion(SMALL, seed=1), 1.5, 200.0, [])
FINITE = st.floats(allow_nan=False, allow_infinity=False)
ANY = st.one_of(st.sampled_from([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e160, 1e30, 5e-324, 0.0]), st.floats())
FAULT = st.tuples(st.integers(0, len(GOOD) - 1), st.sampled_from("tqvu"), ANY, st.integers(0, 40))
SETTINGS = st.sampled_from(
    [{}, {"estimator": "constant"}, {"estimate_friction": False}, {"velocity_source": "message"}, {"torque_std": (1e-9,)}]
)


def spoil(faults: list[tuple[int, str, float, int]], period: float, shift: float) -> list[Measurement]:
    t = shift + period * np.arange(len(GOOD))
    q, v, tau = (np.array([getattr(m, name) for m in GOOD]) for name in ("q", "v", "tau"))
    for start, channel, value, length in faults:
        where = slice(start, start + length)
        if channel == "t":
            t[where] = value
        else:
            {"q": q, "v": v, "u": tau}[channel][where, start % SMALL.n] = value
    return [Measurement(float(t[k]), q[k], None if k % 7 == 0 else v[k], tau[k]) for k in range(len(GOOD))]


@example([], 1e-300, 0.0, {})
@example([], 0.005, 0.0, {"torque_std": (1e-9,)})
@example([(100, "u", 1e308, 10)], 0.005, 0.0, {})
@example([(100, "q", 1e160, 10)], 0.005, 0.0, {"estimator": "constant"})
@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    st.lists(FAULT, max_size=8),
    st.one_of(st.sampled_from([0.005, 1e-3, 0.09, 1e-9, 1e-300, 0.0, -0.01, 3.0]), FINITE),
    st.sampled_from([0.0, 1.7e9, -1e18]),
    SETTINGS,
)
def test_no_stream_of_measurements_makes_it_raise(
    faults: list[tuple[int, str, float, int]], period: float, shift: float, options: dict[str, object]
) -> None:
    online = estimation(SMALL, **options)
    with np.errstate(all="ignore"):
        for m in spoil(faults, period, shift):
            estimate = online.step(m)
            assert estimate is None or estimate.status in STATUSES
        online.tare()
        online.set_enabled(True)
        online.reset("test")
        online.step(GOOD[0])


@pytest.mark.parametrize("estimator", ["variable", "constant"])
@pytest.mark.parametrize(
    ("channel", "value"),
    [*((c, x) for c in "quv" for x in (np.nan, np.inf)), *(("t", x) for x in (np.nan, np.inf, -np.inf, 1e9, 1e308, -1e9))],
)
def test_it_recovers_from_whatever_came(estimator: str, channel: str, value: float, carried: list[Measurement]) -> None:
    """A burst of values that can't be: what comes after is estimated as if nothing had been."""
    options: dict[str, Any] = {"torque_std": (0.1,)} if estimator == "constant" else {}
    online = estimation(estimator=estimator, velocity_source="message", **options)
    run(online, carried[:1000])
    with np.errstate(all="ignore"):
        for m in carried[1000:1010]:
            t, q, v, tau = m.t, m.q.copy(), m.q.copy() if m.v is None else m.v.copy(), m.tau.copy()
            if channel == "t":
                t = value
            else:
                {"q": q, "u": tau, "v": v}[channel][3] = value
            online.step(Measurement(t, q, v, tau))
    assert_found(run(online, carried[1010:2500])[-1])


@pytest.mark.parametrize("estimator", ["variable", "constant"])
@pytest.mark.parametrize("channel", ["q", "u", "v"])
@pytest.mark.parametrize("value", [1e9, 1e160, 1e308])
def test_absurd_values_do_not_make_it_raise_and_a_reset_helps(
    estimator: str, channel: str, value: float, carried: list[Measurement]
) -> None:
    """The gate before it keeps such values out; where they come all the same, nothing stops."""
    options: dict[str, Any] = {"torque_std": (0.1,)} if estimator == "constant" else {}
    online = estimation(estimator=estimator, velocity_source="message", **options)
    run(online, carried[:1000])
    with np.errstate(all="ignore"):
        for m in carried[1000:1010]:
            q, v, tau = m.q.copy(), m.q.copy() if m.v is None else m.v.copy(), m.tau.copy()
            {"q": q, "u": tau, "v": v}[channel][3] = value
            online.step(Measurement(m.t, q, v, tau))
        run(online, carried[1010:1500])
    online.reset("absurd values")
    assert_found(run(online, carried[1500:])[-1])
