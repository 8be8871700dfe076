"""Friction with a nonlinear knob: variable projection finds what was hidden, and says where the data can't tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from arm_recordings import hidden_parameters, recorded
from motions import Motion
from robots import robot

from sysid_ros.effects import Effect, LoadDependentFriction, PreslidingHysteresis, StribeckFriction
from sysid_ros.effects import Motion as SmoothMotion
from sysid_ros.identification import Choices, Recording, identify_recordings
from sysid_ros.sample import FloatArray

MODEL = robot("small_arm")
TRUTH = hidden_parameters(MODEL, 1, links=0.0)
TRUTH[44:48] = 0.0  # the dry friction comes from the effects below


def slow_recording(extra: FloatArray, effect: Effect) -> Recording:
    """A motion through many slow speeds, with the effect's friction."""
    recording = recorded(MODEL, TRUTH, 3, seconds=40.0, torque_noise=0.02)
    t = recording.t - recording.t[0]
    q, v, a = Motion(MODEL, 3, speed=0.8)(t)
    torque = effect.torque_along(SmoothMotion(MODEL, t, q, v, a, np.zeros_like(q)), extra)
    return replace(recording, tau=recording.tau + torque)


@pytest.mark.slow
def test_the_stribeck_velocity_of_each_joint_is_found() -> None:
    hidden = [0.15, 0.08, 0.12, 0.05]
    recording = slow_recording(np.zeros(8), StribeckFriction(MODEL))
    for j, (name, vs) in enumerate(zip(MODEL.joint_names, hidden, strict=True)):
        effect = StribeckFriction(MODEL, (name,), vs=vs)
        t = recording.t - recording.t[0]
        q, v, a = Motion(MODEL, 3, speed=0.8)(t)
        torque = effect.torque_along(SmoothMotion(MODEL, t, q, v, a, np.zeros_like(q)), np.array([1.0, 2.5]))
        assert np.all(np.delete(torque, j, axis=1) == 0.0)
        recording = replace(recording, tau=recording.tau + torque)
    result = identify_recordings(MODEL, [recording], [], {}, Choices(friction="stribeck"), cutoff_hz=8.0)
    # the slide is too fast for its own to show, and keeps Coulomb's friction
    assert [k.joint for k in result.knobs] == list(MODEL.joint_names[:3])
    for knob, vs in zip(result.knobs, hidden, strict=False):
        assert knob.determined
        assert knob.value == pytest.approx(vs, rel=0.35)
    plain = identify_recordings(MODEL, [recording], [], {}, Choices(friction="coulomb"), cutoff_hz=8.0)
    better, worse = (np.mean([e.residual_moving for e in r.errors], axis=0) for r in (result, plain))
    assert np.all(better[:3] < 0.8 * worse[:3])
    assert {b.effect for b in result.model.effects} == {
        "link_inertia",
        "viscous_friction",
        "coulomb_friction",
        "stribeck_friction",
        "rotor_inertia",
        "torque_offset",
    }
    assert len(result.model.known_effects(MODEL)) == 5 + len(result.knobs)
    unasked = identify_recordings(MODEL, [recording], [], {}, cutoff_hz=8.0)
    assert [(k.name, k.joint) for k in unasked.knobs] == [(k.name, k.joint) for k in result.knobs]


@pytest.mark.slow
def test_friction_that_builds_up_after_a_reversal_makes_no_rotor_lighter() -> None:
    """As a spring would, it takes inertia from a joint whose friction is thought to jump."""
    recording = slow_recording(np.array([3.0, 2.0, 1.0, 0.0]), PreslidingHysteresis(MODEL, z_s=0.05))
    found, plain = (
        identify_recordings(MODEL, [recording], [], {}, Choices(friction=friction), cutoff_hz=8.0)
        for friction in ("auto", "coulomb")
    )
    assert {k.joint for k in found.knobs} >= set(MODEL.joint_names[:3])
    for k in found.knobs[:3]:
        assert k.name == "z_s"
        assert k.value == pytest.approx(0.05, rel=0.3)
    rotors = [f"J[{name}]" for name in MODEL.joint_names[:3]]
    truth = dict(zip(found.names, TRUTH, strict=False))
    off = [np.array([{p.name: p for p in x.parameters}[r].value - truth[r] for r in rotors]) for x in (found, plain)]
    std = np.array([{p.name: p for p in found.parameters}[r].std for r in rotors])
    assert np.all(np.abs(off[0]) < 4.0 * std + 0.01)
    assert np.abs(off[0]).max() < 0.5 * np.abs(off[1]).max()


@pytest.mark.slow
def test_each_joint_gets_the_friction_that_predicts_what_was_not_fitted() -> None:
    theta = np.array([1.0, 0.0, 0.8, 0.10, 0.6, 0.0, 0.5, 0.0])
    recording = slow_recording(theta, LoadDependentFriction(MODEL))
    result = identify_recordings(MODEL, [recording], [], {}, Choices(friction="auto"), cutoff_hz=8.0)
    kinds = {b.effect: b.joints for b in result.model.effects}
    assert kinds["load_dependent_friction"] == (MODEL.joint_names[1],)
    assert kinds["coulomb_friction"] == tuple(np.delete(MODEL.joint_names, 1))
    found = {p.name: p for p in result.parameters}
    assert found[f"mu[{MODEL.joint_names[1]}]"].value == pytest.approx(0.10, abs=0.02)
    coulomb = slow_recording(np.array([1.0, 0.0, 0.8, 0.0, 0.6, 0.0, 0.5, 0.0]), LoadDependentFriction(MODEL))
    plain = identify_recordings(MODEL, [coulomb], [], {}, Choices(friction="auto"), cutoff_hz=8.0)
    assert "load_dependent_friction" not in {b.effect for b in plain.model.effects}


@pytest.mark.slow
def test_friction_that_grows_with_the_load_is_found() -> None:
    theta = np.array([1.0, 0.0, 0.8, 0.08, 0.6, 0.05, 0.5, 0.0])
    recording = slow_recording(theta, LoadDependentFriction(MODEL))
    result = identify_recordings(MODEL, [recording], [], {}, Choices(friction="load_dependent"), cutoff_hz=8.0)
    found = {p.name: p for p in result.parameters}
    for k in (1, 2):
        p = found[f"mu[{MODEL.joint_names[k]}]"]
        assert abs(p.value - theta[2 * k + 1]) < 4.0 * p.std + 0.01
        assert p.std < 0.02
