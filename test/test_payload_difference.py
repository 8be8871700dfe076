"""A payload as the difference of two runs: found within its interval, a body that can exist, in whatever frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arm_recordings import hidden_parameters, recorded
from robots import random_body, robot, urdf, with_body

from sysid_ros.exceptions import DataError, RobotModelError
from sysid_ros.identification import collect_rows, free_model
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import Fit, fit
from sysid_ros.identification.payload_difference import PayloadDifference, payload_difference
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel

MODEL = robot("iiwa")
UR10E = Path(__file__).resolve().parents[2] / "shared" / "data" / "ur10e"


def fitted(theta: FloatArray, seed: int, **options: float) -> Fit:
    model, prior = free_model(MODEL), Prior.of(free_model(MODEL))
    rows = collect_rows(model, recorded(MODEL, theta, seed, seconds=20.0, **options), "")  # type: ignore[arg-type]
    return fit([rows], prior.mean, prior.std)


def loaded(theta: FloatArray, payload: FloatArray, friction: float = 1.0) -> FloatArray:
    """The arm with a payload on its last link, and other friction."""
    out = theta.copy()
    n = MODEL.n
    out[10 * n - 10 : 10 * n] += payload
    out[10 * n : 12 * n] *= friction
    return out


@pytest.fixture(scope="module")
def arm() -> tuple[TorqueModel, FloatArray, Fit]:
    truth = hidden_parameters(MODEL, 2)
    return free_model(MODEL), truth, fitted(truth, 2)


def inside(found: PayloadDifference, payload: FloatArray) -> FloatArray:
    return np.asarray((found.theta - payload) / np.sqrt(np.diag(found.covariance)))


def test_a_payload_is_found_though_friction_has_changed(arm: tuple[TorqueModel, FloatArray, Fit]) -> None:
    model, truth, empty = arm
    errors = []
    for seed, friction in ((11, 1.0), (12, 1.2), (13, 0.85)):
        mass, com, inertia = random_body(np.random.default_rng(seed))
        payload = inertial_parameters.from_com(mass, com, inertia)
        found = payload_difference(model, empty, fitted(loaded(truth, payload, friction), seed))
        assert found.frame == MODEL.default_frame
        assert inertial_parameters.is_physical(found.theta)
        assert found.consistent
        assert found.covariance.shape == (10, 10)
        assert found.com.shape == found.com_std.shape == (3,)
        assert found.inertia_com.shape == (3, 3)
        assert found.mass == pytest.approx(mass, abs=4.0 * found.mass_std)
        assert found.mass_std < 0.05
        assert np.all(np.abs(found.com - com) < 4.0 * found.com_std)
        errors.append(inside(found, payload))
    assert np.mean(np.abs(errors) < 1.96) > 0.8


def test_no_payload_weighs_nothing(arm: tuple[TorqueModel, FloatArray, Fit]) -> None:
    model, truth, empty = arm
    found = payload_difference(model, empty, fitted(truth, 5))
    assert abs(found.mass) < 3.0 * found.mass_std + 0.01
    assert inertial_parameters.is_physical(found.theta)
    assert found.consistent


def test_what_was_taken_off_is_no_payload(arm: tuple[TorqueModel, FloatArray, Fit]) -> None:
    """Runs given in the wrong order: the difference can't exist, and that is said."""
    model, truth, empty = arm
    payload = inertial_parameters.from_com(1.5, np.array([0.02, 0.01, 0.1]), 0.003 * np.eye(3))
    found = payload_difference(model, fitted(loaded(truth, payload), 3), empty)
    assert not found.consistent
    assert found.free[0] == pytest.approx(-1.5, abs=0.1)
    assert inertial_parameters.is_physical(found.theta)


def test_frames_that_carry_nothing_are_named(arm: tuple[TorqueModel, FloatArray, Fit]) -> None:
    model, _, empty = arm
    with pytest.raises(RobotModelError, match="nowhere"):
        payload_difference(model, empty, empty, "nowhere")
    with pytest.raises(DataError, match="frame that some joint moves"):
        payload_difference(model, empty, empty, MODEL.frame_names[0])
    links_known = TorqueModel(MODEL, model.free[1:])
    with pytest.raises(DataError, match="all free"):
        payload_difference(links_known, empty, empty)


def test_the_frame_is_only_a_view() -> None:
    """The same body, given in the frame of a link welded on askew."""
    text = with_body(urdf("small_arm"), robot("small_arm").default_frame, 0.01, np.zeros(3), 1e-6 * np.eye(3))
    text = text.replace(
        '<joint name="weld" type="fixed">', '<joint name="weld" type="fixed"><origin xyz="0.1 0 0" rpy="0.3 -1 2"/>'
    )
    arm = RobotModel.from_urdf(text)
    model = free_model(arm)
    truth, prior = hidden_parameters(arm, 1), Prior.of(model)
    payload = inertial_parameters.from_com(1.2, np.array([0.05, 0.02, 0.08]), 0.003 * np.eye(3))
    carrying = truth.copy()
    carrying[10 * arm.n - 10 : 10 * arm.n] += payload
    empty, full = [
        fit([collect_rows(model, recorded(arm, theta, 3, seconds=15.0, torque_noise=0.02), "")], prior.mean, prior.std)
        for theta in (truth, carrying)
    ]
    plain, askew = (payload_difference(model, empty, full, frame) for frame in (arm.default_frame, "welded_body"))
    placed = arm.model.frames[arm.frame_id("welded_body")].placement
    moved = inertial_parameters.move(askew.theta, np.array(placed.rotation), np.array(placed.translation))
    assert not np.allclose(placed.translation, 0.0)
    np.testing.assert_allclose(moved[:4], plain.theta[:4], atol=0.01)
    np.testing.assert_allclose(plain.theta[:4], payload[:4], atol=0.02)


@pytest.mark.parametrize(
    ("run", "mass", "part"), [("fourier14_load", 2.805, 0.05), pytest.param("fast20_load", 1.069, 0.05, marks=pytest.mark.slow)]
)
def test_payloads_of_a_real_arm(run: str, mass: float, part: float) -> None:
    if not UR10E.is_dir():
        pytest.skip("the measured data are not beside the project")
    from sysid_ros.cli.inputs import open_bag
    from sysid_ros.identification import Recording
    from sysid_ros.input_gate import InputGate
    from sysid_ros.online_settings import OnlineSettings
    from sysid_ros.sample import Measurement

    fits, settings = [], OnlineSettings()
    for names in (("fourier14_noload", "fast20_noload"), (run,)):
        rows = []
        for name in names:
            source, arm = open_bag(UR10E / name, "/joint_states", UR10E / "ur10e.urdf", settings)
            gate = InputGate(arm, settings)
            recording = Recording.from_measurements(name, (m for m in map(gate.accept, source) if isinstance(m, Measurement)))
            rows.append(collect_rows(free_model(arm), recording, name, 5.0))
        prior = Prior.of(free_model(arm))
        fits.append(fit(rows, prior.mean, prior.std))
    found = payload_difference(free_model(arm), fits[0], fits[1])
    assert found.mass == pytest.approx(mass, rel=part)
    assert found.consistent
