"""Robots as they are: all is a little wrong everywhere, the larger cause is clear, the marks are fair."""

from __future__ import annotations

import copy
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")

from exam.arms import TEN_ARMS, all_there, arm, rated_effort
from exam.as_built import as_built, without
from exam.baseline import Baseline, Rows
from exam.candidate import recording_of
from exam.case import SIMULATORS, Case
from exam.claims import claimed, claims
from exam.pick_and_place import PickAndPlaceMotion
from exam.real import ATTEMPTS, CLEAR, SEED, draw_real, leading, simulator_of, turn_of
from exam.real_scoring import real_measures, render_real, score_real
from exam.stage import Stage, stage_of
from exam.table import failed_targets

from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.simulation.hidden_effects import (
    CAUSES,
    Circumstances,
    HiddenEffect,
    Noise,
    TrueRobot,
    cause_of,
    move,
    publish,
    realise,
)
from sysid_ros.simulation.payload import Payload

pytestmark = pytest.mark.skipif(not all_there(), reason="the arms of the exam need: pip install example-robot-data")

LEADING = {
    *("payload", "payload_change", "torque_scale", "torque_offset", "spring", "time_delay", "joint_offset", "base_tilt"),
    *("external_force", "joint_coupling", "coulomb_friction", "joint_elasticity", "torque_saturation", "link_inertia"),
    *("gravity_compensated_effort", "torque_unit"),
}


@cache
def usual(name: str, seed: int = 0) -> Circumstances:
    robot, rng = arm(name).model(), np.random.default_rng(seed)
    motion = PickAndPlaceMotion(robot, rng, 12.0)
    return Circumstances(robot, motion, rng, 1.0, np.full(robot.n, 0.1), rated=rated_effort(name))


def per_joint(effects: tuple[HiddenEffect, ...], id_: str, parameter: str) -> dict[str, float]:
    return {j: x for e in effects if e.id == id_ for j, x in e.per_joint(parameter).items()}


@pytest.mark.parametrize("name", TEN_ARMS)
def test_everything_is_a_little_wrong_on_every_joint(name: str) -> None:
    c = usual(name)
    built, joints = as_built(c), set(c.robot.joint_names)
    effort = dict(zip(c.robot.joint_names, c.effort, strict=True))
    levels = [per_joint(built, id_, "Fc") for id_ in ("stribeck_friction", "presliding_hysteresis")]
    assert not levels[0].keys() & levels[1].keys()
    level = {j: fc / effort[j] for one in levels for j, fc in one.items()}
    assert level.keys() == joints
    assert 0.02 <= min(level.values()) <= max(level.values()) <= 0.1
    for id_, parameter, low, high in (
        ("viscous_friction", "b", 0.01, 0.05),
        ("rotor_inertia", "J", 0.003, 0.01),
        ("torque_offset", "offset", -0.01, 0.01),
        ("cogging", "amp", 0.002, 0.008),
    ):
        shares = {j: x / effort[j] for j, x in per_joint(built, id_, parameter).items()}
        assert shares.keys() == joints
        assert low <= min(shares.values()) <= max(shares.values()) <= high
    assert per_joint(built, "torque_scale", "gain").keys() == joints
    assert {j for e in built if e.id == "link_inertia" for j in e.joints} == joints
    assert 0.001 <= next(e.number("delay") for e in built if e.id == "time_delay") <= 0.005
    true = realise(c.robot, built)
    assert np.all(true.joints.coulomb_forward > 0.0)
    assert np.all(true.pi[:, 0] > 0.0)
    assert not np.any(np.isclose(true.pi[:, 0], c.robot.pi.reshape(-1, 10)[:, 0], rtol=1e-6))


def test_links_and_gains_are_off_by_what_is_said() -> None:
    c = usual("ur5")
    many = [e for _ in range(300) for e in as_built(c)]
    gains = [x for e in many if e.id == "torque_scale" for x in e.per_joint("gain").values()]
    masses = [e.settings["mass_factor"] for e in many if e.id == "link_inertia"]
    shifts = [np.linalg.norm(e.settings["com_shift"]) for e in many if e.id == "link_inertia"]
    assert np.std(gains) == pytest.approx(0.02, rel=0.1)
    assert np.std(masses) == pytest.approx(0.06, rel=0.1)
    assert np.sqrt(np.mean(np.square(shifts))) == pytest.approx(0.005, rel=0.1)


def test_a_larger_cause_stands_in_place_of_the_same() -> None:
    c = usual("panda")
    built = as_built(c)
    joint = c.robot.joint_names[1]
    for id_, parameter in (("coulomb_friction", "Fc"), ("torque_offset", "offset"), ("torque_scale", "gain")):
        larger = CAUSES[id_].on(c, [1], [[7.0]])
        rest = without(built, [larger])
        names = {"coulomb_friction": ("stribeck_friction", "presliding_hysteresis")}.get(id_, (id_,))
        assert joint not in {j for name in names for j in per_joint(rest, name, parameter)}
        assert per_joint(rest, "viscous_friction", "b") == per_joint(built, "viscous_friction", "b")
    unit = CAUSES["torque_unit"].draw(c)
    assert not per_joint(without(built, [unit]), "torque_scale", "gain")
    assert without(built, [CAUSES["payload"].draw(c)]) == built


def test_what_leads_is_asked_of_the_causes() -> None:
    assert set(leading()) == LEADING
    turns = [turn_of(seed) for seed in range(64)]
    assert [len(t) for t in turns[:8]] == [0, 1, 1, 2, 0, 1, 1, 2]
    both = {(t[0], simulator_of(seed)) for seed, t in enumerate(turns) if len(t) == 1}
    assert both == {(id_, simulator) for id_ in LEADING for simulator in SIMULATORS}


@pytest.mark.parametrize("name", TEN_ARMS)
def test_pick_and_place_has_rests_and_stays_within_the_limits(name: str) -> None:
    robot = arm(name).model()
    for seed in range(3):
        motion = PickAndPlaceMotion(robot, np.random.default_rng(seed), 30.0)
        t = np.arange(0.0, 30.0, 0.002)
        q, v, a = motion.sample(t)
        assert q.shape == v.shape == a.shape == (len(t), robot.n)
        assert np.all((q > robot.position_lower) & (q < robot.position_upper))
        assert np.all(np.abs(v) <= robot.velocity_limit)
        assert np.abs(v[[0, -1]]).max() < 1e-9
        assert np.abs(np.gradient(q, t, axis=0) - v)[1:-1].max() < 0.02
        assert np.abs(np.gradient(v, t, axis=0) - a)[1:-1].max() < 0.2
        rests = np.mean(np.all(np.abs(v) < 1e-6, axis=1))
        assert 0.05 < rests < 0.8
        assert np.all(np.ptp(q, axis=0) > 0.1)


def test_the_baseline_is_judged_like_the_diagnosis() -> None:
    c = usual("ur5", 1)
    true = realise(c.robot, [CAUSES[id_].draw(c) for id_ in ("viscous_friction", "torque_offset")])
    noise = Noise(np.full(6, 1e-3), np.zeros(6))
    moved = move(true, c.motion, 250, 0.1 * np.ones(6))
    recording = recording_of(publish("a", true, moved, noise, np.random.default_rng(0)))
    rows = Rows.of(c.robot, [recording])
    prepared = prepare(c.robot, [recording], [])
    samples = sum(len(m.t) for m in prepared.motions)
    nothing = Baseline(np.zeros((6, 3)))
    assert nothing.error(rows) == pytest.approx(np.sqrt(np.sum(prepared.problem.y**2, axis=0) / samples))
    fitted = Baseline.fitted(rows)
    assert np.all(fitted.error(rows) < 0.1 * nothing.error(rows).max())
    held = Baseline.fitted(rows, nothing, ("constant",))
    assert not np.any(held.theta[:, 0])
    assert np.any(held.theta[:, 2])


def telling(truth: dict[str, Any], probability: float | None = 0.99) -> dict[str, Any]:
    """What a diagnosis would say that knows the truth."""
    effects = []
    for e in truth["effects"]:
        parameters = []
        for p in e["parameters"]:
            value = p["value"]
            ci95 = value if isinstance(value, str) else [(np.asarray(value) - 0.1).tolist(), (np.asarray(value) + 0.1).tolist()]
            parameters.append({**p, "std": 0.05, "ci95": ci95})
        told = {"name": e["name"], "joints": e["joints"], "parameters": parameters, "cannot_be_told_from": [], "headline": True}
        effects.append(told if probability is None else {**told, "probability": probability})
    n = len(truth["joint_names"])
    rmse = {"joints": truth["joint_names"], "before": [9.0] * n, "after": [1.0] * n, "noise_floor": [0.8] * n}
    return {"verdict": "explained", "effects": effects, "torque_rmse": rmse, "unexplained_fraction": 0.0}


def truth_with(*ids: str, name: str = "ur5") -> dict[str, Any]:
    c = usual(name, 2)
    larger = [CAUSES[id_].draw(c) for id_ in ids]
    effects = [e.as_dict() for e in (*without(as_built(c), larger), *larger)]
    names = list(c.robot.joint_names)
    return {
        "level": "real",
        "hidden": list(ids),
        "larger": [e.as_dict() for e in larger],
        "effects": effects,
        "joint_names": names,
    }


@pytest.mark.parametrize("id_", sorted(LEADING))
def test_who_knows_the_truth_gets_full_marks(id_: str) -> None:
    truth = truth_with(id_)
    row = score_real(truth, telling(truth), np.full(6, 2.0))
    assert (row["refused"], row["right"], row["exact"], row["extra"], row["worse"]) == (False, True, True, [], [])
    assert row["larger"][0]["headline"]
    assert row["larger"][0]["probability"] == 0.99
    assert row["covered"] in (None, 1.0)
    assert row["ratio"] == [0.5] * 6


def test_marks_are_lost_for_what_is_wrong() -> None:
    truth = truth_with("torque_offset", "base_tilt")
    joint = truth["larger"][0]["joints"][0]
    good = telling(truth)

    def marks(change: Any, baseline: float = 2.0) -> dict[str, Any]:
        answer = copy.deepcopy(good)
        change(answer)
        return score_real(truth, answer, np.full(6, baseline))

    elsewhere = marks(
        lambda d: d.update(effects=[e for e in d["effects"] if joint not in e["joints"] or e["name"] != "torque_offset"])
    )
    assert not elsewhere["right"]
    assert not elsewhere["larger"][0]["named"]
    unsure = marks(lambda d: [e.update(probability=0.4) for e in d["effects"] if e["name"] == "base_tilt"])
    assert not unsure["right"]
    assert unsure["larger"][1]["probability"] == 0.4
    false = marks(lambda d: d["effects"].append({**d["effects"][0], "name": "spring"}))
    assert not marks(lambda d: d["effects"].append({**d["effects"][0], "name": "of the messages alone"}))["exact"]
    assert false["right"]
    assert not false["exact"]
    assert len(false["extra"]) == 1
    doubted = marks(lambda d: d["effects"].append({**d["effects"][0], "name": "spring", "probability": 0.3}))
    assert doubted["exact"]
    assert marks(lambda d: None, baseline=0.9)["worse"] == truth["joint_names"]
    refused = marks(
        lambda d: d.update(
            verdict="refused", effects=[], torque_rmse={"after": [0.0] * 6, "noise_floor": [0.0] * 6, "before": [0.0] * 6}
        )
    )
    assert refused["refused"]
    assert not refused["right"]
    assert refused["ratio"] is None


def test_a_size_outside_its_interval_is_not_covered() -> None:
    truth = truth_with("torque_scale")
    answer = telling(truth)
    for e in answer["effects"]:
        if e["name"] == "torque_scale" and e["joints"] == truth["larger"][0]["joints"]:
            e["parameters"][0]["ci95"] = [10.0, 11.0]
    assert score_real(truth, answer, np.full(6, 2.0))["covered"] == 0.0


def test_a_friction_that_holds_the_larger_one_names_it_but_has_to_be_there() -> None:
    truth = truth_with("coulomb_friction")
    larger = truth["larger"][0]
    answer = telling(truth)
    for e in answer["effects"]:
        if e["name"] == "coulomb_friction":
            e["name"] = "stribeck_friction"
    row = score_real(truth, answer, np.full(6, 2.0))
    assert row["larger"][0]["named"]
    assert row["covered"] == 1.0
    assert row["extra"] == [f"stribeck_friction ({', '.join(larger['joints'])})"]


def test_a_companion_is_no_false_claim_and_no_name() -> None:
    truth = truth_with("joint_elasticity")
    answer = telling(truth)
    answer["effects"] = [e for e in answer["effects"] if e["name"] == "rotor_inertia"]
    row = score_real(truth, answer, np.full(6, 2.0))
    assert not row["right"]
    assert not row["extra"]


def test_a_claim_is_false_only_on_none_that_has_it() -> None:
    truth = {"effects": [e.as_dict() for e in (CAUSES["spring"].on(usual("ur5"), [1, 2], [[1.0, 1.0], [0.0, 0.0]]),)]}
    told: dict[str, Any] = {"name": "spring", "parameters": [], "cannot_be_told_from": []}
    names = usual("ur5").robot.joint_names
    marks = [claims(truth, {"effects": [{**told, "joints": [names[j] for j in joints]}]})[0] for joints in ([2, 3], [3, 4])]
    assert [m["true"] for m in marks] == [True, False]
    assert [m["probability"] for m in marks] == [None, None]
    assert claimed(marks[0])
    assert not claimed({**marks[0], "probability": 0.5})


def test_targets_of_robots_as_they_are() -> None:
    truth = truth_with("torque_offset")
    good = {**score_real(truth, telling(truth), np.full(6, 2.0)), "hidden": ["torque_offset"], "arm": "ur5", "diagnose_s": 3.0}
    good["sizes"] = [("offset", True)] * 19 + [("offset", False)]
    assert failed_targets("real", [good] * 20) == []
    refused = {**good, "refused": True, "verdict": "refused", "claimed": 0, "extra": [], "ratio": None, "worse": []}
    missed = failed_targets("real", [good] * 19 + [refused])
    assert any("refused" in sentence for sentence in missed)
    broken = {"verdict": "error", "hidden": ["(error)"], "named": [], "right": False}
    assert real_measures([good, broken])["refused"] == 0.5
    false = {**good, "extra": ["spring (elbow_joint)"] * 9}
    assert any("false" in sentence for sentence in failed_targets("real", [good, false]))
    assert "spring x9" in render_real([good, false, refused])


@cache
def drawn(seed: int, effect: str | None = None) -> Case:
    return draw_real(seed, effect, "compiled")


def stage_in(case: Case) -> Stage:
    """The robot as built, and what it does, that the case was drawn on."""
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([case.seed, SEED, attempt])
        stage = stage_of(TEN_ARMS[int(rng.integers(len(TEN_ARMS)))], rng)
        if stage.background.tolist() == case.truth["background"]:
            return stage
    raise AssertionError("none of the attempts has this background")


@pytest.mark.slow
def test_a_seed_gives_the_same_robot_and_its_truth() -> None:
    one, again = draw_real(4, simulator="compiled"), drawn(4)
    assert np.array_equal(one.train[0].tau, again.train[0].tau)
    assert json.dumps(one.truth) == json.dumps(again.truth)
    assert one.truth["hidden"] == one.truth["larger"] == []
    assert one.train[0].t[-1] == pytest.approx(30.0, abs=0.1)
    assert one.validate[0].t[-1] == pytest.approx(15.0, abs=0.1)
    assert not np.array_equal(draw_real(8, simulator="compiled").train[0].tau[:100], one.train[0].tau[:100])


@pytest.mark.slow
@pytest.mark.parametrize("id_", ["torque_offset", "external_force"])
def test_the_larger_cause_is_clear_and_the_truth_says_so(id_: str) -> None:
    case = drawn(1, id_)
    assert case.truth["hidden"] == [id_]
    assert case.truth["larger"] == [e for e in case.truth["effects"] if e["name"] == id_ and e in case.truth["larger"]]
    robot = case.nominal.model()
    rows = [Rows.of(robot, [recording_of(r)]) for r in (case.train[0], case.validate[0])]
    background = np.array(case.truth["background"])
    error = Baseline.fitted(rows[0], stage_in(case).baseline, cause_of(id_).plain).error(rows[1]) / background
    shows = [robot.joint_names.index(j) for e in case.truth["larger"] for j in e["joints"] if not cause_of(id_).whole_arm]
    # what was drawn was judged as a sum of what each does by itself
    assert (error[shows].min() if shows else error.max()) >= 0.85 * CLEAR


@pytest.mark.slow
def test_both_simulators_agree_on_a_robot_as_built() -> None:
    pytest.importorskip("mujoco", reason="the second simulator needs MuJoCo: pip install 'sysid_ros[dev]'")
    from exam.mujoco_physics import move_in_mujoco

    stage = stage_of("ur5", np.random.default_rng(3))
    true = realise(stage.robot, stage.built)
    ours, theirs = stage.moved[1], move_in_mujoco(true, stage.motions[1], stage.rate, stage.stiffening)
    left = np.sqrt(np.mean((ours.tau - theirs.tau) ** 2, axis=0))
    assert np.all(left < 0.2 * stage.background)


@pytest.mark.parametrize("name", ["ur10", "panda"])
def test_what_is_carried_weighs_the_same_on_a_heavier_link(name: str) -> None:
    """In both simulators, whose links it is not a part of."""
    mujoco = pytest.importorskip("mujoco", reason="the second simulator needs MuJoCo: pip install 'sysid_ros[dev]'")
    from exam.mujoco_model import build

    robot, rng = arm(name).model(), np.random.default_rng(0)
    true, tip = TrueRobot(robot), robot.n - 1
    true.carry(Payload(2.0, np.array([0.02, -0.03, 0.05]), np.diag([0.01, 0.012, 0.008])))
    true.picked_up = Payload(1.0, np.array([0.0, 0.04, 0.02]), np.diag([0.002, 0.003, 0.002]))
    true.move_link(tip, 1.3, np.array([0.01, 0.0, -0.01]))
    before = true.pi[tip].copy()
    true.scale_masses(np.where(np.arange(robot.n) == tip, 1.2, 1.0))
    assert true.pi[tip, 0] - before[0] == pytest.approx(0.2 * 1.3 * robot.pi.reshape(-1, 10)[tip, 0])
    for bodies, pi in ((true.carried, true.pi), ([*true.carried, true.picked_up], true.pi_after)):
        model = build(true, bodies)
        data, q, v, a = mujoco.MjData(model), *rng.uniform(-1.0, 1.0, (3, robot.n))
        joints = [model.joint(j).id for j in robot.joint_names]
        dofs = model.jnt_dofadr[joints]
        data.qpos[model.jnt_qposadr[joints]], data.qvel[dofs], data.qacc[dofs] = q, v, a
        mujoco.mj_inverse(model, data)
        passive = data.qfrc_passive[dofs] + data.qfrc_constraint[dofs]
        expected = (robot.regressor_along(q[None], v[None], a[None]) @ pi.ravel())[0]
        np.testing.assert_allclose(data.qfrc_inverse[dofs] + passive, expected, atol=1e-6)


def test_what_the_truth_file_says_is_plain(tmp_path: Path) -> None:
    path = tmp_path / "truth.json"
    path.write_text(json.dumps(truth_with("payload", "spring")))
    assert json.loads(path.read_text())["larger"][0]["name"] == "payload"
