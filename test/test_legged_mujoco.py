"""Robots on legs in MuJoCo: what they tell fulfils the equations of motion, and what the estimator says of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra mujoco)")
pytest.importorskip("pybullet", reason="the command needs PyBullet: pip install 'sysid_ros[sim]'")

from sysid_ros.cli.simulate import command
from sysid_ros.exceptions import SettingsError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.input_gate import gate_for
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.replay import Replay, replay
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.gait_sequence import MIXED, GaitSequence
from sysid_ros.simulation.legged_gait import LEGGED_GAITS
from sysid_ros.simulation.legged_ground import LeggedGround
from sysid_ros.simulation.legged_record import LeggedRecord, simulate_legged
from sysid_ros.simulation.legged_robot import LeggedRobot
from sysid_ros.simulation.legged_scenario import LeggedScenario
from sysid_ros.simulation.legged_simulation import LeggedSimulation
from sysid_ros.simulation.trunk_state import TrunkState
from sysid_ros.sources import BagSource

pytestmark = pytest.mark.skipif(packaged("go2") is None, reason="example-robot-data is not installed (extra dev)")
ROUGH: dict[str, Any] = {
    "robot": "go2",
    "leg_friction": 0.3,
    "leg_damping": 0.05,
    "rotor_inertia": 0.01,
    "encoder_step": 1e-4,
    "imu_rate": 250,
    "payload_mass": 3.0,
    "payload_com": (0.04, -0.02, 0.1),
}


def told(record: LeggedRecord, **settings: Any) -> tuple[OnlineEstimation, Replay]:
    legs = RobotModel.from_urdf(record.urdf)
    chosen = OnlineSettings(contact_frames=tuple(record.truth["contact_frames"]), **settings)
    estimation = OnlineEstimation(legs, chosen)
    return estimation, replay(list(record.records()), gate_for(legs, estimation.base, chosen), estimation)


@pytest.mark.parametrize("name", ["a1", "go1", "go2", "anymal", "hyq", "solo12"])
def test_every_robot_stands_level_on_the_ends_of_its_legs(name: str) -> None:
    if packaged(name) is None:
        pytest.skip(f"{name} is not packaged")
    robot = LeggedRobot.of(name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), True)
    assert np.ptp(robot.feet[:, 2]) < 0.02
    assert np.all(robot.posture >= robot.base.legs.position_lower)
    assert np.all(robot.posture <= robot.base.legs.position_upper)
    assert np.array_equal(FloatingBase(RobotModel.from_urdf(robot.urdf)).foot_radius, robot.radius)
    bare = LeggedRobot.of(name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), False)
    assert not bare.base.radius_told.any()


def test_a_standing_robot_weighs_what_its_feet_carry() -> None:
    record = simulate_legged(LeggedScenario(robot="go2", duration=1.0, payload_mass=3.0))
    force = np.array([state.forces for state in record.exact]).sum(axis=1).mean(axis=0)
    mass = FloatingBase(RobotModel.from_urdf(record.urdf)).mass + 3.0
    assert np.linalg.norm(force) == pytest.approx(9.81 * mass, rel=2e-3)
    felt = np.mean(np.array([reading.specific_force for reading in record.imu]), axis=0)
    assert np.linalg.norm(felt) == pytest.approx(9.81, abs=0.02)


def test_the_imu_has_its_own_rate_and_its_stamps_are_late() -> None:
    plain = simulate_legged(LeggedScenario(robot="go2", duration=1.0, imu_rate=250))
    late = simulate_legged(LeggedScenario(robot="go2", duration=1.0, imu_rate=250, imu_delay=0.01))
    assert len(plain.imu) == pytest.approx(250, abs=2)
    delays = [b.stamp - a.stamp for a, b in zip(plain.imu, late.imu, strict=True)]
    assert delays == pytest.approx([0.01] * len(delays))


@pytest.mark.slow
def test_rotors_and_friction_of_the_legs_are_found_beside_the_load_in_a_trot() -> None:
    record = simulate_legged(LeggedScenario(gait="trot", duration=8.0, seed=11, **ROUGH), start_time=1000.0)
    estimation, result = told(record)
    assert result.final.mass == pytest.approx(3.0, abs=min(0.15, 3.0 * result.final.mass_std))
    assert not result.events
    assert estimation.estimator is not None
    names = estimation._free.model.parameter_names
    hidden = record.truth["hidden"]["rotor_inertia"]
    found = {name[2:-1]: x for x, name in zip(estimation.estimator.theta, names, strict=True) if name.startswith("J[")}
    # knees are what a trot accelerates
    off = [found[joint] / x - 1.0 for joint, x in zip(record.truth["joint_names"], hidden, strict=True) if "calf" in joint]
    assert np.abs(off).max() < 0.2


@pytest.mark.slow
def test_a_load_that_is_put_on_and_taken_off_in_a_trot_is_seen_within_two_steps() -> None:
    scenario = LeggedScenario(gait="trot", duration=9.0, seed=12, pick_time=4.0, drop_time=6.5, **ROUGH)
    _, result = told(simulate_legged(scenario, start_time=1000.0))
    assert [event.kind for event in result.events] == ["pick", "drop"]
    assert [event.t - 1000.0 for event in result.events] == pytest.approx([4.0, 6.5], abs=0.3)


def test_standing_on_legs_that_rub_is_never_sure_and_wrong() -> None:
    _, result = told(simulate_legged(LeggedScenario(gait="stand", duration=6.0, seed=13, **ROUGH), start_time=1000.0))
    sure = [e for e in result.series if e.status == "ok"]
    assert all(abs(e.mass - 3.0) < 3.0 * e.mass_std for e in sure)
    assert result.final.mass_std > 0.05


@pytest.mark.slow
def test_feet_that_nobody_tells_are_estimated() -> None:
    scenario = LeggedScenario(gait="sway", duration=8.0, seed=14, foot_spheres=False, **ROUGH)
    estimation, result = told(simulate_legged(scenario, start_time=1000.0))
    assert any("foot_radius" in sentence for sentence in result.warnings)
    assert abs(result.final.mass - 3.0) < 3.0 * result.final.mass_std
    legs, estimator = estimation._free.legs, estimation.estimator
    assert legs is not None
    assert legs.radius is not None
    assert estimator is not None
    assert estimation.base is not None
    found = float(estimation.base.foot_radius[0] + estimator.theta[legs.radius][0])
    assert float(np.sqrt(estimator.covariance()[legs.radius, legs.radius][0, 0])) < 0.2 * estimation.base.radius_std
    assert found == pytest.approx(0.022, abs=0.008)


def test_an_imu_that_is_tilted_is_named() -> None:
    scenario = LeggedScenario(gait="sway", duration=8.0, seed=15, imu_tilt=(0.05, -0.04, 0.0), **ROUGH)
    _, result = told(simulate_legged(scenario, start_time=1000.0))
    assert any("IMU is turned" in sentence for sentence in result.warnings)
    assert abs(result.final.mass - 3.0) < 3.0 * result.final.mass_std


@pytest.mark.parametrize(
    ("gait", "delay"),
    [
        pytest.param("trot", 0.01, marks=pytest.mark.slow),
        pytest.param("trot", 0.02, marks=pytest.mark.slow),
        pytest.param("flying_trot", 0.01, marks=pytest.mark.slow),
    ],
)
def test_an_imu_whose_stamps_are_late_is_named_and_put_right(gait: str, delay: float) -> None:
    scenario = LeggedScenario(gait=gait, duration=13.0, seed=16, imu_delay=delay, **ROUGH)
    estimation, result = told(simulate_legged(scenario, start_time=1000.0))
    assert any("ms late against the joints; its stamps are corrected" in sentence for sentence in result.warnings)
    assert estimation.base is not None
    legs, estimator = estimation._free.legs, estimation.estimator
    assert legs is not None
    assert legs.delay is not None
    assert estimator is not None
    left = float(estimator.theta[legs.delay][0])
    assert estimation.base.setup.delay + left == pytest.approx(delay, abs=1.5e-3)
    assert result.final.status == "ok"
    assert abs(result.final.mass - 3.0) < 3.0 * result.final.mass_std
    assert not result.events


def walked(**settings: Any) -> tuple[LeggedRecord, list[TrunkState]]:
    """A recording, and the trunk at each of its messages."""
    simulation = LeggedSimulation(LeggedScenario(**{**ROUGH, **settings}))
    exact, trunks = [], []
    for state, _ in simulation.run(None):
        exact.append(state)
        trunks.append(simulation.world.trunk)
    return LeggedRecord([], exact, [], 0.0, simulation.truth(), simulation.urdf), trunks


def heading(trunk: TrunkState) -> float:
    return float(np.arctan2(trunk.rotation[1, 0], trunk.rotation[0, 0]))


def test_a_crawl_goes_ahead_and_lifts_one_foot_at_a_time() -> None:
    record, trunks = walked(gait="crawl", duration=8.0, seed=1)
    standing = np.array([state.contacts for state in record.exact]).sum(axis=1)
    assert np.mean(standing >= 3) > 0.9
    assert np.mean(standing == 3) > 0.2
    assert np.hypot(*(trunks[-1].position - trunks[0].position)[:2]) > 0.05


def test_a_turn_stays_on_the_spot() -> None:
    _, trunks = walked(gait="turn", duration=4.0, seed=1)
    assert abs(heading(trunks[-1]) - heading(trunks[0])) > 0.5
    assert np.hypot(*(trunks[-1].position - trunks[0].position)[:2]) < 0.1


@pytest.mark.parametrize("robot", ["go2", "anymal"])
@pytest.mark.parametrize("sink", [0.005, 0.02])
def test_feet_sink_into_soft_ground_as_far_as_is_asked(robot: str, sink: float) -> None:
    if packaged(robot) is None:
        pytest.skip(f"{robot} is not packaged")
    hard, soft = (LeggedSimulation(LeggedScenario(robot=robot, duration=1.0, sink=depth)) for depth in (0.0, sink))
    heights = []
    for simulation in (hard, soft):
        for _ in simulation.run(None):
            pass
        heights.append(simulation.world.trunk.position[2])
    assert heights[0] - heights[1] == pytest.approx(sink, rel=0.25)


def test_stairs_are_climbed() -> None:
    ground = LeggedGround(rise=0.04)
    assert [round(ground.height(x), 3) for x in (0.0, 0.6, -0.6, 1.5, 1.8, 2.7)] == [0.0, 0.04, 0.04, 0.16, 0.12, 0.0]
    tops = {(round(float(c[0]), 3), round(float(c[2] + h[2]), 3)) for c, h in ground.boxes()}
    assert all(ground.height(x) == pytest.approx(top) for x, top in tops)
    _, trunks = walked(gait="trot", duration=7.0, seed=1, stairs=0.04, speed=0.4)
    assert max(trunk.position[2] for trunk in trunks) > trunks[0].position[2] + 0.03


def test_feet_slip_on_slippery_ground() -> None:
    """What a foot is pushed by along the ground is at most its grip times the force across it."""
    record, _ = walked(gait="trot", duration=3.0, seed=1, grip=0.25)
    forces = np.array([state.forces for state in record.exact]).reshape(-1, 3)
    pressed = forces[forces[:, 2] > 20.0]
    along = np.hypot(pressed[:, 0], pressed[:, 1]) / pressed[:, 2]
    assert np.quantile(along, 0.9) < 0.35
    assert np.quantile(along, 0.9) > 0.15


@pytest.mark.slow
def test_all_gaits_in_turn_begin_and_end_without_a_jump() -> None:
    rng = np.random.default_rng(3)
    feet = LeggedRobot.of("go2", (0.0,) * 3, (0.0,) * 3, True).feet
    gaits, seen, before = GaitSequence(MIXED, feet, rng, 1.0, 0.2), set(), feet
    for k in range(1, 120_000):
        places = gaits.places(1e-3 * k, 1e-3, np.zeros(2), np.zeros(2))
        # feet swing at a few metres a second
        assert np.abs(places - before).max() < 0.01
        before = places
        seen.add(gaits.name)
    assert seen == set(LEGGED_GAITS)


@pytest.mark.slow
def test_a_load_that_slips_in_a_trot_is_a_change_within_two_steps() -> None:
    scenario = LeggedScenario(gait="trot", duration=10.0, seed=12, shift_time=6.0, **ROUGH)
    record = simulate_legged(scenario, start_time=1000.0)
    assert [e["kind"] for e in record.truth["events"]] == ["pick", "shift"]
    _, result = told(record)
    assert [event.kind for event in result.events] == ["change"]
    assert result.events[0].t - 1000.0 == pytest.approx(6.0, abs=0.4)
    off = np.abs(result.final.theta - np.array(record.truth["shifted"]["theta"]))
    assert np.all(off[:3] < 3.0 * result.final.std[:3])
    assert np.all(result.final.std[1:3] < 0.4 * 3.0 * 0.05)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"robot": "nobody"}, "robot is nobody"),
        ({"gait": "fly"}, "gait is fly"),
        ({"imu_rate": 333}, "imu_rate is 333"),
        ({"leg_friction": -1.0}, "leg_friction is -1.0"),
        ({"grip": 0.0}, "grip is 0.0"),
        ({"sink": 0.2}, "sink is 0.2"),
        ({"stairs": -0.1}, "stairs is -0.1"),
        ({"shift_time": 0.5}, "shift_time is 0.5"),
        ({"lifted_foot": "FR_toe"}, "lifted_foot is FR_toe"),
    ],
)
def test_what_can_not_be_simulated_is_said(settings: dict[str, Any], named: str) -> None:
    with pytest.raises(SettingsError, match=named):
        simulate_legged(LeggedScenario(**{"duration": 1.0, **settings}))


def test_the_command_refuses_options_of_the_other_simulator(tmp_path: Path) -> None:
    bag = ["quadruped", "--bag", str(tmp_path / "bag")]
    with pytest.raises(SettingsError, match="--robot"):
        CliRunner().invoke(command, [*bag, "--robot", "go2"], catch_exceptions=False)
    with pytest.raises(SettingsError, match="--hoist"):
        CliRunner().invoke(command, [*bag, "--simulator", "mujoco", "--hoist", "1"], catch_exceptions=False)


def test_the_command_writes_a_bag(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    arguments = [
        "quadruped",
        "--bag",
        str(bag),
        "--simulator",
        "mujoco",
        "--robot",
        "go2",
        "--duration",
        "1",
        "--imu-rate",
        "250",
    ]
    assert CliRunner().invoke(command, arguments, catch_exceptions=False).exit_code == 0
    truth = json.loads((tmp_path / "bag.truth.json").read_text())
    assert truth["simulator"] == "mujoco"
    assert truth["settings"]["imu_rate"] == 250
    assert len(list(BagSource(bag))) == 500
