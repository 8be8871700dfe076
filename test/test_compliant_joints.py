"""Elastic joints and joints with play: the equation of the link behind them, and that they are found with their size."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from motions import Motion as Path_
from robots import robot
from unsimulated import unsimulated as unsimulated

from sysid_ros.diagnosis import Diagnosis, diagnose
from sysid_ros.diagnosis.covariance import _equations
from sysid_ros.diagnosis.deflections import fit_deflection
from sysid_ros.diagnosis.knobs import made_anew
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import inexact_links, prepare
from sysid_ros.diagnosis.sets.never_known import dry_friction, unknown_columns
from sysid_ros.diagnosis.swings import by_links, follows, swinging
from sysid_ros.effects import EFFECTS, Backlash, JointElasticity, Motion
from sysid_ros.effects.compliance import deflection, torque_of
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.seen_motion import clear_band

ARM, JOINT = "small_arm", 1
RATE = 250.0
SPRING = 300.0
HIDDEN_IN = {"joint_elasticity": 1, "backlash": 0}
"""A joint that carries weight, and one whose load changes its sign."""


def moved(seed: int = 3, seconds: float = 6.0, rate: float = 200.0) -> Motion:
    model = robot(ARM)
    t = np.arange(round(seconds * rate)) / rate
    return Motion(model, t, *Path_(model, seed, speed=1.2)(t), np.zeros((len(t), model.n)))


def test_the_link_moves_by_its_equation() -> None:
    motion = moved()
    by_q, by_v, inertia = (x[:, JOINT, JOINT] for x in motion.sensitivity)
    for f, ratio in ((3.0, 0.02), (8.0, 0.3)):
        k = float(inertia.mean()) * (2.0 * np.pi * f) ** 2
        x = deflection(motion, JOINT, k, ratio)
        d = 2.0 * ratio * np.sqrt(k * float(inertia.mean()))
        load = motion.link_torque[:, JOINT]
        left = inertia * x[:, 2] + d * x[:, 1] + k * x[:, 0] + by_q * x[:, 0] + by_v * x[:, 1] - load
        assert np.abs(left).max() < 0.01 * np.abs(load).max()
        for order in (0, 1):
            slope = np.gradient(x[:, order], motion.period)
            assert np.abs(slope - x[:, order + 1])[2:-2].max() < 0.03 * np.abs(x[:, order + 1]).max()


def test_a_stiff_joint_follows_its_load_at_once() -> None:
    motion = moved()
    name = (motion.robot.joint_names[JOINT],)
    soft = JointElasticity(motion.robot, name).columns_along(motion)
    k = float(motion.sensitivity[2][:, JOINT, JOINT].mean()) * (2.0 * np.pi * 30.0) ** 2
    stiff = JointElasticity(motion.robot, name, around=1.0 / k, damping=0.5).columns_along(motion)
    inside = slice(100, -100)
    assert np.abs(stiff - soft)[inside].max() < 0.1 * np.abs(soft[inside]).max()


def test_to_first_order_and_exactly_differ_by_the_square_of_the_lag() -> None:
    motion = moved()
    x = deflection(motion, JOINT, 400.0, 0.2)
    errors = []
    for share in (1.0, 0.5):
        exact, linear = (torque_of(motion, JOINT, share * x, e) for e in (True, False))
        errors.append(float(np.abs(exact - linear).max()))
    assert errors[0] < 0.05 * float(np.abs(torque_of(motion, JOINT, x, True)).max())
    assert errors[1] / errors[0] == pytest.approx(0.25, abs=0.1)


@pytest.mark.parametrize("id_", HIDDEN_IN)
def test_a_link_that_carries_more_swings_as_that_of_a_heavier_robot(id_: str) -> None:
    """What the links carry is a part of the column: a spring under a payload that it does not know of is found too soft."""
    motion = moved()
    model, joints = motion.robot, (motion.robot.joint_names[JOINT],)
    carried = np.zeros((model.n, 10))
    carried[-1, [0, 3, 4, 6, 9]] = 1.5, 0.2, 0.03, 0.03, 0.01
    heavier = model.with_links(carried.ravel())
    own = Motion(heavier, motion.t, motion.q, motion.v, motion.a, motion.tau)
    loaded = motion.with_torques(own.rigid_torque, own.rigid_torque)
    for around in (0.0, 0.01):
        alone = EFFECTS[id_].from_settings(heavier, joints, {"around": around}).columns_along(own)
        settings = {"around": around, "links": carried.ravel().tolist()}
        beside = EFFECTS[id_].from_settings(model, joints, settings)
        np.testing.assert_allclose(beside.columns_along(loaded), alone, atol=1e-9 * np.abs(alone).max())
        assert beside.settings["links"] == settings["links"]
        without = EFFECTS[id_].from_settings(model, joints, {"around": around}).columns_along(loaded)
        assert np.abs(without - alone).max() > 0.02 * np.abs(alone).max()


def test_links_lighter_than_nothing_leave_a_spring_as_it_was() -> None:
    """They are met on the way to a set, and what swings on the spring is no body: its motion would grow without end."""
    motion = moved()
    model, last = motion.robot, motion.robot.n - 1
    recording = Recording("moved", motion.t, motion.q, motion.v, motion.link_torque)
    train = prepare(model, [recording], [])
    library = Library(model, train.band)
    spring, link = library.whole("joint_elasticity", (JOINT,), around=0.01), library.whole("link_inertia", (last,))
    fit = train.problem.fit([spring, link])
    theta = fit.theta.copy()
    theta[fit.slices[1]] = -20.0 * model.pi[10 * last : 10 * last + 10]
    links = [m.link_torque for m in library.motions]
    again = made_anew(train.problem, library, replace(fit, theta=theta), links, train.nominal)
    assert all(np.isfinite(t.columns).all() for t in again.terms)
    assert np.isfinite(again.theta).all()


def test_a_link_with_play_lies_on_a_flank_or_flies() -> None:
    motion, gap = moved(), 0.02
    inertia = motion.sensitivity[2][:, JOINT, JOINT]
    k = float(inertia.mean()) * (2.0 * np.pi * 20.0) ** 2
    x = deflection(motion, JOINT, k, 0.5, gap)
    load = motion.link_torque[:, JOINT]
    assert np.abs(x[:, 0]).max() < 0.5 * gap + 6.0 * np.abs(load).max() / k
    flies = np.abs(x[:, 0]) < 0.49 * gap
    by_q, by_v = (s[:, JOINT, JOINT] for s in motion.sensitivity[:2])
    carried = load - by_q * x[:, 0] - by_v * x[:, 1] - inertia * x[:, 2]
    assert np.abs(carried[flies]).max(initial=0.0) < 1e-9 * np.abs(load).max()
    held = np.abs(x[:, 0]) > 0.5 * gap
    assert np.all(carried[held] * x[held, 0] > -1e-9)
    # at the start a side that is told overrides the load's
    other = deflection(motion, JOINT, k, 0.5, gap, side=int(-np.sign(x[0, 0])))
    assert other[0, 0] * x[0, 0] < 0.0


def test_settings_out_of_range_are_refused() -> None:
    with pytest.raises(Exception, match=r"side 2.*-1, 0 or 1"):
        Backlash(robot(ARM), side=2)
    with pytest.raises(Exception, match=r"damping -0.1"):
        JointElasticity(robot(ARM), damping=-0.1)


def test_a_position_is_clear_up_to_where_its_motion_ends_whatever_its_unit() -> None:
    rng = np.random.default_rng(0)
    t = np.arange(4000) / 500.0
    q = sum(np.sin(2.0 * np.pi * f * t + p) / f**3 for f, p in ((0.4, 0.3), (1.1, 1.0), (3.0, 2.0)))
    noisy = np.stack([q, q], axis=1) + 1e-3 * rng.normal(size=(4000, 2))
    clear = clear_band(noisy, 500.0)
    assert np.all((clear > 3.0) & (clear < 8.0))
    np.testing.assert_allclose(clear_band(1000.0 * noisy, 500.0), clear)
    still = clear_band(1e-4 * rng.normal(size=(4000, 1)), 500.0)
    assert still[0] < 1.0


# what follows is hidden by equations of its own: Runge and Kutta's method on the robot's inverse dynamics


def behind(kind: str, seed: int, seconds: float) -> Recording:
    """A recording with the link of a joint behind a spring or a play, and a motor of 0.2 kg m^2 there."""
    model = robot(ARM)
    rng = np.random.default_rng(seed)
    path = Path_(model, seed, speed=1.2)
    t = np.arange(round(seconds * RATE)) / RATE
    joint = HIDDEN_IN[kind]
    one = np.eye(model.n)[joint]
    gap = 0.03 if kind == "backlash" else 0.0
    k, d = (SPRING, 0.4) if kind == "joint_elasticity" else (4000.0, 20.0)

    def carried(x: float, u: float) -> float:
        if gap and abs(x) <= 0.5 * gap:
            return 0.0
        torque = k * (x - np.sign(x) * 0.5 * gap) + d * u
        return 0.0 if gap and torque * x < 0.0 else float(torque)

    def rate(at: tuple[FloatArray, ...], x: float, u: float) -> tuple[float, float]:
        q, v, a = at
        torque = model.rnea(q - x * one, v - u * one, a)[joint]
        inertia = model.rnea(q - x * one, v - u * one, a + one)[joint] - torque
        return u, float((torque - carried(x, u)) / inertia)

    steps = 1 if kind == "joint_elasticity" else 4
    h = 1.0 / (RATE * steps)
    fine = np.arange(2.0 * steps * len(t) + 2.0) * 0.5 * h
    states = [np.asarray(x) for x in path(fine)]
    load = float(model.rnea(*(s[0] for s in states))[joint])
    later = float(model.rnea(*(s[2] for s in states))[joint])
    x, u = load / k + 0.5 * gap * np.sign(load), (later - load) / h / k
    lag = np.zeros((len(t), 3))
    for i in range(len(t) * steps):
        first, mid, last = (tuple(s[2 * i + n] for s in states) for n in (0, 1, 2))
        k1 = rate(first, x, u)
        if i % steps == 0:
            lag[i // steps] = x, u, k1[1]
        k2 = rate(mid, x + 0.5 * h * k1[0], u + 0.5 * h * k1[1])
        k3 = rate(mid, x + 0.5 * h * k2[0], u + 0.5 * h * k2[1])
        k4 = rate(last, x + h * k3[0], u + h * k3[1])
        x += h / 6.0 * (k1[0] + 2.0 * k2[0] + 2.0 * k3[0] + k4[0])
        u += h / 6.0 * (k1[1] + 2.0 * k2[1] + 2.0 * k3[1] + k4[1])
    q, v, a = path(t)
    tau = model.rnea_along(q - lag[:, :1] * one, v - lag[:, 1:2] * one, a - lag[:, 2:] * one)
    tau[:, joint] += 0.2 * a[:, joint]
    tau += 0.03 * rng.normal(size=tau.shape)
    return Recording(f"seed {seed}", t, np.round(q / 2e-5) * 2e-5, v + 1e-3 * rng.normal(size=v.shape), tau)


@pytest.mark.parametrize("factor", [0.6, 1.0, 1.6])
def test_a_stiff_joint_on_a_slow_arm_is_found_from_any_first_value(factor: float) -> None:
    """Its deflection is the load over the stiffness: far from where the columns were made as good a measure as near it."""
    model, rng = robot(ARM), np.random.default_rng(0)
    t = np.arange(round(14.0 * RATE)) / RATE
    q, v, a = Path_(model, 3, speed=0.5)(t)
    motion = Motion(model, t, q, v, a, np.zeros_like(q))
    spring = JointElasticity(model, [model.joint_names[JOINT]], around=1.0 / (3.0 * SPRING), damping=0.05)
    tau = motion.link_torque + spring.torque_along(motion, np.array([1.0 / (3.0 * SPRING)])) + 0.003 * rng.normal(size=q.shape)
    train = prepare(model, [Recording("slow", t, q, None, tau)], [])
    library = Library(model, train.band)
    term = library.whole("joint_elasticity", (JOINT,), around=factor / (3.0 * SPRING), damping=0.05, exact=False)
    fit, found = fit_deflection(train.problem, library, train.problem.fit([term]), term)
    assert 1.0 / found.effect.settings["around"] == pytest.approx(3.0 * SPRING, rel=0.1)
    assert fit.terms == (found,)


def test_the_torque_of_a_compliant_joint_is_known_to_change_with_the_links_that_swing_on_it() -> None:
    """Along the few directions that are followed nearly all of what one heavier link does to it is found."""
    model = robot(ARM)
    train = prepare(model, [behind("joint_elasticity", 1, 14.0)], [])
    library, basis, heavier = Library(model, train.band), inexact_links(model).basis, model.n - 1
    spring = library.whole("joint_elasticity", (JOINT,), around=1.0 / SPRING, damping=0.02, exact=True)
    fit = train.problem.fit([spring, library.local("rotor_inertia", JOINT)], inexact=True)
    found = by_links(train.problem, library, fit, spring)[:, JOINT, heavier]
    sides = [library.remake(spring, links=(x * basis[:, heavier]).tolist()) for x in (0.005, -0.005)]
    true = (sides[0].columns - sides[1].columns)[:, JOINT, 0] / 0.01 / SPRING
    assert np.sqrt(np.mean(true**2)) > 0.1
    assert np.linalg.norm(found - true) < 0.2 * np.linalg.norm(true)


def test_what_the_rows_say_is_said_of_the_spring_that_the_columns_were_made_for() -> None:
    """The linear fit wants another one: what it leaves is not what that spring leaves, of no parameter."""
    model = robot(ARM)
    train = prepare(model, [behind("joint_elasticity", 1, 14.0)], [])
    library = Library(model, train.band)
    spring = library.whole("joint_elasticity", (JOINT,), around=1.01 / SPRING, damping=0.02, exact=True)
    fit = train.problem.fit([spring, library.local("rotor_inertia", JOINT)], inexact=True)
    assert float(fit.theta_of(spring)[0]) < 0.9 / SPRING
    _, score, _ = _equations(train.problem, library, fit, [], swinging(train.problem, library, fit))
    made_for = fit.theta.copy()
    made_for[0] = 1.01 / SPRING
    never = unknown_columns(train.problem, dry_friction(model, fit), whole=True)
    for i, (j, (index, X)) in enumerate(fit.blocks.items()):
        left = (train.problem.y[:, j] - X @ made_for[index]) / fit.variance[:, j]
        own = len(fit.theta) + len(never) * i + np.arange(len(never))
        np.testing.assert_allclose(score[own], never[:, :, j] @ left, rtol=1e-6, atol=1e-9)
    index, X = fit.blocks[JOINT]
    rotor = X[:, list(index).index(1)] / fit.variance[:, JOINT]  # a column that does not depend on the spring
    assert score[1] == pytest.approx(rotor @ (train.problem.y[:, JOINT] - X @ made_for[index]), rel=1e-6)


def test_a_step_so_long_that_links_swing_otherwise_is_not_believed() -> None:
    model = robot(ARM)
    train = prepare(model, [behind("joint_elasticity", 1, 14.0)], [])
    library = Library(model, train.band)
    spring = library.whole("joint_elasticity", (JOINT,), around=1.0 / SPRING, damping=0.02, exact=True)
    fit = train.problem.fit([spring], inexact=True)
    swings, step = swinging(train.problem, library, fit), np.zeros(len(fit.theta))
    step[0] = 1e-4 / SPRING
    assert follows(library, fit, swings, step, gained=1.0)
    step[0] = 0.5 / SPRING
    assert not follows(library, fit, swings, step, gained=1.0)
    step[0] = -2.0 / SPRING  # a spring that pushes
    assert not follows(library, fit, swings, step, gained=np.inf)


@cache
def diagnosed(kind: str) -> Diagnosis:
    return diagnose(robot(ARM), [behind(kind, 1, 14.0)], [behind(kind, 2, 8.0)])


@pytest.mark.parametrize(
    ("kind", "name", "value", "share"),
    [
        pytest.param("joint_elasticity", "stiffness", SPRING, 0.04, marks=pytest.mark.slow),
        pytest.param("backlash", "gap", 0.03, 0.12, marks=pytest.mark.slow),
    ],
)
def test_what_a_joint_gives_way_by_is_found_with_its_motor(kind: str, name: str, value: float, share: float) -> None:
    effects = {e["name"]: e for e in diagnosed(kind).as_dict()["effects"]}
    assert next(iter(effects)) == kind
    assert set(effects) <= {kind, EFFECTS[kind].companion}
    assert effects[kind]["joints"] == [robot(ARM).joint_names[HIDDEN_IN[kind]]]
    (size,) = (p for p in effects[kind]["parameters"] if p["name"] == name)
    assert size["value"] == pytest.approx(value, rel=share)
    assert size["ci95"][0] < size["value"] < size["ci95"][1]
    (motor,) = effects[EFFECTS[kind].companion]["parameters"]
    assert motor["value"] == pytest.approx(0.2, rel=0.15)
    assert motor["joint"] == robot(ARM).joint_names[HIDDEN_IN[kind]]


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("ratio", [0.1, 1.0])
def test_a_link_without_inertia_follows_its_load_at_once(ratio: float, exact: bool) -> None:
    """Links that are found on one motion may be none on another: no step resolves how fast such a one swings."""
    motion, stiffness = moved(), 2000.0
    by_q, by_v, inertia = motion.own_sensitivity(JOINT)
    none = np.where(motion.t < 3.0, inertia, -inertia)
    motion._own_sensitivity[JOINT] = 0.0 * by_q, 0.0 * by_v, none
    lag = deflection(motion, JOINT, stiffness, ratio, exact=exact)
    assert np.isfinite(lag).all()
    load, later = motion.link_torque[:, JOINT], slice(700, -10)
    np.testing.assert_allclose(stiffness * lag[later, 0], load[later], atol=0.1 * float(np.ptp(load)))
