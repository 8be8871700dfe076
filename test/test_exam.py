"""The exam itself: cases are what their seed says and show what they hide, and the marks are fair."""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")

from exam.ambiguity import told_apart
from exam.arms import ARMS, all_there, arm
from exam.case import LEVELS, Case, draw_case
from exam.scoring import score
from exam.table import failed_targets, measures, render

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.hidden_effects import (
    CAUSES,
    Circumstances,
    DiagnosisMotion,
    HiddenEffect,
    nominal_residual,
    realise,
    shown,
)

pytestmark = pytest.mark.skipif(not all_there(), reason="the arms of the exam need: pip install example-robot-data")

# names and signs that other files agree on
PARAMETERS = {
    "payload": {"mass", "com"},
    "payload_change": {"mass", "com", "t0"},
    "link_inertia": {"dm", "dmc"},
    "rotor_inertia": {"J"},
    "viscous_friction": {"b"},
    "coulomb_friction": {"Fc"},
    "quadratic_friction": {"c"},
    "stribeck_friction": {"Fc", "Fs", "vs"},
    "asymmetric_coulomb_friction": {"F_pos", "F_neg"},
    "load_dependent_friction": {"Fc", "mu"},
    "presliding_hysteresis": {"Fc", "z_s"},
    "friction_drift": {"Fc", "b", "rate_Fc", "rate_b"},
    "torque_offset": {"offset"},
    "torque_offset_drift": {"rate"},
    "torque_scale": {"gain"},
    "torque_sign": {"gain"},
    "torque_unit": {"factor"},
    "joint_offset": {"delta"},
    "joint_sign": {"sign"},
    "joint_order": {"takes_from"},
    "base_tilt": {"roll", "pitch"},
    "gravity_compensated_effort": {"coef"},
    "time_delay": {"delay"},
    "effort_lag": {"lag"},
    "velocity_lag": {"cutoff"},
    "joint_elasticity": {"stiffness"},
    "backlash": {"gap"},
    "spring": {"k", "q0"},
    "cogging": {"harmonic", "amp"},
    "joint_coupling": {"c"},
    "torque_saturation": {"limit"},
    "torque_quantisation": {"step"},
    "external_force": {"force"},
}

INSIDE = {id_: cause for id_, cause in CAUSES.items() if not cause.outside}


@cache
def model(name: str) -> RobotModel:
    return arm(name).model()


@cache
def drawn(seed: int, level: str = "single", effect: str | None = None) -> Case:
    return draw_case(seed, level, effect, "compiled")


@cache
def circumstances(name: str, seed: int) -> Circumstances:
    robot = model(name)
    rng = np.random.default_rng(seed)
    return Circumstances(robot, DiagnosisMotion(robot, rng, 3.4, 2.4, 0.4), rng, 1.0, np.full(robot.n, 0.1))


def usual(name: str, seed: int, scale: float = 1.0) -> Circumstances:
    """Always the same draws, from a generator of its own."""
    c = copy.copy(circumstances(name, seed))
    c.rng, c.scale = np.random.default_rng([seed, 1]), scale
    return c


@pytest.mark.parametrize("name", ARMS)
def test_every_effect_can_be_drawn_on_every_arm(name: str) -> None:
    assert set(PARAMETERS) == set(INSIDE)
    robot = model(name)
    for id_, cause in INSIDE.items():
        effect = cause.draw(usual(name, 1))
        names = effect.as_dict()
        assert effect.id == id_
        assert {p["name"] for p in names["parameters"]} == PARAMETERS[id_]
        assert set(effect.joints) <= set(arm(name).joint_names)
        again = cause.draw(usual(name, 1))
        assert again.as_dict() == names
        assert realise(robot, (effect,)).effects == (effect,)


def test_scale_makes_effects_smaller() -> None:
    for id_, symbol in {"coulomb_friction": "Fc", "payload": "mass", "rotor_inertia": "J"}.items():
        large, small = (CAUSES[id_].draw(usual("ur5", 2, scale)) for scale in (1.0, 0.25))
        sizes = [next(float(p.value) for p in e.parameters if p.name == symbol) for e in (large, small)]  # type: ignore[arg-type]
        assert sizes[1] == pytest.approx(0.25 * sizes[0])


@pytest.mark.parametrize("name", ARMS)
def test_motion_stays_within_the_limits(name: str) -> None:
    robot = arm(name).model()
    for seed in range(3):
        motion = DiagnosisMotion(robot, np.random.default_rng(seed), 7.0, 4.0)
        t = np.arange(0.0, motion.duration, 0.005)
        q, v, a = motion.sample(t)
        assert np.all((q > robot.position_lower) & (q < robot.position_upper))
        assert np.all(np.abs(v) <= robot.velocity_limit)
        assert np.all(np.abs(robot.rnea_along(q, v, a)[::10]) <= robot.effort_limit)
        assert np.abs(v[[0, -1]]).max() < 1e-9
        assert np.abs(np.gradient(q, t, axis=0) - v)[1:-1].max() < 0.02


@pytest.mark.slow
def test_a_seed_gives_the_same_case_and_another_seed_another() -> None:
    one, other = drawn(300, "healthy"), drawn(301, "healthy")
    again = draw_case(300, "healthy", simulator="compiled")
    assert np.array_equal(one.train[0].tau, again.train[0].tau)
    assert one.truth == again.truth
    assert one.truth["noise"] != other.truth["noise"]
    assert not np.array_equal(one.train[0].q[0], one.validate[0].q[0])
    first, second = (CAUSES["coulomb_friction"].draw(usual("ur5", seed)).as_dict() for seed in (1, 2))
    assert first["parameters"] != second["parameters"]


def test_what_is_hidden_shows_in_the_recording() -> None:
    case = drawn(309, effect="coulomb_friction")
    robot = case.nominal.model()
    noise = np.array(case.truth["noise"]["torque"])
    _, _, residual = nominal_residual(robot, case.train[0].exact)
    floors = shown(residual, noise * np.sqrt(16.0 / case.truth["rate"]))
    hidden = [robot.joint_names.index(j) for j in case.truth["effects"][0]["joints"]]
    assert floors[hidden].min() >= 4.0
    others = np.delete(floors, hidden)
    assert not others.size or others.max() < 1.0


@pytest.mark.slow
def test_healthy_robots_hide_nothing() -> None:
    healthy = drawn(300, "healthy")
    assert healthy.truth["hidden"] == []
    declared = drawn(303, "healthy").nominal.model()
    assert declared.damping.min() > 0.0
    assert declared.friction.min() > 0.0
    coloured = drawn(301, "healthy")
    assert min(coloured.truth["noise"]["coloured"]) > 0.0


@pytest.mark.slow
def test_the_harder_levels_hide_what_they_say() -> None:
    hard = draw_case(302, "hard", effect="torque_offset", simulator="compiled")
    assert {"coulomb_friction", "viscous_friction"} <= {e["name"] for e in hard.truth["effects"]}
    assert hard.truth["rate"] == 250
    assert hard.train[0].t[-1] == pytest.approx(14.4, abs=0.1)
    pair = draw_case(300, "pairs", effect="torque_scale", simulator="compiled").truth["hidden"]
    assert len(pair) == 2
    assert pair[0] == "torque_scale"
    assert draw_case(301, "outside", simulator="compiled").truth["hidden"][0].startswith("outside_")


def test_a_cause_that_another_one_explains_is_drawn_again() -> None:
    robot = arm("ur5").model()
    motion = DiagnosisMotion(robot, np.random.default_rng(0), 6.0, 3.0)
    floor = np.full(robot.n, 0.02)
    weight = HiddenEffect("link_inertia", (robot.joint_names[2],), (), "", {"mass_factor": 1.0, "com_shift": [0.05, 0.05, 0.05]})
    assert told_apart(realise(robot, (weight,)), motion, floor)
    assert not told_apart(realise(robot, (weight,)), motion, 1e3 * floor)


def document(truth: dict[str, Any]) -> dict[str, Any]:
    """What a diagnosis would say that knows the truth."""
    effects = []
    for e in truth["effects"]:
        parameters = []
        for p in e["parameters"]:
            value = p["value"]
            interval = (
                value if isinstance(value, str) else [(np.asarray(value) - 0.1).tolist(), (np.asarray(value) + 0.1).tolist()]
            )
            parameters.append({**p, "std": 0.05, "ci95": interval})
        effects.append({"name": e["name"], "joints": e["joints"], "parameters": parameters, "cannot_be_told_from": []})
    rmse = {"joints": truth["joint_names"], "before": [9.0] * 2, "after": [1.1] * 2, "noise_floor": [1.0] * 2}
    return {
        "verdict": "explained" if effects else "nothing_wrong",
        "effects": effects,
        "torque_rmse": rmse,
        "unexplained_fraction": 0.0,
    }


def truth_of(*ids: str, level: str = "single", background: tuple[str, ...] = ()) -> dict[str, Any]:
    c = usual("ur5", 3)
    effects = [CAUSES[id_].draw(c).as_dict() for id_ in (*background, *ids)]
    return {"hidden": list(ids), "level": level, "effects": effects, "joint_names": list(c.robot.joint_names)}


@pytest.mark.parametrize("id_", list(INSIDE))
def test_who_knows_the_truth_gets_full_marks(id_: str) -> None:
    truth = truth_of(id_)
    row = score(truth, document(truth))
    assert row["right"]
    assert row["exact"]
    assert row["joints"]
    assert row["covered"] in (None, 1.0)
    assert (row["before"], row["after"]) == pytest.approx((9.0, 1.1))


def test_marks_are_lost_for_what_is_wrong() -> None:
    truth = truth_of("coulomb_friction", "base_tilt", level="pairs")
    good = document(truth)
    assert score(truth, good)["all_found"]
    changes: tuple[tuple[Callable[[Any], Any], str], ...] = (
        (lambda d: d["effects"].pop(0), "all_found"),
        (lambda d: d["effects"].append({**d["effects"][1], "name": "torque_offset"}), "exact"),
        (lambda d: d["effects"][0].update(joints=["elbow_joint", "wrist_1_joint", "wrist_3_joint"]), "joints"),
        (lambda d: d["effects"].insert(0, {**d["effects"][1], "name": "spring"}), "right"),
        (lambda d: d["effects"].clear(), "right"),
    )
    for change, lost in changes:
        worse = copy.deepcopy(good)
        change(worse)
        assert not score(truth, worse)[lost], lost


def test_a_size_outside_its_interval_is_not_covered() -> None:
    truth = truth_of("base_tilt")
    answer = document(truth)
    answer["effects"][0]["parameters"][0]["ci95"] = [10.0, 11.0]
    assert score(truth, answer)["covered"] == 0.5


def test_look_alikes_count_only_where_they_are_admitted() -> None:
    truth = truth_of("payload")
    answer = document(truth)
    answer["effects"][0]["name"] = "link_inertia"
    assert not score(truth, answer)["right"]
    answer["effects"][0]["cannot_be_told_from"] = ["payload"]
    assert score(truth, answer)["right"]
    assert score(truth, answer)["exact"]
    answer["effects"][0]["name"] = "torque_scale"  # no look-alike, whatever it admits
    assert not score(truth, answer)["right"]
    for id_, cause in INSIDE.items():
        assert set(cause.companions) <= set(INSIDE)
        assert all(id_ in INSIDE[other].equivalent for other in cause.equivalent)


def test_companions_are_no_false_alarm_and_others_are() -> None:
    for id_, cause in INSIDE.items():
        if not cause.companions:
            continue
        truth = truth_of(id_)
        for name, fine in [*((x, True) for x in cause.companions), ("time_delay", False)]:
            answer = document(truth)
            answer["effects"].append({**answer["effects"][0], "name": name})
            assert score(truth, answer)["exact"] is fine


def test_friction_of_every_joint_is_no_answer_in_the_hard_level() -> None:
    truth = truth_of("spring", level="hard", background=("coulomb_friction", "viscous_friction"))
    answer = document(truth)
    assert score(truth, answer)["right"]
    assert score(truth, answer)["exact"]
    del answer["effects"][2]
    assert not score(truth, answer)["right"]


@pytest.mark.parametrize(("level", "good"), [("healthy", "nothing_wrong"), ("outside", "unexplained")])
def test_verdicts_of_levels_without_a_name(level: str, good: str) -> None:
    truth = {"hidden": [], "level": level, "effects": []}
    assert score(truth, {"verdict": good, "effects": []})["right"]
    assert not score(truth, {"verdict": "explained", "effects": []})["right"]


def test_targets_hold_or_are_said_to_fail() -> None:
    truth = truth_of("spring")
    right = {**score(truth, document(truth)), "hidden": ["spring"], "covered": 0.95}
    wrong = {**right, "right": False, "exact": False, "first": "cogging", "named": ["cogging"], "joints": None}
    assert failed_targets("single", [right] * 40) == []
    assert any("first" in sentence for sentence in failed_targets("single", [right] * 30 + [wrong] * 10))
    assert measures("single", [right, wrong])["first"] == 0.5
    assert "cogging x10" in render("single", [right] * 30 + [wrong] * 10)
    assert failed_targets("single", [])
    assert set(LEVELS) == {"single", "hard", "pairs", "healthy", "outside", "real"}


def test_urdf_of_an_arm_says_nothing_but_its_links() -> None:
    for name in ARMS:
        robot = RobotModel.from_urdf(arm(name).urdf, arm(name).joint_names)
        assert robot.n in (6, 7)
        assert not np.any(robot.damping)
        assert not np.any(robot.friction)
        assert "mesh" not in arm(name).urdf
