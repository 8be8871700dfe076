"""Torque that repeats with every tooth of a gear: of many teeth a turn, which only slow motion shows below the band's end."""

from __future__ import annotations

import numpy as np
import pytest
from robots import robot
from test_diagnosis import ARM, record

from sysid_ros.diagnosis import diagnose
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

SPEED = 0.15


@pytest.mark.slow
@pytest.mark.parametrize("teeth", [86.0, 202.0, 320.0])
def test_the_number_of_teeth_is_found(teeth: float) -> None:
    def meshes(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
        out = tau.copy()
        out[:, 0] += 0.4 * np.sin(teeth * q[:, 0] + 0.7)
        return out

    result = diagnose(robot(ARM), [record(meshes, 1, 20.0, speed=SPEED)], [record(meshes, 2, 12.0, speed=SPEED)])
    assert [f.id for f in result.findings] == ["cogging"]
    found = {p.name: p for p in result.findings[0].parameters}
    assert found["harmonic"].low <= teeth <= found["harmonic"].high
    assert found["harmonic"].value == pytest.approx(teeth, abs=0.2)
    assert found["amp"].value == pytest.approx(0.4, rel=0.02)
