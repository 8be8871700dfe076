"""The URDF of the robot is likelier than others; faults of the channels and currents are hypotheses beside it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_bags import bag, messages
from motions import Motion as Path_
from robots import DATA, robot, urdf
from test_diagnosis import ARM, RATE, record
from unsimulated import unsimulated as unsimulated

from sysid_ros import load
from sysid_ros.cli.main import run
from sysid_ros.diagnosis import diagnose
from sysid_ros.diagnosis.channel_faults import Fault
from sysid_ros.diagnosis.whose.coarse_rows import CoarseRows
from sysid_ros.diagnosis.whose.robot_hypotheses import judge
from sysid_ros.diagnosis.whose.robot_kernels import Carried
from sysid_ros.diagnosis.whose.robot_likelihood import probabilities
from sysid_ros.diagnosis.whose.robot_trial import Trial
from sysid_ros.effects import JointSign, TorqueSign, TorqueUnit
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording


@pytest.mark.slow
def test_the_likeliest_of_several_urdfs_is_judged(tmp_path: Path) -> None:
    heavy, foreign = tmp_path / "heavy.urdf", tmp_path / "foreign.urdf"
    heavy.write_text(urdf(ARM).replace('value="3"', 'value="12"'))
    foreign.write_text(urdf(ARM).replace('"turn"', '"other"'))
    recorded, out = bag(tmp_path / "bag", messages()), tmp_path / "out"
    right = DATA / f"{ARM}.urdf"
    given = [x for path in (heavy, right, foreign) for x in ("--urdf", str(path))]
    assert run(["diagnose", *given, str(recorded), "--out", str(out)]) == 0
    document = json.loads((out / "diagnosis.json").read_text())
    share = {Path(x["urdf"]).name: x["probability"] for x in document["urdfs"]}
    assert list(share) == ["heavy.urdf", right.name, "foreign.urdf"]
    assert share[right.name] > 0.9
    assert share["foreign.urdf"] == 0.0
    assert f"{right} is likeliest the robot's" in document["notes"][0]


@pytest.mark.slow
def test_a_wrong_sign_is_told_from_a_joint_that_counts_backwards() -> None:
    healthy = record(None, 1)
    flipped = np.where(np.arange(healthy.q.shape[1]) == 2, -1.0, 1.0)
    effort = judge(robot(ARM), [replace(healthy, tau=healthy.tau * flipped)])
    joint = judge(robot(ARM), [replace(healthy, q=healthy.q * flipped, tau=healthy.tau * flipped, v=None)])
    assert effort is not None
    assert joint is not None
    for found, kind in ((effort, TorqueSign), (joint, JointSign)):
        (fault,) = found.faults
        assert fault.effect.id == kind.id
        assert fault.joints == (2,)
        assert fault.probability is not None
        assert fault.probability > 0.9


@pytest.mark.slow
def test_a_link_that_is_far_off_on_an_arm_that_is_exact_else_is_no_unit(tmp_path: Path) -> None:
    """A link lighter by 0.94 kg was told as efforts in lbf ft: with links all as inexact as usual, that was likelier."""
    hidden = ["--hide", "link_inertia", "--hide-seed", "5", "--seed", "3", "--duration", "20"]
    assert run(["simulate", "arm", "--bag", str(tmp_path / "bag"), *hidden]) == 0
    recorded = load(tmp_path / "bag").arrays()
    iiwa = RobotModel.from_urdf(recorded.robot_description or "", recorded.joint_names)
    found = judge(iiwa, [Recording("bag", recorded.t, recorded.q, recorded.v, recorded.tau)])
    assert found is not None
    assert not found.faults
    assert found.probability > 0.99


def heavy_link(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    links = np.zeros((model.n, 10))
    links[1] = 1.5 * model.pi[10:20]
    return tau + model.link_torque_along(q, v, a, links.ravel())


def test_exact_links_cost_what_they_expect_less() -> None:
    """Of the URDF's own torque exact links are likelier; of one with a heavy link those are that leave that link free."""
    arm = robot(ARM)
    for cause, wrong in ((None, None), (heavy_link, 1)):
        rows = CoarseRows.of(arm, [record(cause, 1)])
        assert rows is not None
        trial = Trial.of(arm, rows)
        each = {link: trial.exact(link) for link in (None, *range(arm.n))}
        links = {link: x.likelihood().sum(axis=1).max() - x.faults_prior for link, x in each.items()}
        assert max(links, key=lambda link: links[link]) == wrong
        assert links[wrong] > trial.likelihood().sum(axis=1).max()


def rubs_more_than_it_carries(sign: float) -> Recording:
    """An arm whose first joint, on a vertical axis, shows hardly anything but friction, in efforts of some sign."""
    model, rng = robot(ARM), np.random.default_rng(3)
    t = np.arange(round(20.0 * RATE)) / RATE
    q, v, a = Path_(model, 3, speed=0.8)(t)
    tau = model.rnea_along(q, v, a)
    size = tau[:, 0].std()
    tau[:, 0] += 8.0 * size * np.tanh(v[:, 0] / 0.02) + 3.0 * size * v[:, 0] / v[:, 0].std()
    tau += 0.5 * size * rng.normal(size=q.shape)
    return Recording("rubs", t, q, None, tau * np.where(np.arange(model.n) == 0, sign, 1.0))


@pytest.mark.slow
def test_friction_that_gives_power_is_an_effort_of_the_wrong_sign() -> None:
    right, wrong = (judge(robot(ARM), [rubs_more_than_it_carries(sign)]) for sign in (1.0, -1.0))
    assert right is not None
    assert wrong is not None
    assert not right.faults
    (fault,) = wrong.faults
    assert fault.effect.id == TorqueSign.id
    assert fault.joints == (0,)


@pytest.mark.slow
def test_of_one_dead_channel_among_currents_nothing_is_said_and_of_the_others_their_factors() -> None:
    factors, rng = np.array([11.0, 14.0, 7.0, 9.0]), np.random.default_rng(0)

    def published(seed: int) -> Recording:
        tau = record(None, seed).tau / factors
        tau[:, 3] = 1e-4 * rng.normal(size=len(tau))
        return replace(record(None, seed), tau=tau)

    found = diagnose(robot(ARM), [published(1)], [published(2)])
    assert found.verdict != "refused"
    (unit,) = [f for f in found.findings if f.id == TorqueUnit.id]
    names = robot(ARM).joint_names
    assert [p.joint for p in unit.parameters] == list(names[:3])
    for p, factor in zip(unit.parameters, factors[:3], strict=True):
        assert isinstance(p.std, float)
        assert abs(p.value * factor - 1.0) < 2.0 * p.std * factor < 0.06
    assert not any(names[3] in f.joints for f in found.causes)
    assert any(f"On {names[3]} the efforts hold nothing" in note for note in found.notes)


@pytest.mark.slow
def test_dead_channels_among_currents_are_the_reason_of_a_refusal() -> None:
    healthy, rng = record(None, 1), np.random.default_rng(0)
    tau = healthy.tau / np.array([11.0, 14.0, 7.0, 9.0])
    tau[:, 1:3] = 1e-4 * rng.normal(size=(len(tau), 2))
    found = judge(robot(ARM), [replace(healthy, tau=tau)])
    assert found is not None
    assert found.refusal is not None
    assert "factor of its own on each joint (torque_unit)" in found.refusal
    assert found.factors is not None
    assert not found.factors.seen[1:3].any()


def test_a_likelihood_that_a_moment_decides_is_no_certainty() -> None:
    even, moment = np.full(400, 0.1), np.zeros(400)
    moment[7] = 40.0
    nothing: FloatArray = np.zeros(400)
    assert probabilities([even, nothing])[0] > 0.999
    assert 0.5 < probabilities([moment, nothing])[0] < 0.99


def test_the_same_torques_in_other_units_are_as_likely() -> None:
    """Also where a factor makes a joint's efforts smaller than anything that would be compared."""
    model, healthy = robot(ARM), record(None, 1, seconds=8.0)
    factors = [1.0, 20.0, 1e-3, 0.5]
    published = replace(healthy, tau=healthy.tau * factors)
    rows, scaled = (CoarseRows.of(model, [x]) for x in (healthy, published))
    assert rows is not None
    assert scaled is not None
    fault = Fault(TorqueUnit(factors), tuple(range(model.n)), ())
    alike = replace(Trial.of(model, rows), usual=Trial.of(model, scaled).without(fault, 0.0).usual)
    undone = Trial.of(model, scaled).without(fault, -3.0)
    assert undone.likelihood().sum() == pytest.approx(
        alike.likelihood().sum() - 3.0 * 3 - 3 * len(rows.t) * np.log(np.abs(factors)).sum(), abs=1e-3
    )
    np.testing.assert_allclose(undone.usual[:2], Trial.of(model, rows).usual[:2])


@pytest.mark.slow
@pytest.mark.parametrize("part", [0.37, 0.71])
def test_what_is_picked_up_at_any_time_is_no_reason_to_refuse(part: float) -> None:
    model, healthy = robot(ARM), record(None, 2)
    frame, later = model.frame_id(model.default_frame), healthy.t > healthy.t[0] + part * (healthy.t[-1] - healthy.t[0])
    q, v = healthy.q, np.gradient(healthy.q, healthy.t, axis=0)
    a = np.gradient(v, healthy.t, axis=0)
    body = 3.0 * np.array([2.0, 0.02, 0.01, 0.12, 0.02, 0.0, 0.02, 0.0, 0.0, 0.02])
    tau = healthy.tau.copy()
    tau[later] += [model.payload_regressor(*x, frame) @ body for x in zip(q[later], v[later], a[later], strict=True)]
    found = judge(model, [replace(healthy, tau=tau)])
    assert found is not None
    assert found.refusal is None


def test_a_payload_of_hundreds_of_the_arms_mass_is_no_explanation() -> None:
    """As efforts that are taken for kN m ask for: they explained the torques of another robot."""
    healthy = record(None, 1)
    rows = CoarseRows.of(robot(ARM), [healthy])
    assert rows is not None
    kernels = Trial.of(robot(ARM), rows).kernels
    usual = float(np.sqrt(np.mean(healthy.tau**2, axis=0)).max())
    assert kernels.heaviness(usual) > -0.1
    assert kernels.heaviness(3.0 * usual) > -1.5
    assert kernels.heaviness(1000.0 * usual) < -12.0
    assert kernels.carrying(Carried.NOTHING, rows).heaviness(1000.0 * usual) == 0.0


@pytest.mark.slow
def test_efforts_in_kilonewton_metres_are_found_all_the_same() -> None:
    healthy = record(None, 1)
    found = judge(robot(ARM), [replace(healthy, tau=healthy.tau / 1000.0)])
    assert found is not None
    (fault,) = found.faults
    assert isinstance(fault.effect, TorqueUnit)
    np.testing.assert_allclose(fault.effect.factors, 1e-3)
    assert found.refusal is None


@pytest.mark.slow
def test_a_joint_that_shows_friction_alone_tells_no_factor_and_is_no_dead_channel() -> None:
    factors, model = np.array([11.0, 14.0, 7.0, 9.0]), robot(ARM)
    run = record(None, 1)
    assert run.v is not None
    tau, most = run.tau.copy(), float(np.abs(run.tau[:, 3]).max())
    tau[:, 3] += 20.0 * most * (np.tanh(run.v[:, 3] / 0.02) + np.random.default_rng(0).normal(size=len(tau)))
    found = judge(model, [replace(run, tau=tau / factors)])
    assert found is not None
    assert (found.refusal, found.silent) == (None, ())
    assert found.factors is not None
    part = found.factors.std / found.factors.values
    off = np.abs(np.log(found.factors.values * factors))
    assert np.all(off < 2.0 * part)
    assert np.all(part[:3] < 0.25)
    assert part[3] > 0.5


def test_a_joint_whose_position_never_changes_is_no_reason_to_fail() -> None:
    """Its position, hundreds of millions of its spread, had left no digits for how far states are apart."""
    model, moves = robot(ARM), Path_(robot(ARM), 5)
    t = np.arange(round(12.0 * RATE)) / RATE
    q, v, a = moves(t)
    stands = np.arange(model.n) == 2
    q, v, a = np.where(stands, q[0], q), np.where(stands, 0.0, v), np.where(stands, 0.0, a)
    tau = model.rnea_along(q, v, a) + 0.02 * np.random.default_rng(5).normal(size=q.shape)
    found = judge(model, [Recording("stands", t, q, None, tau)])
    assert found is not None
    assert not found.faults
    assert found.probability > 0.95
