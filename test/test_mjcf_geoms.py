"""The geoms of a robot described for MuJoCo: drawn where MuJoCo has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_robot_view import placed

from sysid_ros.pages.robot_view import Track, scene, view
from sysid_ros.robot.appearance import Appearance, Shape, appearance
from sysid_ros.robot.mjcf import is_mjcf
from sysid_ros.robot.mjcf_geoms import mjcf_geoms
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.sources import urdf_text

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")

ARM = """<mujoco model="two">
  <compiler angle="degree"/>
  <asset>
    <material name="steel" rgba="0.2 0.4 0.6 1"/>
    <mesh name="wedge" file="wedge.obj" scale="0.001 0.001 0.001"/>
  </asset>
  <worldbody>
    <geom type="plane" size="5 5 0.1"/>
    <body name="stand" pos="0.1 0.2 0.3" euler="10 20 30">
      <geom name="foot" type="box" size="0.1 0.2 0.05" pos="0 0 0.02" euler="0 0 40" rgba="1 0 0 1"/>
      <body name="upper" pos="0 0 0.1" euler="0 90 5">
        <joint name="shoulder" axis="0 0.6 0.8" pos="0.02 0.01 -0.03" ref="20"/>
        <joint name="twist" axis="1 0 0" pos="0 0.05 0"/>
        <geom name="bar" type="capsule" size="0.03 0.2" pos="0.01 0 0.05" euler="5 6 7" material="steel"/>
        <geom name="can" type="cylinder" size="0.04 0.1" pos="0.1 0 0.05" euler="50 6 7" rgba="0 1 0 1"/>
        <geom name="hull" type="box" size="0.3 0.3 0.3" group="3"/>
        <geom name="ghost" type="sphere" size="0.7" rgba="1 1 1 0"/>
        <body pos="0 0.1 0.4" quat="0.9 0.1 0.3 0.2">
          <joint name="slide" type="slide" axis="0 0.2 1" pos="0.3 0 0"/>
          <geom name="egg" type="ellipsoid" size="0.1 0.05 0.2" pos="0.02 0 0" euler="30 0 60" rgba="0 0 1 1"/>
          <geom name="ball" type="sphere" size="0.06" pos="0 0 0.3" rgba="1 1 0 1"/>
          <geom name="wedge" type="mesh" mesh="wedge" pos="0.2 0 0.1" euler="70 20 10" rgba="0 1 1 1"/>
          <body name="tip" pos="0 0 0.2"><geom name="cap" type="box" size="0.1 0.1 0.02" group="4" rgba="1 0 1 1"/></body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""
COLOURS = {
    "foot": "#FF0000", "bar": "#336699", "can": "#00FF00", "egg": "#0000FF", "ball": "#FFFF00", "wedge": "#00FFFF",
    "cap": "#FF00FF",
}  # fmt: skip
CORNERS = np.array([[x, y, z] for x in (0.0, 300.0) for y in (0.0, 40.0) for z in (0.0, 90.0)][:-1])
"""A box without one of its corners, in millimetres and away from its centre."""
FACES = ((1, 2, 4), (1, 4, 3), (1, 5, 6), (1, 6, 2), (1, 3, 7), (1, 7, 5), (2, 6, 4), (3, 4, 7), (4, 6, 7), (5, 7, 6))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS] + [f"f {a} {b} {c}" for a, b, c in FACES]
    (tmp_path / "wedge.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "two.xml").write_text(ARM)
    return tmp_path / "two.xml"


def inside(kind: str, points: FloatArray, size: FloatArray) -> FloatArray:
    """Below 0: points in a geom's own frame are inside it; 0: on its surface."""
    if kind == "box":
        return np.asarray((np.abs(points) - size).max(axis=1))
    if kind == "ellipsoid":
        return np.asarray(np.linalg.norm(points / size, axis=1) - 1.0)
    aside, along = np.linalg.norm(points[:, :2], axis=1), np.abs(points[:, 2])
    if kind == "cylinder":
        return np.asarray(np.maximum(aside / size[0], along / size[1]) - 1.0)
    half = size[1] if kind == "capsule" else 0.0
    return np.asarray(np.hypot(aside, np.maximum(along - half, 0.0)) / size[0] - 1.0)


def by_name(looks: Appearance) -> dict[str, Shape]:
    """The drawn geoms; what has no colour of theirs is the line between two joints of one body."""
    names = {colour: name for name, colour in COLOURS.items()}
    return {names[shape.colour]: shape for shape in looks.shapes if shape.colour in names}


def test_geoms_stand_where_mujoco_has_them(path: Path) -> None:
    """In a posture, no point of a drawn shape is outside MuJoCo's geom, and they reach its ends; what it hides is not drawn."""
    model = RobotModel.from_urdf(urdf_text(path))
    looks = appearance(model, None, mjcf_geoms(path))
    assert looks.source == "shapes"
    shapes = by_name(looks)
    assert set(shapes) == set(COLOURS)
    q = np.array([0.7, -0.4, 0.15])
    seen = view(model, path, [Track("", np.arange(2.0), np.array([q, q]))])
    assert seen is not None
    frames = placed(scene(seen)["joints"], q)
    theirs = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(theirs)
    data.qpos[:] = q
    mujoco.mj_kinematics(theirs, data)
    for name, shape in shapes.items():
        rotation, origin = frames[shape.joint] if shape.joint >= 0 else (np.eye(3), np.zeros(3))
        geom, place = theirs.geom(name), data.geom(name)
        points = (shape.vertices @ rotation.T + origin - place.xpos) @ place.xmat.reshape(3, 3)
        if name != "wedge":
            kind = {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box"}[int(geom.type[0])]
            assert inside(kind, points, geom.size).max() < 1e-4
            reach = np.abs(points).max(axis=0)
            full = {"sphere": [geom.size[0]] * 3, "capsule": [*geom.size[[0, 0]], geom.size[:2].sum()]}
            full |= {"cylinder": geom.size[[0, 0, 1]], "box": geom.size, "ellipsoid": geom.size}
            np.testing.assert_allclose(reach, full[kind], rtol=0.02)


def test_a_mesh_stands_where_its_file_says(path: Path) -> None:
    """MuJoCo turns meshes into their principal axes; drawn they are as in their file."""
    (wedge,) = (geom for geom in mjcf_geoms(path) if geom.is_mesh)
    theirs = mujoco.MjModel.from_xml_path(str(path))
    spec = mujoco.MjSpec.from_file(str(path))
    stated = spec.geom("wedge")
    frame = np.zeros(9)
    mujoco.mju_quat2Mat(frame, mujoco.MjSpec.from_string(TURNED).compile().geom("turned").quat)
    true = 0.001 * CORNERS @ frame.reshape(3, 3).T + np.array(stated.pos) - theirs.joint("slide").pos
    found, _ = wedge.mesh
    assert len(found) == len(true)
    for corner in true:
        assert np.linalg.norm(found - corner, axis=1).min() < 1e-6


TURNED = """<mujoco><compiler angle="degree"/>
  <worldbody><geom name="turned" type="box" size="1 1 1" euler="70 20 10"/></worldbody></mujoco>"""


def test_files_without_geoms_have_none(path: Path, tmp_path: Path) -> None:
    assert not mjcf_geoms(None)
    assert not mjcf_geoms(tmp_path / "no.xml")
    (tmp_path / "arm.urdf").write_text(urdf_text(path))
    assert not mjcf_geoms(tmp_path / "arm.urdf")
    (tmp_path / "wedge.obj").unlink()
    assert not mjcf_geoms(path)


@pytest.mark.parametrize(
    ("text", "is_one"),
    [
        ("<mujoco/>", True),
        ("<?xml version='1.0'?>\n<!-- <robot> -->\n<mujoco model='a'>", True),
        ("<robot name='a'><mujoco><compiler discardvisual='false'/></mujoco></robot>", False),
        ("<!-- made from <mujoco> -->\n<robot name='a'/>", False),
        ("mass,torque", False),
    ],
)
def test_the_first_element_tells(text: str, is_one: bool) -> None:
    assert is_mjcf(text) == is_one
