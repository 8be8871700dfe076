"""What every effect keeps to, whatever it models: one suite over all that are registered, on three kinds of robots."""

from __future__ import annotations

import re

import numpy as np
import pytest
import yaml
from motions import Motion as Motion_
from robots import ROBOTS, random_body, random_sample, robot, urdf, with_body

from sysid_ros import effects
from sysid_ros.effects import EFFECTS, TRUNK_EFFECTS, Effect, LinkInertia, Motion, Payload
from sysid_ros.exceptions import ModelFileError, RobotModelError
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import Sample

every_effect = pytest.mark.parametrize("effect_id", EFFECTS)
every_robot = pytest.mark.parametrize("robot_name", ROBOTS)
FRICTION = [name for name in EFFECTS if "friction" in name]
WITH_MEMORY = ("presliding_hysteresis", "time_delay", "effort_lag", "joint_elasticity")
"""What these do to a sample depends on the samples before it."""


def make(effect_id: str, robot_name: str, joints: tuple[str, ...] = ()) -> Effect:
    return EFFECTS[effect_id](robot(robot_name), joints)


def samples(model: RobotModel, count: int = 20) -> list[Sample]:
    rng = np.random.default_rng(3)
    return [random_sample(model, rng) for _ in range(count)]


def test_every_class_of_the_package_is_registered_by_its_id() -> None:
    classes = [getattr(effects, name) for name in effects.__all__]
    concrete = {c for c in classes if isinstance(c, type) and issubclass(c, Effect) and not c.__abstractmethods__}
    assert {*EFFECTS.values(), *TRUNK_EFFECTS.values()} == concrete
    assert all(name == c.id for name, c in EFFECTS.items())
    assert all(re.fullmatch("[a-z_]+", name) for name in EFFECTS)


@every_effect
def test_the_docstring_has_the_equation_with_a_reference_or_a_unit(effect_id: str) -> None:
    text = EFFECTS[effect_id].__doc__ or ""
    assert re.search(r"``tau\w* = [^`]+``", text), text
    assert re.search(r"\(.*\d{4}.*\)|\[[^]]+\]", text, re.DOTALL) or EFFECTS[effect_id] is Payload
    assert EFFECTS[effect_id].label
    assert EFFECTS[effect_id].signature
    assert EFFECTS[effect_id].separated_by
    assert set(EFFECTS[effect_id].look_alikes)


@every_effect
@every_robot
def test_shapes_names_and_units(effect_id: str, robot_name: str) -> None:
    effect = make(effect_id, robot_name)
    assert effect.p == len(effect.parameter_names) == len(effect.units) > 0
    assert len(set(effect.parameter_names)) == effect.p
    assert all(effect.parameter_names)
    assert all(effect.units)
    for sample in samples(effect.robot):
        columns = effect.columns(sample)
        assert columns.shape == (effect.robot.n, effect.p)
        assert columns.dtype == np.float64
        assert np.isfinite(columns).all()


@every_effect
@every_robot
def test_torque_is_columns_times_theta_and_linear_in_it(effect_id: str, robot_name: str) -> None:
    effect = make(effect_id, robot_name)
    rng = np.random.default_rng(0)
    for sample in samples(effect.robot):
        one, two = rng.normal(size=(2, effect.p))
        torque = effect.torque(sample, one)
        assert torque.shape == (effect.robot.n,)
        np.testing.assert_allclose(torque, effect.columns(sample) @ one, atol=1e-9)
        both = effect.torque(sample, 2.0 * one - 3.0 * two)
        np.testing.assert_allclose(both, 2.0 * torque - 3.0 * effect.torque(sample, two), atol=1e-8)


@every_effect
@every_robot
def test_fill_writes_the_columns_and_leaves_nothing_of_the_sample_before(effect_id: str, robot_name: str) -> None:
    effect = make(effect_id, robot_name)
    wide = np.zeros((effect.robot.n, effect.p + 4))
    for sample in samples(effect.robot):
        effect.robot.rnea(sample.q, sample.v, sample.a)
        effect.fill(sample, wide[:, 2:-2])
        np.testing.assert_array_equal(wide[:, 2:-2], effect.columns(sample))
        assert not wide[:, :2].any()
        assert not wide[:, -2:].any()


@every_effect
@every_robot
def test_columns_do_not_depend_on_what_was_asked_before(effect_id: str, robot_name: str) -> None:
    effect = make(effect_id, robot_name)
    first, second = samples(effect.robot, 2)
    expected = effect.columns(first)
    kept = expected.copy()
    effect.columns(second)
    np.testing.assert_array_equal(expected, kept)
    np.testing.assert_array_equal(effect.columns(first), kept)


@every_effect
@every_robot
def test_settings_make_the_effect_again_also_through_yaml(effect_id: str, robot_name: str) -> None:
    effect = make(effect_id, robot_name)
    again = EFFECTS[effect_id].from_settings(effect.robot, effect.joint_names, yaml.safe_load(yaml.safe_dump(effect.settings)))
    assert again.settings == effect.settings
    assert again.parameter_names == effect.parameter_names
    assert again.units == effect.units
    assert again.joint_names == effect.joint_names
    for sample in samples(effect.robot, 3):
        np.testing.assert_array_equal(again.columns(sample), effect.columns(sample))


@every_effect
@every_robot
def test_some_of_the_joints(effect_id: str, robot_name: str) -> None:
    whole = make(effect_id, robot_name)
    names = whole.robot.joint_names
    chosen = (names[2], names[0])
    part = make(effect_id, robot_name, chosen)
    assert part.joint_names == (names[0], names[2])  # the model's order, whatever the caller's
    assert set(part.parameter_names) <= set(whole.parameter_names)
    where = [whole.parameter_names.index(name) for name in part.parameter_names]
    assert part.units == tuple(whole.units[i] for i in where)
    for sample in samples(whole.robot, 5):
        np.testing.assert_allclose(part.columns(sample), whole.columns(sample)[:, where], atol=1e-12)
        theta = np.arange(1.0, part.p + 1.0)
        np.testing.assert_allclose(part.torque(sample, theta), part.columns(sample) @ theta, atol=1e-9)


@every_effect
def test_a_joint_that_the_robot_lacks(effect_id: str) -> None:
    with pytest.raises(ModelFileError, match=r"(?s)shoulder_9.*turn, lift"):
        make(effect_id, "small_arm", ("lift", "shoulder_9"))


@pytest.mark.parametrize("effect_id", FRICTION)
@every_robot
def test_friction_never_gives_power(effect_id: str, robot_name: str) -> None:
    effect = make(effect_id, robot_name)
    rng = np.random.default_rng(1)
    for sample in samples(effect.robot, 200):
        torque = effect.torque(sample, rng.uniform(0.0, 5.0, effect.p))
        assert np.all(sample.v * torque >= 0.0)
    standing = random_sample(effect.robot, rng, still=True)
    assert not effect.torque(standing, np.ones(effect.p)).any()


def test_coulomb_friction_has_its_full_size_once_its_width_is_left() -> None:
    effect = effects.CoulombFriction(robot("small_arm"), width=0.05)
    v = np.array([0.5, -0.5, 2.0, -0.2])
    torque = effect.torque(Sample(0.0, np.zeros(4), v, np.zeros(4), np.zeros(4)), np.array([1.0, 2.0, 3.0, 4.0]))
    np.testing.assert_allclose(torque, [1.0, -2.0, 3.0, -4.0], rtol=2e-3)


def test_a_slide_has_the_units_of_a_force() -> None:
    expected = {"viscous_friction": "N s/m", "coulomb_friction": "N", "rotor_inertia": "kg", "torque_offset": "N"}
    for name, unit in expected.items():
        assert make(name, "small_arm", ("slide",)).units == (unit,)
    for name in EFFECTS:
        effect = make(name, "small_arm", ("slide",))
        if any("[slide]" in parameter for parameter in effect.parameter_names):
            assert not any("rad" in unit or "N m" in unit.split("/")[0] for unit in effect.units), name


@every_effect
@every_robot
def test_columns_of_a_whole_motion(effect_id: str, robot_name: str) -> None:
    effect = make(effect_id, robot_name)
    model = effect.robot
    t = np.arange(200.0) * 0.01
    motion = Motion(model, t, *Motion_(model, 3)(t), np.zeros((200, model.n)))
    along = effect.columns_along(motion)
    assert along.shape == (200, model.n, effect.p)
    assert np.isfinite(along).all()
    if effect_id not in WITH_MEMORY:
        each = np.stack([effect.columns(sample) for sample in motion.samples()])
        np.testing.assert_allclose(along, each, atol=1e-9 * max(1.0, float(np.abs(each).max())))


@every_robot
def test_links_times_their_urdf_parameters_are_the_inverse_dynamics(robot_name: str) -> None:
    model = robot(robot_name)
    effect = LinkInertia(model)
    np.testing.assert_array_equal(effect.nominal, model.pi)
    for sample in samples(model):
        expected = model.rnea(sample.q, sample.v, sample.a)
        np.testing.assert_allclose(effect.columns(sample) @ effect.nominal, expected, atol=1e-9 * np.abs(expected).max())


@every_robot
def test_payload_is_the_torque_of_the_urdf_with_the_body_welded_on(robot_name: str) -> None:
    model = robot(robot_name)
    rng = np.random.default_rng(5)
    for frame in model.frame_names:
        body = random_body(rng)
        loaded = RobotModel.from_urdf(with_body(urdf(robot_name), frame, *body))
        assert loaded.joint_names == model.joint_names
        effect = Payload(model, frame=frame)
        theta = inertial_parameters.from_com(*body)
        for sample in samples(model, 4):
            state = sample.q, sample.v, sample.a
            np.testing.assert_allclose(effect.columns(sample) @ theta, loaded.rnea(*state) - model.rnea(*state), atol=1e-9)


def test_payload_where_joints_are_locked() -> None:
    chosen = ("left_shoulder", "right_shoulder", "right_turn")
    body = random_body(np.random.default_rng(6))
    theta = inertial_parameters.from_com(*body)
    model = RobotModel.from_urdf(urdf("tree_robot"), chosen)
    for frame in ("right_tip", "right_tool", "left_hand", "torso"):
        loaded = RobotModel.from_urdf(with_body(urdf("tree_robot"), frame, *body), chosen)
        for sample in samples(model, 4):
            state = sample.q, sample.v, sample.a
            expected = loaded.rnea(*state) - model.rnea(*state)
            np.testing.assert_allclose(Payload(model, frame=frame).torque(sample, theta), expected, atol=1e-9)


@every_robot
def test_payload_is_the_same_body_in_every_frame_of_its_link(robot_name: str) -> None:
    model = robot(robot_name)
    theta = inertial_parameters.from_com(*random_body(np.random.default_rng(7)))
    frames = {"iiwa": ("lbr_iiwa_link_7",) * 2, "small_arm": ("hand",) * 2, "tree_robot": ("right_tip", "right_tool")}[robot_name]
    for sample in samples(model, 5):
        rotation, origin = zip(*(model.frame_placement(sample.q, f) for f in frames), strict=True)
        moved = inertial_parameters.move(theta, rotation[1].T @ rotation[0], rotation[1].T @ (origin[0] - origin[1]))
        one, other = (Payload(model, frame=f) for f in frames)
        np.testing.assert_allclose(one.torque(sample, theta), other.torque(sample, moved), atol=1e-9)


def test_payload_loads_only_the_joints_that_carry_it() -> None:
    model = robot("tree_robot")
    (sample,) = samples(model, 1)
    columns = Payload(model, frame="left_hand").columns(sample)
    carrying = {name for name, row in zip(model.joint_names, columns, strict=True) if row.any()}
    assert carrying == {"lift", "left_shoulder", "left_wrist"}
    assert not Payload(model, frame="ground").columns(sample).any()


def test_payload_in_a_frame_that_the_robot_lacks() -> None:
    with pytest.raises(RobotModelError, match=r"flange.*hand"):
        Payload(robot("small_arm"), frame="flange")
