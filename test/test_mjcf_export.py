"""The exported MJCF against the model that it was made of, in MuJoCo."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from motions import Motion as Path_
from robots import robot, urdf

from sysid_ros.effects import EFFECTS, Effect, LinkInertia, Motion
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.mjcf_export import export_mjcf
from sysid_ros.torque.model_file import EffectBlock, ModelFile, urdf_digest
from sysid_ros.torque.torque_model import TorqueModel

TURNS = 0.002

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install 'sysid_ros[mujoco]'")


def model_file(model: RobotModel, parts: Sequence[tuple[Effect, FloatArray]]) -> ModelFile:
    blocks = [EffectBlock(e.id, e.joint_names, e.settings, theta, e.parameter_names, e.units, None) for e, theta in parts]
    nothing = np.zeros(model.n)
    return ModelFile(model.name, model.joint_names, urdf_digest(model.urdf), tuple(blocks), nothing, nothing)


def physical(model: RobotModel) -> RobotModel:
    """The robot with a small ball on each link, so that none is without mass."""
    ball = np.array([0.2, 0.0, 0.0, 0.0, 2e-3, 0.0, 2e-3, 0.0, 0.0, 2e-3])
    return model.with_links(np.tile(ball, model.n))


def found(model: RobotModel, gain: float = 0.0, delay: float = 0.0) -> ModelFile:
    """A model as a diagnosis finds one: links, rotors, friction, a gain and a delay."""
    n = model.n
    parts: list[tuple[Effect, FloatArray]] = [
        (LinkInertia(model), physical(model).pi * 1.1),
        (EFFECTS["rotor_inertia"](model), np.linspace(0.1, 0.3, n)),
        (EFFECTS["viscous_friction"](model), np.linspace(0.5, 2.0, n)),
        (EFFECTS["coulomb_friction"].from_settings(model, (), {"width": TURNS}), np.linspace(0.5, 1.5, n)),
    ]
    if gain:
        parts.append((EFFECTS["torque_scale"](model, model.joint_names[:1]), np.array([gain])))
    if delay:
        parts.append((EFFECTS["time_delay"](model), np.array([delay])))
    return model_file(model, parts)


@pytest.mark.parametrize("name", ["small_arm", "tree_robot", "iiwa"])
def test_the_inverse_dynamics_in_mujoco_give_the_torque_of_the_model(name: str, tmp_path: Path) -> None:
    model = robot(name)
    file = found(model, gain=0.2)
    assert export_mjcf(model, file, tmp_path / "extended.xml") == []
    t = np.arange(0.0, 10.0, 0.02)
    q, v, a = Path_(model, 1, speed=2.0)(t)
    expected = TorqueModel(model, [], file.known_effects(model)).torque_along(Motion(model, t, q, v, a, np.zeros_like(q)))
    there = mujoco.MjModel.from_xml_path(str(tmp_path / "extended.xml"))
    data = mujoco.MjData(there)
    joints = [there.joint(joint).id for joint in model.joint_names]
    at, dofs = there.jnt_qposadr[joints], there.jnt_dofadr[joints]
    gear = np.array([there.actuator(joint).gear[0] for joint in model.joint_names])
    reached = np.empty_like(q)
    for k in range(len(t)):
        data.qpos[at], data.qvel[dofs], data.qacc[dofs] = q[k], v[k], a[k]
        mujoco.mj_inverse(there, data)
        reached[k] = data.qfrc_inverse[dofs] / gear
    # the model's dry friction turns within its width, MuJoCo's within two steps
    moving = np.abs(v) > 3.0 * TURNS + 2.0 * there.opt.timestep * np.abs(a)
    error = np.sqrt(np.sum(np.where(moving, reached - expected, 0.0) ** 2, axis=0) / np.sum(moving, axis=0))
    assert np.all(error < 0.01 * np.sqrt(np.mean(expected**2, axis=0)))
    tip = mujoco.mj_name2id(there, mujoco.mjtObj.mjOBJ_SITE, model.default_frame)
    if tip >= 0:
        mujoco.mj_kinematics(there, data)
        np.testing.assert_allclose(data.site_xpos[tip], model.frame_placement(q[-1], model.default_frame)[1], atol=1e-9)


@pytest.mark.parametrize("delay", [0.011, -0.011])
def test_a_late_effort_is_a_late_sensor_and_an_early_one_a_late_actuator(delay: float, tmp_path: Path) -> None:
    model = robot("small_arm")
    export_mjcf(model, found(model, delay=delay), tmp_path / "extended.xml")
    there = mujoco.MjModel.from_xml_path(str(tmp_path / "extended.xml"))
    assert there.numeric("effort_delay").data[0] == delay
    if not hasattr(there, "actuator_delay"):
        pytest.skip("this version of MuJoCo knows no delays")
    data, seen = mujoco.MjData(there), []
    for _ in range(12):
        data.ctrl[0] = 1.0
        mujoco.mj_step(there, data)
        seen.append((data.actuator_force[0], data.sensordata[0]))
    force, effort = np.array(seen).T
    if delay < 0.0:
        assert force[2] == 0.0
    else:
        assert force[2] == 1.0
    assert effort[2] == 0.0
    assert effort[-1] == 1.0


def test_joints_that_a_urdf_names_twice_keep_their_axes(tmp_path: Path) -> None:
    twice = "".join(f'<transmission name="{j}_t"><joint name="{j}"/></transmission>' for j in robot("small_arm").joint_names)
    model = RobotModel.from_urdf(urdf("small_arm").replace("</robot>", f"{twice}</robot>"))
    texts = []
    for one in (robot("small_arm"), model):
        export_mjcf(one, model_file(one, []), tmp_path / "extended.xml")
        texts.append((tmp_path / "extended.xml").read_text())
    assert texts[0] == texts[1]


def test_point_masses_and_links_without_mass_are_taken(tmp_path: Path) -> None:
    """As URDFs have them for tools and frames."""
    model = robot("small_arm")
    change = np.zeros((model.n, 10))
    change[1], change[-1] = inertial_parameters.from_com(0.2, np.array([0.0, 0.0, 0.04]), np.zeros((3, 3))), 0.0
    change[[1, -1]] -= model.pi.reshape(-1, 10)[[1, -1]]
    light = model.with_links(change.ravel())
    export_mjcf(light, model_file(light, []), tmp_path / "extended.xml")
    there = mujoco.MjModel.from_xml_path(str(tmp_path / "extended.xml"))
    assert there.body(model.body_names[1]).mass[0] == pytest.approx(0.2)
    assert there.body(model.body_names[-1]).mass[0] < 1e-6


def test_what_no_simulator_can_have_is_refused_and_what_is_lost_is_said(tmp_path: Path) -> None:
    model = robot("small_arm")
    spring = EFFECTS["spring"](model)
    notes = export_mjcf(model, model_file(model, [(spring, np.ones(spring.p))]), tmp_path / "extended.xml")
    assert any("spring" in note for note in notes)
    theta = model.pi.copy()
    theta[0] = -1.0
    with pytest.raises(ModelFileError, match="no body"):
        export_mjcf(model, model_file(model, [(LinkInertia(model), theta)]), tmp_path / "other.xml")


def test_without_mujoco_the_file_is_written_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sysid_ros.torque.mjcf_export._takes_delays", lambda: False)
    model = robot("small_arm")
    export_mjcf(model, found(model, delay=0.01), tmp_path / "extended.xml")
    root = ElementTree.parse(tmp_path / "extended.xml").getroot()
    assert [float(e.get("data", "0")) for e in root.iter("numeric")] == [0.01]
    assert not any("delay" in e.attrib for e in root.iter("actuatorfrc"))
