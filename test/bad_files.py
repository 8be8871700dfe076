"""Bad input of every kind, small: a robot of two joints, its recordings, models and mappings, each with one thing wrong."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sysid_ros.effects import CoulombFriction, LinkInertia, ViscousFriction
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.sources import BagRecorder
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.model_file import EffectBlock, ModelFile, urdf_digest

URDF = """<robot name="two"><link name="base"/><link name="one"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link><link name="two"><inertial>
<origin xyz="0 0 0.1"/><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.005"/></inertial></link>
<joint name="a" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50"
velocity="3"/></joint><joint name="b" type="revolute"><origin xyz="0 0 0.4"/><parent link="one"/><child link="two"/><axis
xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="3"/></joint></robot>"""
MJCF = """<mujoco model="two"><worldbody><body name="one"><joint name="a" axis="0 1 0"/><inertial pos="0 0 0.2" mass="2"
diaginertia="0.02 0.02 0.01"/><body name="two" pos="0 0 0.4"><joint name="b" axis="0 1 0"/><inertial pos="0 0 0.1" mass="1"
diaginertia="0.01 0.01 0.005"/></body></body></worldbody></mujoco>"""
NAMES = ("time", "position_a", "position_b", "velocity_a", "velocity_b", "effort_a", "effort_b")
JOINTS = ("a", "b")

Change = Callable[[FloatArray], FloatArray]
Content = str | bytes | list[JointStateRecord] | None
"""Of a file, or the messages of a bag; None where there is nothing."""


@cache
def table(seconds: float = 12.0, rate: float = 100.0) -> FloatArray:
    """Columns of :data:`NAMES`, shape (N, 7): sums of sines, exact torques, some friction and noise."""
    robot, rng = RobotModel.from_urdf(URDF), np.random.default_rng(0)
    t = np.arange(round(seconds * rate)) / rate
    w = 2.0 * np.pi * np.array([[0.23, 0.31], [0.61, 0.47], [0.9, 1.1]])
    phase = w * t[:, None, None] + np.array([[0.3, 1.0], [2.0, 0.1], [0.7, 2.2]])
    q = np.sum(0.35 * np.sin(phase), axis=1)
    v = np.sum(0.35 * w * np.cos(phase), axis=1)
    a = np.sum(-0.35 * w**2 * np.sin(phase), axis=1)
    tau = robot.rnea_along(q, v, a) + 0.4 * np.tanh(v / 0.02) + 0.3 * v + 0.03 * rng.normal(size=q.shape)
    return np.column_stack([100.0 + t, q, v, tau])


def with_columns(change: Change, *names: str) -> FloatArray:
    """The table with some columns changed, shape (N, 7)."""
    values = table().copy()
    at = [NAMES.index(name) for name in names]
    values[:, at] = change(values[:, at])
    return values


def csv(values: FloatArray, names: Sequence[str] = NAMES, mark: str = ",") -> str:
    return "\n".join([mark.join(names), *(mark.join(map(repr, row)) for row in values.tolist())]) + "\n"


def records(values: FloatArray) -> list[JointStateRecord]:
    return [JointStateRecord(row[0], 100.0 + 0.01 * k, JOINTS, row[1:3], row[3:5], row[5:7]) for k, row in enumerate(values)]


def bag(path: Path, messages: Sequence[JointStateRecord], storage: str = "mcap") -> Path:
    with BagRecorder(path, storage) as recorder:
        recorder.write_joint_states(messages)
    return path


@cache
def model_text() -> str:
    """A model.yaml of the robot."""
    robot = RobotModel.from_urdf(URDF)
    known = [
        KnownEffect(LinkInertia(robot), robot.pi),
        KnownEffect(ViscousFriction(robot), np.full(2, 0.3)),
        KnownEffect(CoulombFriction(robot), np.full(2, 0.4)),
    ]
    blocks = [
        EffectBlock(
            *(k.effect.id, robot.joint_names, k.effect.settings, k.theta, k.effect.parameter_names, k.effect.units),
            1e-4 * np.eye(k.theta.size),
        )
        for k in known
    ]
    file = ModelFile("two", JOINTS, urdf_digest(URDF), tuple(blocks), np.full(2, 0.03), np.full(2, 0.02))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.yaml"
        file.write(path)
        return path.read_text()


def model_with(change: Callable[[dict[str, Any]], object]) -> str:
    document = yaml.safe_load(model_text())
    change(document)
    return yaml.safe_dump(document)


def npz(**arrays: Any) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def good_npz() -> bytes:
    x = table()
    return npz(t=x[:, 0], q=x[:, 1:3], v=x[:, 3:5], tau=x[:, 5:7], joint_names=np.array(JOINTS))


def parquet() -> bytes:
    import pyarrow
    from pyarrow import parquet as format

    file = io.BytesIO()
    format.write_table(pyarrow.table(dict(zip(NAMES, table().T, strict=True))), file)
    return file.getvalue()


LOGS: dict[str, tuple[str, Callable[[], Content]]] = {
    "not there": ("x.mcap", lambda: None),
    "bag of one message": ("x", lambda: records(table()[:1])),
    "bag of two messages": ("x", lambda: records(table()[:2])),
    "bag of two seconds": ("x", lambda: records(table()[:200])),
    "efforts all zero": ("x", lambda: records(with_columns(np.zeros_like, "effort_a", "effort_b"))),
    "efforts no numbers": ("x", lambda: records(with_columns(lambda x: x * np.nan, "effort_a", "effort_b"))),
    "effort of one joint no number": ("x", lambda: records(with_columns(lambda x: x * np.nan, "effort_b"))),
    "no efforts": ("x", lambda: [replace(r, effort=()) for r in records(table())]),
    "no positions": ("x", lambda: [replace(r, position=()) for r in records(table())]),
    "degrees": ("x", lambda: records(with_columns(np.rad2deg, *NAMES[1:5]))),
    "times that run backwards": ("x", lambda: records(with_columns(lambda x: x[::-1], "time"))),
    "times that stand still": ("x", lambda: records(with_columns(lambda x: 0.0 * x + 100.0, "time"))),
    "stamps of zero": ("x", lambda: records(with_columns(np.zeros_like, "time"))),
    "at rest": ("x", lambda: records(with_columns(lambda x: 0.0 * x + 0.1, *NAMES[1:7]))),
    "other robot's joints": ("x", lambda: [replace(r, names=("left", "right")) for r in records(table())]),
    "joint twice": ("x", lambda: [replace(r, names=("a", "a")) for r in records(table())]),
    "infinite efforts": ("x", lambda: records(with_columns(lambda x: np.full_like(x, np.inf), "effort_a"))),
    "huge positions": ("x", lambda: records(with_columns(lambda x: 1e9 * x, "position_a"))),
    "empty mcap": ("x.mcap", lambda: b""),
    "empty db3": ("x.db3", lambda: b""),
    "text as mcap": ("x.mcap", lambda: "hello\n" * 99),
    "text as db3": ("x.db3", lambda: "hello\n" * 99),
    "ROS 1 bag": ("x.bag", lambda: b"#ROSBAG V2.0\n"),
    "unknown suffix": ("x.xlsx", lambda: b"PK"),
    "no suffix": ("x.", lambda: b"PK"),
    "csv empty": ("x.csv", lambda: ""),
    "csv header only": ("x.csv", lambda: ",".join(NAMES) + "\n"),
    "csv one row": ("x.csv", lambda: csv(table()[:1])),
    "csv two rows": ("x.csv", lambda: csv(table()[:2])),
    "csv without time": ("x.csv", lambda: csv(table()[:, 1:], NAMES[1:])),
    "csv without effort": ("x.csv", lambda: csv(table()[:, :5], NAMES[:5])),
    "csv text in a number": ("x.csv", lambda: csv(table()).replace("100.05,", "100.05x,")),
    "csv decimal commas and commas": ("x.csv", lambda: csv(table()).replace(".", ",")),
    "csv semicolons in the head only": ("x.csv", lambda: csv(table()).replace(",", ";", 6)),
    "csv without header": ("x.csv", lambda: csv(table()).split("\n", 1)[1]),
    "csv same name twice": ("x.csv", lambda: csv(table(), (*NAMES[:5], "effort_a", "effort_a"))),
    "csv all NaN": ("x.csv", lambda: csv(table() * np.nan)),
    "csv NaN efforts": ("x.csv", lambda: csv(with_columns(lambda x: x * np.nan, "effort_a", "effort_b"))),
    "csv NaN times": ("x.csv", lambda: csv(with_columns(lambda x: x * np.nan, "time"))),
    "csv ragged": ("x.csv", lambda: csv(table()) + "1,2,3\n"),
    "csv binary": ("x.csv", lambda: bytes(range(256)) * 20),
    "csv utf-16": ("x.csv", lambda: csv(table()).encode("utf-16")),
    "csv times in ns without a unit": ("x.csv", lambda: csv(with_columns(lambda x: 1e9 * x, "time"))),
    "csv times in ms without a unit": ("x.csv", lambda: csv(with_columns(lambda x: 1e3 * x, "time"))),
    "npz broken": ("x.npz", lambda: good_npz()[:900]),
    "npz text": ("x.npz", lambda: "hello"),
    "npz empty": ("x.npz", lambda: b""),
    "npz of objects": ("x.npz", lambda: npz(t=np.array([{}], dtype=object), q=np.zeros((1, 2)), tau=np.zeros((1, 2)))),
    "npz of words": ("x.npz", lambda: npz(t=np.array(["a", "b"]), q=np.zeros((2, 2)), tau=np.zeros((2, 2)))),
    "npz without effort": ("x.npz", lambda: npz(t=np.arange(9.0), q=np.zeros((9, 2)))),
    "npz of other shapes": ("x.npz", lambda: npz(t=np.arange(9.0), q=np.zeros((8, 2)), tau=np.zeros((9, 2)))),
    "npz of one dimension": ("x.npz", lambda: npz(t=np.arange(9.0), q=np.zeros(9), tau=np.zeros(9))),
    "npz of a number": ("x.npz", lambda: npz(t=np.float64(1.0), q=np.zeros((1, 2)), tau=np.zeros((1, 2)))),
    "npz of nothing": ("x.npz", lambda: npz(t=np.zeros(0), q=np.zeros((0, 2)), tau=np.zeros((0, 2)))),
    "npz complex": ("x.npz", lambda: npz(t=np.arange(9.0), q=1j * np.ones((9, 2)), tau=np.zeros((9, 2)))),
    "npz three joints": ("x.npz", lambda: npz(t=0.01 * np.arange(9.0), q=np.zeros((9, 3)), tau=np.zeros((9, 3)))),
    "npz a name too few": ("x.npz", lambda: npz(t=np.arange(9.0), q=np.zeros((9, 2)), tau=np.zeros((9, 2)), joint_names=["a"])),
    "parquet broken": ("x.parquet", lambda: parquet()[:500]),
    "parquet text": ("x.parquet", lambda: "hello"),
}
"""Recordings that tell nothing, by what is wrong with them."""

ROBOTS: dict[str, tuple[str, str | bytes | None]] = {
    "not there": ("r.urdf", None),
    "empty": ("r.urdf", ""),
    "no XML": ("r.urdf", "hello"),
    "cut": ("r.urdf", URDF[: len(URDF) // 2]),
    "binary": ("r.urdf", bytes(range(256))),
    "another root": ("r.urdf", "<sdf version='1.6'/>"),
    "no joints": ("r.urdf", '<robot name="x"><link name="base"/></robot>'),
    "no movable joint": ("r.urdf", URDF.replace('"revolute"', '"fixed"')),
    "unknown joint type": ("r.urdf", URDF.replace('"revolute"', '"hinge"', 1)),
    "joint without a type": ("r.urdf", URDF.replace(' type="revolute"', "", 1)),
    "joint without a name": ("r.urdf", URDF.replace('<joint name="a"', "<joint")),
    "joint without a child": ("r.urdf", URDF.replace('<child link="two"/>', "")),
    "joint to a link that is not there": ("r.urdf", URDF.replace('<child link="two"/>', '<child link="three"/>')),
    "two roots": ("r.urdf", URDF.replace("</robot>", '<link name="other"/></robot>')),
    "circle": ("r.urdf", URDF.replace('<parent link="base"/>', '<parent link="two"/>')),
    "joint twice": ("r.urdf", URDF.replace('name="b"', 'name="a"')),
    "link twice": ("r.urdf", URDF.replace('<link name="two">', '<link name="one">')),
    "no inertial": ("r.urdf", URDF.replace("<inertial>", "<!--").replace("</inertial>", "-->")),
    "negative mass": ("r.urdf", URDF.replace('mass value="2"', 'mass value="-2"')),
    "mass of no number": ("r.urdf", URDF.replace('mass value="2"', 'mass value="two"')),
    "mass NaN": ("r.urdf", URDF.replace('mass value="2"', 'mass value="nan"')),
    "inertia incomplete": ("r.urdf", URDF.replace('ixx="0.02"', "")),
    "axis of no length": ("r.urdf", URDF.replace('axis xyz="0 1 0"', 'axis xyz="0 0 0"')),
    "axis of two numbers": ("r.urdf", URDF.replace('axis xyz="0 1 0"', 'axis xyz="0 1"')),
    "origin of words": ("r.urdf", URDF.replace('origin xyz="0 0 0.4"', 'origin xyz="here"')),
    "limit of words": ("r.urdf", URDF.replace('lower="-2"', 'lower="low"')),
    "xacro": ("r.urdf.xacro", '<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>'),
    "xacro by the name of a URDF": ("r.urdf", '<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>'),
    "folder": ("r.urdf/x", ""),
    "MJCF cut": ("r.xml", MJCF[: len(MJCF) // 2]),
    "MJCF with an unknown word": ("r.xml", MJCF.replace("<body", "<corpse", 1)),
    "MJCF without a mass": ("r.xml", MJCF.replace('mass="1"', 'mass="0"')),
    "MJCF with a ball": ("r.xml", MJCF.replace('<joint name="a"', '<joint type="ball" name="a"')),
    "MJCF without joints": ("r.xml", "<mujoco><worldbody><body><geom size='1'/></body></worldbody></mujoco>"),
    "MJCF with a mesh that is not there": (
        "r.xml",
        MJCF.replace("<worldbody>", '<asset><mesh name="m" file="no.stl"/></asset><worldbody>'),
    ),
    "MJCF that includes what is not there": ("r.xml", MJCF.replace("<worldbody>", '<include file="no.xml"/><worldbody>')),
}
"""Descriptions that no robot can be made of."""

MODELS: dict[str, Callable[[], str | bytes | None]] = {
    "not there": lambda: None,
    "empty": lambda: "",
    "no YAML": lambda: "format: [1",
    "a list": lambda: "- 1\n- 2\n",
    "binary": lambda: bytes(range(256)),
    "another version": lambda: model_with(lambda d: d.update(format=2)),
    "no version": lambda: model_with(lambda d: d.pop("format")),
    "another robot's joints": lambda: model_with(lambda d: d["robot"].update(joints=["left", "right"])),
    "no robot": lambda: model_with(lambda d: d.pop("robot")),
    "robot a word": lambda: model_with(lambda d: d.update(robot="two")),
    "no joints": lambda: model_with(lambda d: d["robot"].pop("joints")),
    "no effects": lambda: model_with(lambda d: d.pop("effects")),
    "effects a word": lambda: model_with(lambda d: d.update(effects="friction")),
    "unknown effect": lambda: model_with(lambda d: d["effects"][1].update(effect="magnetism")),
    "effect without theta": lambda: model_with(lambda d: d["effects"][1].pop("theta")),
    "theta NaN": lambda: model_with(lambda d: d["effects"][1].update(theta=[float("nan"), 1.0])),
    "theta of words": lambda: model_with(lambda d: d["effects"][1].update(theta=["much", "more"])),
    "theta too short": lambda: model_with(lambda d: d["effects"][1].update(theta=[0.1])),
    "covariance of another shape": lambda: model_with(lambda d: d["effects"][1].update(covariance=[[1.0]])),
    "covariance negative": lambda: model_with(lambda d: d["effects"][1].update(covariance=[[-1.0, 0.0], [0.0, 1.0]])),
    "unknown setting": lambda: model_with(lambda d: d["effects"][2]["settings"].update(colour=1)),
    "setting of a wrong type": lambda: model_with(lambda d: d["effects"][2]["settings"].update(width="slow")),
    "joint of an effect not in the robot": lambda: model_with(lambda d: d["effects"][1].update(joints=["a", "c"])),
    "noise negative": lambda: model_with(lambda d: d["noise"].update(torque_std=[-1.0, 1.0])),
    "noise of another length": lambda: model_with(lambda d: d["noise"].update(torque_std=[1.0])),
    "uncertainty of another shape": lambda: model_with(lambda d: d.update(uncertainty={"directions": [[1.0]]})),
    "json of a result": lambda: json.dumps({"verdict": "explained", "effects": []}),
}
"""Files that are no model.yaml of the robot."""

COLUMNS: dict[str, str | bytes | None] = {
    "not there": None,
    "empty": "",
    "no YAML": "time: [",
    "a list": "- time\n",
    "unknown key": "time: time\nposition: [position_a]\neffort: [effort_a]\ntorque: [effort_a]\n",
    "column not there": "time: clock\nposition: [position_a]\neffort: [effort_a]\n",
    "a number": "time: 3\nposition: 4\neffort: 5\n",
    "wrong type": "time: time\nposition: {a: position_a}\neffort: 3.5\n",
    "nothing for time": "position: [position_a]\neffort: [effort_a]\n",
    "null": "time: time\nposition:\neffort: [effort_a]\n",
    "more efforts than positions": "time: time\nposition: [position_a]\neffort: [effort_a, effort_b]\n",
    "unknown unit": "time: time\nposition: [position_a]\neffort: [effort_a]\ntime_unit: minutes\n",
    "joint not in the robot": "time: time\nposition: [position_a]\neffort: [effort_a]\njoints: [elbow]\n",
    "a column twice": "time: time\nposition: [position_a, position_a]\neffort: [effort_a, effort_b]\njoints: [a, b]\n",
    "a joint twice": "time: time\nposition: [position_a, position_b]\neffort: [effort_a, effort_b]\njoints: [a, a]\n",
}
"""Mappings of columns that do not fit the table."""

CONFIGS: dict[str, str | bytes | None] = {
    "not there": None,
    "empty": "",
    "no YAML": "a: [",
    "a word": "hello\n",
    "binary": bytes(range(256)),
    "wrong type": "effort_scale: often\n",
    "wrong length": "effort_scale: [1.0, 2.0, 3.0]\n",
    "sign of two": "effort_sign: [2.0, 1.0]\n",
    "out of range": "max_gap: -1.0\n",
    "not a number": "max_gap: .nan\n",
    "joint not in the robot": "joint_names: [a, elbow]\n",
    "joint twice": "joint_names: [a, a]\n",
    "gravity of two": "gravity: [0.0, -9.81]\n",
    "frame not there": "frame_id: gripper\n",
    "unknown estimator": "estimator: magic\n",
}
"""Parameter files that can't be meant."""


WORDS: dict[str, dict[str, str]] = {
    "logs": {
        "not there": "does not exist",
        "bag of one message": "before there is an estimate",
        "bag of two messages": "before there is an estimate",
        "bag of two seconds": "it ends after 2 s",
        "efforts all zero": "repeats an old value",
        "efforts no numbers": "effort of a is NaN",
        "effort of one joint no number": "effort of b is NaN",
        "no efforts": "'effort' is empty",
        "no positions": "'position' is empty",
        "degrees": "rad/s",
        "times that run backwards": "is before the last one",
        "times that stand still": "came before",
        "stamps of zero": "stamp is 0",
        "at rest": "has not changed",
        "other robot's joints": "left, right",
        "joint twice": "names a more than once",
        "infinite efforts": "is inf",
        "huge positions": "e\\+08",
        "empty mcap": "empty file",
        "empty db3": "empty file",
        "text as mcap": "not a rosbag2 file",
        "text as db3": "not a rosbag2 file",
        "ROS 1 bag": "rosbags-convert",
        "unknown suffix": "xlsx",
        "no suffix": "not a bag",
        "csv empty": "is empty",
        "csv header only": "no rows below",
        "csv one row": "before there is an estimate",
        "csv two rows": "before there is an estimate",
        "csv without time": "don't tell time",
        "csv without effort": "don't tell position and effort",
        "csv text in a number": "line 7, column 'time': '100.05x' is no number",
        "csv decimal commas and commas": "14 values in line 2",
        "csv semicolons in the head only": "values in line 2",
        "csv without header": "don't tell time",
        "csv same name twice": "two columns are called 'effort_a'",
        "csv all NaN": "no time in it is a number",
        "csv NaN efforts": "effort of a is NaN",
        "csv NaN times": "no time in it is a number",
        "csv ragged": "3 values in line 1202",
        "csv binary": "not text in UTF-8",
        "csv utf-16": "not text in UTF-8",
        "csv times in ns without a unit": "time_unit: ms, us or ns",
        "csv times in ms without a unit": "time_unit: ms, us or ns",
        "npz broken": "not a zip file",
        "npz text": "holds no arrays of numbers",
        "npz empty": "No data left",
        "npz of objects": "holds no arrays of numbers",
        "npz of words": "could not convert string",
        "npz without effort": "holds t, q; it must hold",
        "npz of other shapes": "\\(8, 2\\)",
        "npz of one dimension": "must be \\(N,\\) and \\(N, n\\)",
        "npz of a number": "before there is an estimate",
        "npz of nothing": "no row",
        "npz complex": "complex numbers",
        "npz three joints": "3 joints without names",
        "npz a name too few": "Name each of them",
        "parquet broken": "can't be read as Parquet",
        "parquet text": "can't be read as Parquet",
    },
    "robots": {
        "not there": "does not exist",
        "empty": "no element found",
        "no XML": "syntax error",
        "cut": "line 3",
        "binary": "not text in UTF-8",
        "another root": "<sdf>; it must be <robot>",
        "no joints": "no movable joint",
        "no movable joint": "no movable joint",
        "unknown joint type": "joint 'a' .* 'hinge'; it must be one of",
        "joint without a type": "type None",
        "joint without a name": "<joint> without a name",
        "joint without a child": "joint 'b' .* has no child",
        "joint to a link that is not there": "names 'three', which is no link",
        "two roots": "2 root links, base, other",
        "circle": "one tree",
        "joint twice": "two joints of the name 'a'",
        "link twice": "two links of the name 'one'",
        "no inertial": "no link .* has a mass",
        "negative mass": "link 'one' .* the mass '-2'",
        "mass of no number": "the mass 'two'",
        "mass NaN": "the mass 'nan'",
        "inertia incomplete": "ixx of <inertia>",
        "axis of no length": "no direction",
        "axis of two numbers": "xyz of <axis> is '0 1'",
        "origin of words": "xyz of <origin> is 'here'",
        "limit of words": "lower of <limit> is 'low'",
        "xacro": "xacro (is not installed|can't expand)",
        "xacro by the name of a URDF": "xacro (is not installed|can't expand)",
        "folder": "is a folder",
        "MJCF cut": "MuJoCo can't read",
        "MJCF with an unknown word": "corpse",
        "MJCF without a mass": "mass and inertia of moving bodies",
        "MJCF with a ball": "ball joints",
        "MJCF without joints": "no movable joint",
        "MJCF with a mesh that is not there": "no.stl",
        "MJCF that includes what is not there": "no.xml",
    },
    "models": {
        "not there": "No such file",
        "empty": "states no format",
        "no YAML": "is not YAML",
        "a list": "states no format",
        "binary": "is not YAML",
        "another version": "format 2; this version reads format 1",
        "no version": "states no format",
        "another robot's joints": "left, right",
        "no robot": "lacks 'robot'",
        "robot a word": "robot is 'two'",
        "no joints": "lacks 'joints'",
        "no effects": "lacks 'effects'",
        "effects a word": "effects is 'friction'",
        "unknown effect": "unknown effect 'magnetism'",
        "effect without theta": "lacks 'theta'",
        "theta NaN": "theta of effect 'viscous_friction'",
        "theta of words": "theta of effect 'viscous_friction' is \\['much', 'more'\\]; it needs 2 finite numbers",
        "theta too short": "needs 2 finite numbers",
        "covariance of another shape": "2 x 2 finite numbers",
        "covariance negative": "variances of 0 or more",
        "unknown setting": "unexpected keyword argument 'colour'",
        "setting of a wrong type": "width 'slow'; it must be a positive number",
        "joint of an effect not in the robot": "names joints c",
        "noise negative": "noise.torque_std",
        "noise of another length": "noise.torque_std",
        "uncertainty of another shape": "needs 24 rows",
        "json of a result": "states no format",
    },
    "columns": {
        "not there": "No such file",
        "empty": "must give names of columns",
        "no YAML": "is not YAML",
        "a list": "must give names of columns",
        "unknown key": "has torque; it may have",
        "column not there": "no column 'clock'",
        "a number": "no column '3'",
        "wrong type": "must be a name, or a list of names",
        "nothing for time": "time: NAME",
        "null": "position is None in the mapping",
        "more efforts than positions": "1 columns of position and 2 of effort",
        "unknown unit": "'minutes'",
        "joint not in the robot": "elbow",
        "a column twice": "'position_a' twice",
        "a joint twice": "'a' twice",
    },
    "configs": {
        "not there": "No such file",
        "empty": "holds no parameters",
        "no YAML": "is not YAML",
        "a word": "holds no parameters",
        "binary": "is not YAML",
        "wrong type": "effort_scale is 'often'",
        "wrong length": "effort_scale has 3 numbers",
        "sign of two": "effort_sign",
        "out of range": "max_gap is -1",
        "not a number": "max_gap is nan",
        "joint not in the robot": "has elbow, which the messages lack",
        "joint twice": "repeated",
        "gravity of two": "gravity",
        "frame not there": "gripper",
        "unknown estimator": "'magic'",
    },
}
"""What the message of the first command must say, a regular expression each."""
