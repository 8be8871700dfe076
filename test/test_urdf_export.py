"""Export to URDF: what is written comes back, whichever links are fixed to others or locked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from robots import ROBOTS, random_body, robot, urdf, with_body

from sysid_ros.effects import EFFECTS, CoulombFriction, Effect, LinkInertia, RotorInertia, ViscousFriction
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.model_file import EffectBlock, ModelFile, urdf_digest
from sysid_ros.torque.urdf_export import check_model_file, check_urdf, export_urdf, identified_urdf


def model_file(robot: RobotModel, parts: list[tuple[Effect, FloatArray]]) -> ModelFile:
    blocks = tuple(
        EffectBlock(e.id, e.joint_names, e.settings, theta, e.parameter_names, e.units, np.eye(e.p)) for e, theta in parts
    )
    ones = np.ones(robot.n)
    return ModelFile(robot.name, robot.joint_names, urdf_digest(robot.urdf), blocks, ones, ones)


def identified(robot: RobotModel, seed: int = 0) -> ModelFile:
    rng = np.random.default_rng(seed)
    links = np.concatenate([inertial_parameters.from_com(*random_body(rng)) for _ in range(robot.n)])
    return model_file(
        robot,
        [
            (LinkInertia(robot), links),
            (ViscousFriction(robot), rng.uniform(0.0, 3.0, robot.n)),
            (CoulombFriction(robot), rng.uniform(0.0, 3.0, robot.n)),
            (RotorInertia(robot), rng.uniform(0.0, 0.3, robot.n)),
        ],
    )


def loaded(text: str, robot: RobotModel) -> RobotModel:
    return RobotModel.from_urdf(text, robot.joint_names)


def test_a_frame_without_mass_keeps_its_inertia() -> None:
    """As the hand and the grasp frame of some arms have it: not that of a body, but what simulators add to the link."""
    text = with_body(urdf("small_arm"), robot("small_arm").default_frame, 0.0, np.zeros(3), 0.1 * np.eye(3))
    model = RobotModel.from_urdf(text)
    file = model_file(model, [(LinkInertia(model), model.pi.copy())])
    made, _ = identified_urdf(model, file)
    check_urdf(model, file, made)
    np.testing.assert_allclose(loaded(made, model).pi, model.pi, atol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("drop", [0, 2])
def test_what_is_written_comes_back(name: str, drop: int, tmp_path: Path) -> None:
    full = RobotModel.from_urdf(urdf(name))
    robot = RobotModel.from_urdf(urdf(name), full.joint_names[: full.n - drop])
    model = identified(robot)
    notes = export_urdf(robot, model, tmp_path / "out.urdf")
    again = loaded((tmp_path / "out.urdf").read_text(), robot)
    np.testing.assert_allclose(again.pi, model.effects[0].theta, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(again.damping, model.effects[1].theta)
    np.testing.assert_array_equal(again.friction, model.effects[2].theta)
    np.testing.assert_array_equal(again.position_lower, robot.position_lower)
    assert any("rotor_inertia" in note for note in notes)


def test_another_simulator_reads_the_same_robot() -> None:
    """PyBullet's own inverse dynamics of the exported arm."""
    from sysid_ros.simulation.arm import ArmWorld

    robot = RobotModel.from_urdf(urdf("iiwa"))
    model = identified(robot, 3)
    text, _ = identified_urdf(robot, model)
    world, rng = ArmWorld(text, robot.default_frame), np.random.default_rng(0)
    try:
        for _ in range(5):
            q, v, a = rng.normal(size=(3, robot.n))
            expected = robot.regressor(q, v, a) @ model.effects[0].theta
            np.testing.assert_allclose(world.inverse_dynamics(q, v, a), expected, atol=1e-4 * np.abs(expected).max())
    finally:
        world.close()


def test_a_light_fixed_link_keeps_its_mass_and_a_heavy_one_is_merged() -> None:
    rng = np.random.default_rng(1)
    _, com, inertia = random_body(rng)
    for scale, kept in ((0.01, True), (3.0, False)):
        text = with_body(urdf("small_arm"), RobotModel.from_urdf(urdf("small_arm")).default_frame, scale, com, scale * inertia)
        robot = RobotModel.from_urdf(text)
        links = RobotModel.from_urdf(urdf("small_arm")).pi
        welded = inertial_parameters.from_com(0.01, com, 0.01 * inertia)
        theta = links.copy()
        theta[-10:] += welded
        out, notes = identified_urdf(robot, model_file(robot, [(LinkInertia(robot), theta)]))
        np.testing.assert_allclose(loaded(out, robot).pi, theta, rtol=1e-9, atol=1e-12)
        assert any(("subtracted" if kept else "without mass") in note and "welded_body" in note for note in notes)


def test_the_links_of_locked_joints_can_be_unlocked_again() -> None:
    full = RobotModel.from_urdf(urdf("tree_robot"))
    robot = RobotModel.from_urdf(urdf("tree_robot"), [j for j in full.joint_names if j not in ("grip", "right_slide")])
    theta = robot.pi * 1.05
    out, notes = identified_urdf(robot, model_file(robot, [(LinkInertia(robot), theta)]))
    free = RobotModel.from_urdf(out)
    np.testing.assert_allclose(loaded(out, robot).pi, theta, rtol=1e-9, atol=1e-12)
    finger = full.body_names.index("finger")
    np.testing.assert_allclose(free.pi[10 * finger : 10 * finger + 10], full.pi[10 * finger : 10 * finger + 10], rtol=1e-9)
    assert any("finger" in note for note in notes)


def test_of_other_dry_friction_the_level_is_held() -> None:
    robot = RobotModel.from_urdf(urdf("small_arm"))
    effect = EFFECTS["stribeck_friction"](robot, robot.joint_names[:2])
    theta = np.arange(1.0, effect.p + 1.0)
    out, notes = identified_urdf(robot, model_file(robot, [(effect, theta)]))
    level = {name: value for name, value in zip(effect.parameter_names, theta, strict=True) if name.startswith("Fc[")}
    friction = loaded(out, robot).friction
    np.testing.assert_allclose(friction[:2] - robot.friction[:2], [level[f"Fc[{name}]"] for name in robot.joint_names[:2]])
    np.testing.assert_array_equal(friction[2:], robot.friction[2:])
    assert any("alone" in note and "stribeck_friction" in note for note in notes)


def test_effects_of_one_kind_add_up_and_friction_below_zero_is_said() -> None:
    """As a diagnosis adds to what was known."""
    robot = RobotModel.from_urdf(urdf("small_arm"))
    n = robot.n
    links, viscous, coulomb = LinkInertia(robot), EFFECTS["viscous_friction"](robot), EFFECTS["coulomb_friction"](robot)
    change = np.zeros(n)
    change[0] = -5.0
    model = model_file(
        robot,
        [
            (links, 1.1 * robot.pi), (viscous, np.full(n, 2.0)), (coulomb, np.full(n, 3.0)),
            (links, 0.9 * robot.pi), (viscous, np.full(n, 0.5)), (coulomb, change),
        ],
    )  # fmt: skip
    out, notes = identified_urdf(robot, model)
    again = loaded(out, robot)
    np.testing.assert_allclose(again.pi, robot.pi, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(again.damping, 2.5)
    np.testing.assert_allclose(again.friction, [0.0, *[3.0] * (n - 1)])
    assert any("below zero" in note and robot.joint_names[0] in note for note in notes)


def test_what_the_model_does_not_say_stays_the_urdfs() -> None:
    robot = RobotModel.from_urdf(urdf("small_arm"))
    out, _ = identified_urdf(robot, model_file(robot, []))
    again = loaded(out, robot)
    np.testing.assert_allclose(again.pi, robot.pi, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(again.damping, robot.damping)


def test_links_that_are_no_bodies_are_refused() -> None:
    robot = RobotModel.from_urdf(urdf("small_arm"))
    theta = robot.pi.copy()
    theta[10] = -1.0
    with pytest.raises(ModelFileError, match=rf"{robot.body_names[1]}.*-1 kg.*physical consistency"):
        identified_urdf(robot, model_file(robot, [(LinkInertia(robot), theta)]))


def test_a_urdf_of_another_model_is_noticed() -> None:
    robot = RobotModel.from_urdf(urdf("small_arm"))
    out, _ = identified_urdf(robot, identified(robot, 0))
    check_urdf(robot, identified(robot, 0), out)
    with pytest.raises(ModelFileError, match="differ"):
        check_urdf(robot, identified(robot, 1), out)


def test_a_model_file_is_read_back(tmp_path: Path) -> None:
    robot = RobotModel.from_urdf(urdf("small_arm"))
    path = tmp_path / "model.yaml"
    identified(robot, 0).write(path)
    check_model_file(robot, identified(robot, 0), path)
    with pytest.raises(ModelFileError, match="link_inertia"):
        check_model_file(robot, identified(robot, 1), path)


def test_comments_and_shapes_of_the_urdf_are_kept() -> None:
    robot = RobotModel.from_urdf(urdf("tree_robot"))
    theta = robot.pi.copy().reshape(-1, 10)
    theta[theta[:, 0] == 0.0] = inertial_parameters.from_com(0.1, np.zeros(3), 1e-4 * np.eye(3))
    out, _ = identified_urdf(robot, model_file(robot, [(LinkInertia(robot), theta.ravel())]))
    assert out.startswith("<?xml")
    for tag in ("<visual", "<collision", "<mimic", "<!--", "<limit"):
        assert out.count(tag) == urdf("tree_robot").count(tag)
