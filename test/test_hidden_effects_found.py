"""What a simulated robot hides is found: a dozen of the exam (``make exam`` has the rest)."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")
pytest.importorskip("mujoco", reason="the second simulator needs MuJoCo: pip install 'sysid_ros[dev]'")
pytest.importorskip("sysid_ros.diagnosis", reason="the diagnosis is not part of this installation")

from exam.__main__ import sit
from exam.arms import all_there

pytestmark = [
    pytest.mark.slow,
    pytest.mark.long,
    pytest.mark.skipif(not all_there(), reason="the arms of the exam need: pip install example-robot-data"),
]

HIDDEN = (
    "payload", "link_inertia", "rotor_inertia", "viscous_friction", "coulomb_friction", "asymmetric_coulomb_friction",
    "torque_offset", "torque_scale", "joint_offset", "base_tilt", "time_delay", "spring",
)  # fmt: skip
IN_MUJOCO = ("coulomb_friction", "base_tilt")
SEED = 400

each = pytest.mark.parametrize("id_", HIDDEN)


@cache
def row_of(id_: str) -> dict[str, Any]:
    """A case drawn, diagnosed and marked."""
    row: dict[str, Any] = sit(SEED + HIDDEN.index(id_), "single", id_, "mujoco" if id_ in IN_MUJOCO else "compiled")
    return row


@each
def test_the_cause_is_named_first_and_on_its_joints(id_: str) -> None:
    row = row_of(id_)
    assert row["right"], row["named"]
    # None where it is named by another name of the same torque, as the sum of two effects is
    assert row["joints"] is not False, row["effects"]


@each
def test_the_extended_model_predicts_another_motion(id_: str) -> None:
    assert row_of(id_)["after"] < 0.6 * row_of(id_)["before"]


def test_what_is_left_of_another_motion_is_noise() -> None:
    assert np.median([row_of(id_)["after"] for id_ in HIDDEN]) < 1.2


def test_little_else_is_named() -> None:
    assert np.mean([row_of(id_)["exact"] for id_ in HIDDEN]) > 0.8


def test_sizes_are_inside_their_intervals() -> None:
    inside = [covered for id_ in HIDDEN for _, covered in row_of(id_)["sizes"]]
    assert len(inside) >= len(HIDDEN)
    assert np.mean(inside) > 0.75
