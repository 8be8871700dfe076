"""Friction that the URDF states and the robot has less of: it may be less by no more than is stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from robots import urdf
from test_diagnosis import ARM, record

from sysid_ros.diagnosis import diagnose
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.robot.robot_model import RobotModel

STATED, DAMPING, TRUE = 2.0, 1.5, 0.5
"""Dry and viscous friction that each joint has in the URDF, and the dry friction that it has [N m], [N m s/rad]."""


def stating() -> RobotModel:
    text = urdf(ARM)
    assert "<dynamics" not in text
    return RobotModel.from_urdf(text.replace("</joint>", f'<dynamics damping="{DAMPING}" friction="{STATED}"/></joint>'))


def test_friction_that_is_less_than_stated_is_told_by_how_much() -> None:
    """Placeholders of a URDF, as 1 N m and 1 N m s/rad on every joint, had left it unexplained, after four times the time."""
    recording = record(None, 3, seconds=20.0)
    assert recording.v is not None
    tau = recording.tau + TRUE * np.tanh(recording.v / 0.01)
    d = diagnose(stating(), [replace(recording, tau=tau)]).as_dict()
    assert d["verdict"] == "explained"
    told = {e["name"]: {p["joint"]: p for p in e["parameters"]} for e in d["effects"]}
    assert set(told) == {"coulomb_friction", "viscous_friction"}
    for name, less in (("coulomb_friction", TRUE - STATED), ("viscous_friction", -DAMPING)):
        assert set(told[name]) == set(stating().joint_names)
        for p in told[name].values():
            assert p["value"] == pytest.approx(less, abs=max(3.0 * p["std"], 0.02 * abs(less)))
    assert d["headline"].startswith("Overestimated")


@pytest.mark.parametrize(
    ("effect", "stated"),
    [
        ("coulomb_friction", [STATED]),
        ("viscous_friction", [DAMPING]),
        ("presliding_hysteresis", [STATED]),
        ("stribeck_friction", [STATED, STATED]),
        ("asymmetric_coulomb_friction", [STATED, STATED]),
        ("load_dependent_friction", [STATED, 0.0]),
        ("friction_drift", [STATED, 0.0, DAMPING, 0.0]),
        ("rotor_inertia", [0.0]),
    ],
)
def test_no_joint_has_less_than_nothing_of_what_the_urdf_states(effect: str, stated: list[float]) -> None:
    robot = stating()
    library = Library(robot, prepare(robot, [record(None, 0)], []).band)
    term = next(t for t in library.local_options(effect, 1) if t.p == len(stated))
    np.testing.assert_allclose(term.effect.stated, stated)
    std = np.full(term.p, 1e-4)
    none = -np.array(stated)
    assert not term.possible(none - 0.01, std)
    if effect in ("coulomb_friction", "viscous_friction", "presliding_hysteresis"):
        assert term.possible(0.9 * none, std)
