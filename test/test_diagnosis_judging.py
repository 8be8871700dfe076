"""What is said of other motion: no more than it shows, and no less."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from exam.candidate import recording_of
from exam.real import draw_real
from motions import Motion as Path_
from robots import robot, urdf
from test_diagnosis import ARM, NOISE, RATE, record
from unsimulated import unsimulated as unsimulated

from sysid_ros.diagnosis import diagnose
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.leftover import leftovers
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared, prepare
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.signal_faults import velocity_lag
from sysid_ros.diagnosis.whose.robot_hypotheses import judge
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.bristle import bristle
from sysid_ros.signals.recording import Recording


def with_velocities(rate: float, smooth: float = 0.0) -> Recording:
    """Velocities that are differences of the published positions, through a low-pass with a time constant [s]."""
    model = robot(ARM)
    t = np.arange(round(12.0 * rate)) / rate
    q, v, a = Path_(model, 3, speed=1.2)(t)
    q = np.round(q / 2e-5) * 2e-5
    v = np.diff(q, axis=0, prepend=q[:1]) * rate
    keep = np.exp(-1.0 / (rate * smooth)) if smooth else 0.0
    for i in range(1, len(v)):
        v[i] = keep * v[i - 1] + (1.0 - keep) * v[i]
    return Recording("differences", t, q, v, model.rnea_along(q, v, a))


@pytest.mark.parametrize("rate", [100.0, 125.0, 250.0, 500.0])
def test_differences_of_positions_are_late_but_not_filtered(rate: float) -> None:
    assert velocity_lag([with_velocities(rate)]) is None


@pytest.mark.parametrize("rate", [100.0, 250.0, 500.0])
def test_differences_that_were_filtered_are(rate: float) -> None:
    lag = velocity_lag([with_velocities(rate, 0.03)])
    assert lag is not None
    tau = 1.0 / (2.0 * np.pi * lag.cutoff)
    assert 0.03 - 0.5 / rate < tau < 0.03 + 1.0 / rate


def prepared(seed: int, seconds: float, stroke: tuple[int, float] = (0, 1.0), besides: float = 0.0) -> Prepared:
    """Rows of a healthy arm, or of one whose first joint bears a torque that rises with the time and with its position.

    Args:
        stroke: how a joint moves: in one stroke, which takes this part of the time; with 1, as all others do.
        besides: that torque [N m].
    """
    model, rng = robot(ARM), np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    q, v, a = Path_(model, seed, speed=1.2)(t)
    joint, part = stroke
    if part < 1.0:
        moves = np.clip((t - 0.02 * seconds) / (part * seconds), 0.0, 1.0)
        q[:, joint] = 0.8 * moves**3 * (10.0 - 15.0 * moves + 6.0 * moves**2)
        v = np.gradient(q, t, axis=0, edge_order=2)
        a = np.gradient(v, t, axis=0, edge_order=2)
    tau = model.rnea_along(q, v, a) + NOISE * rng.normal(size=q.shape)
    tau[:, 0] += besides * (t / seconds + q[:, 0])
    return prepare(model, [Recording(f"seed {seed}", t, q, None, tau)], [])


def test_a_joint_that_stands_most_of_the_time_follows_nothing() -> None:
    """Where a joint stands its rows are straight lines: a beat or a change with time would fit the few that are left."""
    model = robot(ARM)
    told = 0
    for seed in range(1, 9):
        train, held = (prepared(seed + k, seconds, (model.n - 1, 0.15)) for k, seconds in ((0, 14.0), (50, 8.0)))
        told += len(leftovers(train, train.problem.fit([]), held, held.problem.y))
    assert told == 0


def test_terms_that_make_up_for_one_another_go_together() -> None:
    """In one stroke position and time are nearly one: either alone takes the part of both. On other motion both are wrong, either
    alone is more so, and nothing is right."""
    model = robot(ARM)
    train, held = prepared(1, 16.0, (0, 0.95), besides=2.0), prepared(2, 12.0)
    library = Library(model, train.band)
    fit = train.problem.fit([library.local("spring", 0, shape="line"), library.local("torque_offset_drift", 0)])
    selection = Selection(train.problem, library, train.nominal)
    selection.fit = fit
    posterior = selection.judged_with(HeldOut.of(model, held, fit))
    assert not selection.fit.terms
    assert not posterior.probability


@pytest.mark.slow
def test_an_error_beyond_the_noise_is_not_nothing() -> None:
    """A torque that only the recording to judge on has, and that follows nothing."""
    rng = np.random.default_rng(5)
    healthy, odd = record(None, 1, 10.0), record(None, 2, 7.0)
    slow = np.convolve(rng.normal(size=len(odd.t) + 400), np.hanning(401), "valid")[:, None]
    other = replace(odd, tau=odd.tau + 6.0 * NOISE * slow / slow.std() * np.eye(robot(ARM).n)[1])
    assert diagnose(robot(ARM), [healthy], [odd]).verdict == "nothing_wrong"
    result = diagnose(robot(ARM), [healthy], [other])
    assert result.verdict == "unexplained"
    assert robot(ARM).joint_names[1] in result.unexplained
    assert not result.findings


def with_noise(seed: int, part: float, colour: float = 0.0) -> Recording:
    """A healthy arm with Coulomb friction on the first joint, on whose last joints the noise is larger than the torque."""
    model, rng = robot(ARM), np.random.default_rng(seed)
    t = np.arange(round(14.0 * RATE)) / RATE
    q, v, a = Path_(model, seed, speed=0.5)(t)
    tau = model.rnea_along(q, v, a)
    noise = rng.normal(size=q.shape)
    if colour:
        keep = np.exp(-1.0 / (RATE * colour))
        for i in range(1, len(noise)):
            noise[i] = keep * noise[i - 1] + np.sqrt(1.0 - keep**2) * noise[i]
    size = np.full(model.n, 0.01)
    size[0] = 0.1
    size[2:] = part * tau[:, 2:].std(axis=0)
    tau[:, 0] += 1.5 * tau[:, 0].std() * np.sign(v[:, 0])
    return Recording("noise", t, q, v, tau + size * noise)


def accepted(model: RobotModel, recording: Recording) -> bool:
    found = judge(model, [recording])
    return found is not None and found.refusal is None and not found.faults


@pytest.mark.slow
@pytest.mark.parametrize("colour", [0.0, 0.5])
def test_joints_with_nothing_but_noise_make_no_other_robot(colour: float) -> None:
    for seed in range(4):
        assert accepted(robot(ARM), with_noise(seed, 20.0, colour))


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.02, 0.3])
def test_efforts_without_gravity_make_no_other_robot(noise: float) -> None:
    """Of a slow arm nothing is left to compare then but noise."""
    model, rng = robot(ARM), np.random.default_rng(0)
    t = np.arange(round(14.0 * RATE)) / RATE
    for seed in range(3):
        q, v, a = Path_(model, seed, speed=0.4)(t)
        still = np.zeros_like(q)
        tau = model.rnea_along(q, v, a) - model.rnea_along(q, still, still)
        assert accepted(model, Recording("slow", t, q, v, tau + noise * rng.normal(size=q.shape)))


def gears_that_build_up(seed: int) -> Recording:
    """An arm on which most of the torque is dry friction, which builds up over 0.03 rad after each reversal."""
    model, rng = robot(ARM), np.random.default_rng(seed)
    t = np.arange(round(20.0 * RATE)) / RATE
    q, v, a = Path_(model, seed, speed=1.0)(t)
    tau = model.rnea_along(q, v, a)
    rubs = np.array([4.0, 8.0, 4.0, 2.0]) * bristle(q, 0.1, 1.0 / RATE)
    return Recording("gears", t, q, None, tau + rubs + 0.1 * rng.normal(size=q.shape))


@pytest.mark.slow
def test_friction_that_builds_up_makes_no_other_robot() -> None:
    """What follows a reversal is the joint's own, whoever's robot it is: as nobody's, it was held against the URDF."""
    heavier = robot(ARM).with_links(robot(ARM).pi)
    for seed in range(4):
        found, other = (judge(model, [gears_that_build_up(seed)]) for model in (robot(ARM), heavier))
        assert found is not None
        assert other is not None
        assert found.refusal is None
        assert not found.faults
        assert found.probability > 0.8
        assert found.urdf.sum(axis=1).max() > other.urdf.sum(axis=1).max() + 10.0


@cache
def rubbing() -> RobotModel:
    """An arm whose URDF declares dry friction on its first two joints."""
    root = ElementTree.fromstring(urdf(ARM))
    for joint in root.findall("joint"):
        for dynamics in joint.findall("dynamics"):
            joint.remove(dynamics)
        if joint.get("name") in robot(ARM).joint_names[:2]:
            ElementTree.SubElement(joint, "dynamics", friction="1.2", damping="0.5")
    return RobotModel.from_urdf(ElementTree.tostring(root, encoding="unicode"))


def rubbed(seed: int, seconds: float, turns: float) -> Recording:
    """A recording of it, whose friction turns at a speed [rad/s]."""
    model, rng = rubbing(), np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    q, v, a = Path_(model, seed, speed=0.8)(t)
    tau = model.rnea_along(q, v, a) + model.damping * v + model.friction * np.tanh(v / turns)
    return Recording(f"seed {seed}", t, q, None, tau + NOISE * rng.normal(size=q.shape))


@pytest.mark.slow
@pytest.mark.parametrize("turns", [0.002, 0.02, 0.05])
def test_declared_friction_may_turn_at_any_low_speed(turns: float) -> None:
    """A URDF gives its level, not its shape where the joint hardly moves: that shape is no fault of the URDF."""
    train = prepare(rubbing(), [rubbed(1, 10.0, turns)], [])
    assert train.turns is not None
    np.testing.assert_allclose(np.maximum(train.turns[:2], 0.01), max(turns, 0.01), rtol=0.3)
    held = prepare(rubbing(), [rubbed(2, 7.0, turns)], [], train.turns)
    np.testing.assert_array_equal(held.turns, train.turns)
    assert diagnose(rubbing(), [rubbed(1, 10.0, turns)], [rubbed(2, 7.0, turns)]).verdict == "nothing_wrong"


@pytest.mark.slow
def test_a_declared_level_that_is_wrong_is_found_whatever_its_shape() -> None:
    low = rubbed(1, 12.0, 0.02), rubbed(2, 7.0, 0.02)
    extra = [replace(r, tau=r.tau + np.eye(rubbing().n)[0] * 0.6 * np.tanh(np.gradient(r.q, r.t, axis=0) / 0.02)) for r in low]
    result = diagnose(rubbing(), extra[:1], extra[1:])
    assert [f.id for f in result.findings] == ["coulomb_friction"]
    (level,) = [p for f in result.findings for p in f.parameters if p.name == "Fc"]
    assert level.joint == rubbing().joint_names[0]
    assert level.low <= 0.6 <= level.high


def in_strokes(seed: int, seconds: float, k: float) -> Recording:
    """An arm that goes from point to point, with a cable of stiffness k [N m/rad] along its third joint."""
    model, rng = robot(ARM), np.random.default_rng(seed)
    x = np.linspace(0.0, 1.0, round(2.2 * RATE))
    stroke = np.concatenate([x**3 * (10.0 - 15.0 * x + 6.0 * x**2), np.ones(round(0.8 * RATE))])[:, None]
    points = rng.uniform(-1.0, 1.0, (round(seconds / 3.0) + 1, model.n))
    q = np.concatenate([a + stroke * (b - a) for a, b in pairwise(points)])
    t = np.arange(len(q)) / RATE
    v = np.gradient(q, t, axis=0, edge_order=2)
    tau = model.rnea_along(q, v, np.gradient(v, t, axis=0, edge_order=2)) + NOISE * rng.normal(size=q.shape)
    tau[:, 2] += k * (q[:, 2] - 0.2)
    return Recording(f"seed {seed}", t, q, None, tau)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow)])
def test_a_weak_and_slow_cause_is_not_taken_for_slow_noise(seed: int) -> None:
    """Before it is tried, the noise holds what it does; it gains much more once the noise is found anew."""
    result = diagnose(robot(ARM), [in_strokes(seed, 12.0, 0.07)], [in_strokes(seed + 50, 9.0, 0.07)])
    assert [(f.id, f.joints) for f in result.findings] == [("spring", robot(ARM).joint_names[2:3])]
    (k,) = [p for p in result.findings[0].parameters if p.name == "k"]
    assert k.low <= 0.07 <= k.high


@pytest.mark.slow
def test_a_joint_whose_torque_is_mostly_friction_has_no_factor_of_its_own() -> None:
    """Half of its rows make it noise about a law, all of them a law that no model has: 276 in the log-likelihood."""
    case = draw_real(99713)
    found = judge(case.nominal.model(), [recording_of(r) for r in case.train])
    assert found is not None
    assert not found.faults
    assert found.refusal is None


@pytest.mark.slow
def test_a_unit_is_sure_where_only_its_factors_are_in_doubt() -> None:
    """One factor of 1000 has .81, one on each joint of some 890 the rest: no other unit, and 1e5 was taken for N m."""
    case = draw_real(99722)
    found = judge(case.nominal.model(), [recording_of(r) for r in case.train])
    assert found is not None
    (fault,) = found.faults
    assert fault.effect.id == "torque_unit"
    assert fault.probability is not None
    assert fault.probability > 0.95
    assert fault.values[0][:3] == ("factor", None, 1000.0)
    assert found.refusal is None
