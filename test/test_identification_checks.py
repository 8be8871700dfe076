"""Bad recordings: what is wrong is found, named, and kept out of the fit; sound ones raise no alarm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from arm_recordings import START, hidden_parameters, recorded
from motions import Motion
from robots import robot, urdf

from sysid_ros.diagnosis.diagnose import _in_order
from sysid_ros.diagnosis.fault_findings import message_finding
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.identification import BagRows, Choices, Recording, collect_rows, free_model, identify_recordings
from sysid_ros.identification.channel_checks import CheckedRecording, check_channels, frozen_messages
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.plausibility import check_plausible
from sysid_ros.identification.spectrum import choose_cutoff
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

MODEL = robot("iiwa")
TRUTH = hidden_parameters(MODEL, 1)
JOINTS = MODEL.joint_names


@pytest.fixture(scope="module")
def sound() -> Recording:
    return recorded(MODEL, TRUTH, 1, seconds=20.0)


def changed(recording: Recording, joint: int, where: slice, value: float) -> Recording:
    tau = recording.tau.copy()
    tau[where, joint] = value
    return replace(recording, tau=tau)


def prepared_rows(robot: RobotModel, checked: Sequence[CheckedRecording], cutoff_hz: float) -> tuple[list[BagRows], FloatArray]:
    """Rows of recordings for links, friction, rotors and offsets, and the URDF's values of these parameters, shape (p,)."""
    model = free_model(robot)
    rows = [collect_rows(model, c.recording, c.recording.name, cutoff_hz, spoiled=c.spoiled) for c in checked]
    return rows, Prior.of(model).mean


def test_a_sound_recording_raises_no_alarm(sound: Recording) -> None:
    checked = check_channels(MODEL, sound, 0.1)
    assert checked.problems == ()
    assert not checked.spoiled.any()
    bags, nominal = prepared_rows(MODEL, [checked], 5.0)
    assert check_plausible(MODEL, bags, nominal) == []


@pytest.mark.parametrize("step", [0.05, 0.5])
def test_a_coarse_torque_is_not_called_frozen_or_saturated(sound: Recording, step: float) -> None:
    coarse = replace(sound, tau=step * np.rint(sound.tau / step))
    assert check_channels(MODEL, coarse, 0.1).problems == ()


def test_a_coarse_torque_without_noise_is_not_called_saturated() -> None:
    """Its largest value stands for as long as the torque takes to turn."""
    exact = recorded(MODEL, TRUTH, 1, seconds=20.0, torque_noise=0.0)
    assert check_channels(MODEL, replace(exact, tau=0.5 * np.rint(exact.tau / 0.5)), 0.1).problems == ()


def test_a_frozen_effort_is_named_and_left_out(sound: Recording) -> None:
    frozen = changed(sound, 3, slice(1000, 1500), 7.25)
    checked = check_channels(MODEL, frozen, 0.1)
    (problem,) = checked.problems
    assert (problem.kind, problem.joint) == ("frozen_effort", JOINTS[3])
    assert "7.25" in problem.text
    assert checked.spoiled[1000:1500, 3].mean() > 0.99
    assert not np.delete(checked.spoiled, 3, axis=1).any()
    (rows,), _ = prepared_rows(MODEL, [checked], 5.0)
    during = (rows.t > START + 4.0) & (rows.t < START + 6.0)
    assert not rows.moving[during, 3].any()
    assert rows.moving[~during, 3].mean() > 0.5


def test_messages_of_a_frozen_joint_are_found_and_those_of_a_limited_one_are_not(sound: Recording) -> None:
    effort, q, v = changed(sound, 3, slice(1000, 1500), 7.25), sound.q.copy(), np.gradient(sound.q, sound.t, axis=0)
    fast = 2000 + int(np.argmax(np.abs(v[2000:3000, 1])))
    q[fast : fast + 200, 1] = q[fast, 1]
    frozen, words = frozen_messages(MODEL, replace(effort, q=q, v=v))
    assert np.array_equal(np.flatnonzero(frozen), [*range(1000, 1500), *range(fast, fast + 200)])
    assert [JOINTS[3] in words[1], JOINTS[1] in words[0]] == [True, True]
    assert all("These messages are not used" in x for x in words)
    limit = float(np.quantile(np.abs(sound.tau[:, 1]), 0.6))
    limited = replace(sound, tau=np.clip(sound.tau, -limit, limit))
    assert "saturated_effort" in {p.kind for p in check_channels(MODEL, limited, 0.1).problems}
    assert not frozen_messages(MODEL, limited)[0].any()
    assert not frozen_messages(MODEL, sound)[0].any()


def test_a_diagnosis_leaves_out_messages_of_a_frozen_joint_before_it_looks_for_spikes(sound: Recording) -> None:
    frozen = changed(sound, 3, slice(1000, 1500), 7.25)
    ((kept,),), ((faults,),), notes, refusal = _in_order(MODEL, [frozen])
    assert refusal is None
    assert len(kept.t) == len(sound.t) - 500
    assert (faults.frozen, faults.spiked) == (500, 0)
    (note,) = notes
    assert f"effort of {JOINTS[3]} stays at 7.25" in note
    (finding,) = message_finding([faults], JOINTS)
    (share,) = finding.parameters
    assert (share.name, share.value) == ("frozen", 500 / len(sound.t))
    whole = changed(sound, 3, slice(0, 4000), float(np.median(sound.tau[4000:, 3])))
    assert f"effort of {JOINTS[3]} is constant" in (_in_order(MODEL, [whole])[3] or "")


def test_a_constant_effort_is_refused(sound: Recording) -> None:
    with pytest.raises(DataError, match=f"{JOINTS[2]} is constant") as caught:
        check_channels(MODEL, changed(sound, 2, slice(None), 1.5), 0.1)
    assert "1.5" in str(caught.value)


def test_a_saturated_effort_is_named_and_left_out(sound: Recording) -> None:
    limit = 0.6 * float(np.abs(sound.tau[:, 1]).max())
    tau = sound.tau.copy()
    tau[:, 1] = np.clip(tau[:, 1], -limit, limit)
    checked = check_channels(MODEL, replace(sound, tau=tau), 0.1)
    assert {(p.kind, p.joint) for p in checked.problems} == {("saturated_effort", JOINTS[1])}
    clipped = np.abs(tau[:, 1]) >= limit
    assert checked.spoiled[clipped, 1].mean() > 0.9
    assert not checked.spoiled[~clipped, 1].any()


def test_a_frozen_position_is_named(sound: Recording) -> None:
    v = np.gradient(sound.q, sound.t, axis=0)
    q = sound.q.copy()
    fastest = int(np.argmax(np.convolve(np.abs(v[:, 4]), np.ones(200), mode="valid")))
    where = slice(fastest, fastest + 200)
    q[where, 4] = q[fastest, 4]
    checked = check_channels(MODEL, replace(sound, q=q, v=v), 0.1)
    assert ("frozen_position", JOINTS[4]) in {(p.kind, p.joint) for p in checked.problems}
    assert checked.spoiled[where].all()


def test_gaps_and_stamps_that_run_back_are_said(sound: Recording) -> None:
    keep = np.ones(len(sound.t), dtype=bool)
    keep[2000:2400] = False
    cut = sound.at(keep, "cut")
    assert [p.kind for p in check_channels(MODEL, cut, 0.1).problems] == ["gaps"]
    t = sound.t.copy()
    t[3000:] -= 20.0
    assert [p.kind for p in check_channels(MODEL, replace(sound, t=t), 0.1).problems] == ["time_runs_back"]


def test_positions_beyond_the_urdf_are_said(sound: Recording) -> None:
    q = sound.q + np.array([0.0, 2.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert ("position_outside", JOINTS[1]) in {
        (p.kind, p.joint) for p in check_channels(MODEL, replace(sound, q=q), 0.1).problems
    }


def refusal(recording: Recording, model: RobotModel = MODEL) -> str:
    with pytest.raises(DataError) as caught:
        identify_recordings(model, [recording], [], {})
    return str(caught.value)


def test_currents_in_place_of_torques(sound: Recording) -> None:
    text = refusal(replace(sound, tau=sound.tau / np.array([9.0, 9.0, 8.0, 8.0, 7.0, 6.0, 6.0])))
    assert "effort_scale" in text
    assert "current" in text
    assert JOINTS[1] in text


def test_efforts_against_gravity(sound: Recording) -> None:
    text = refusal(replace(sound, tau=-sound.tau))
    assert "effort_sign" in text


@pytest.mark.slow
def test_a_urdf_whose_joints_stand_elsewhere(sound: Recording) -> None:
    order = [1, 0, 3, 2, 5, 4, 6]
    text = refusal(replace(sound, q=sound.q[:, order], tau=sound.tau[:, order]))
    assert "URDF of the robot that was recorded" in text


def test_a_urdf_of_a_much_lighter_robot(sound: Recording) -> None:
    import re

    light = re.sub(r'<mass value="([^"]+)"', lambda m: f'<mass value="{0.15 * float(m.group(1))}"', urdf("iiwa"))
    text = refusal(sound, RobotModel.from_urdf(light))
    assert "URDF of the robot that was recorded" in text


@pytest.mark.slow
def test_doubts_can_be_accepted(sound: Recording) -> None:
    result = identify_recordings(MODEL, [replace(sound, tau=0.2 * sound.tau)], [], {}, Choices(accept_doubts=True))
    assert "implausible_effort" in {p.kind for p in result.problems}


def test_a_joint_that_never_moves() -> None:
    text = refusal(recorded(MODEL, TRUTH, 1, seconds=10.0, still=(JOINTS[2],)))
    assert JOINTS[2] in text
    assert JOINTS[3] not in text


@pytest.mark.parametrize("odd", ["payload", pytest.param("scale", marks=pytest.mark.slow)])
def test_two_bags_that_contradict(sound: Recording, odd: str) -> None:
    other = TRUTH.copy()
    if odd == "payload":
        other[60:70] += np.array([3.0, 0.1, 0.0, 0.3, 0.05, 0.0, 0.05, 0.0, 0.0, 0.02])
    second = recorded(MODEL, other, 2, seconds=20.0)
    if odd == "scale":
        second = replace(second, tau=second.tau * np.array([1.0, 1.5, 1.0, 1.0, 1.0, 1.0, 1.0]))
    with pytest.raises(DataError, match="bag 1 and bag 2 contradict each other"):
        identify_recordings(MODEL, [sound, second], [], {})


@pytest.mark.slow
def test_the_odd_one_of_three_bags_is_named(sound: Recording) -> None:
    other = TRUTH.copy()
    other[60:70] += np.array([3.0, 0.1, 0.0, 0.3, 0.05, 0.0, 0.05, 0.0, 0.0, 0.02])
    bags = [sound, recorded(MODEL, other, 2, seconds=15.0), recorded(MODEL, TRUTH, 3, seconds=15.0)]
    with pytest.raises(DataError, match=r"^bag 2 contradicts the others"):
        identify_recordings(MODEL, bags, [], {})


@pytest.mark.parametrize(
    ("choices", "word"),
    [(Choices(method="best"), "irls"), (Choices(form="energy"), "momentum"), (Choices(friction="none"), "stribeck")],
)
def test_an_unknown_choice(sound: Recording, choices: Choices, word: str) -> None:
    with pytest.raises(SettingsError, match=word):
        identify_recordings(MODEL, [sound], [], {}, choices)


def test_the_cut_off_follows_the_motion() -> None:
    slow, fast = (recorded(MODEL, TRUTH, 1, seconds=20.0, rate=rate) for rate in (250.0, 250.0))
    stretched = replace(slow, t=START + 4.0 * (slow.t - START))
    low, high = (choose_cutoff([r], JOINTS) for r in (stretched, fast))
    assert low.hz < 0.5 * high.hz
    for cutoff in (low, high):
        assert "Hz" in cutoff.reason
        assert any(j in cutoff.reason for j in JOINTS)


def test_noisy_positions_ask_for_a_lower_cut_off() -> None:
    noise = (1e-5, 1e-4, 1e-3)
    cutoffs = [choose_cutoff([recorded(MODEL, TRUTH, 1, seconds=20.0, encoder_noise=e)], JOINTS) for e in noise]
    assert cutoffs[0].hz > cutoffs[1].hz > cutoffs[2].hz
    assert "noise of the position" in cutoffs[1].reason


def test_joints_that_stand_in_one_recording_each_are_identified_from_the_others() -> None:
    """What a joint that never changes shows of its drive is rounding, which is no information of either sign."""
    model, recordings = robot("small_arm"), []
    for seed, stands in enumerate((2, 0)):
        t = np.arange(3000) / 200.0
        q, v, a = Motion(model, seed, speed=1.0)(t)
        here = np.arange(model.n) == stands
        q, v, a = np.where(here, q[0], q), np.where(here, 0.0, v), np.where(here, 0.0, a)
        rng = np.random.default_rng(seed)
        tau = model.rnea_along(q, v, a) + 0.1 * np.sign(v) + 0.02 * rng.normal(size=q.shape)
        q = np.where(here, q, q + 1e-5 * rng.normal(size=q.shape))
        recordings.append(Recording(f"r{seed}", t, q, None, tau))
    found = identify_recordings(model, recordings, [], {})
    told = {p.name: p for p in found.parameters}
    for joint in model.joint_names:
        assert told[f"Fc[{joint}]"].value == pytest.approx(0.1, abs=0.02)
