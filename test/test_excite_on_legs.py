"""``sysid excite`` of a robot on legs: the trunk moves, feet stay and press, limits hold, and more is told than by a sway."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sysid_ros.cli.main import run
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.motion_limits import MotionLimits
from sysid_ros.excitation.trunk_dynamics import TrunkDynamics
from sysid_ros.excitation.trunk_limits import TrunkLimits
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.planted_feet import PlantedFeet
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray

mujoco = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def feet() -> PlantedFeet:
    path = packaged("go2")
    if path is None:
        pytest.skip("example-robot-data is not installed")
    return PlantedFeet(FloatingBase(RobotModel.from_urdf(path.read_text())))


def moved(t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    size, w = np.array([0.03, 0.02, 0.02, 0.1, 0.12, 0.1]), 2.0 * np.pi * np.array([0.3, 0.5, 0.7, 0.6, 0.4, 0.5])
    phase = np.outer(t, w) + np.arange(FREE)
    return size * np.sin(phase), size * w * np.cos(phase), -size * w**2 * np.sin(phase)


def test_velocities_and_accelerations_are_those_of_the_positions(feet: PlantedFeet) -> None:
    t, h = np.linspace(0.0, 2.0, 30), 1e-4
    pose, velocity, acceleration = moved(t)
    placed = feet.placed(pose)
    _, v, a = feet.states(placed, velocity, acceleration)
    before, now, after = (feet.joints(moved(t + x)[0])[0] for x in (-h, 0.0, h))
    assert placed.miss.max() < 1e-9
    # rolling of feet whose legs turn about changing axes is held to first order
    assert v[:, FREE:] == pytest.approx((after - before) / (2.0 * h), abs=0.01 * np.abs(v[:, FREE:]).max())
    assert a[:, FREE:] == pytest.approx((after - 2.0 * now + before) / h**2, abs=0.01 * np.abs(a[:, FREE:]).max())


def test_forces_of_the_feet_carry_the_robot(feet: PlantedFeet) -> None:
    dynamics = TrunkDynamics(feet)
    states = dynamics.of(*moved(np.linspace(0.0, 2.0, 20)))
    robot = feet.base.robot
    for i in range(20):
        wrench = robot.rnea(*(x[i] for x in states.motion))
        J = states.poses.placed.points[i]
        torque = np.concatenate([np.zeros(FREE), states.torque[i]])
        forces = np.linalg.lstsq(J.reshape(-1, robot.n).T, wrench - torque, rcond=None)[0].reshape(-1, 3)
        assert np.einsum("kan,ka->n", J, forces) + torque == pytest.approx(wrench, abs=1e-6)
        assert forces @ states.poses.placed.normal[i] == pytest.approx(states.up[i], abs=1e-6)


def test_standing_keeps_all_limits_and_a_fall_forward_does_not(feet: PlantedFeet) -> None:
    settings = ExcitationSettings()
    limits = TrunkLimits(TrunkDynamics(feet), MotionLimits(feet.base.legs, settings), settings)
    still = np.zeros((1, FREE))
    assert limits.most(still, still, still).max() < 1.0
    pushed = np.zeros((1, FREE))
    pushed[0, 0] = 2.0 * settings.foot_friction * 9.81
    cones = limits.most(still, still, pushed)[-2 * len(feet.legs) : -len(feet.legs)]
    assert cones.max() > 1.0


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory, feet: PlantedFeet) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("legs")
    out = ["--out", str(folder / "sway.yaml"), "--trunk", str(folder / "trunk.yaml"), "--json", str(folder / "out.json")]
    size = ["--duration", "4", "--harmonics", "2", "--starts", "1", "--comparison", "1"]
    assert run(["excite", "--robot", "go2", *out, "--plot", str(folder / "sway.png"), *size]) == 0
    document: dict[str, Any] = json.loads((folder / "out.json").read_text())
    return folder, document


@pytest.mark.slow
def test_the_motion_keeps_its_limits_and_tells_more_than_random_ones(done: tuple[Path, dict[str, Any]]) -> None:
    folder, document = done
    assert all(0.0 <= np.max(values) <= 1.0 for values in document["use"].values())
    assert document["criteria"]["after"]["d"] > document["criteria"]["before_best"]["d"]
    motion, trunk = (yaml.safe_load((folder / name).read_text()) for name in ("sway.yaml", "trunk.yaml"))
    assert len(motion["points"]) == len(trunk["points"])
    for end in (motion["points"][0], motion["points"][-1]):
        assert end["positions"] == pytest.approx(document["motion"]["start"], abs=1e-5)
        assert end["velocities"] == pytest.approx(np.zeros(12), abs=1e-3)
    assert (folder / "sway.png").stat().st_size > 10_000


@pytest.mark.slow
def test_a_robot_in_mujoco_follows_it_and_stays_on_all_feet(done: tuple[Path, dict[str, Any]]) -> None:
    from sysid_ros.simulation.legged_record import simulate_legged
    from sysid_ros.simulation.legged_scenario import LeggedScenario

    record = simulate_legged(LeggedScenario(robot="go2", motion=str(done[0] / "sway.yaml"), duration=4.0))
    assert all(np.all(state.contacts == 1.0) for state in record.exact)
    points = yaml.safe_load((done[0] / "sway.yaml").read_text())["points"]
    wanted = np.array([p["positions"] for p in points])
    followed = np.array([state.q for state in record.exact[:: round(len(record.exact) / (len(points) - 1))]])
    count = min(len(wanted), len(followed))
    assert np.abs(followed[:count] - wanted[:count]).max() < 0.25
