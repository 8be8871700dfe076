"""Identified models are physical, and cost little of what the unconstrained fit predicts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from arm_recordings import hidden_parameters, recorded, require_physical
from robots import robot

from sysid_ros.identification import Choices, Identification, Recording, free_model, identify_recordings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.urdf_export import check_model_file, export_urdf

UR10E = Path(__file__).resolve().parents[2] / "shared" / "data" / "ur10e"


def both(arm: RobotModel, bags: list[Recording], checks: list[Recording]) -> tuple[Identification, Identification]:
    return (
        identify_recordings(arm, bags, checks, {}, Choices(physical=True), 5.0),
        identify_recordings(arm, bags, checks, {}, Choices(physical=False), 5.0),
    )


def judge(arm: RobotModel, physical: Identification, free: Identification, folder: Path) -> None:
    require_physical(free_model(arm), physical.theta)
    assert physical.physical is not None
    for mine, other in zip(physical.validation, free.validation, strict=True):
        np.testing.assert_array_less(mine.residual, 1.05 * other.residual)
    physical.model.write(folder / "model.yaml")
    check_model_file(arm, physical.model, folder / "model.yaml")
    export_urdf(arm, physical.model, folder / "arm.urdf")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 8))
@pytest.mark.parametrize("colour", [0.0, 0.98])
def test_simulated_arms(seed: int, colour: float, tmp_path: Path) -> None:
    arm = robot("iiwa" if seed % 2 else "small_arm")
    truth = hidden_parameters(arm, seed)
    runs = [recorded(arm, truth, seed + 10 * k, seconds=15.0, colour=colour) for k in range(2)]
    judge(arm, *both(arm, runs[:1], runs[1:]), tmp_path)


@pytest.mark.slow
def test_a_real_arm(tmp_path: Path) -> None:
    if not UR10E.is_dir():
        pytest.skip("the measured data are not beside the project")
    from sysid_ros.cli.inputs import open_bag
    from sysid_ros.input_gate import InputGate
    from sysid_ros.online_settings import OnlineSettings
    from sysid_ros.sample import Measurement

    recordings, settings = [], OnlineSettings()
    for name in ("fourier14_noload", "fast20_noload"):
        source, arm = open_bag(UR10E / name, "/joint_states", UR10E / "ur10e.urdf", settings)
        gate = InputGate(arm, settings)
        recordings.append(Recording.from_measurements(name, (m for m in map(gate.accept, source) if isinstance(m, Measurement))))
    judge(arm, *both(arm, recordings[:1], recordings[1:]), tmp_path)
