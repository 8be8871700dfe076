"""Changes of what is carried, forces that are none, and models that are not quite right, on streams of known truth."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from motions import Motion, measurements
from robots import robot, urdf

from sysid_ros.effects import Payload
from sysid_ros.effects.base_tilt import tilted_gravity
from sysid_ros.estimators import ESTIMATORS
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import NOT_A_BODY, PayloadEstimate, nearest_body
from sysid_ros.online.small_tilt import SmallTilt
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.link_inexactness import link_inexactness
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement, Sample
from sysid_ros.signals.cutoff import default_cutoff, position_noise

RATE, START = 250.0, 100.0
MODEL = robot("iiwa")
BODY = inertial_parameters.from_com(1.5, np.array([0.03, -0.02, 0.08]), np.diag([0.004, 0.006, 0.005]))
NEVER = np.inf


def stream(
    seconds: float = 16.0,
    pick: float = 6.0,
    drop: float = NEVER,
    seed: int = 1,
    encoder_noise: float = 1e-5,
    links: FloatArray | None = None,
    tilt: tuple[float, float] | None = None,
) -> list[Measurement]:
    """An arm that picks up and drops; its links differ by ``links`` (10 n,) from the URDF's, its base by ``tilt``."""
    model = MODEL if links is None else MODEL.with_links(links)
    if tilt is not None:  # links and payload alike
        model = RobotModel.from_urdf(urdf("iiwa"), gravity=tuple(tilted_gravity(MODEL.gravity, *tilt)))
    motion, effects = Motion(model, seed=seed), [(Payload(model), BODY, pick, drop)]
    return measurements(motion, seconds, RATE, effects, 0.1, encoder_noise, velocity=False)


def pushed(recording: list[Measurement], begin: float, end: float, force: FloatArray) -> list[Measurement]:
    """A force in the axes of the base acts at the flange from ``begin`` to ``end`` [s]."""
    frame = MODEL.frame_id(MODEL.default_frame)
    data = MODEL.model.createData()
    out = []
    for m in recording:
        if begin <= m.t - START < end:
            jacobian = pin.computeFrameJacobian(MODEL.model, data, m.q, frame, pin.LOCAL_WORLD_ALIGNED)
            m = replace(m, tau=m.tau - jacobian[:3].T @ force)
        out.append(m)
    return out


def run(recording: list[Measurement], **settings: object) -> tuple[OnlineEstimation, list[PayloadEstimate]]:
    online = OnlineEstimation(MODEL, OnlineSettings(**settings))  # type: ignore[arg-type]
    return online, [e for e in map(online.step, recording) if e is not None]


def after(series: list[PayloadEstimate], t: float) -> list[PayloadEstimate]:
    return [e for e in series if e.t - START >= t]


def test_a_pick_is_known_at_once_and_holds_nothing_of_before() -> None:
    """Rows are made again since the change: 5 % in a tenth of a second, for good."""
    online, series = run(stream())
    (event,) = online.events
    assert event.kind == "pick"
    assert abs(event.t - START - 6.0) < 0.02
    assert all(abs(e.theta[0] - 1.5) < 0.075 for e in after(series, 6.12))
    assert series[-1].status == "ok"


@pytest.mark.parametrize("size", [20.0, 60.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_push_while_carrying_is_a_force_and_nothing_of_it_stays(size: float, seed: int) -> None:
    direction = np.random.default_rng(seed).normal(size=3)
    recording = pushed(stream(seed=seed), 9.0, 10.0, size * direction / np.linalg.norm(direction))
    online, series = run(recording)
    assert [e.kind for e in online.events] == ["pick", "external_force"]
    assert abs(online.events[1].t - START - 9.0) < 0.05
    assert online.events[1].mass_after == pytest.approx(1.5, abs=0.05)
    told = [e for e in series if e.status == "ok"]
    assert all(abs(e.theta[0] - 1.5) < 3.0 * e.mass_std for e in told)
    assert not [e for e in told if 9.3 <= e.t - START < 10.0]  # nothing is claimed while it acts
    again = after(series, 13.0)
    assert {e.status for e in again} == {"ok"}
    assert abs(again[-1].theta[0] - 1.5) < 0.03


@pytest.mark.parametrize("name", sorted(set(ESTIMATORS) - {"variable"}))
def test_every_estimator_finds_a_pick_and_a_drop(name: str) -> None:
    """A random walk pays for what it could follow; the others are as good as least squares with a prior."""
    online, series = run(stream(14.0, 6.0, 11.0), estimator=name)
    left = ("drop", "change") if name == "kalman" else ("drop",)  # what is left may be above what counts as nothing
    assert [e.kind in kinds for e, kinds in zip(online.events, (("pick",), left), strict=True)] == [True, True]
    carried = [e for e in after(series, 9.0) if e.t - START < 10.9]
    assert {e.status for e in carried} <= {"ok", "warming_up"}
    assert abs(carried[-1].theta[0] - 1.5) < (0.5 if name == "kalman" else 0.02)
    assert abs(carried[-1].theta[0] - 1.5) < 3.0 * carried[-1].mass_std


def test_a_drop_of_which_little_is_known_yet_is_a_drop() -> None:
    """Its first mass may come out negative by chance: what may be a body is told as one until that is denied."""
    for seed in range(1, 5):
        online, series = run(stream(12.1, drop=12.0, seed=seed))
        assert [e.kind for e in online.events] == ["pick", "drop"]
        assert online.events[1].mass_after >= 0.0 or series[-1].status == "no_payload"


def test_a_push_on_the_empty_arm_is_no_pick() -> None:
    online, series = run(pushed(stream(pick=NEVER), 6.0, 7.0, np.array([40.0, 20.0, -30.0])))
    assert [e.kind for e in online.events] == ["external_force"]
    assert series[-1].status == "no_payload"


def test_a_short_carry_is_a_pick_and_a_drop() -> None:
    online, _ = run(stream(pick=6.0, drop=8.0))
    assert [e.kind for e in online.events] == ["pick", "drop"]


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_links_that_are_off_are_in_the_interval(seed: int) -> None:
    rng = np.random.default_rng(seed)
    off = np.repeat(0.02 * rng.choice([-1.0, 1.0], MODEL.n), 10) * MODEL.pi
    _, series = run(stream(links=off, seed=seed))
    for e in after(series, 8.0):
        assert abs(e.theta[0] - 1.5) < 2.5 * e.mass_std
    exact = run(stream(links=off, seed=seed), link_mass_error=0.0, link_com_error=0.0, effort_gain_error=0.0)[1][-1]
    assert series[-1].mass_std > 5.0 * exact.mass_std


def test_a_tare_takes_out_what_the_links_are_wrong_by() -> None:
    """They are learned from the motion before it, and so is what an offset makes of a mass."""
    off = np.repeat(0.02 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0]), 10) * MODEL.pi
    online = OnlineEstimation(MODEL, OnlineSettings(effort_gain_error=0.0))
    recording = stream(links=off)
    empty = [m for m in recording if m.t - START < 5.8]
    for m in empty:
        online.step(m)
    assert "Tared" in online.tare()
    last = [e for e in map(online.step, recording[len(empty) :]) if e is not None][-1]
    untared = run(recording)[1][-1]
    assert last.mass_std < 0.1 * untared.mass_std
    assert abs(last.theta[0] - 1.5) < 3.0 * last.mass_std


class Wakes(Motion):
    """Every other joint hardly moves until 5 s after the start, and moves as all do two seconds later."""

    def __call__(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        q, v, a = super().__call__(t)
        x, some = np.clip((t - START - 5.0) / 2.0, 0.0, 1.0)[:, None], slice(None, None, 2)
        part, away = 0.05 + 0.95 * (10 * x**3 - 15 * x**4 + 6 * x**5), q[:, some] - self.centre[some]
        rate, bend = 0.475 * (30 * x**2 - 60 * x**3 + 30 * x**4), 0.2375 * (60 * x - 180 * x**2 + 120 * x**3)
        a[:, some] = part * a[:, some] + 2.0 * rate * v[:, some] + bend * away
        v[:, some] = part * v[:, some] + rate * away
        q[:, some] = self.centre[some] + part * away
        return q, v, a


def test_after_a_tare_the_interval_holds_on_another_motion() -> None:
    """Of the links that hardly moved before it little is learned, and the interval knows."""
    distances = []
    for seed in range(4):
        off = np.repeat(0.02 * np.random.default_rng(seed).choice([-1.0, 1.0], MODEL.n), 10) * MODEL.pi
        true = MODEL.with_links(off)
        recording = measurements(Wakes(true, seed), 12.0, RATE, [(Payload(true), BODY, 6.0, NEVER)], 0.1, 1e-5, velocity=False)
        online, last = OnlineEstimation(MODEL, OnlineSettings()), None
        for m in recording:
            if m.t - START == 5.5:
                online.tare()
            last = online.step(m) or last
        assert last is not None
        error = last.theta - BODY
        assert abs(error[0]) < 3.0 * last.mass_std
        distances.append(error @ np.linalg.solve(last.covariance, error) / 10.0)
    assert np.mean(distances) < 1.6


def test_a_tare_soon_after_a_pick_takes_the_estimate_off() -> None:
    """What the rows of before it say of the links is said of another load; what they are wrong by stays in the interval."""
    online, recording = OnlineEstimation(MODEL, OnlineSettings()), stream(seconds=10.0)
    for m in recording[:1600]:
        online.step(m)
    before = online.latest
    assert before is not None
    assert "Tared" in online.tare()
    last = [e for e in map(online.step, recording[1600:]) if e is not None][-1]
    assert abs(last.theta[0]) < 3.0 * np.hypot(last.mass_std, before.mass_std)


def test_what_model_errors_explain_is_not_laid_on_the_noise() -> None:
    """The nearest body is near by the covariance that explains the distance."""
    rng = np.random.default_rng(0)
    noise, model = (np.diag(np.square([m, *[c] * 3, *[i] * 6])) for m, c, i in ((1e-3, 1e-4, 1e-4), (0.02, 0.01, 0.05)))
    for _ in range(20):
        wrong = BODY + np.linalg.cholesky(model) @ rng.normal(size=10)
        body, distance = nearest_body(wrong, noise, noise + model)
        moved = body - wrong
        assert moved @ np.linalg.solve(noise + model, moved) <= 1.01 * distance + 1e-9
        assert distance < NOT_A_BODY


def test_the_directions_of_inexact_links_make_the_torque_that_they_stand_for() -> None:
    L = link_inexactness(MODEL, 0.03, 0.002)
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-1.5, 1.5, (40, MODEL.n)), rng.normal(size=(40, MODEL.n)), rng.normal(size=(40, MODEL.n))
    Y = MODEL.regressor_along(q, v, a)
    told = np.einsum("tjk,kc->tjc", Y, L)
    drawn = []
    for _ in range(400):
        links = []
        for j in range(MODEL.n):
            body = pin.Inertia.FromDynamicParameters(MODEL.pi[10 * j : 10 * j + 10] * (1.0 + 0.03 * rng.normal()))
            moved = pin.Inertia(body.mass, body.lever + 0.002 * rng.normal(size=3), body.inertia)
            links.append(moved.toDynamicParameters())
        drawn.append(Y @ (np.concatenate(links) - MODEL.pi))
    expected, found = np.sqrt(np.mean(np.square(drawn), axis=(0, 1))), np.sqrt(np.sum(told**2, axis=2).mean(axis=0))
    np.testing.assert_allclose(found, expected, rtol=0.12)


def test_what_is_carried_is_heavy_in_another_direction_too_where_the_base_is_tilted() -> None:
    tilt = SmallTilt(MODEL, 0.1, MODEL.frame_id(MODEL.flange))
    tilt.told, tilt.load = "It is.", BODY
    q, zero, angles, columns = np.linspace(-1.0, 1.0, MODEL.n), np.zeros(MODEL.n), np.array([2e-4, -3e-4]), np.zeros((MODEL.n, 2))
    tilt.fill(Sample(0.0, q, zero, zero, zero), columns)
    loaded = MODEL.pi + Payload(MODEL, frame=MODEL.flange).as_links(BODY).ravel()
    turned = RobotModel.from_urdf(urdf("iiwa"), gravity=tuple(MODEL.gravity + np.cross(angles @ tilt.axes, MODEL.gravity)))
    change = (turned.regressor(q, zero, zero) - MODEL.regressor(q, zero, zero)) @ loaded
    np.testing.assert_allclose(columns @ angles, change, atol=1e-9)


def test_a_tilted_base_is_said_and_does_no_harm() -> None:
    online, series = run(stream(tilt=(0.07, -0.05)))
    (said,) = [w for w in online.warnings if "tilted" in w]
    angle, std = (float(x) for x in re.findall(r"by (\d\.\d) degrees \(std (\d\.\d)\)", said)[0])
    assert abs(angle - 4.93) < 2.5 * std < 2.0
    told = np.array(re.findall(r"-?\d+\.\d+", said.split("[")[1]), dtype=float)
    np.testing.assert_allclose(told, tilted_gravity(MODEL.gravity, 0.07, -0.05), atol=0.17)  # 1 degree
    assert abs(series[-1].theta[0] - 1.5) < 3.0 * series[-1].mass_std
    assert [e.kind for e in online.events] == ["pick"]


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_how_a_base_is_tilted_stays_as_uncertain_as_the_data_leave_it(seed: int) -> None:
    """What was found when it was told is no truth: the angles go on being estimated, with an interval that holds."""
    tilt = (0.07, -0.05)
    online, _ = run(stream(6.0, pick=NEVER, seed=seed, tilt=tilt))
    assert [w for w in online.warnings if "tilted" in w]
    assert online.estimator is not None
    found = online._free.tilt
    assert found is not None
    where = online._free.tilt_slice
    theta, covariance = online.estimator.theta[where], online.estimator.covariance()[where, where]
    g = found.robot.gravity + np.cross(theta @ found.axes, found.robot.gravity)
    left = np.cross(g, tilted_gravity(MODEL.gravity, *tilt)) @ found.axes.T / (g @ g)
    assert left @ np.linalg.solve(covariance, left) < 13.8  # 99.9 % quantile of chi-squared with 2 degrees of freedom
    assert np.sqrt(covariance.diagonal().max()) < 0.01


def test_a_level_base_is_known_to_be_level() -> None:
    online, _ = run(stream())
    assert not [w for w in online.warnings if "tilted" in w]
    assert online.estimator is not None
    tilt = online.estimator.covariance()[-2:, -2:]
    assert np.sqrt(tilt.diagonal()).max() < 1e-4


def test_coarse_encoders_lower_the_cutoff_and_leave_no_bias() -> None:
    errors = []
    for seed in range(5, 9):
        recording = stream(encoder_noise=2e-4, seed=seed)
        last, fast = run(recording)[1][-1], run(recording, cutoff_hz=10.0)[1][-1]
        assert abs(last.theta[0] - 1.5) < 0.02
        assert abs(last.theta[0] - 1.5) < 2.5 * last.mass_std
        errors.append((last.theta[0] - 1.5, fast.theta[0] - 1.5))
    adapted, fixed = np.linalg.norm(errors, axis=0)
    assert adapted < fixed


def test_the_cutoff_follows_the_noise_of_the_positions() -> None:
    rng = np.random.default_rng(0)
    t = np.arange(300)[:, None] / RATE
    q = np.sin(2.0 * np.pi * np.array([0.3, 0.5]) * t)
    assert position_noise(q) < 1e-7
    assert position_noise(q + 1e-4 * rng.normal(size=q.shape)) == pytest.approx(1e-4, rel=0.1)
    assert position_noise(np.full((20, 2), np.nan)) == 0.0
    assert position_noise(q[:4]) == 0.0
    assert default_cutoff(250.0) == 10.0
    assert default_cutoff(250.0, 1e-6) == 10.0
    coarse, coarser = default_cutoff(250.0, 1e-4), default_cutoff(250.0, 3e-4)
    assert 2.5 <= coarser < coarse < 10.0


def test_an_outage_of_the_noise_widens_nothing_for_good() -> None:
    """After a push the noise is what it was: the interval is as narrow as without it."""
    quiet = run(stream())[1][-1]
    after_push = run(pushed(stream(), 9.0, 10.0, np.array([30.0, -30.0, 10.0])))[1][-1]
    assert after_push.mass_std < 1.3 * quiet.mass_std
