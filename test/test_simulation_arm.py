"""The simulated arm: what it records is what rigid-body dynamics say, and the payload that it hides is in the torques."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")

from sysid_ros.exceptions import SettingsError
from sysid_ros.robot.inertial_parameters import is_physical, to_com
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation import ArmRecord, ArmScenario, ArmSimulation, ExcitingTrajectory, simulate_arm
from sysid_ros.simulation.arm import ArmWorld
from sysid_ros.simulation.description import HOME, TIP_LINK, arm_description
from sysid_ros.simulation.payload import box, urdf_with_payload

LOADED = ArmScenario(
    seed=3,
    duration=7.0,
    payload_mass=1.5,
    payload_com=(0.05, -0.03, 0.08),
    payload_rpy=(0.3, -0.2, 0.5),
    pick_time=2.0,
    drop_time=6.0,
)
RUBBING = ArmScenario(
    seed=4,
    duration=4.0,
    viscous_friction=(0.8,),
    coulomb_friction=(1.0, 1.0, 0.8, 0.8, 0.4, 0.4, 0.3),
    rotor_inertia=(0.2,),
    torque_offset=(0.3,),
)


@pytest.fixture(scope="module")
def loaded() -> ArmRecord:
    return simulate_arm(LOADED)


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return RobotModel.from_urdf(arm_description())


def centred(record: ArmRecord) -> tuple[np.ndarray, ...]:
    """t, q, v, a, tau of the exact record, derivatives by central differences."""
    q, h = record.exact_q, 1.0 / record.truth["rate"]
    v = (q[2:] - q[:-2]) / (2.0 * h)
    a = (q[2:] - 2.0 * q[1:-1] + q[:-2]) / h**2
    return record.t[1:-1], q[1:-1], v, a, record.exact_tau[1:-1]


def carried(record: ArmRecord, t: np.ndarray) -> np.ndarray:
    return np.asarray((t >= record.truth["pick_time"]) & (t < record.truth["drop_time"]))


def test_pybullet_and_pinocchio_have_the_same_inverse_dynamics(robot: RobotModel) -> None:
    world = ArmWorld(arm_description(), TIP_LINK)
    rng = np.random.default_rng(0)
    assert world.joint_names == robot.joint_names
    assert robot.default_frame == TIP_LINK
    for _ in range(50):
        q, v, a = rng.uniform(-2.0, 2.0, 7), rng.uniform(-2.0, 2.0, 7), rng.uniform(-10.0, 10.0, 7)
        expected = robot.rnea(q, v, a)
        assert np.abs(world.inverse_dynamics(q, v, a) - expected).max() < 1e-9 * np.abs(expected).max()
    world.close()


def test_recorded_torque_is_the_inverse_dynamics_of_the_recorded_motion(loaded: ArmRecord, robot: RobotModel) -> None:
    assert LOADED.payload is not None
    full = RobotModel.from_urdf(urdf_with_payload(loaded.urdf, TIP_LINK, LOADED.payload))
    t, q, v, a, tau = centred(loaded)
    on = carried(loaded, t)
    error = tau - np.array([(full if c else robot).rnea(*x) for c, *x in zip(on, q, v, a, strict=True)])
    assert np.sqrt(np.mean(error**2, axis=0)).max() < 0.006
    # a skew d between torque and motion would leave d * dtau/dt
    rate = np.gradient(tau, t, axis=0)
    calm = np.abs(rate).max(axis=1) < 500.0
    assert abs(np.sum((error * rate)[calm]) / np.sum(rate[calm] ** 2)) < 5e-5


def test_velocity_of_the_message_belongs_to_its_position(loaded: ArmRecord) -> None:
    _, _, v, _, _ = centred(loaded)
    assert np.abs(loaded.exact_v[1:-1] - v).max() < 1e-9


def test_torques_show_the_ten_parameters_of_the_body(loaded: ArmRecord, robot: RobotModel) -> None:
    t, q, v, a, tau = centred(loaded)
    frame = robot.frame_id(loaded.truth["frame"])
    use = np.flatnonzero(carried(loaded, t))[10::3]
    columns = np.vstack([robot.payload_regressor(q[k], v[k], a[k], frame) for k in use])
    rows = np.concatenate([tau[k] - robot.rnea(q[k], v[k], a[k]) for k in use])
    theta = np.linalg.lstsq(columns, rows, rcond=None)[0]
    mass, com, inertia = to_com(theta)
    assert mass == pytest.approx(loaded.truth["payload"]["mass"], rel=5e-4)
    assert np.abs(com - loaded.truth["payload"]["com"]).max() < 2e-4
    assert np.abs(inertia - loaded.truth["payload"]["inertia_com"]).max() < 3e-4
    assert theta == pytest.approx(np.array(loaded.truth["payload"]["theta"]), abs=2e-3)


def test_the_pick_is_no_impact_and_the_tied_body_does_not_slip() -> None:
    simulation = ArmSimulation(dataclasses.replace(LOADED, pick_time=1.5, drop_time=None))
    velocities: list[FloatArray] = []
    body = LOADED.payload
    assert body is not None
    while simulation.t < 2.5:
        state = simulation.step()
        assert state.v is not None
        velocities.append(state.v)
        if simulation.carries:
            assert simulation.world.body.slip(body) < 1e-4
    simulation.close()
    assert np.abs(np.diff(velocities, axis=0)).max() < 0.2


def test_pick_and_drop_by_hand() -> None:
    simulation = ArmSimulation(dataclasses.replace(LOADED, duration=np.inf, pick_time=np.inf, drop_time=None))
    assert not simulation.drop()
    for _ in range(5):
        simulation.step()
    assert simulation.pick()
    assert not simulation.pick()
    simulation.step()
    assert simulation.drop()
    assert simulation.events == [(0.005, "pick"), (0.006, "drop")]
    assert simulation.pick()
    simulation.step()
    assert simulation.carries
    simulation.close()


def test_friction_rotor_and_offset_are_in_the_torques(robot: RobotModel) -> None:
    record = simulate_arm(RUBBING)
    effects = {name: np.array(values) for name, values in record.truth["effects"].items()}
    _, q, v, a, tau = centred(record)
    links = np.array([robot.rnea(*x) for x in zip(q, v, a, strict=True)])
    drive = effects["viscous_friction"] * v + effects["coulomb_friction"] * np.sign(v) + effects["rotor_inertia"] * a
    error = (tau - links - drive - effects["torque_offset"])[np.abs(v) > 0.01]
    assert np.abs(error).max() < 0.02


def test_friction_never_gives_power_and_a_resting_joint_sticks() -> None:
    simulation = ArmSimulation(
        dataclasses.replace(RUBBING, coulomb_friction=(200.0,), viscous_friction=(0.0,), rotor_inertia=(0.0,))
    )
    states = [simulation.step() for _ in range(200)]
    simulation.close()
    assert np.abs(np.array([s.v for s in states])).max() < 1e-6


def test_noise_is_what_was_asked_for_and_does_not_change_the_motion(loaded: ArmRecord) -> None:
    assert np.std(loaded.tau - loaded.exact_tau) == pytest.approx(0.1, rel=0.02)
    assert np.std(loaded.q - loaded.exact_q) == pytest.approx(1e-5, rel=0.02)
    assert loaded.v is not None
    assert np.std(loaded.v - loaded.exact_v) == pytest.approx(1e-3, rel=0.02)
    quiet = simulate_arm(dataclasses.replace(LOADED, duration=7.0, torque_noise=0.0, encoder_noise=0.0, velocity=False))
    assert quiet.v is None
    assert np.array_equal(quiet.exact_q, loaded.exact_q)
    assert np.array_equal(quiet.tau, loaded.exact_tau)


def test_seed_decides_everything() -> None:
    short = dataclasses.replace(LOADED, duration=2.0, pick_time=1.0, drop_time=None, rate=250)
    one, again, other = simulate_arm(short), simulate_arm(short), simulate_arm(dataclasses.replace(short, seed=9))
    assert np.array_equal(one.q, again.q)
    assert np.array_equal(one.tau, again.tau)
    assert not np.allclose(one.q, other.q)
    assert one.q.shape == one.tau.shape == (500, 7)
    assert np.diff(one.t) == pytest.approx(np.full(499, 0.004))


@pytest.mark.parametrize("seed", range(5))
def test_motion_stays_within_its_limits_and_begins_and_ends_at_rest(seed: int, robot: RobotModel) -> None:
    rng = np.random.default_rng(seed)
    motion = ExcitingTrajectory(np.array(HOME), robot.position_lower, robot.position_upper, rng, duration=12.0)
    t = np.arange(0.0, 12.0005, 1e-3)
    q, v, a = motion.sample(t)
    assert np.all((q > robot.position_lower) & (q < robot.position_upper))
    assert np.abs(v).max() <= 1.5 * 1.001
    assert np.abs(a).max() <= 6.0 * 1.001
    assert np.abs(np.gradient(q, t, axis=0) - v)[1:-1].max() < 1e-4
    assert np.abs(np.gradient(v, t, axis=0) - a)[1:-1].max() < 1e-2
    assert np.abs(v[[0, -1]]).max() < 1e-9
    assert np.abs(a[[0, -1]]).max() < 1e-9


def test_motion_is_shrunk_until_the_effort_fits(robot: RobotModel) -> None:
    motion = ExcitingTrajectory(np.array(HOME), robot.position_lower, robot.position_upper, np.random.default_rng(0))
    assert motion.limit_effort(robot.rnea, robot.effort_limit) == 1.0
    assert motion.limit_effort(robot.rnea, np.full(7, 55.0)) < 1.0
    with pytest.raises(SettingsError, match="effort limit"):
        motion.limit_effort(robot.rnea, np.full(7, 10.0))


def test_payload_is_a_physical_body_and_the_urdf_holds_it(robot: RobotModel) -> None:
    payload = box(2.0, (0.1, 0.0, 0.05), (0.2, 0.1, 0.05), (0.4, 0.1, -0.7))
    assert is_physical(payload.theta)
    moments, axes = payload.principal()
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes @ np.diag(moments) @ axes.T == pytest.approx(payload.inertia_com)
    full = RobotModel.from_urdf(urdf_with_payload(arm_description(), TIP_LINK, payload))
    rng = np.random.default_rng(1)
    q, v, a = rng.uniform(-1.0, 1.0, (3, 7))
    by_columns = robot.payload_regressor(q, v, a, robot.frame_id(TIP_LINK)) @ payload.theta
    assert full.rnea(q, v, a) - robot.rnea(q, v, a) == pytest.approx(by_columns, abs=1e-9)


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        ({"payload_mass": -1.0}, "payload_mass is -1"),
        ({"payload_mass": 0.0}, "leave it out"),
        ({"payload_mass": 1.0, "payload_com": (0.0, float("nan"), 0.0)}, "payload_com"),
        ({"payload_mass": 1.0, "payload_size": (0.1, 0.0, 0.1)}, "positive edges"),
        ({"payload_mass": 1.0, "pick_time": 20.0}, "pick_time is 20"),
        ({"payload_mass": 1.0, "pick_time": 5.0, "drop_time": 4.0}, "drop_time is 4"),
        ({"payload_mass": 1.0, "drop_time": 16.0}, "drop_time is 16"),
        ({"pick_time": 5.0}, "payload_mass is missing"),
        ({"rate": 300}, "divisor of 1000"),
        ({"duration": 0.0}, "duration is 0"),
        ({"seed": -1}, "seed is -1"),
        ({"torque_noise": -0.1}, "torque_noise"),
        ({"coulomb_friction": (0.1, -0.1)}, "coulomb_friction"),
    ],
)
def test_bad_scenario(settings: dict[str, object], match: str) -> None:
    with pytest.raises(SettingsError, match=match):
        ArmScenario(**settings)  # type: ignore[arg-type]


def test_wrong_number_of_joint_values_and_a_payload_that_pulls_the_arm_away() -> None:
    with pytest.raises(SettingsError, match="1 value for all joints or 7"):
        simulate_arm(ArmScenario(viscous_friction=(1.0, 2.0)))
    with pytest.raises(SettingsError, match="away from the motion"):
        simulate_arm(ArmScenario(duration=1.5, payload_mass=20.0, payload_com=(1.0, 1.0, 1.0)))
