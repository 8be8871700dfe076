"""Changes of a fleet: what is drawn is found and dated, nothing is found in nothing, and the parts do what they say."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime
from functools import cache
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyarrow", reason="the extra fleet is not installed")

from click.testing import CliRunner
from html_pages import elements
from pyarrow import parquet

from sysid_ros.cli.batch import command as batch
from sysid_ros.cli.simulate import command as simulate
from sysid_ros.fleet.changes import alarms as alarms_module
from sysid_ros.fleet.changes.alarms import alarms, changed_share, percent, told
from sysid_ros.fleet.changes.carried import carried_evidence
from sysid_ros.fleet.changes.evidence import JointEvidence, interval, shapes
from sysid_ros.fleet.changes.fleet_changes import FleetChanges, fleet_changes
from sysid_ros.fleet.changes.levels import in_levels, levels
from sysid_ros.fleet.changes.pooled import OneSeries, pooled
from sysid_ros.fleet.changes.quantities import Costs
from sysid_ros.fleet.changes.series import FleetSeries, RobotSeries, Series, fleet_series
from sysid_ros.fleet.fleet_page import answer, fleet_page
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.fleet.store import Results, Store
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.fleet.drawn_fleet import Fleet, draw_fleet
from sysid_ros.simulation.fleet.fleet_recording import record
from sysid_ros.simulation.fleet.fleet_scenario import FleetScenario
from sysid_ros.simulation.fleet.fleet_tables import drawn_rows
from sysid_ros.simulation.fleet.plain_arm import KINDS, plain_arm

URDFS = {"small": plain_arm("small", *KINDS["small"])}
SMALL = FleetScenario(robots=5, weeks=30, changes={"wear": 1, "torque_offset": 1, "tool": 1}, seed=5)


def stored(fleet: Fleet, path: Path) -> FleetSeries:
    store = Store(path, create=True)
    with store.writing():
        store.append([Results(r.bag, r.joints, r.payloads) for r in drawn_rows(fleet)])
    return fleet_series(store)


@cache
def small_fleet() -> Fleet:
    return draw_fleet(SMALL, URDFS)


@pytest.fixture(scope="module")
def changes(tmp_path_factory: pytest.TempPathFactory) -> FleetChanges:
    return fleet_changes(stored(small_fleet(), tmp_path_factory.mktemp("fleet") / "store"))


def test_what_is_drawn_is_found_named_and_dated(changes: FleetChanges) -> None:
    found = {(a.change.robot, a.change.joint): a.change for a in alarms(changes)}
    assert len(found) == len(small_fleet().changes)
    for true in small_fleet().changes:
        change = found[true.robot, true.joint]
        assert change.quantity == (true.parameter if true.joint else "payload")
        assert abs(change.since[0] - true.day) < 14.0
        assert np.sign(change.size) == np.sign(true.size)


def test_sizes_are_told_in_units_of_the_parameter(changes: FleetChanges) -> None:
    found = {(a.change.robot, a.change.joint): a.change for a in alarms(changes)}
    for true in small_fleet().changes:
        assert found[true.robot, true.joint].size == pytest.approx(true.size, rel=0.3)


def of_friction(usual: float, bags: int, seed: int) -> Series:
    """A joint whose Coulomb friction scatters by 5 % of itself, and whose offset is another on each."""
    rng, p = np.random.default_rng(seed), len(JOINT_PARAMETERS)
    y = np.full((bags, p), np.nan)
    y[:, 0] = usual * (1.0 + 0.05 * rng.normal(size=bags))
    y[:, JOINT_PARAMETERS.index("torque_offset")] = rng.normal()
    return Series("j", np.arange(bags), y, np.tile(0.01 * np.eye(p), (bags, 1, 1)), np.full(bags, 30.0), Costs("j"))


def test_frictions_count_as_parts_of_what_they_are() -> None:
    series = [of_friction(usual, 30, seed) for seed, usual in enumerate((0.5, 1.0, 2.0))]
    found = levels(series)
    np.testing.assert_allclose([of[0] for of in found], [0.5, 1.0, 2.0], rtol=0.04)
    assert np.all(np.array(found)[:, 1:] == 1.0)
    scaled = [in_levels(s, level) for s, level in zip(series, found, strict=True)]
    np.testing.assert_allclose([np.std(s.y[:, 0]) for s in scaled], 0.05, rtol=0.4)
    np.testing.assert_allclose([s.covariance[0, 0, 0] for s in scaled], 0.01 / np.array([0.5, 1.0, 2.0]) ** 2, rtol=0.1)


def test_of_one_bag_a_level_is_that_of_the_kind() -> None:
    found = levels([of_friction(usual, 1, seed) for seed, usual in enumerate((0.5, 1.0, 2.0))])
    assert np.all(np.array(found) == 1.0)


def test_dates_count_from_the_first_bag(changes: FleetChanges) -> None:
    first = min(bag.day for bag in small_fleet().bags)
    assert changes.series.start == SMALL.date(first)
    assert changes.series.last == pytest.approx(max(bag.day for bag in small_fleet().bags) - first)


def test_a_rate_that_is_lower_tells_no_more(changes: FleetChanges) -> None:
    some = [len(told(changes, rate)) for rate in (0.5, 0.05, 1e-6, 1e-300)]
    assert some == sorted(some, reverse=True)
    assert some[0] > 0


def test_alarms_are_those_of_the_e_benjamini_hochberg_procedure(changes: FleetChanges) -> None:
    looks = (*np.log([900.0, 500.0, 30.0]), *[-1.0] * 7)
    made = replace(changes, looks=looks, candidates=tuple(replace(changes.candidates[0], log_e=e) for e in looks[:3]))
    # 10 looks at 0.05: the k-th must be at least 200 / k: 900, 500 and not 30
    assert [round(np.exp(c.log_e)) for c in told(made, 0.05)] == [900, 500]
    assert [round(np.exp(c.log_e)) for c in told(made, 0.25)] == [900, 500, 30]
    assert told(replace(made, looks=(0.0,) * 10, candidates=()), 0.05) == ()


def test_share_of_changes_is_the_likeliest() -> None:
    assert changed_share([-3.0] * 40) < 1e-3
    assert changed_share([50.0] * 10 + [-3.0] * 30) == pytest.approx(0.25, abs=0.02)


def test_what_rounds_to_all_is_told_as_less() -> None:
    assert (percent(0.99999), percent(0.123)) == ("> 99.9 %", "12.3 %")


def simple_evidence(y: FloatArray, std: float, correlation: float = 0.0) -> JointEvidence:
    n, p = y.shape
    block = std**2 * ((1.0 - correlation) * np.eye(p) + correlation)
    covariance = np.einsum("nm,pq->npmq", np.eye(n), block) + np.einsum("nm,pq->npmq", np.full((n, n), 100.0), np.eye(p))
    return JointEvidence(y, covariance, np.full(p, std), shapes(np.arange(0.0, 7.0 * n, 7.0)))


def test_evidence_has_mean_one_where_nothing_changes() -> None:
    rng = np.random.default_rng(3)
    e = [np.exp(simple_evidence(rng.normal(size=(10, 2)), 1.0).look().log_e) for _ in range(200)]
    # an e-value: of so many with such tails the mean is seldom far above 1, and by Markov few are large
    assert np.mean(e) < 2.0
    assert np.mean(np.array(e) > 20.0) <= 1.0 / 20.0


def test_bayes_factor_is_that_of_the_gaussian_densities() -> None:
    rng = np.random.default_rng(4)
    y, std = rng.normal(size=(6, 1)), 1.0
    look = simple_evidence(y, std).look()
    courses = shapes(np.arange(0.0, 7.0 * 6, 7.0))
    C = np.eye(6) + 100.0

    def log_density(cov: FloatArray) -> float:
        return float(-0.5 * np.linalg.slogdet(cov)[1] - 0.5 * y[:, 0] @ np.linalg.solve(cov, y[:, 0]))

    total = 0.0
    for k in range(courses.f.shape[1]):
        d = courses.f[:, k]
        for size in (1.0, 3.0, 10.0, 30.0, 100.0):
            total += np.exp(courses.log_prior[k]) / 5.0 * np.exp(log_density(C + size**2 * np.outer(d, d)) - log_density(C))
    assert look.log_of[0] == pytest.approx(np.log(total), rel=1e-9)


def test_what_is_correlated_in_a_bag_is_told_apart() -> None:
    """Two parameters whose errors nearly cancel: a step in one shows in both only as noise does."""
    rng = np.random.default_rng(5)
    n = 30
    block = np.array([[1.0, -0.95], [-0.95, 1.0]])
    y = rng.multivariate_normal(np.zeros(2), block, n)
    y[15:, 1] += 1.5
    look = simple_evidence(y, 1.0, correlation=-0.95).look()
    assert np.argmax(look.log_of) == 1
    assert look.log_of[1] - look.log_of[0] > 3.0


def test_an_odd_bag_is_no_change() -> None:
    rng = np.random.default_rng(6)
    y = rng.normal(size=(30, 2))
    y[12, 0] += 15.0
    model = simple_evidence(y, 1.0)
    look = model.look()
    assert look.log_odd > np.max(look.log_of)
    assert look.log_e < np.log(20.0)
    assert model.take_odd(look) == 12
    assert model.look().log_e < np.log(20.0)


def test_a_change_that_is_known_is_not_found_again() -> None:
    rng = np.random.default_rng(7)
    y = rng.normal(size=(40, 1))
    y[18:, 0] += 12.0
    model = simple_evidence(y, 1.0)
    first = model.look()
    course = model.take(first, 0)
    assert first.log_e > 50.0
    assert course[-1] == pytest.approx(12.0, abs=1.0)
    assert model.look().log_e < np.log(20.0)


def test_two_bags_on_one_day_and_none_after_tell_no_change() -> None:
    courses = shapes(np.array([3.0, 3.0]))
    assert courses.f.shape == (2, 0)
    evidence = JointEvidence(np.zeros((2, 1)), np.eye(2).reshape(2, 1, 2, 1), np.ones(1), courses)
    assert evidence.look().log_e <= 0.0


def test_interval_of_a_mixture() -> None:
    median, low, high = interval(np.array([0.0, 10.0]), np.array([10.0, 20.0]), np.array([0.5, 0.5]))
    assert (median, low, high) == pytest.approx((10.0, 0.5, 19.5))


def test_what_robots_share_is_learned() -> None:
    rng = np.random.default_rng(8)
    days, made = np.arange(0.0, 7.0 * 60, 7.0), []
    for _ in range(15):
        x = rng.normal(size=(60, 1))
        y = 2.0 + 0.5 * rng.normal() + 0.3 * x[:, 0] + rng.normal(scale=np.hypot(0.1, 0.2), size=60)
        made.append(OneSeries(days, y, np.full(60, 0.01), x))
    for robust in (True, False):
        found = pooled(made, robust)
        assert found.mean == pytest.approx(2.0, abs=0.4)
        assert np.sqrt(found.scatter) == pytest.approx(0.2, rel=0.1)
        assert found.beta[0] == pytest.approx(0.3, abs=0.03)
        assert np.sqrt(found.wander * 365.0) < 0.1


def robot_with(mass: FloatArray) -> RobotSeries:
    n = len(mass)
    names = tuple(f"bag_{k}" for k in range(n))
    return RobotSeries("r", "k", np.arange(0.0, 7.0 * n, 7.0), names, names, (), mass, np.full(n, 0.03))


def test_products_are_no_tool_and_a_tool_is_told_under_products() -> None:
    rng = np.random.default_rng(9)
    products = rng.choice([0.0, 0.7, 1.9], 40) + rng.normal(scale=0.03, size=40)
    new_product = np.where(np.arange(40) > 20, rng.choice([0.0, 0.7, 1.9, 1.1], 40), products) + rng.normal(scale=0.01, size=40)
    tool = products + 0.3 * (np.arange(40) >= 22)
    quiet, new, found = (carried_evidence(robot_with(m), 0.0) for m in (products, new_product, tool))
    assert quiet is not None
    assert new is not None
    assert found is not None
    assert quiet.log_e < np.log(20.0)
    assert new.log_e < np.log(20.0)
    assert found.log_e > np.log(1000.0)
    assert found.delta == pytest.approx(0.3, abs=0.05)
    assert abs(found.after[np.argmax(found.weights)] - 7.0 * 22) <= 14.0
    assert carried_evidence(robot_with(np.array([np.nan, 1.0])), 0.0) is None


def test_page_is_alone_whole_and_escaped(changes: FleetChanges) -> None:
    bad = '</script><b>"x"'
    failed = [{"bag": bad, "reason": bad}]
    text = fleet_page(changes, alarms(changes), failed, alarms_module.RATE, bad)
    found = elements(text)
    assert not found.wrong
    assert not found.open
    assert [a for a in found.fetched if not a.startswith("#")] == []
    assert "<b>" not in text.replace("<b></b>", "").replace("<b>robot_", "")
    data = json.loads(next(s for s in found.scripts if s.startswith("{")))
    assert [len(r["joints"]) for r in data["robots"]] == [6] * 5
    assert {len(j["curves"]) for r in data["robots"] for j in r["joints"]} == {len(JOINT_PARAMETERS)}


def test_a_bag_holds_what_its_truth_says() -> None:
    """Efforts without noise follow from the parameters: held against the equation at one instant."""
    fleet = draw_fleet(replace(SMALL, robots=1, weeks=1, changes={}), URDFS)
    (bag,) = fleet.bags
    held, robot, true = record(fleet, bag), fleet.robots[0], bag.parameters
    q, v, a = robot.programs[bag.program].sample(held.t)
    assert np.allclose(held.q, q, atol=2e-4)
    if not bag.carried.any():
        links = robot.model.rnea_along(q - true["joint_offset"], v, a)
        drive = true["rotor_inertia"] * a + true["coulomb_friction"] * np.tanh(v / 0.02) + true["viscous_friction"] * v
        left = held.tau - true["torque_gain"] * (links + drive) - true["torque_offset"]
        assert np.all(left.std(axis=0) < 1.3 * true["noise"])


def test_commands(tmp_path: Path) -> None:
    out, run = tmp_path / "year", CliRunner().invoke
    made = run(
        simulate, ["fleet", "--bag", str(out), "--store", "--robots", "2", "--weeks", "12", "--changes", "torque_offset=1"]
    )
    assert made.exit_code == 0, made.output
    page, summary = tmp_path / "page.html", tmp_path / "a.json"
    arguments = ["report", str(out / "store"), "--out", str(page), "--json", str(summary)]
    told_of = run(batch, arguments)
    assert told_of.exit_code == 0, told_of.output
    document = json.loads(summary.read_text())
    alarm = document["alarms"][0]
    assert alarm["quantity"] == "torque_offset"
    datetime.fromisoformat(alarm["since"])
    assert parquet.read_table(out / "store" / "alarms" / "alarms.parquet").num_rows == len(document["alarms"])
    assert "torque offset" in page.read_text()
    assert run(batch, arguments).exit_code != 0  # not overwritten
    again = run(simulate, ["fleet", "--bag", str(out), "--robots", "1"])
    assert again.exit_code != 0
    assert run(simulate, ["fleet", "--bag", str(tmp_path / "b"), "--changes", "rust=1"]).exit_code == 2


def test_a_bag_that_is_written_is_read(tmp_path: Path) -> None:
    out = tmp_path / "fleet"
    asked = ["fleet", "--bag", str(out), "--robots", "1", "--weeks", "1", "--duration", "4", "--rate", "50", "--changes", "0"]
    made = CliRunner().invoke(simulate, asked)
    assert made.exit_code == 0, made.output
    from sysid_ros import load

    recording = load(next((out / "robot_01").iterdir()))
    assert recording.duration == pytest.approx(4.0 - 1.0 / 50.0)


def test_bags_of_one_date_tell_no_change(tmp_path: Path) -> None:
    fleet = draw_fleet(replace(SMALL, robots=1, weeks=4, changes={}), URDFS)
    rows = [Results(r.bag, r.joints, r.payloads) for r in drawn_rows(fleet)]
    for row in [row for r in rows for row in (r.bag, *r.joints, *r.payloads)]:
        row["date"] = SMALL.start
    store = Store(tmp_path / "store", create=True)
    with store.writing():
        store.append(rows)
    series = fleet_series(store)
    changes = fleet_changes(series)
    assert alarms(changes) == ()
    assert "of one date" in series.notes[0]
    assert "can't be told" in answer((), series)


UR10E = Path(__file__).resolve().parents[2] / "shared" / "data" / "ur10e"


@pytest.mark.slow
@pytest.mark.skipif(not UR10E.is_dir(), reason="the recordings of ../shared/data are not here")
def test_a_real_arm_as_a_fleet_of_one(tmp_path: Path) -> None:
    """Its recordings carry one date all: the report tells what was found of each and says that no change can be told."""
    pytest.importorskip("distributed", reason="the extra fleet is not installed")
    robots, store = tmp_path / "robots.yaml", tmp_path / "store"
    robots.write_text(f"robots: [{{robot: ur10e, kind: ur10e, urdf: {UR10E / 'ur10e.urdf'}}}]\n")
    made = CliRunner().invoke(batch, [str(UR10E), "--robots", str(robots), "--out", str(store), "--workers", "1"])
    assert made.exit_code == 0, made.output
    said = CliRunner().invoke(batch, ["report", str(store)])
    assert said.exit_code == 0, said.output
    assert "can't be told" in said.output
    assert len(fleet_series(Store(store)).robots[0].bags) == 6
