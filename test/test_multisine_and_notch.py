"""Multisines: at rest at their ends, periodic, orthogonal, within the limits; notches: as designed, and told what they buy."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from robots import DATA, robot

from sysid_ros.cli.main import run
from sysid_ros.control.notch import ComplexArray, Notch, Resonance, benefit, notch_for, resonance_of
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.feasibility import Feasibility
from sysid_ros.excitation.motion_limits import MotionLimits
from sysid_ros.excitation.multisine import crest_factor, multisines, schroeder
from sysid_ros.sample import FloatArray

ROBOT = robot("small_arm")
LIMITS = MotionLimits(ROBOT, ExcitationSettings())


def test_motions_rest_at_their_ends_and_are_periodic_between() -> None:
    found = multisines(LIMITS, Feasibility(LIMITS), (0.3, 5.0), 5.0, 2)
    assert len(found) == ROBOT.n
    for m in found:
        q, v, a = m.sample(np.array([0.0, m.duration, m.ramp + 1.0, m.ramp + 1.0 + m.period]))
        assert np.allclose(q[:2], m.centre, atol=1e-12)
        assert np.allclose(v[:2], 0.0, atol=1e-9)
        assert np.allclose(a[:2], 0.0, atol=1e-6)
        assert np.allclose(q[2], q[3])
        # what is said to be a velocity and an acceleration is one
        t = np.linspace(0.3, m.duration - 0.3, 200)
        h = 1e-5
        (q0, v0, _), (q1, v1, _), (_, v, a) = m.sample(t - h), m.sample(t + h), m.sample(t)
        assert np.allclose((q1 - q0) / (2 * h), v, atol=1e-5)
        assert np.allclose((v1 - v0) / (2 * h), a, atol=1e-3)
        assert set((m.harmonics % 2).tolist()) == {1.0}


def test_limits_are_kept_and_something_moves() -> None:
    for m in multisines(LIMITS, Feasibility(LIMITS), (0.5, 8.0), 4.0, 1):
        q, v, a = m.sample(m.grid(1e-3))
        use = np.abs(LIMITS.use(q, v, a, LIMITS.torque(q, v, a))).max(axis=(1, 2))
        assert np.all(use <= 1.0)
        assert use.max() > 0.3


def test_experiments_are_orthogonal_at_every_frequency() -> None:
    found = multisines(LIMITS, Feasibility(LIMITS), (0.3, 5.0), 5.0, 1)
    U = np.stack([m.amplitude * np.exp(1j * m.phase) for m in found], axis=1)
    for one in U:
        scaled = one / np.abs(one)
        assert np.allclose(scaled @ scaled.conj().T, len(found) * np.eye(len(found)), atol=1e-9)


def test_schroeder_phases_have_a_low_crest() -> None:
    t, k = np.linspace(0.0, 1.0, 5000, endpoint=False), np.arange(1, 60, 2)
    x = np.sum(np.sin(2 * np.pi * np.outer(k, t) + schroeder(np.ones(len(k)))[:, None]), axis=0)
    assert crest_factor(x) < 2.2
    assert crest_factor(np.sum(np.cos(2 * np.pi * np.outer(k, t)), axis=0)) > 5.0


def test_one_joint_alone() -> None:
    (m,) = multisines(LIMITS, Feasibility(LIMITS), (0.3, 5.0), 5.0, 1, joints=[1])
    assert not np.delete(m.amplitude, 1, axis=1).any()
    with pytest.raises(SettingsError, match="odd harmonics"):
        multisines(LIMITS, Feasibility(LIMITS), (0.3, 0.35), 5.0, 1)


def test_command_writes_one_motion_a_joint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "traj.yaml"
    urdf = [
        "excite",
        "--urdf",
        str(DATA / "small_arm.urdf"),
        "--multisine",
        "--no-collisions",
        "--duration",
        "5",
        "--period",
        "5",
    ]
    names = ROBOT.joint_names[:2]
    arguments = [*urdf, "--out", str(out), "--json", str(tmp_path / "m.json"), "--move", names[0], "--move", names[1]]
    assert run(arguments) == 0
    assert sorted(p.name for p in tmp_path.glob("traj*")) == ["traj_1.yaml", "traj_2.yaml"]
    assert len(json.loads((tmp_path / "m.json").read_text())["frequencies_hz"]) > 10
    assert run(arguments) == 2
    assert "traj_1.yaml" in capsys.readouterr().err
    assert run([*urdf, "--out", str(tmp_path / "x.yaml"), "--band", "5"]) == 2
    assert "--band" in capsys.readouterr().err
    assert run([*urdf, "--out", str(tmp_path / "x.yaml"), "--move", "elbow_of_another"]) == 2


def second_order(f: FloatArray, f0: float, damping: float) -> ComplexArray:
    s, w = 2j * np.pi * f, 2.0 * np.pi * f0
    return np.asarray(s / (s**2 + 2.0 * damping * w * s + w**2) + 0.02 / (s + 3.0))


@pytest.mark.parametrize("damping", [0.01, 0.05])
def test_resonance_is_found_between_the_lines(damping: float) -> None:
    f = np.arange(1.0, 40.0, 0.25)
    for f0 in (11.03, 14.6, 19.9):
        found = resonance_of(f, second_order(f, f0, damping), 5.0, 30.0)
        assert found.frequency == pytest.approx(f0, rel=0.003)
        assert found.damping == pytest.approx(damping, rel=0.1)
    with pytest.raises(DataError, match="no peak"):
        resonance_of(f, second_order(f, 2.0, 0.05), 5.0, 30.0)
    with pytest.raises(DataError, match="lines"):
        resonance_of(f, second_order(f, 10.0, 0.05), 10.0, 10.6)


def test_notch_is_as_deep_as_asked_and_passes_the_rest() -> None:
    notch = notch_for(Resonance(15.0, 0.02, 10.0), depth=0.1)
    assert abs(notch.response(np.array([15.0]))[0]) == pytest.approx(0.1)
    assert abs(notch.response(np.array([1.0]))[0]) == pytest.approx(1.0, abs=0.01)
    b, a = notch.discrete(1e-3)
    z = np.exp(2j * np.pi * np.array([15.0, 5.0]) * 1e-3)
    made = np.polyval(b, z) / np.polyval(a, z)
    assert np.allclose(np.abs(made), np.abs(notch.response(np.array([15.0, 5.0]))), atol=2e-3)


def test_what_a_notch_buys_is_that_of_the_loop() -> None:
    f = np.arange(0.25, 60.0, 0.125)
    plant = np.asarray(0.3 * second_order(f, 14.0, 0.02), dtype=np.complex128)
    notch = Notch(14.0, 0.02, 0.2)
    told = benefit(f, plant, notch, (40.0, 4.0), delay=0.01)
    s = 2j * np.pi * f
    L = plant * (40.0 / s + 4.0) * np.exp(-0.01 * s)
    near = np.abs(f / 14.0 - 1.0) < 0.3
    own = [np.max(np.abs(x / (1.0 + x))[near]) for x in (L, L * notch.response(f))]
    assert told.decibel == pytest.approx(20.0 * np.log10(own[0] / own[1]))
    assert told.phase_lost > 0.0
