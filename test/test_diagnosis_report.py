"""What ``sysid diagnose`` writes and tells: contacts, message faults, a URDF of bodies that can exist, the report, the drive."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from diagnosis_bags import ARM, bag, messages
from motions import Motion as Path_
from robots import DATA, robot

from sysid_ros.cli.main import run
from sysid_ros.diagnosis import Diagnosis, diagnose
from sysid_ros.exceptions import ModelFileError
from sysid_ros.input_gate.message_faults import find_message_faults
from sysid_ros.input_gate.missing_joints import missing_joints
from sysid_ros.input_gate.raw_messages import read_messages
from sysid_ros.input_gate.recording_check import only_places
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.torque.model_file import ModelFile

FILES = {"report.html", "diagnosis.json", "model.yaml", "extended.urdf", "extended.xml", "predictions.npz"}
FORCE, START, END = np.array([12.0, 5.0, -20.0]), 7.0, 7.6


def push(t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """A hand that pushes the last link."""
    model = robot(ARM)
    jacobian = model.frame_jacobian_along(q, model.frame_id("hand"))
    during = (t >= START) & (t < END)
    return np.asarray(-np.einsum("kxj,x->kj", jacobian, FORCE) * during[:, None])


def recording(name: str, seed: int, seconds: float, pushed: bool) -> Recording:
    records = messages(seed, seconds, push if pushed else None)
    return read_messages(name, records, robot(ARM), OnlineSettings())[0]


def polled(whole: Recording, source: float = 1.0 / 47.0, poll: float = 1.0 / 50.0) -> Recording:
    """What a driver publishes that asks every ``poll`` for the latest sample of a source of that period [s]."""
    stamps = np.arange(whole.t[0] + source, whole.t[-1], poll)
    samples = whole.t[0] + np.floor((stamps - whole.t[0]) / source) * source
    q, tau = (np.stack([np.interp(samples, whole.t, x) for x in channel.T], axis=1) for channel in (whole.q, whole.tau))
    return Recording(whole.name, stamps, q, None, tau)


@cache
def pushed() -> Diagnosis:
    return diagnose(robot(ARM), [recording("fit", 0, 14.0, True)], [recording("judge", 1, 10.0, True)])


@pytest.mark.slow
def test_a_contact_is_dated_with_its_force_and_keeps_out_of_the_other_fits() -> None:
    found = {f.id: f for f in pushed().findings}
    assert set(found) == {"external_force", "coulomb_friction"}
    values = {p.name: p.value for p in found["external_force"].parameters}
    np.testing.assert_allclose(values["force"], FORCE, atol=1.5)
    assert (values["t0"], values["t1"]) == (pytest.approx(START, abs=0.08), pytest.approx(END, abs=0.08))
    assert values["frame"] == "hand"
    levels = [p.value for p in found["coulomb_friction"].parameters]
    np.testing.assert_allclose(levels, 0.6, rtol=0.06)
    # the same push in the recording to judge on is left out of it
    assert any("judge: from" in note and "left out" in note for note in pushed().notes)
    torque = pushed().torque
    assert torque is not None
    assert np.all(torque.after < 2.0 * torque.noise_floor)


@pytest.mark.slow
def test_a_driver_that_polls_a_slower_source_hides_no_friction() -> None:
    found = diagnose(robot(ARM), [polled(recording("fit", 0, 20.0, False))], [polled(recording("judge", 1, 14.0, False))])
    assert found.verdict == "explained"
    causes = {f.id: f for f in found.findings}
    assert set(causes) == {"coulomb_friction", "message_faults"}
    np.testing.assert_allclose([p.value for p in causes["coulomb_friction"].parameters], 0.6, rtol=0.06)
    assert {p.name for p in causes["message_faults"].parameters} == {"repeated", "polled"}
    assert "slower source" in causes["message_faults"].remark
    assert found.torque is not None
    assert np.all(found.torque.after < 2.0 * found.torque.noise_floor)


def test_stamps_in_order_are_not_complained_of() -> None:
    rng = np.random.default_rng(0)
    for rate, resolution, jitter in ((100.0, 1e-3, 0.0), (250.0, 1e-4, 0.3), (1000.0, 2.5e-5, 0.1)):
        t = np.arange(round(8 * rate)) / rate
        q = Path_(robot(ARM), 3)(t)[0] + 0.2 * resolution * rng.normal(size=(len(t), 4))
        stamps = 1.0 + t + jitter / rate * rng.uniform(-1.0, 1.0, len(t))
        faults = find_message_faults(stamps, np.round(q / resolution) * resolution, rng.normal(size=q.shape))
        assert faults.keep.all()
        assert not any(faults.shares().values())
        # what the positions tell of the stamps is said and taken off, where it is more than the noise of the encoders
        size = jitter / rate / np.sqrt(3.0)
        assert (faults.in_words() == "") == (faults.jitter == 0.0)
        assert faults.jitter == (pytest.approx(size, rel=0.1) if jitter == 0.3 else pytest.approx(size, abs=0.3 * size))
        assert np.std(np.diff(faults.times - t)) <= np.std(np.diff(stamps - t)) * (0.5 if faults.jitter else 1.0) + 1e-9


@pytest.mark.parametrize("small", [0.1, 0.3])
@pytest.mark.parametrize("speed", [0.11, 0.2, 0.3])
def test_steps_of_a_coarse_encoder_are_no_late_messages(speed: float, small: float) -> None:
    """Of the joint that moves most, so that a step of it looks as if all joints agreed; a message that is late is one."""
    t, rng = np.arange(4000) / 1000.0, np.random.default_rng(1)
    q = np.stack([speed * t, small * np.sin(1.3 * t), small * np.cos(t), small * np.sin(0.7 * t)], axis=1)
    steps = np.array([1.5e-3, 2.5e-5, 2.5e-5, 2.5e-5])
    measured, tau = np.round((q + 0.2 * steps * rng.normal(size=q.shape)) / steps) * steps, rng.normal(size=q.shape)
    assert find_message_faults(t, measured, tau).late == 0
    measured[2000] = measured[1995]
    assert find_message_faults(t, measured, tau).late == 1


def test_message_faults_are_counted_and_the_rest_is_kept_in_order() -> None:
    rng = np.random.default_rng(0)
    t = np.arange(2000) / 200.0
    q = Path_(robot(ARM), 3)(t)[0]
    tau = rng.normal(size=q.shape)
    kept = np.delete(np.arange(2000), [300, 301, 700])
    q[1000], tau[1000] = q[999], tau[999]
    q[1200] = q[1194]
    order = kept.copy()
    order[[50, 51]] = order[[51, 50]]
    faults = find_message_faults(1.0 + t[order], q[order], tau[order])
    assert (faults.dropped, faults.repeated, faults.late, faults.unordered) == (3, 1, 1, 1)
    assert faults.delay == pytest.approx(0.03, rel=0.1)
    used = t[order][faults.order][faults.keep]
    assert np.all(np.diff(used) > 0.0)
    assert len(used) == len(kept) - 2


def test_a_joint_that_carries_the_others_must_not_be_missing() -> None:
    text = robot(ARM).urdf
    assert missing_joints(RobotModel.from_urdf(text)) is None
    assert "lift" in str(missing_joints(RobotModel.from_urdf(text, ["turn", "elbow", "slide"])))
    # a turntable under an upright arm changes no torque of the others
    assert missing_joints(RobotModel.from_urdf(text, ["lift", "elbow", "slide"])) is None


def test_links_that_all_weigh_the_same_only_hold_a_place() -> None:
    (said,) = only_places(RobotModel.from_urdf(re.sub(r'<mass value="[^"]*"', '<mass value="1.0"', robot(ARM).urdf)))
    assert "4 of 4 links" in said
    assert "weigh 1 kg each" in said
    assert "Give the URDF with the robot's own inertials" in said
    assert only_places(robot(ARM)) == ()
    assert only_places(robot("iiwa")) == ()


def test_links_that_are_no_bodies_become_the_nearest_ones_in_the_urdf(tmp_path: Path) -> None:
    from sysid_ros.diagnosis.extended_model import urdf_part
    from sysid_ros.diagnosis.prepare import prepare
    from sysid_ros.effects import LinkInertia, Payload
    from sysid_ros.torque.model_file import EffectBlock, urdf_digest
    from sysid_ros.torque.urdf_export import export_urdf

    model = robot(ARM)
    train = prepare(model, [recording("fit", 0, 8.0, False)], [])
    links = LinkInertia(model)
    theta = links.nominal.copy()
    # a moment of inertia below zero, about an axis that a motion does not show
    theta[34] -= 0.05
    body = Payload(model)
    carried = inertial_parameters.from_com(0.7, np.array([0.02, 0.0, 0.1]), 1e-3 * np.eye(3))
    blocks = tuple(
        EffectBlock(e.id, e.joint_names, e.settings, value, e.parameter_names, e.units, None)
        for e, value in ((links, theta), (body, carried))
    )
    found = ModelFile(model.name, model.joint_names, urdf_digest(model.urdf), blocks, np.full(4, 0.03), np.full(4, 0.01))
    assert not inertial_parameters.is_physical(theta[30:] + carried)
    part, notes = urdf_part(model, found, train)
    assert any("hand" in note and "nearest" in note for note in notes)
    # what was found is as uncertain as that: it may as well be those bodies, and nobody need be told
    unsure = replace(blocks[0], covariance=np.diag(np.full(len(theta), 0.1**2)))
    open_, silent = urdf_part(model, replace(found, effects=(unsure, blocks[1])), train)
    assert not any("nearest" in note for note in silent)
    np.testing.assert_allclose(open_.effects[0].theta, part.effects[0].theta)
    export_urdf(model, part, tmp_path / "extended.urdf")
    extended = RobotModel.from_urdf((tmp_path / "extended.urdf").read_text())
    for body_ in extended.pi.reshape(-1, 10):
        assert inertial_parameters.is_physical(body_)
    motion = train.motions[0]
    wanted = motion.regressor @ theta + motion.payload_regressor(model.default_frame) @ carried
    reached = extended.rnea_along(motion.q, motion.v, motion.a)
    assert np.sqrt(np.mean((reached - wanted) ** 2)) < 0.03
    assert np.sqrt(np.mean((motion.link_torque - wanted) ** 2)) > 0.3


def test_the_files_are_written_and_the_report_opens_without_a_network(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path, out = bag(tmp_path / "run", messages(5, 14.0)), tmp_path / "out"
    assert run(["diagnose", str(path), "--urdf", str(DATA / "small_arm.urdf"), "--out", str(out)]) == 0
    assert {p.name for p in out.iterdir()} == FILES
    document = json.loads((out / "diagnosis.json").read_text())
    assert [e["name"] for e in document["effects"]] == ["coulomb_friction"]
    page = (out / "report.html").read_text()
    body = page[page.index("<body>") :]
    assert "src=" not in body
    assert "<link" not in page
    for word in ("Coulomb friction", "The recorded motion held in simulation", "coherence", "noise floor", str(path)):
        assert word in body
    again = ModelFile.read(out / "model.yaml")
    np.testing.assert_allclose(again.effects[0].theta, 0.6, rtol=0.06)
    urdf = RobotModel.from_urdf((out / "extended.urdf").read_text())
    np.testing.assert_allclose(urdf.friction, 0.6, rtol=0.06)
    predictions = np.load(out / "predictions.npz")
    assert predictions["tau_extended"].shape == predictions["tau_measured"].shape == (len(predictions["t"]), 4)
    told = capfd.readouterr()
    assert "judging on held-out data" in told.err
    assert "Verdict: explained" in told.out
    # the diagnosis of a robot whose model is known finds nothing more
    known = ["--model", str(out / "model.yaml"), "--urdf", str(DATA / "small_arm.urdf"), "--out", str(tmp_path / "again")]
    assert run(["diagnose", str(path), *known]) == 0
    assert json.loads((tmp_path / "again" / "diagnosis.json").read_text())["verdict"] == "nothing_wrong"


@pytest.mark.slow
def test_all_else_is_written_where_no_urdf_can_hold_the_model(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> list[str]:
        raise ModelFileError("a link of it is no body.")

    monkeypatch.setattr("sysid_ros.cli.diagnose_output.export_urdf", refuse)
    path, out = bag(tmp_path / "run", messages(5, 14.0)), tmp_path / "out"
    assert run(["diagnose", str(path), "--urdf", str(DATA / "small_arm.urdf"), "--out", str(out)]) == 0
    assert {p.name for p in out.iterdir()} == FILES
    assert (out / "extended.urdf").read_text() == (DATA / "small_arm.urdf").read_text()
    assert "as it was given: a link of it is no body." in " ".join(capfd.readouterr().err.split())
