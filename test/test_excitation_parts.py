"""Settings, limits, criteria and constraints of an excitation: each against its definition."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from robots import ROBOTS, robot
from test_collision_model import chain

from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.excitation.arm_rows import ArmRows, random_states
from sysid_ros.excitation.criteria import ExcitationCriteria
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.feasibility import Feasibility
from sysid_ros.excitation.fourier_trajectory import FourierBasis, FourierTrajectory
from sysid_ros.excitation.motion_limits import JointLimit, MotionLimits, read_joint_limits
from sysid_ros.excitation.optimiser import MotionConstraints
from sysid_ros.identification import BaseParameters, free_model
from sysid_ros.robot.collision_model import CollisionModel
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import Sample
from sysid_ros.torque.torque_model import TorqueModel

SETTINGS = ExcitationSettings(position_scale=0.9, velocity_scale=0.5, effort_scale=0.25, acceleration_limit=4.0)


@pytest.mark.parametrize(
    ("values", "match"),
    [
        ({"duration": 0.0}, "duration is 0"),
        ({"velocity_scale": 1.5}, "velocity_scale is 1.5"),
        ({"harmonics": 1}, "harmonics is 1"),
        ({"starts": 0}, "starts is 0"),
        ({"floor": float("nan")}, "floor is nan"),
        ({"clearance": -0.1}, "clearance is -0.1"),
        ({"acceleration_limit": float("inf")}, "acceleration_limit is inf"),
    ],
)
def test_settings_that_are_not_allowed(values: dict[str, float], match: str) -> None:
    with pytest.raises(SettingsError, match=match):
        ExcitationSettings(**values)  # type: ignore[arg-type]


@pytest.mark.parametrize(("duration", "period"), [(3.0, 3.0), (10.0, 10.0), (24.0, 12.0), (60.0, 10.0)])
def test_the_period_is_about_ten_seconds(duration: float, period: float) -> None:
    assert ExcitationSettings(duration=duration).base_period == pytest.approx(period)


def test_limits_are_parts_of_the_urdf() -> None:
    arm = robot("small_arm")
    limits = MotionLimits(arm, SETTINGS)
    assert limits.lower == pytest.approx([-0.9 * np.pi, -1.98, -2.25, 0.01])
    assert limits.upper == pytest.approx([0.9 * np.pi, 1.98, 2.25, 0.19])
    assert limits.velocity == pytest.approx(0.5 * arm.velocity_limit)
    assert limits.effort == pytest.approx(0.25 * arm.effort_limit)
    assert limits.acceleration == pytest.approx([4.0, 4.0, 4.0, 1.0])
    assert any("acceleration" in note for note in limits.notes)


def test_given_limits_replace_those_of_the_urdf() -> None:
    given = {"elbow": JointLimit(lower=-1.0, velocity=1.0, acceleration=9.0, effort=8.0)}
    limits = MotionLimits(robot("small_arm"), SETTINGS, given)
    middle, room = 0.75, 0.9 * 1.75
    assert (limits.lower[2], limits.upper[2]) == pytest.approx((middle - room, middle + room))
    assert (limits.velocity[2], limits.acceleration[2], limits.effort[2]) == pytest.approx((0.5, 9.0, 2.0))
    assert limits.velocity[1] == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"wrist": JointLimit()}, "wrist"),
        ({"elbow": JointLimit(lower=3.0)}, "elbow can't move"),
        ({"elbow": JointLimit(velocity=0.0)}, "velocity limit of joint elbow is 0"),
    ],
)
def test_limits_that_leave_nothing(given: dict[str, JointLimit], match: str) -> None:
    with pytest.raises(SettingsError, match=match):
        MotionLimits(robot("small_arm"), SETTINGS, given)


def test_limits_that_the_urdf_does_not_state_are_said() -> None:
    text = chain().replace('effort="50" velocity="2"', 'effort="0" velocity="0"')
    limits = MotionLimits(RobotModel.from_urdf(text), ExcitationSettings(velocity_default=0.7))
    assert limits.velocity == pytest.approx(0.7)
    assert np.all(np.isinf(limits.effort))
    assert any("No velocity limit" in note and "joint1" in note for note in limits.notes)
    assert any("No effort limit" in note for note in limits.notes)


def test_nominal_torque_is_that_of_the_torque_model() -> None:
    arm = robot("tree_robot")
    limits = MotionLimits(arm, SETTINGS)
    q, v, a = random_states(limits, 20)
    known = TorqueModel(arm, ())
    expected = [known.known_torque(Sample(0.0, *state, np.zeros(arm.n))) for state in zip(q, v, a, strict=True)]
    assert limits.torque(q, v, a) == pytest.approx(np.array(expected), abs=1e-9)


def test_a_file_of_joint_limits(tmp_path: Path) -> None:
    path = tmp_path / "joint_limits.yaml"
    path.write_text(
        "joint_limits:\n"
        "  elbow: {has_velocity_limits: true, max_velocity: !degrees 90, has_acceleration_limits: false, max_acceleration: 9}\n"
        "  lift: {max_position: 1.5, max_effort: 12}\n"
    )
    assert read_joint_limits(path) == {
        "elbow": JointLimit(velocity=np.deg2rad(90.0)),
        "lift": JointLimit(upper=1.5, effort=12.0),
    }
    example = Path(__file__).parents[1] / "config" / "joint_limits.yaml"
    assert read_joint_limits(example)["shoulder_pan_joint"].acceleration == 5.0


@pytest.mark.parametrize(
    ("text", "match"),
    [("a: 1", "joint_limits"), ("joint_limits: {a: {max_velocity: fast}}", "max_velocity of a is 'fast'"), ("{", "not YAML")],
)
def test_a_file_of_joint_limits_that_is_none(tmp_path: Path, text: str, match: str) -> None:
    path = tmp_path / "limits.yaml"
    path.write_text(text)
    with pytest.raises(SettingsError, match=match):
        read_joint_limits(path)
    with pytest.raises(SettingsError, match="can't be read"):
        read_joint_limits(tmp_path / "none.yaml")


@pytest.mark.parametrize("name", ROBOTS)
def test_criteria_are_those_of_the_information(name: str) -> None:
    model = free_model(robot(name))
    limits = MotionLimits(model.robot, SETTINGS)
    criteria = ExcitationCriteria(ArmRows(model, limits))
    q, v, a = random_states(limits, 300, seed=5)
    found = criteria.evaluate(q, v, a)
    zero = np.zeros(model.robot.n)
    Y = np.array([model.split(Sample(0.0, *state, zero))[0] for state in zip(q, v, a, strict=True)])
    assert criteria.base.rank == len(criteria.names) == len(criteria.columns)
    base = Y[:, :, criteria.columns]
    rows, all_rows = base.reshape(-1, criteria.base.rank), Y.reshape(-1, model.p)
    assert np.linalg.matrix_rank(rows / np.linalg.norm(rows, axis=0), tol=1e-6) == criteria.base.rank
    assert all_rows - rows @ np.linalg.lstsq(rows, all_rows, rcond=None)[0] == pytest.approx(0.0, abs=1e-7)
    information = np.einsum("kia,kib->ab", base, base)
    assert found.unweighted_condition_number == pytest.approx(_condition(information), rel=1e-6)
    weighted = base * criteria.weight[:, None]
    assert found.condition_number == pytest.approx(_condition(np.einsum("kia,kib->ab", weighted, weighted)), rel=1e-6)
    # each column has unit power over the states that the scale comes from, so M is a correlation there
    assert criteria.evaluate(*random_states(limits, 500)).d <= 0.0
    assert found.a >= 1.0 / np.exp(found.d / criteria.base.rank) - 1e-9
    assert found.e <= np.exp(found.d / criteria.base.rank) + 1e-9


def _condition(information: np.ndarray) -> float:
    scale = 1.0 / np.sqrt(np.diag(information))
    return float(np.sqrt(np.linalg.cond(information * np.outer(scale, scale))))


def test_the_condition_number_is_that_of_identification() -> None:
    model = free_model(robot("small_arm"))
    limits = MotionLimits(model.robot, SETTINGS)
    q, v, a = random_states(limits, 500)
    criteria = ExcitationCriteria(ArmRows(model, limits))
    zero = np.zeros(model.robot.n)
    Y = np.array([model.split(Sample(0.0, *state, zero))[0] for state in zip(q, v, a, strict=True)])
    base = BaseParameters(np.einsum("kia,kib->ab", Y, Y)[np.ix_(criteria.columns, criteria.columns)])
    assert base.rank == len(criteria.columns)
    assert criteria.evaluate(q, v, a).unweighted_condition_number == pytest.approx(base.condition_number, rel=1e-6)


def test_a_motion_that_tells_nothing_has_no_finite_d() -> None:
    model = free_model(robot("small_arm"))
    criteria = ExcitationCriteria(ArmRows(model, MotionLimits(model.robot, SETTINGS)))
    still = np.zeros((50, model.robot.n))
    found = criteria.evaluate(still, still, still)
    assert found.d == -np.inf
    assert found.condition_number == np.inf


@pytest.mark.parametrize("name", ROBOTS)
def test_the_derivative_of_d(name: str) -> None:
    model = free_model(robot(name))
    limits = MotionLimits(model.robot, SETTINGS)
    criteria = ExcitationCriteria(ArmRows(model, limits))
    state = np.stack(random_states(limits, 60, seed=2))
    direction, h = np.random.default_rng(3).normal(size=state.shape), 1e-5
    _, *gradients = criteria.negative_d(*state)
    difference = (criteria.negative_d(*(state + h * direction))[0] - criteria.negative_d(*(state - h * direction))[0]) / (2.0 * h)
    assert float(np.sum(np.stack(gradients) * direction)) == pytest.approx(difference, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("name", [*ROBOTS, "chain"])
def test_constraints_lie_above_what_is_used_and_have_their_derivative(name: str) -> None:
    arm = RobotModel.from_urdf(chain()) if name == "chain" else robot(name)
    collision = CollisionModel(arm, clearance=0.01, floor=-0.5)
    limits = MotionLimits(arm, ExcitationSettings())
    basis = FourierBasis(10.0, 10.0, 3)
    random = np.random.default_rng(4)
    coefficients = 0.2 * random.normal(size=(basis.size, arm.n)) * (limits.upper - limits.lower)
    coefficients[0] = 0.5 * (limits.lower + limits.upper)
    feasibility = Feasibility(limits, collision)
    constraints = MotionConstraints(feasibility, basis, 1000)
    value, gradient = constraints.evaluate(coefficients, 50.0)
    exact = constraints.exact(feasibility.use(FourierTrajectory(basis, np.array(coefficients)), 0.01))
    assert value.shape == exact.shape
    assert np.all(value >= exact - 1e-9)
    assert np.all(value <= exact + np.log(2000.0) / 50.0 + 1e-9)
    direction, h = random.normal(size=coefficients.shape) * (limits.upper - limits.lower), 1e-6
    after, before = (constraints.evaluate(coefficients + x * direction, 50.0)[0] for x in (h, -h))
    along = np.einsum("mkj,kj->m", gradient, direction)
    limit_rows = 4 * arm.n
    assert along[:limit_rows] == pytest.approx(((after - before) / (2.0 * h))[:limit_rows], rel=1e-3, abs=1e-4)


def test_the_fast_check_agrees_with_the_full_one() -> None:
    arm = RobotModel.from_urdf(chain())
    limits = MotionLimits(arm, ExcitationSettings())
    feasibility = Feasibility(limits, CollisionModel(arm, clearance=0.01, floor=-0.6))
    basis = FourierBasis(2.0, 2.0, 3)
    random = np.random.default_rng(6)
    answers = []
    for _ in range(30):
        coefficients = random.uniform(0.01, 0.2) * random.normal(size=(basis.size, arm.n))
        coefficients[0] = random.uniform(0.5 * limits.lower, 0.5 * limits.upper)
        trajectory = FourierTrajectory(basis, coefficients)
        keeps = feasibility.keeps(trajectory)
        assert keeps == feasibility.use(trajectory).feasible
        answers.append(keeps)
    assert 3 < sum(answers) < 27


@pytest.mark.parametrize(
    ("scale", "floor", "match"),
    [(1e-3, None, "joint1 needs at least"), (0.9, 0.5, "link[123] and floor overlap by")],
)
def test_what_prevents_every_motion_is_named(scale: float, floor: float | None, match: str) -> None:
    text = chain().replace('axis xyz="0 1 0"', 'axis xyz="0 0.6 0.8"') if scale < 0.1 else chain()
    arm = RobotModel.from_urdf(text)
    limits = MotionLimits(arm, ExcitationSettings(effort_scale=scale, position_scale=0.1))
    feasibility = Feasibility(limits, CollisionModel(arm, clearance=0.01, floor=floor))
    with pytest.raises(DataError, match=match):
        feasibility.postures(np.random.default_rng(0), 5)


def test_a_start_that_is_not_feasible_is_named() -> None:
    arm = RobotModel.from_urdf(chain())
    feasibility = Feasibility(MotionLimits(arm, ExcitationSettings()), CollisionModel(arm, clearance=0.01, floor=-0.2))
    feasibility.require_posture(np.array([0.0, 0.1, 0.2]))
    with pytest.raises(DataError, match=r"joint joint2 at 2\.99"):
        feasibility.require_posture(np.array([0.0, 2.99, 0.0]))
    with pytest.raises(DataError, match="link3 and floor"):
        feasibility.require_posture(np.array([1.5, 0.0, 0.0]))
