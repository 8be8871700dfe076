"""RobotModel: which joints move and in what order, what is said of the others, and errors that name the cure."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest
from robots import ROBOTS, random_sample, robot, urdf

from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot.body_torque import BodyTorque
from sysid_ros.robot.flange import gripper_joints
from sysid_ros.robot.joint_motion import MOTION, joint_table
from sysid_ros.robot.link_products import LANES, in_lanes, link_products, own_blocks
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel

every_robot = pytest.mark.parametrize("robot_name", ROBOTS)
TREE_JOINTS = ("lift", "left_shoulder", "left_wrist", "grip", "right_shoulder", "right_turn", "right_slide")


def test_every_movable_joint_that_does_not_mimic() -> None:
    model = robot("tree_robot")
    assert model.name == "tree_robot"
    assert set(model.joint_names) == set(TREE_JOINTS)
    assert model.n == 7
    assert model.joint_names[0] == "lift"
    for chain in (("left_shoulder", "left_wrist", "grip"), ("right_shoulder", "right_turn", "right_slide")):
        places = [model.joint_names.index(j) for j in chain]
        assert places == sorted(places)


def test_limits_and_kinds_are_in_the_order_of_the_joints() -> None:
    model = robot("tree_robot")
    at = {name: i for i, name in enumerate(model.joint_names)}
    assert {name for name in at if model.is_prismatic[at[name]]} == {"lift", "grip", "right_slide"}
    assert {name for name in at if model.is_continuous[at[name]]} == {"right_shoulder"}
    assert (model.position_lower[at["right_slide"]], model.position_upper[at["right_slide"]]) == (-0.1, 0.2)
    assert (model.position_lower[at["right_shoulder"]], model.position_upper[at["right_shoulder"]]) == (-np.inf, np.inf)
    assert model.velocity_limit[at["right_turn"]] == 6.0
    assert model.effort_limit[at["lift"]] == 400.0
    assert model.damping[at["left_shoulder"]] == 0.7
    assert model.friction[at["left_shoulder"]] == 0.4
    assert not model.damping[at["left_wrist"]]


def test_a_limit_that_is_not_stated_is_infinite() -> None:
    text = urdf("small_arm").replace(' effort="60" velocity="3"', ' effort="0" velocity="0"')
    model = RobotModel.from_urdf(text)
    lift = model.joint_names.index("lift")
    assert model.effort_limit[lift] == model.velocity_limit[lift] == np.inf


@every_robot
def test_arrays_have_the_shapes_that_are_stated(robot_name: str) -> None:
    model, sample = robot(robot_name), random_sample(robot(robot_name), np.random.default_rng(0))
    n, state = model.n, (sample.q, sample.v, sample.a)
    for name in (
        "position_lower",
        "position_upper",
        "velocity_limit",
        "effort_limit",
        "is_prismatic",
        "is_continuous",
        "damping",
    ):
        assert getattr(model, name).shape == (n,), name
    assert len(model.body_names) == n
    assert model.pi.shape == (10 * n,)
    assert model.rnea(*state).shape == model.gravity_torque(sample.q).shape == (n,)
    assert model.regressor(*state).shape == (n, 10 * n)
    assert model.payload_regressor(*state, model.frame_id(model.default_frame)).shape == (n, 10)
    rotation, origin = model.frame_placement(sample.q, model.default_frame)
    assert rotation.shape == (3, 3)
    assert origin.shape == (3,)


@every_robot
def test_gravity_torque_is_the_inverse_dynamics_at_rest(robot_name: str) -> None:
    model = robot(robot_name)
    q = random_sample(model, np.random.default_rng(0)).q
    np.testing.assert_allclose(model.gravity_torque(q), model.rnea(q, np.zeros(model.n), np.zeros(model.n)), atol=1e-10)


@every_robot
@pytest.mark.parametrize("count", [1, LANES, LANES + 3])
def test_link_products_are_those_with_the_regressor(robot_name: str, count: int) -> None:
    """Of any number of columns, some of them of one link alone, wherever they go."""
    model, rng = robot(robot_name), np.random.default_rng(0)
    sample, linear = random_sample(model, rng), rng.normal(size=(10 * model.n, count))
    linear[:10, count // 2 :] = 0.0
    lanes, places = in_lanes(linear), rng.permutation(count)
    out, wrench = np.full((model.n, count + 1), 7.0), np.full((model.n, lanes.shape[1], 6 * LANES), np.nan)
    about, state = (joint_table(model.model), model.gravity, lanes, own_blocks(lanes)), (sample.q, sample.v, sample.a)
    link_products(*about, *state, np.full((model.n, MOTION), np.nan), wrench, places, out)
    np.testing.assert_allclose(out[:, places], model.regressor(*state) @ linear, atol=1e-11)
    np.testing.assert_array_equal(out[:, count], 7.0)


@every_robot
def test_the_torque_of_a_body_is_that_of_its_regressor(robot_name: str) -> None:
    model, rng = robot(robot_name), np.random.default_rng(1)
    sample, theta = random_sample(model, rng), rng.normal(size=10)
    for frame in map(model.frame_id, model.frame_names):
        regressor = model.payload_regressor(sample.q, sample.v, sample.a, frame)
        np.testing.assert_allclose(BodyTorque(model, frame)(sample.q, sample.v, sample.a, theta), regressor @ theta, atol=1e-10)


def test_gravity_is_an_argument() -> None:
    q = np.array([0.3, -0.5, 0.7, 0.1])
    down, up = (RobotModel.from_urdf(urdf("small_arm"), gravity=(0.0, 0.0, z)) for z in (-9.81, 9.81))
    np.testing.assert_allclose(down.gravity_torque(q), -up.gravity_torque(q))
    assert not RobotModel.from_urdf(urdf("small_arm"), gravity=(0, 0, 0)).gravity_torque(q).any()


@pytest.mark.parametrize("chosen", [("right_slide", "lift", "left_wrist"), ("grip",), ("grip_mimic", "grip")])
def test_only_the_chosen_joints_move_in_the_models_order(chosen: tuple[str, ...]) -> None:
    model = RobotModel.from_urdf(urdf("tree_robot"), chosen)
    assert set(model.joint_names) == set(chosen)
    assert model.joint_names == RobotModel.from_urdf(urdf("tree_robot"), chosen[::-1]).joint_names
    (note,) = [n for n in model.notes if "locked at 0" in n and "Mimic" not in n]
    for name in set(TREE_JOINTS) - set(chosen):
        assert name in note
    assert not any(re.search(rf"\b{name}\b", n) for n in model.notes for name in chosen if "locked" in n)


def test_locked_joints_are_at_zero_and_their_links_still_weigh() -> None:
    whole = robot("tree_robot")
    chosen = ("lift", "left_shoulder", "right_turn")
    part = RobotModel.from_urdf(urdf("tree_robot"), chosen)
    where = [whole.joint_names.index(j) for j in part.joint_names]
    rng = np.random.default_rng(2)
    q, v, a = np.zeros((3, whole.n))
    q[where], v[where], a[where] = rng.normal(size=(3, 3))
    np.testing.assert_allclose(part.rnea(q[where], v[where], a[where]), whole.rnea(q, v, a)[where], atol=1e-10)
    for array in ("position_upper", "effort_limit", "is_prismatic", "is_continuous", "damping"):
        np.testing.assert_array_equal(getattr(part, array), getattr(whole, array)[where])


def test_a_link_may_have_the_name_of_a_joint() -> None:
    whole = robot("tree_robot")
    text = urdf("tree_robot").replace(f'"{whole.body_names[whole.joint_names.index("right_turn")]}"', '"right_turn"')
    assert '<link name="right_turn"' in text
    part = RobotModel.from_urdf(text, ("lift", "left_shoulder"))
    q, v, a = np.random.default_rng(4).normal(size=(3, 2))
    other = RobotModel.from_urdf(urdf("tree_robot"), ("lift", "left_shoulder"))
    np.testing.assert_allclose(part.rnea(q, v, a), other.rnea(q, v, a), atol=1e-12)


def test_mimic_joints_are_named() -> None:
    assert any("Mimic" in note and "grip_mimic" in note for note in robot("tree_robot").notes)
    assert not any("Mimic" in note for note in robot("small_arm").notes)


def test_links_without_mass_are_named() -> None:
    notes = [note for note in RobotModel.from_urdf(urdf("tree_robot"), ("lift", "right_turn")).notes if "mass" in note]
    assert not notes  # what is fixed to the flange weighs
    bare = urdf("tree_robot").replace('<mass value="0.6"/>', '<mass value="0"/>')
    (note,) = [note for note in RobotModel.from_urdf(bare).notes if "mass" in note]
    assert "right_tool" in note


def test_regressors_of_one_joint_are_matrices_too() -> None:
    model = RobotModel.from_urdf(urdf("small_arm"), ("elbow",))
    q, v, a = np.array([[0.3], [0.1]]), np.array([[0.2], [-0.4]]), np.array([[1.0], [0.5]])
    assert model.regressor(q[0], v[0], a[0]).shape == (1, 10)
    np.testing.assert_allclose(model.regressor(q[0], v[0], a[0]) @ model.pi, model.rnea(q[0], v[0], a[0]))
    np.testing.assert_allclose(model.link_torque_along(q, v, a, model.pi), model.rnea_along(q, v, a))


@pytest.mark.parametrize("mass", ["heavy", "nan", "-3", "inf"])
def test_a_mass_that_is_no_number_is_told(mass: str) -> None:
    with pytest.raises(RobotModelError, match=f"'upper_arm' .* the mass '{mass}'"):
        RobotModel.from_urdf(urdf("small_arm").replace('<mass value="3"/>', f'<mass value="{mass}"/>'))


def test_joints_in_descriptions_for_other_programs_do_not_count() -> None:
    extra = '<gazebo><joint name="ball" type="revolute"/></gazebo><ros2_control><joint name="lift"/></ros2_control></robot>'
    model = RobotModel.from_urdf(urdf("small_arm").replace("</robot>", extra))
    assert model.joint_names == robot("small_arm").joint_names


def test_a_continuous_joint_is_one_coordinate_that_turns_without_limit() -> None:
    model = robot("small_arm")
    assert model.joint_names == ("turn", "lift", "elbow", "slide")
    q = np.array([0.4, 0.2, -0.5, 0.05])
    turned = q + np.array([2.0 * np.pi * 7, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(model.gravity_torque(turned), model.gravity_torque(q), atol=1e-9)
    for one, other in zip(model.frame_placement(q, "hand"), model.frame_placement(turned, "hand"), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


def test_a_continuous_joint_is_a_revolute_one_without_stops() -> None:
    revolute = urdf("small_arm").replace('type="continuous"', 'type="revolute"')
    revolute = revolute.replace('<limit effort="40"', '<limit lower="-9" upper="9" effort="40"')
    one, other = robot("small_arm"), RobotModel.from_urdf(revolute)
    sample = random_sample(one, np.random.default_rng(0))
    np.testing.assert_allclose(one.rnea(sample.q, sample.v, sample.a), other.rnea(sample.q, sample.v, sample.a), atol=1e-10)


def test_a_slide_against_newton() -> None:
    """The lift of the tree leans by 0.1 rad: it holds the weight of all it carries along its axis, and accelerates all of it."""
    model = robot("tree_robot")
    total = 12 + 3 + 1.1 + 0.1 + 0.1 + 4 + 0.6
    force = model.gravity_torque(np.zeros(7))[0]
    assert force == pytest.approx(total * 9.81 * np.cos(0.1))
    a = np.zeros(7)
    a[0] = 2.0
    assert model.rnea(np.zeros(7), np.zeros(7), a)[0] == pytest.approx(force + 2.0 * total)


def test_frames() -> None:
    model = robot("tree_robot")
    assert {"ground", "right_tip", "left_hand", "other_finger"} <= set(model.frame_names)
    assert model.default_frame == "torso"  # both arms hang on it
    assert robot("iiwa").default_frame == "lbr_iiwa_link_7"
    assert robot("small_arm").default_frame == "hand"
    left = RobotModel.from_urdf(urdf("tree_robot"), ("lift", "left_shoulder", "left_wrist"))
    assert left.default_frame == "left_hand"


def test_default_frame_with_a_gripper_is_the_link_that_both_fingers_share() -> None:
    model = RobotModel.from_urdf(urdf("tree_robot"), ("lift", "left_shoulder", "left_wrist", "grip", "grip_mimic"))
    assert model.default_frame == "left_hand"


ARMS = {
    "panda": ("panda_link7", "panda_link8"),
    "ur5_robot": ("wrist_3_link", "tool0"),
    "ur10_robot": ("wrist_3_link", "tool0"),
    "ur3_gripper": ("wrist_3_link", "tool0"),
    "xarm7": ("link7", "link_eef"),
    "kinova": ("j2s6s200_link_6", "j2s6s200_link_6"),
    "z1": ("link06", "link06"),
    "so100": ("wrist", "wrist"),
    "baxter": ("right_wrist", "right_wrist"),
    "talos_left_arm": ("arm_left_7_link", "arm_left_7_link"),
    "allegro_left_hand": ("link_11.0", "link_11.0"),
}
"""Link that the arm's last joint moves, and its flange."""


@pytest.mark.parametrize("name", ARMS)
def test_the_flange_is_no_finger(name: str) -> None:
    path = packaged(name)
    if path is None:
        pytest.skip("example-robot-data is not installed")
    model = RobotModel.from_urdf(path.read_text())
    assert (model.default_frame, model.flange) == ARMS[name]
    assert model.model.frames[model.frame_id(model.flange)].parentJoint == model.body_names.index(model.default_frame) + 1


def test_fingers_come_in_pairs_or_are_called_so() -> None:
    assert gripper_joints(urdf("tree_robot")) == {"grip", "grip_mimic"}
    assert gripper_joints(urdf("small_arm")) == frozenset()  # its slide bears the arm


def test_frame_placement_against_pinocchio() -> None:
    model = robot("iiwa")
    q = random_sample(model, np.random.default_rng(0)).q
    raw = pin.buildModelFromXML(urdf("iiwa"))
    data = raw.createData()
    pin.framesForwardKinematics(raw, data, q)
    expected = data.oMf[raw.getFrameId("lbr_iiwa_link_7")]
    rotation, origin = model.frame_placement(q, "lbr_iiwa_link_7")
    np.testing.assert_allclose(rotation, expected.rotation, atol=1e-12)
    np.testing.assert_allclose(origin, expected.translation, atol=1e-12)


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_joints_of_other_kinds_do_not_move(kind: str) -> None:
    """As a mobile base or a loose object has them: they are locked like every joint that is not used, and named."""
    text = urdf("small_arm").replace(
        '<link name="base"/>',
        f'<link name="world"/><link name="base"/><joint name="rolling" type="{kind}">'
        '<parent link="world"/><child link="base"/></joint>',
    )
    model = RobotModel.from_urdf(text)
    assert model.joint_names == robot("small_arm").joint_names
    assert any("rolling" in note for note in model.notes)
    sample = random_sample(model, np.random.default_rng(0))
    state = sample.q, sample.v, sample.a
    np.testing.assert_allclose(model.rnea(*state), robot("small_arm").rnea(*state), atol=1e-10)


def test_the_joints_that_messages_name() -> None:
    names = ("battery_cover", "elbow", "lift", "turn")
    model = RobotModel.for_messages(urdf("small_arm"), names)
    assert model.joint_names == ("turn", "lift", "elbow")
    assert RobotModel.for_messages(urdf("small_arm"), names, ("elbow",)).joint_names == ("elbow",)


def test_a_finger_that_mimics_stays_locked_where_messages_name_it() -> None:
    names = tuple(f"{j}" for j in (*TREE_JOINTS, "grip_mimic"))
    model = RobotModel.for_messages(urdf("tree_robot"), names)
    assert "grip_mimic" not in model.joint_names
    assert any("grip_mimic" in note for note in model.notes)


ONE_LINK = '<robot name="stone"><link name="stone"/></robot>'


@pytest.mark.parametrize(
    ("text", "joints", "message"),
    [
        ("", (), r"not well-formed XML.*xacro"),
        ("<robot name='a'><link", (), r"not well-formed XML"),
        ("<sdf/>", (), r"<sdf>.*<robot>"),
        (ONE_LINK, (), r"'stone' has no movable joint"),
        (ONE_LINK, ("a",), r"no movable joint named a.*none at all"),
        (urdf("small_arm"), ("lift", "shoulder"), r"no movable joint named shoulder.*turn, lift, elbow, slide"),
        (urdf("small_arm"), ("lift", "lift"), r"repeated.*lift"),
        (
            urdf("small_arm").replace('<link name="forearm">', '<link name="other">'),
            (),
            r"'lift' .* names 'upper_arm'|'elbow' .*names 'forearm', which is no link",
        ),
        (urdf("small_arm").replace('<child link="forearm"/>', '<child link="base"/>'), (), r"elbow, lift, turn.*one tree"),
    ],
)
def test_errors_name_what_is_wrong(text: str, joints: tuple[str, ...], message: str) -> None:
    with pytest.raises(RobotModelError, match=f"(?s){message}"):
        RobotModel.from_urdf(text, joints)


def test_an_unknown_frame_is_answered_with_those_there_are() -> None:
    with pytest.raises(RobotModelError, match=r"no link named 'gripper'.*forearm, hand"):
        robot("small_arm").frame_id("gripper")


def test_messages_of_another_robot() -> None:
    with pytest.raises(RobotModelError, match=r"shoulder_pan.*turn, lift, elbow, slide.*--urdf"):
        RobotModel.for_messages(urdf("small_arm"), ("shoulder_pan",))
    with pytest.raises(RobotModelError, match=r"lack joints lift; they name turn"):
        RobotModel.for_messages(urdf("small_arm"), ("turn",), ("turn", "lift"))


def test_a_robot_of_one_joint_has_a_regressor_of_one_row() -> None:
    body = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    joint = '<joint name="hip" type="revolute"><parent link="base"/><child link="leg"/><limit effort="9" velocity="9"/></joint>'
    model = RobotModel.from_urdf(f'<robot name="one"><link name="base"/><link name="leg">{body}</link>{joint}</robot>')
    state = np.array([[0.3], [0.2], [2.0]])
    assert model.regressor(*state).shape == (1, 10)
    np.testing.assert_allclose(model.regressor(*state) @ model.pi, model.rnea(*state))
