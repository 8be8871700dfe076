"""What `sysid export` writes, in the simulators themselves: in random states they need the torques of model.yaml."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from robots import urdf

from sysid_ros.cli.export import WRITERS
from sysid_ros.cli.main import run
from sysid_ros.effects import EFFECTS, CoulombFriction, Effect, LinkInertia, Motion, RotorInertia, ViscousFriction
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.rotation import rotation_of
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.torque.exported import known_of
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.model_file import EffectBlock, ModelFile, urdf_digest
from sysid_ros.torque.torque_model import TorqueModel

STATES = 1000
TOLERANCE = 0.01
"""Of the rms of each joint's torque."""
ROBOTS = ("iiwa", "panda")
NAMES = ("arm.xml", "arm.urdf", "arm.sdf", "arm.drake.urdf", "arm.isaac.json", "arm.isaac.yaml", "joints.csv")


@dataclass(frozen=True)
class Exported:
    """A robot's files, random states of it (N, n), and parts of model.yaml's torque there (N, n) [N m]."""

    folder: Path
    robot: RobotModel
    q: FloatArray
    v: FloatArray
    a: FloatArray
    whole: FloatArray
    rotors: FloatArray
    friction: FloatArray


def description(name: str) -> str:
    if name in ("iiwa", "small_arm", "tree_robot"):
        return urdf(name)
    path = packaged(name)
    if path is None:
        pytest.skip("example-robot-data is not installed (extra dev)")
    return path.read_text()


def written(robot: RobotModel, parts: list[tuple[Effect, FloatArray]], folder: Path) -> None:
    """Model, description and all exports of a robot."""
    blocks = [EffectBlock(e.id, e.joint_names, e.settings, theta, e.parameter_names, e.units, None) for e, theta in parts]
    nothing = np.zeros(robot.n)
    ModelFile(robot.name, robot.joint_names, urdf_digest(robot.urdf), tuple(blocks), nothing, nothing).write(
        folder / "model.yaml"
    )
    (folder / "given.urdf").write_text(robot.urdf)
    outs = [str(folder / name) for name in NAMES]
    assert run(["export", str(folder / "model.yaml"), "--urdf", str(folder / "given.urdf"), "--out", *outs]) == 0


@cache
def exported(name: str, folder: Path) -> Exported:
    robot = RobotModel.from_urdf(description(name))
    n, rng = robot.n, np.random.default_rng(1)
    ball = np.array([0.2, 0.0, 0.0, 0.0, 2e-3, 0.0, 2e-3, 0.0, 0.0, 2e-3])
    parts: list[tuple[Effect, FloatArray]] = [
        (LinkInertia(robot), 1.05 * robot.pi + np.tile(ball, n)),
        (RotorInertia(robot), rng.uniform(0.1, 0.5, n)),
        (ViscousFriction(robot), rng.uniform(0.5, 2.0, n)),
        (CoulombFriction(robot), rng.uniform(0.5, 2.0, n)),
    ]
    written(robot, parts, folder)
    known = known_of(robot, ModelFile.read(folder / "model.yaml"))
    q = rng.uniform(np.maximum(robot.position_lower, -3.0), np.minimum(robot.position_upper, 3.0), (STATES, n))
    v = rng.choice([-1.0, 1.0], (STATES, n)) * rng.uniform(0.2, 2.0, (STATES, n))  # the model's dry friction has turned
    a = 3.0 * rng.normal(size=(STATES, n))
    whole = np.array([known.known_torque(Sample(0.0, *state, np.zeros(n))).copy() for state in zip(q, v, a, strict=True)])
    friction = parts[2][1] * v + parts[3][1] * np.sign(v)
    return Exported(folder, robot, q, v, a, whole, parts[1][1] * a, friction)


@pytest.fixture(scope="module", params=ROBOTS)
def arm(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    return exported(str(request.param), tmp_path_factory.mktemp(str(request.param)))


def assert_equal(found: FloatArray, expected: FloatArray) -> None:
    """Every state's torque, to a part of the rms of its joint."""
    largest = np.max(np.abs(found - expected), axis=0) / np.sqrt(np.mean(expected**2, axis=0))
    assert np.all(largest < TOLERANCE), largest


def test_mujoco_needs_the_whole_torque(arm: Exported) -> None:
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")
    there = mujoco.MjModel.from_xml_path(str(arm.folder / "arm.xml"))
    data = mujoco.MjData(there)
    joints = [there.joint(name).id for name in arm.robot.joint_names]
    at, dofs = there.jnt_qposadr[joints], there.jnt_dofadr[joints]
    # friction as MuJoCo's inverse gives it is softened by the constraint's own softness: its level is compared by itself
    dry = there.dof_frictionloss[dofs].copy()
    there.dof_frictionloss[:] = 0.0
    found = np.empty_like(arm.whole)
    for k in range(STATES):
        data.qpos[at], data.qvel[dofs], data.qacc[dofs] = arm.q[k], arm.v[k], arm.a[k]
        mujoco.mj_inverse(there, data)
        found[k] = data.qfrc_inverse[dofs]
    assert_equal(found + dry * np.sign(arm.v), arm.whole)


def test_pybullet_needs_the_torque_of_links_and_friction(arm: Exported) -> None:
    """Its inverse dynamics know no damping and no friction: those that it read for its joints are added."""
    pybullet = pytest.importorskip("pybullet", reason="pybullet is not installed (extra sim)")
    pytest.importorskip("pybullet_data")
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=client)
        bare = arm.folder / "bare.urdf"
        root = ElementTree.parse(arm.folder / "arm.urdf").getroot()
        for link in root.findall("link"):  # meshes that are not there
            for shape in (*link.findall("visual"), *link.findall("collision")):
                link.remove(shape)
        bare.write_text(ElementTree.tostring(root, encoding="unicode"))
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE
        body = pybullet.loadURDF(str(bare), useFixedBase=True, flags=flags, physicsClientId=client)
        infos = [
            pybullet.getJointInfo(body, j, physicsClientId=client)
            for j in range(pybullet.getNumJoints(body, physicsClientId=client))
        ]
        moving = [info for info in infos if info[2] != pybullet.JOINT_FIXED]
        ours = {name: j for j, name in enumerate(arm.robot.joint_names)}
        back = [(i, ours[info[1].decode()]) for i, info in enumerate(moving) if info[1].decode() in ours]
        theirs, mine = (list(x) for x in zip(*back, strict=True))
        found = np.empty_like(arm.whole)
        for k in range(STATES):
            q, v, a = (np.zeros(len(moving)) for _ in range(3))
            q[theirs], v[theirs], a[theirs] = arm.q[k, mine], arm.v[k, mine], arm.a[k, mine]
            tau = pybullet.calculateInverseDynamics(body, q.tolist(), v.tolist(), a.tolist(), physicsClientId=client)
            found[k, mine] = np.array(tau)[theirs]
        damping, dry = np.zeros(arm.robot.n), np.zeros(arm.robot.n)
        damping[mine], dry[mine] = (np.array([moving[i][field] for i in theirs]) for field in (6, 7))
    finally:
        pybullet.disconnect(client)
    assert_equal(found + damping * arm.v + dry * np.sign(arm.v), arm.whole - arm.rotors)


def test_pinocchio_needs_the_torque_of_links_and_friction_and_with_the_table_the_whole(arm: Exported) -> None:
    model = pin.buildModelFromUrdf(str(arm.folder / "arm.urdf"))
    locked = [model.getJointId(name) for name in model.names[1:] if name not in arm.robot.joint_names]
    model = pin.buildReducedModel(model, locked, pin.neutral(model))
    assert tuple(model.names)[1:] == arm.robot.joint_names
    data, states = model.createData(), list(zip(arm.q, arm.v, arm.a, strict=True))
    links = np.array([pin.rnea(model, data, *state).copy() for state in states])
    dynamics = {e.get("name"): e.find("dynamics") for e in ElementTree.parse(arm.folder / "arm.urdf").getroot().findall("joint")}
    damping, dry = (np.array([float(dynamics[j].get(word)) for j in arm.robot.joint_names]) for word in ("damping", "friction"))  # type: ignore[union-attr,arg-type]
    assert_equal(links + damping * arm.v + dry * np.sign(arm.v), arm.whole - arm.rotors)

    table = json.loads((arm.folder / "arm.isaac.json").read_text())["actuator_cfg"]
    armature, friction, viscous = (
        np.array([table[key][j] for j in arm.robot.joint_names]) for key in ("armature", "friction", "viscous_friction")
    )
    model.armature = armature
    whole = np.array([pin.rnea(model, data, *state).copy() for state in states])
    assert_equal(whole + viscous * arm.v + friction * np.sign(arm.v), arm.whole)


@pytest.mark.parametrize(("name", "rotors"), [("arm.sdf", False), ("arm.drake.urdf", True)])
def test_drake_needs_the_torque_of_all_but_dry_friction(arm: Exported, name: str, rotors: bool) -> None:
    """It reads an SDF with libsdformat, the parser of Gazebo."""
    pytest.importorskip("pydrake", reason="drake is not installed: pip install drake")
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import MultibodyForces

    plant = MultibodyPlant(0.0)
    (model,) = Parser(plant).AddModels(str(arm.folder / name))
    if name.endswith(".urdf"):
        plant.WeldFrames(plant.world_frame(), plant.get_body(plant.GetBodyIndices(model)[0]).body_frame())
    plant.Finalize()
    context = plant.CreateDefaultContext()
    joints = [plant.GetJointByName(joint) for joint in arm.robot.joint_names]
    at, dofs = [j.position_start() for j in joints], [j.velocity_start() for j in joints]
    found = np.empty_like(arm.whole)
    for k in range(STATES):
        q, v, a = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities()), np.zeros(plant.num_velocities())
        q[at], v[dofs], a[dofs] = arm.q[k], arm.v[k], arm.a[k]
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        found[k] = plant.CalcInverseDynamics(context, a, forces)[dofs]
    level = np.array(list(json.loads((arm.folder / "arm.isaac.json").read_text())["actuator_cfg"]["friction"].values()))
    assert_equal(found, arm.whole - level * np.sign(arm.v) - (0.0 if rotors else arm.rotors))


def numbers(text: str | None) -> FloatArray:
    return np.array([float(x) for x in (text or "").split()])


def placed(element: ElementTree.Element) -> Any:
    pose = numbers(element.findtext("pose"))
    return pin.SE3(rotation_of(pose[3:].tolist()), pose[:3])


def from_sdf(path: Path) -> tuple[Any, dict[str, FloatArray]]:
    """The model of an SDF by the rules of its specification, as far as they are used here, and damping and friction by joint."""
    (sdf,) = ElementTree.parse(path).getroot().findall("model")
    links = {e.get("name"): e for e in sdf.findall("link")}
    model, ids, dynamics = pin.Model(), {"world": 0}, {}
    for joint in sdf.findall("joint"):
        parent, child = joint.findtext("parent"), joint.findtext("child")
        pose, axis = joint.find("pose"), joint.find("axis")
        assert pose is not None
        assert axis is not None
        assert pose.get("relative_to") == {"world": "__model__"}.get(str(parent), parent)
        along = numbers(axis.findtext("xyz"))
        kind = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}[
            str(joint.get("type"))
        ]
        name = str(joint.get("name"))
        ids[str(child)] = model.addJoint(ids[str(parent)], kind(*(along / np.linalg.norm(along))), placed(joint), name)
        dynamics[name] = np.array([float(axis.findtext(f"dynamics/{word}") or "nan") for word in ("damping", "friction")])
        link = links[child]
        at, inertial = link.find("pose"), link.find("inertial")
        assert at is not None
        assert inertial is not None
        assert at.get("relative_to") == name
        assert not numbers(at.text).any()
        xx, xy, xz, yy, yz, zz = (
            float(inertial.findtext(f"inertia/i{k}") or "nan") for k in ("xx", "xy", "xz", "yy", "yz", "zz")
        )
        com, tensor = placed(inertial), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        mass = float(inertial.findtext("mass") or "nan")
        assert mass > 0.0
        model.appendBodyToJoint(
            ids[str(child)], pin.Inertia(mass, com.translation, com.rotation @ tensor @ com.rotation.T), pin.SE3.Identity()
        )
    return model, dynamics


@pytest.mark.parametrize("name", [*ROBOTS, "small_arm", "tree_robot"])
def test_an_sdf_read_by_its_specification_needs_the_torque_of_links_and_friction(name: str, tmp_path: Path) -> None:
    arm = exported(name, tmp_path)
    model, dynamics = from_sdf(tmp_path / "arm.sdf")
    order = [model.getJointId(joint) - 1 for joint in arm.robot.joint_names]
    data, found = model.createData(), np.empty_like(arm.whole)
    for k in range(STATES):
        states = [np.empty(model.nv) for _ in range(3)]
        for state, given in zip(states, (arm.q[k], arm.v[k], arm.a[k]), strict=True):
            state[order] = given
        found[k] = pin.rnea(model, data, *states)[order]
    damping, dry = np.array([dynamics[joint] for joint in arm.robot.joint_names]).T
    assert_equal(found + damping * arm.v + dry * np.sign(arm.v), arm.whole - arm.rotors)
    names = [str(e.get("name")) for e in next(ElementTree.parse(tmp_path / "arm.sdf").iter("model"))]
    assert len(set(names)) == len(names)


def test_each_file_says_what_it_can_not_hold(tmp_path: Path) -> None:
    robot = RobotModel.from_urdf(urdf("small_arm"))
    spring, scale = EFFECTS["spring"](robot), EFFECTS["torque_scale"](robot)
    written(
        robot,
        [(RotorInertia(robot), np.full(robot.n, 0.2)), (scale, np.full(scale.p, 0.1)), (spring, np.ones(spring.p))],
        tmp_path,
    )
    assert {name[name.index(".") :] for name in NAMES} == set(WRITERS)
    lost = {name: {"spring"} for name in NAMES}
    for name in ("arm.urdf", "arm.sdf"):
        lost[name] |= {"rotor_inertia", "torque_scale"}
    for name in ("arm.drake.urdf", "arm.isaac.json", "arm.isaac.yaml"):
        lost[name] |= {"torque_scale"}
    for name in NAMES:
        text = (tmp_path / name).read_text().replace("drake:rotor_inertia", "")
        assert {e.id for e in (spring, scale, RotorInertia(robot)) if e.id in text} == lost[name], name


def test_the_armature_that_an_mjcf_states_counts_until_the_links_are_the_models_own(tmp_path: Path) -> None:
    """As its damping and friction: who identifies the links identifies the rotors too."""
    pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")
    joint = '<joint name="hip" axis="0 1 0" armature="0.5"/><inertial pos="0 0 .1" mass="1" diaginertia=".1 .1 .1"/>'
    (tmp_path / "given.xml").write_text(f'<mujoco model="one"><worldbody><body name="leg">{joint}</body></worldbody></mujoco>')
    from sysid_ros.robot.mjcf import urdf_of_mjcf

    robot = RobotModel.from_urdf(urdf_of_mjcf(tmp_path / "given.xml"))
    written(robot, [(RotorInertia(robot), np.array([0.25]))], tmp_path)
    root = ElementTree.parse(tmp_path / "arm.xml").getroot()
    assert [float(e.get("armature", "nan")) for e in root.iter("joint") if e.get("name")] == [0.75]
    table = json.loads((tmp_path / "arm.isaac.json").read_text())
    assert table["joints"]["hip"]["armature"] == 0.75
    assert "armature that the robot's description states" in (tmp_path / "arm.sdf").read_text()

    sample = Sample(0.0, np.array([0.3]), np.array([0.2]), np.array([2.0]), np.zeros(1))
    own = [KnownEffect(LinkInertia(robot), robot.pi.copy()), KnownEffect(RotorInertia(robot), np.array([0.25]))]
    for known, rotor in (([], 0.5), (own[1:], 0.75), (own[:1], 0.0), (own, 0.25)):
        model = TorqueModel(robot, [], known)
        expected = robot.regressor(sample.q, sample.v, sample.a) @ robot.pi + rotor * sample.a
        np.testing.assert_allclose(model.known_torque(sample), expected)
        np.testing.assert_allclose(model.armature(), rotor)
        motion = Motion(robot, np.zeros(1), sample.q[None], sample.v[None], sample.a[None], np.zeros((1, 1)))
        np.testing.assert_allclose(model.torque_along(motion)[0], expected)
        rows = model.compiled()
        row = rows.empty.copy()
        rows.fill(0.0, np.stack([sample.q, sample.v, sample.a, sample.tau]), row)
        np.testing.assert_allclose(-row[:, rows.p], expected)
