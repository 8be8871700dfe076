"""The collision model: distances and their derivatives, what is compared with what, and where meshes come from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from robots import robot

from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot.collision_model import FLOOR, CollisionModel
from sysid_ros.robot.mesh_files import MeshFiles
from sysid_ros.robot.robot_model import RobotModel

BALL = '<sphere radius="0.05"/>'
LENGTHS = (0.3, 0.4, 0.3)


def chain(shape: str = BALL, lift: float = 0.2) -> str:
    """Three hinges about y, one after the other along x, with a shape in the middle of each link, ``lift`` above the base."""
    inertial = '<inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
    links = f'<link name="base"><collision><origin xyz="-0.2 0 {lift}"/><geometry>{BALL}</geometry></collision></link>'
    joints, parent, x = "", "base", 0.0
    for i, length in enumerate(LENGTHS, start=1):
        collision = f'<collision><origin xyz="{length / 2} 0 0"/><geometry>{shape}</geometry></collision>'
        links += f'<link name="link{i}">{inertial}{collision}</link>'
        height = lift if i == 1 else 0.0
        joints += (
            f'<joint name="joint{i}" type="revolute"><parent link="{parent}"/><child link="link{i}"/><axis xyz="0 1 0"/>'
            f'<origin xyz="{x} 0 {height}"/><limit lower="-3" upper="3" effort="50" velocity="2"/></joint>'
        )
        parent, x = f"link{i}", length
    return f'<robot name="chain">{links}{joints}</robot>'


def centres(q: np.ndarray) -> dict[str, np.ndarray]:
    """Middle of each ball, by hand: x and z."""
    out = {"base": np.array([-0.2, 0.2])}
    origin, angle = np.array([0.0, 0.2]), 0.0
    for i, length in enumerate(LENGTHS):
        angle += q[i]
        along = np.array([np.cos(angle), -np.sin(angle)])
        out[f"link{i + 1}"] = origin + 0.5 * length * along
        origin = origin + length * along
    return out


def test_distances_of_balls_are_those_of_their_centres() -> None:
    model = CollisionModel(RobotModel.from_urdf(chain()), clearance=0.01, floor=-0.5)
    random = np.random.default_rng(0)
    for _ in range(20):
        q = random.uniform(-3.0, 3.0, 3)
        ball = centres(q)
        expected = [
            (ball[a][1] + 0.5 if b == FLOOR else np.linalg.norm(ball[a] - ball[b]) - 0.05) - 0.05 - 0.01 for a, b in model.pairs
        ]
        assert model.room(q) == pytest.approx(expected, abs=1e-6)


def test_neighbours_are_not_compared_and_all_others_are() -> None:
    model = CollisionModel(RobotModel.from_urdf(chain()), floor=-0.5)
    assert {frozenset(p) for p in model.pairs} == {
        frozenset(p)
        for p in (("base", "link2"), ("base", "link3"), ("link1", "link3"), ("link1", FLOOR), ("link2", FLOOR), ("link3", FLOOR))
    }


def test_derivative_of_the_room() -> None:
    model = CollisionModel(RobotModel.from_urdf(chain('<box size="0.2 0.06 0.06"/>')), clearance=0.01, floor=-0.1)
    random, h = np.random.default_rng(1), 1e-4
    errors = []
    for _ in range(30):
        q, direction = random.uniform(-2.0, 2.0, 3), random.normal(size=3)
        difference = (model.room(q + h * direction) - model.room(q - h * direction)) / (2.0 * h)
        model.room(q)
        errors.append(np.abs(model.room_gradient(q, range(len(model.pairs))) @ direction - difference))
    # where the nearest corner changes, the distance has a kink
    assert np.quantile(errors, 0.9) < 0.02
    assert np.median(errors) < 1e-3


@pytest.mark.parametrize("name", ["chain", "iiwa"])
def test_no_pair_comes_nearer_faster_than_stated(name: str) -> None:
    if name == "iiwa":
        path = kuka()
        model = CollisionModel(RobotModel.from_urdf(path.read_text()), MeshFiles(path.parent), floor=0.0)
    else:
        model = CollisionModel(RobotModel.from_urdf(chain()), floor=-0.5)
    random, n = np.random.default_rng(2), model.robot.n
    lower, upper = model.robot.position_lower, model.robot.position_upper
    for _ in range(100):
        q, speed = random.uniform(lower, upper), random.uniform(0.0, 1.0, n)
        dt = random.uniform(0.01, 0.3)
        there = q + dt * speed * random.uniform(-1.0, 1.0, n)
        assert np.all(np.abs(model.room(there) - model.room(q)) <= dt * model.approach_rates(speed) + 1e-5)


APART = 0.5 * LENGTHS[0] + LENGTHS[1] + 0.5 * LENGTHS[2]
"""Between the middles of the first and the last link, stretched out."""


def test_links_that_are_built_together_are_left_out_and_named() -> None:
    for radius, together in ((0.5 * APART - 0.01, False), (0.5 * APART + 0.01, True)):
        model = CollisionModel(RobotModel.from_urdf(chain(f'<sphere radius="{radius}"/>')))
        assert (("link1", "link3") in model.pairs) is not together
        assert any("link1 and link3" in note and "touch" in note for note in model.notes) is together


def test_a_joint_that_can_not_be_at_zero_counts_in_the_middle_of_its_range() -> None:
    text = chain().replace('lower="-3" upper="3"', 'lower="-2.9" upper="-0.3"')
    model = CollisionModel(RobotModel.from_urdf(text), clearance=10.0)
    middle = CollisionModel(RobotModel.from_urdf(text)).room(np.full(3, -1.6))
    assert model.clearance == pytest.approx(0.5 * middle, abs=1e-9)


def test_links_that_are_built_near_each_other_keep_half() -> None:
    model = CollisionModel(RobotModel.from_urdf(chain('<sphere radius="0.25"/>')), clearance=0.15)
    k = model.pairs.index(("link1", "link3"))
    assert model.clearance[k] == pytest.approx(0.5 * (APART - 0.5), abs=1e-6)
    assert any("link1 and link3" in note and "half" in note for note in model.notes)


def test_pairs_can_be_left_out_by_name() -> None:
    arm = RobotModel.from_urdf(chain())
    model = CollisionModel(arm, floor=-0.5, ignored=[("link3", "base"), ("link2", FLOOR)])
    assert not {frozenset(p) for p in model.pairs} & {frozenset(("base", "link3")), frozenset(("link2", FLOOR))}
    with pytest.raises(RobotModelError, match="link9"):
        CollisionModel(arm, ignored=[("link9", "base")])


def test_locked_joints_do_not_move_their_shapes() -> None:
    free = CollisionModel(RobotModel.from_urdf(chain()))
    locked = CollisionModel(RobotModel.from_urdf(chain(), ["joint1", "joint3"]))
    room = dict(zip(locked.pairs, locked.room(np.array([0.4, 1.0])), strict=True))
    expected = dict(zip(free.pairs, free.room(np.array([0.4, 0.0, 1.0])), strict=True))
    assert room[("base", "link3")] == pytest.approx(expected[("base", "link3")], abs=1e-6)


def test_without_shapes_it_says_so_and_keeps_the_joints_above_the_floor() -> None:
    arm = robot("small_arm")
    assert CollisionModel(arm).pairs == ()
    assert any("no collision shapes" in note for note in CollisionModel(arm).notes)
    model = CollisionModel(arm, floor=-0.05)
    straight_down = np.array([0.0, np.pi / 2, 0.0, 0.1])
    assert model.room(straight_down).min() == pytest.approx(0.2 - 0.4 - 0.3 - 0.1 + 0.05, abs=2e-3)
    assert any("between their joints" in note and "forearm" in note for note in model.notes)


def test_meshes_are_found_as_packages_and_their_hull_is_compared(tmp_path: Path) -> None:
    mesh = tmp_path / "arm_description" / "meshes" / "block.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_text(_block(0.1, 0.03, 0.03))
    text = chain('<mesh filename="package://arm_description/meshes/block.stl"/>')
    arm = RobotModel.from_urdf(text)
    lost = CollisionModel(arm, MeshFiles(None))
    assert any("--package-path" in note and "block.stl" in note for note in lost.notes)
    assert not lost.pairs
    boxes = CollisionModel(RobotModel.from_urdf(chain('<box size="0.2 0.06 0.06"/>')))
    q = np.array([0.3, 1.1, 0.9])
    for files in (
        MeshFiles(None, [tmp_path]),
        MeshFiles(tmp_path / "arm_description" / "urdf"),
        MeshFiles(None, [mesh.parents[1]]),
    ):
        found = CollisionModel(arm, files)
        assert found.pairs == boxes.pairs
        assert found.room(q) == pytest.approx(boxes.room(q), abs=1e-5)


def test_a_mesh_that_is_damaged_is_named(tmp_path: Path) -> None:
    (tmp_path / "bad.stl").write_text("not a mesh")
    with pytest.raises(RobotModelError, match="mesh"):
        CollisionModel(RobotModel.from_urdf(chain('<mesh filename="bad.stl"/>')), MeshFiles(tmp_path))


def test_file_addresses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = tmp_path / "share" / "robot_meshes" / "a part.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_text("")
    nothing = MeshFiles(None)
    assert nothing.find(f"file://{str(mesh).replace(' ', '%20')}") == mesh
    assert nothing.find(str(mesh)) == mesh
    assert nothing.find("package://robot_meshes/a part.stl") is None
    assert nothing.find("https://example.org/a.stl") is None
    assert MeshFiles(mesh.parent).find("a part.stl") == mesh
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    assert MeshFiles(None).find("package://robot_meshes/a%20part.stl") == mesh
    monkeypatch.delenv("AMENT_PREFIX_PATH")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "share"))
    assert MeshFiles(None).find("package://robot_meshes/a part.stl") == mesh


def test_an_arm_with_meshes_has_all_its_links() -> None:
    path = kuka()
    model = CollisionModel(RobotModel.from_urdf(path.read_text()), MeshFiles(path.parent), 0.02, floor=0.0)
    links = {name for pair in model.pairs for name in pair}
    assert links == {f"lbr_iiwa_link_{i}" for i in range(8)} | {FLOOR}
    assert model.room(np.zeros(7)).min() > 0.0
    folded = np.array([0.0, 0.0, 0.0, 2.9, 0.0, 0.0, 0.0])
    assert model.room(folded).min() < 0.0
    down = np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    floor = [k for k, pair in enumerate(model.pairs) if FLOOR in pair]
    assert model.room(down)[floor].min() < 0.0


def kuka() -> Path:
    data = pytest.importorskip("pybullet_data", reason="PyBullet, which brings the arm, is not installed")
    return Path(data.getDataPath()) / "kuka_iiwa" / "model.urdf"


def _block(x: float, y: float, z: float) -> str:
    """A box of half edges x, y, z as an STL."""
    corners = [np.array([i, j, k]) * (x, y, z) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    lines = ["solid block"]
    for a, b, c, d in faces:
        for triangle in ((a, b, c), (a, c, d)):
            vertices = "".join("vertex {} {} {}\n".format(*corners[i]) for i in triangle)
            lines.append(f"facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet")
    return "\n".join([*lines, "endsolid block"]) + "\n"
