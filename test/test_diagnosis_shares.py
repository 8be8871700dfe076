"""Shares of causes in the held-out error: they add up, and name the fewest that matter; what they are told as."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import permutations

import numpy as np
import pytest
from diagnosis_bags import ARM, messages
from robots import robot, urdf, with_body
from unsimulated import unsimulated as unsimulated

from sysid_ros.cli.diagnose_output import show
from sysid_ros.diagnosis import Diagnosis, Finding, diagnose
from sysid_ros.diagnosis.evidence import Part, Removes, fewest, removed_power, shapley
from sysid_ros.diagnosis.fault_findings import with_findings
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.diagnosis.result import Rest
from sysid_ros.effects import EFFECTS, LinkInertia, Parameter
from sysid_ros.effects.wording import of_joints, one, phrase
from sysid_ros.input_gate.raw_messages import read_messages
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.pages.diagnosis_page import diagnosis_page
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.urdf_bodies import fixed_bodies, matching, within_reach
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

INERTIA = np.diag([1e-3, 1e-3, 1e-3])
HAND, PLACE = 0.7, np.array([0.01, 0.02, 0.06])


def random_game(count: int, seed: int) -> Removes:
    """What sets of causes remove: a sum of each one's own, of pairs, and of all."""
    rng = np.random.default_rng(seed)
    own, pairs = rng.uniform(0.0, 0.1, count), 0.02 * rng.normal(size=(count, count))

    def removes(causes: frozenset[int]) -> float:
        index = sorted(causes)
        whole = 0.05 if len(causes) == count else 0.0
        return float(own[index].sum() + pairs[np.ix_(index, index)].sum() + whole)

    return removes


def test_shares_are_the_mean_over_all_orders_and_add_up() -> None:
    removes = random_game(4, 1)
    found, orders = np.zeros(4), list(permutations(range(4)))
    for order in orders:
        for k, i in enumerate(order):
            found[i] += removes(frozenset(order[: k + 1])) - removes(frozenset(order[:k]))
    shares = shapley(removes, 4)
    np.testing.assert_allclose(shares, found / len(orders))
    assert shares.sum() == pytest.approx(removes(frozenset(range(4))))


def test_shares_of_many_causes_are_drawn_and_add_up() -> None:
    few = random_game(9, 2)
    # five more of which each removes a part of its own: nothing is drawn of the nine
    more: Callable[[frozenset[int]], float] = lambda s: few(frozenset(i for i in s if i < 9)) + 0.01 * sum(i >= 9 for i in s)  # noqa: E731
    shares, exact = shapley(more, 14), shapley(few, 9)
    total = more(frozenset(range(14)))
    assert shares.sum() == pytest.approx(total)
    np.testing.assert_allclose(shares[9:], 0.01)
    assert np.all(np.abs(shares[:9] - exact) < 0.05 * total)


def test_the_headline_has_the_fewest_causes_that_remove_nearly_all() -> None:
    assert fewest([0.03, 0.50, 0.15, 0.30, -0.02]) == {1, 2, 3}
    assert fewest([0.03]) == {0}
    assert fewest([-0.02, 0.01]) == frozenset()
    assert fewest([]) == frozenset()


def recording(name: str, seed: int, seconds: float, extra: Callable[..., FloatArray]) -> Recording:
    return read_messages(name, messages(seed, seconds, extra), robot(ARM), OnlineSettings())[0]


def gears(t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Viscous friction and rotors."""
    return 0.8 * v + 0.05 * a


@cache
def worn() -> Diagnosis:
    return diagnose(robot(ARM), [recording("fit", 0, 14.0, gears)], [recording("judge", 1, 10.0, gears)])


def test_any_set_of_terms_removes_what_a_fit_of_it_removes() -> None:
    model = robot(ARM)
    train, judged = (prepare(model, [recording("run", seed, 10.0, gears)], []) for seed in (0, 1))
    library = Library(model, train.band)
    joints = range(model.n)
    groups = [[library.local(id_, j) for j in joints] for id_ in ("coulomb_friction", "viscous_friction", "rotor_inertia")]
    fit = train.problem.fit([t for g in groups for t in g], inexact=True)
    held = HeldOut.of(model, judged, fit)
    weight = 1.0 / held.rms(np.sqrt(fit.noise.along(judged.band))) ** 2
    removes = removed_power(train.problem, held, fit, [Part(t, frozenset({i})) for i, g in enumerate(groups) for t in g], weight)

    def power(rows: FloatArray) -> float:
        return float(np.sum(held.rms(rows) ** 2 * weight))

    for causes in ({0}, {1, 2}, {0, 1, 3}, {0, 1, 2, 3}):
        terms = [t for i in causes if i < 3 for t in groups[i]]
        again = train.problem.fit(terms, fit.noise, 0, inexact=3 in causes)
        expected = 1.0 - power(held.residual(again)) / power(judged.problem.y)
        assert removes(frozenset(causes)) == pytest.approx(expected, abs=1e-9)


def test_shares_and_what_is_left_add_up_to_the_whole_error() -> None:
    found = worn()
    assert [f.id for f in found.findings] == ["coulomb_friction", "viscous_friction", "rotor_inertia"]
    assert found.torque is not None
    assert found.rest is not None
    weight = found.torque.noise_floor**-2.0
    removed = 1.0 - np.sum(found.torque.after**2 * weight) / np.sum(found.torque.before**2 * weight)
    gains = [f.heldout_gain or 0.0 for f in found.findings]
    assert sum(gains) + found.rest.unclaimed == pytest.approx(removed, abs=1e-9)
    assert sum(gains) + found.rest.unclaimed + found.rest.noise + found.rest.unexplained == pytest.approx(1.0)
    assert [f.headline for f in found.findings] == [True, True, False]
    document = found.as_dict()
    assert [e["headline"] for e in document["effects"]] == [True, True, False]
    assert all(e["probability"] > 0.9 for e in document["effects"])
    assert document["headline"].startswith("Mostly: unmodelled dry friction (Coulomb) on all 4 joints (")
    assert f"Together they make {100 * sum(gains[:2]):.0f} % of the error" in document["headline"]


def test_a_cause_that_becomes_a_fault_of_the_data_leaves_the_others_the_rest_of_the_error() -> None:
    found = replace(worn(), rest=Rest(0.0, 0.01, 0.0))
    first, *others = found.findings
    lost = first.heldout_gain or 0.0
    scaled = with_findings(found, [*others, replace(first, heldout_gain=None, of_data=True, headline=False)])
    assert scaled.findings[0].heldout_gain == pytest.approx((others[0].heldout_gain or 0.0) / (1.0 - lost))
    assert scaled.rest is not None
    assert scaled.rest.noise == pytest.approx(0.01 / (1.0 - lost))
    assert "The data have a fault of their own: unmodelled dry friction" in scaled.headline


def of_verdict(verdict: str, *findings: Finding, refusal: str | None = None, left: float = 0.0) -> str:
    return Diagnosis(verdict, ("a", "b"), refusal, findings, unexplained_fraction=left).headline


def test_every_verdict_has_its_answer() -> None:
    cause = worn().findings[0]
    fault = replace(cause, heldout_gain=None, of_data=True, headline=False, words="efforts in coarse steps on b (0.1 N m)")
    small = replace(cause, headline=False, heldout_gain=0.01)
    assert of_verdict("refused", refusal="The robot stands still.") == "No answer: The robot stands still."
    assert of_verdict("nothing_wrong").startswith("Nothing is wrong that these recordings could show")
    assert of_verdict("unexplained").startswith("The model is wrong, and no cause")
    assert of_verdict("explained", fault) == "The model is right, the data are not: efforts in coarse steps on b (0.1 N m)."
    assert of_verdict("explained", cause).startswith("Unmodelled dry friction")
    both = of_verdict("explained", cause, small, fault)
    assert both.endswith("The data have a fault of their own: efforts in coarse steps on b (0.1 N m).")
    assert "; 23 % of it is of no cause that is known here." in of_verdict("partly_explained", cause, left=0.23)
    assert of_verdict("partly_explained", small).startswith("What was found in the fitted recordings does not make")


def test_a_hand_that_is_not_mounted_is_told_as_the_link_of_the_urdf() -> None:
    described = RobotModel.from_urdf(with_body(urdf(ARM), "hand", HAND, PLACE, INERTIA))
    last = LinkInertia(described, described.joint_names[-1:])
    hand = inertial_parameters.from_com(HAND, PLACE, INERTIA)
    covariance = np.diag([0.02, 0.002, 0.002, 0.002] + [1e-3] * 6) ** 2

    def told(theta: FloatArray) -> str:
        return last.in_words(last.as_parameters(theta, covariance), "slide")

    assert told(-hand) == (
        "the model has 0.700 ± 0.039 kg on 'hand' that are not there (mass and place of the URDF's 'welded_body' (0.7 kg): "
        "not mounted?)"
    )
    assert told(-2.0 * hand) == (
        "the model has 1.400 ± 0.039 kg on 'hand' that are not there (around (10.0, 20.0, 60.0) mm of its frame)"
    )
    assert (
        told(hand) == "the robot has 0.700 ± 0.039 kg on 'hand' that the model lacks, around (10.0, 20.0, 60.0) mm of its frame"
    )
    assert told(np.array([0.01, 0.1, *np.zeros(8)])).startswith("the mass of 'hand' lies elsewhere than the model says")


def test_the_page_answers_first_and_its_bar_adds_up() -> None:
    fault = replace(worn().findings[0], heldout_gain=None, of_data=True, headline=False, words="efforts in coarse steps on lift")
    page = diagnosis_page(replace(worn(), findings=(*worn().findings, fault)), "arm", {})
    body = page[page.index("<body>") :]
    marks = ("Mostly: unmodelled dry friction", "Then: ", "Faults of the data", "Efforts in coarse steps", "What makes the error")
    places = [body.index(mark) for mark in (*marks, "Torque error of each joint", "Numbers of each cause")]
    assert places == sorted(places)
    widths = [float(x) for x in re.findall(r'<i style="width:([\d.]+)%;background:[^"]+" title', body)]
    assert sum(widths) == pytest.approx(100.0, abs=0.1)
    assert len(widths) >= 3
    # statistics are folded, with what they mean
    assert body.index("<details>") < body.index("Bayesian information criterion")


def test_the_terminal_answers_first_and_is_no_wider_than_its_tables(capsys: pytest.CaptureFixture[str]) -> None:
    show(worn())
    out = capsys.readouterr().out
    assert " ".join(out.split()).startswith(worn().headline)
    assert max(map(len, out.splitlines())) <= 100
    assert "noise, which no model removes" not in out  # below a tenth of a per cent here
    show(Diagnosis("refused", ("a",), "The robot stands still. Let it move."))
    assert capsys.readouterr().out.split("\n")[:2] == ["No answer: The robot stands still.", "Let it move."]


def test_words_hold_the_sizes_and_which_way_they_are_off() -> None:
    def told(*values: float) -> str:
        found = [Parameter("b", f"j{i}", x, "N m s/rad", 0.01, x - 0.02, x + 0.02) for i, x in enumerate(values)]
        return phrase("{unmodelled} friction on {where} ({b})", "friction", found, "j")

    assert told(2.0) == "unmodelled friction on j (2.000 ± 0.020 N m s/rad)"
    assert told(1.0, 3.5) == "unmodelled friction on j (1 to 3.5 N m s/rad)"
    assert told(-1.0, -2.0) == "overestimated friction on j (-2 to -1 N m s/rad)"
    assert told(-1.0, 2.0).startswith("wrongly modelled")
    assert one(Parameter("delay", None, 0.004, "s", 1e-5)) == "4.000 ± 0.020 ms"
    assert one(Parameter("com", None, [0.02, -0.05, 0.3], "m")) == "(0.020, -0.050, 0.300) m"
    assert of_joints("abc", 3) == "all 3 joints"
    assert of_joints("abcd", 6) == "4 of 6 joints (a, b, c and d)"
    for effect in EFFECTS.values():
        assert effect.words.count("{") == effect.words.count("}")


def test_bodies_fixed_to_a_link_stand_in_the_frame_of_its_joint() -> None:
    described = RobotModel.from_urdf(with_body(urdf(ARM), "hand", HAND, PLACE, INERTIA))
    last = described.n - 1
    (body,) = [b for b in fixed_bodies(described, last) if b.name == "welded_body"]
    np.testing.assert_allclose(body.theta + robot(ARM).pi[-10:], described.pi[-10:], atol=1e-12)
    assert matching(described, last, body.theta[:4] * 1.01, np.full(4, 0.01)) != []
    assert matching(described, last, body.theta[:4] * 2.0, np.full(4, 0.01)) == []


def test_no_centre_of_mass_is_farther_off_than_the_robot_is_long() -> None:
    std = np.full(4, 0.01)
    assert within_reach(robot(ARM), np.array([1.0, 0.1, 0.1, 0.1]), std)
    assert not within_reach(robot(ARM), np.array([1.0, 0.0, 0.0, 20.0]), std)
    assert not within_reach(robot(ARM), np.array([-0.5, 0.0, 0.0, 0.0]), std)
    assert within_reach(robot(ARM), np.array([-0.5, 0.0, 0.0, 0.0]), np.full(4, 0.5))
