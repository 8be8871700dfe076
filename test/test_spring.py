"""A spring along a line rests somewhere on its joint: what does not is an offset of the measurement."""

from __future__ import annotations

import numpy as np
import pytest
from robots import robot
from test_diagnosis import ARM, record

from sysid_ros.diagnosis import diagnose
from sysid_ros.effects import Spring
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions

MODEL = robot(ARM)
LIFT, SLIDE = 1, 3


@pytest.mark.parametrize(
    ("theta", "std", "possible"),
    [
        ([3.0, 2.0], [0.1, 0.1], True),  # rests two thirds of a radian from zero
        ([3.0, 15.0], [0.1, 0.1], True),
        ([0.01, 100.0], [0.01, 0.1], False),  # ten thousand radians
        ([0.0, 0.5], [0.2, 0.2], True),  # not known well enough to be none
    ],
)
def test_a_spring_rests_within_a_turn(theta: list[float], std: list[float], possible: bool) -> None:
    spring = Spring(MODEL, [MODEL.joint_names[LIFT]])
    assert spring.possible(np.array(theta), np.array(std)) is possible


def test_a_joint_that_slides_has_no_balancer() -> None:
    moved = motions(MODEL, record(None, 1))
    shapes = {j: [c.settings["shape"] for c in Spring.candidates(moved, j)] for j in (LIFT, SLIDE)}
    assert shapes == {LIFT: ["line", "sine"], SLIDE: ["line"]}


@pytest.mark.slow
def test_a_large_offset_is_no_spring() -> None:
    def off(model: object, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
        return tau + 20.0

    found = diagnose(MODEL, [record(off, 2)])
    told = {f.id: f.joints for f in found.findings if (f.probability or 0.0) > 0.5}
    assert set(told["torque_offset"]) == set(MODEL.joint_names)
    assert "spring" not in told
