"""The robot of a page: joints stand where RobotModel says, shapes stay near the given ones, what is carried has its size."""

from __future__ import annotations

from base64 import b64decode
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from robots import random_body, robot, urdf
from test_pages import arm, diagnosis

from sysid_ros.pages.diagnosis_view import diagnosis_view
from sysid_ros.pages.payload_view import trunk_orientation
from sysid_ros.pages.robot_view import RATE, Track, ellipsoid, percentages, scene, thinned, view
from sysid_ros.robot.appearance import appearance, files_of, in_joint
from sysid_ros.robot.inertial_parameters import from_com
from sysid_ros.robot.mesh_reduction import along, box, capsule, cone, cylinder, reduced
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.rotation import quaternion, rotation_of
from sysid_ros.sample import FloatArray, ImuRecord, Measurement
from sysid_ros.signals.postures import PostureLog, Postures

Mesh = tuple[FloatArray, Any]


def columns(of: dict[str, Any], text: str) -> FloatArray:
    """Numbers of a scene as the page reads them."""
    raw = np.frombuffer(b64decode(text), "<u2").reshape(-1, len(of["low"]))
    return np.asarray(np.array(of["low"]) + np.array(of["step"]) * raw)


def placed(joints: list[dict[str, Any]], q: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Rotation and origin of each joint's frame in the base, from what a scene says of the joints."""
    out: list[tuple[FloatArray, FloatArray]] = []
    for joint, value in zip(joints, q, strict=True):
        rotation, origin = out[joint["parent"]] if joint["parent"] >= 0 else (np.eye(3), np.zeros(3))
        axis = np.array(joint["axis"])
        origin = origin + rotation @ np.array(joint["origin"])
        rotation = rotation @ np.array(joint["rotation"]).reshape(3, 3)
        if joint["slides"]:
            origin = origin + rotation @ axis * value
        else:
            cross = np.cross(np.eye(3), axis)
            rotation = rotation @ (np.eye(3) + np.sin(value) * cross + (1.0 - np.cos(value)) * cross @ cross)
        out.append((rotation, origin))
    return out


@pytest.mark.parametrize("name", ["small_arm", "tree_robot"])
def test_the_joints_of_a_page_stand_where_the_model_says(name: str) -> None:
    model = robot(name)
    rng = np.random.default_rng(0)
    t, q = np.arange(20) / RATE, rng.uniform(-2.0, 2.0, (20, model.n))
    seen = view(model, None, [Track("", t, q)])
    assert seen is not None
    said = scene(seen)
    (track,) = said["tracks"]
    np.testing.assert_allclose(np.frombuffer(b64decode(track["t"]), "<f4"), t, atol=1e-6)
    kept = columns(track, track["q"])
    np.testing.assert_allclose(kept, q, atol=4.0 / 65535)
    for k in (0, 7, 19):
        for (rotation, origin), body in zip(placed(said["joints"], kept[k]), model.body_names, strict=True):
            true_rotation, true_origin = model.frame_placement(q[k], body)
            np.testing.assert_allclose(rotation, true_rotation, atol=3e-4)
            np.testing.assert_allclose(origin, true_origin, atol=3e-4)


@pytest.mark.parametrize("name", ["small_arm", "tree_robot"])
def test_every_link_is_seen_without_meshes(name: str) -> None:
    looks = appearance(robot(name))
    assert {shape.joint for shape in looks.shapes} >= set(range(robot(name).n))
    assert looks.source == "lines"
    for shape in looks.shapes:
        assert shape.vertices.shape[1] == shape.triangles.shape[1] == 3
        assert 0 <= shape.triangles.min() <= shape.triangles.max() < len(shape.vertices) < 65536


def test_shapes_of_the_urdf_stand_where_it_says(tmp_path: Path) -> None:
    looks = appearance(arm())
    assert looks.source == "shapes"
    first = np.concatenate([s.vertices for s in looks.shapes if s.joint == 0])
    np.testing.assert_allclose([first.min(axis=0), first.max(axis=0)], [[-0.05, -0.05, 0.0], [0.05, 0.05, 0.4]], atol=1e-12)
    # a mesh beside the URDF, in millimetres and dark blue
    corners = [(x, y, z) for x in (0, 300) for y in (0, 20) for z in (0, 20)]
    faces = [
        (1, 2, 4),
        (1, 4, 3),
        (5, 8, 6),
        (5, 7, 8),
        (1, 5, 6),
        (1, 6, 2),
        (3, 4, 8),
        (3, 8, 7),
        (1, 3, 7),
        (1, 7, 5),
        (2, 6, 8),
        (2, 8, 4),
    ]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    (tmp_path / "arm.obj").write_text("\n".join(lines) + "\n")
    mesh = '<geometry><mesh filename="arm.obj" scale="0.001 0.001 0.001"/></geometry>'
    shape = f'<visual>{mesh}<material name="m"><color rgba="0 0 0.5 1"/></material></visual>'
    text = urdf("small_arm").replace('<link name="forearm">', f'<link name="forearm">{shape}')
    with_mesh = appearance(RobotModel.from_urdf(text), files_of(tmp_path / "arm.urdf"))
    (blue,) = (s for s in with_mesh.shapes if s.colour == "#000080")
    assert blue.joint == 2
    np.testing.assert_allclose(
        [blue.vertices.min(axis=0), blue.vertices.max(axis=0)], np.array([[0.0, 0.0, 0.0], [0.3, 0.02, 0.02]]), atol=1e-6
    )
    # the same one without its file is a line
    assert all(
        s.colour != "#000080" for s in appearance(RobotModel.from_urdf(text), files_of(tmp_path / "no" / "arm.urdf")).shapes
    )


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh[0][mesh[1][:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(
    ("mesh", "size"),
    [
        (box(np.array([1.0, 2.0, 3.0])), 6.0),
        (cylinder(0.5, 2.0), np.pi / 2.0),
        (capsule(0.5, 1.0), np.pi * 0.25 + np.pi / 6.0),
        (cone(0.5, 3.0), np.pi / 4.0),
        (along(np.zeros(3), np.array([1.0, 2.0, 2.0]), 0.5), np.pi * 0.25 * 3.0 + np.pi / 6.0),
    ],
)
def test_primitives_are_closed_and_have_their_volume(mesh: Mesh, size: float) -> None:
    assert volume(mesh) == pytest.approx(size, rel=0.05)


def test_fewer_vertices_stay_near_the_given_ones() -> None:
    vertices, triangles = capsule(0.3, 1.0)
    few, left = reduced((vertices, triangles), 0.1, 10_000)
    assert len(few) < 0.8 * len(vertices)
    assert len(left) < len(triangles)
    apart = np.linalg.norm(few[:, None] - vertices[None], axis=2)
    assert apart.min(axis=1).max() <= 0.1 * np.sqrt(3.0)
    assert apart.min(axis=0).max() <= 0.1 * np.sqrt(3.0)
    assert volume((few, left)) == pytest.approx(volume((vertices, triangles)), rel=0.15)
    fewer, _ = reduced((vertices, triangles), 0.01, 60)
    assert len(fewer) <= 60
    assert reduced((np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)), 0.1, 10)[0].shape == (0, 3)


def test_an_ellipsoid_has_the_inertia_that_it_was_made_of() -> None:
    model, rng = robot("small_arm"), np.random.default_rng(1)
    mass, com, inertia = random_body(rng)
    found = ellipsoid(model, "hand", mass, com, "", inertia, np.array([0.01, 0.02, 0.0]))
    squares = found.axes**2
    again = found.rotation @ np.diag(mass / 5.0 * (squares.sum() - squares)) @ found.rotation.T
    joint, rotation, translation = in_joint(model, "hand")
    np.testing.assert_allclose(rotation.T @ again @ rotation, inertia, rtol=1e-9)
    np.testing.assert_allclose(found.position, rotation @ com + translation)
    assert (found.joint, found.outline is not None and np.allclose(found.outline - found.axes, 1.96 * 0.02)) == (joint, True)
    # no inertia, or no body's: the ball of water
    for tensor in (None, np.diag([1.0, 1.0, 3.0])):
        ball = ellipsoid(model, "hand", 2.0, com, "", tensor)
        np.testing.assert_allclose(1e3 * 4.0 / 3.0 * np.pi * ball.axes**3, 2.0)
    assert from_com(mass, com, inertia).shape == (10,)


def test_a_long_motion_is_thinned_to_a_film_that_keeps_its_ends() -> None:
    t = np.concatenate([np.arange(0.0, 4.0, 0.001), [3.9], np.arange(9.0, 10.0, 0.001)])
    kept = thinned(Track("", t, np.column_stack([t, -t])))
    assert kept.t[0] == 0.0
    assert kept.t[-1] == t[-1]
    assert np.all(np.diff(kept.t) > 0.0)
    assert len(kept.t) == pytest.approx(5.0 * RATE, abs=3)
    np.testing.assert_array_equal(kept.q[:, 0], kept.t)
    assert len(thinned(Track("", np.arange(0.0, 1e4, 0.02), np.zeros((500_000, 1)))).t) <= 6000


def test_where_there_is_no_robot_or_no_motion_there_is_no_view() -> None:
    assert view(None, None, [Track("", np.arange(9.0), np.zeros((9, 4)))]) is None
    assert view(robot("small_arm"), None, [Track("", np.zeros(1), np.zeros((1, 4)))]) is None


def test_what_was_found_is_drawn_where_it_is() -> None:
    seen = diagnosis_view(arm(), None, diagnosis())
    assert seen is not None
    assert [ring.joints for ring in seen.rings] == [(0, 1, 2)]
    (body,) = seen.ellipsoids
    assert body.joint == 2
    np.testing.assert_allclose(body.position, [0.1, 0.2, 0.3])
    np.testing.assert_allclose([c.values for c in seen.colourings], np.outer([4.0, 2.0], np.ones(3)))
    assert len({c.most for c in seen.colourings}) == 1
    assert diagnosis_view(arm(), None, replace(diagnosis(), predictions=None)) is None


def test_colours_of_the_page_begin_and_end_with_the_scale() -> None:
    seen = view(arm(), None, [Track("", np.arange(2.0), np.zeros((2, 3)))], colourings=(percentages("x", [0.0, 0.5, np.nan]),))
    assert seen is not None
    assert (seen.colour(0.0, 2.0), seen.colour(2.0, 2.0), seen.colour(9.0, 2.0)) == (*seen.colours[:1], *seen.colours[-1:] * 2)
    assert seen.colourings[0].texts == ("0 %", "50 %", "–")
    assert scene(seen)["colourings"][0]["values"] == [0.0, 0.5, None]


def test_the_trunk_turns_as_the_imu_says() -> None:
    text = urdf("small_arm").replace('<link name="base"/>', '<link name="base"/><link name="imu"/>')
    text = text.replace(
        "</robot>", '<joint name="m" type="fixed"><parent link="base"/><child link="imu"/><origin rpy="0 0 1.5"/></joint></robot>'
    )
    model = RobotModel.from_urdf(text)
    turns = [rotation_of([0.1 * k, -0.2, 0.3 * k]) for k in range(3)]
    mounted = rotation_of([0.0, 0.0, 1.5])
    said = np.array([quaternion(turn @ mounted) for turn in turns])
    found = trunk_orientation(model, Postures(np.arange(3.0), np.zeros((3, 4)), said, "imu"))
    assert found is not None
    for turn, x in zip(turns, found, strict=True):
        assert abs(float(np.dot(x, quaternion(turn)))) == pytest.approx(1.0)
    assert trunk_orientation(model, Postures(np.arange(3.0), np.zeros((3, 4)), said, "hand")) is None
    assert trunk_orientation(model, Postures(np.arange(3.0), np.zeros((3, 4)), said, "elsewhere")) is None
    assert trunk_orientation(model, Postures(np.arange(3.0), np.zeros((3, 4)))) is None


def test_a_log_keeps_a_posture_every_twenty_fifth_of_a_second() -> None:
    log = PostureLog()
    assert log.postures() is None
    log.turn(ImuRecord(0.0, 0.0, "imu", (0.0, 0.0, 0.0, 1.0), np.zeros(3), np.zeros(3)))
    for k in range(500):
        log.add(Measurement(0.002 * k, np.full(2, float(k)), None, np.zeros(2)))
    kept = log.postures()
    assert kept is not None
    np.testing.assert_allclose(np.diff(kept.t), 1.0 / RATE, atol=0.0021)
    assert kept.orientation is not None
    assert (kept.orientation.shape, kept.imu_frame) == ((len(kept.t), 4), "imu")
    # an IMU that tells no orientation says so by zeros
    log.turn(ImuRecord(1.0, 1.0, "imu", (0.0, 0.0, 0.0, 0.0), np.zeros(3), np.zeros(3)))
    log.add(Measurement(2.0, np.zeros(2), None, np.zeros(2)))
    without = log.postures()
    assert without is not None
    assert without.orientation is None
