"""Channels of a robot on legs that are not what they are named: each is found by what it does, and nothing where nothing is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sysid_ros.diagnosis.channel_faults import Fault
from sysid_ros.diagnosis.legs.leg_channels import Channelled, LegChannels, channels_on_legs
from sysid_ros.diagnosis.legs.leg_hypotheses import ImuFault, hypotheses
from sysid_ros.diagnosis.legs.leg_instants import Instants, _usable, middles
from sysid_ros.diagnosis.legs.leg_kinematics import _jacobians, _likelihood, feet_push, gravity_likelihood
from sysid_ros.diagnosis.legs.on_legs import diagnose_on_legs
from sysid_ros.effects import Channels
from sysid_ros.exceptions import DataError
from sysid_ros.floating.feet_along import FeetAlong
from sysid_ros.identification.channel_checks import check_legs
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.zero_phase import SmoothMotion

pytest.importorskip("pybullet_data", reason="PyBullet, which brings the quadruped, is not installed (extra sim)")

from test_legs_diagnosed import noisy
from test_legs_identified import BASE, LEGS, recording

CUTOFF = 5.0
FIRST, SECOND = [0, 1, 2], [3, 4, 5]


def moments(run: Recording, delays: tuple[tuple[float, float], ...] = ((0.0, 0.0),)) -> list[Instants]:
    return Instants.of([check_legs(LEGS, run, 0.1)], CUTOFF, 0.1, 40, delays)


def named(words: str) -> ImuFault:
    return next(h for _, h in hypotheses(BASE) if isinstance(h, ImuFault) and words in h.words)


def with_imu(run: Recording, omega: FloatArray, force: FloatArray) -> Recording:
    assert run.trunk is not None
    return replace(run, trunk=replace(run.trunk, omega=omega, force=force))


def swapped(run: Recording) -> Recording:
    """With all channels of two legs under each other's names."""
    assert run.v is not None
    other = [*SECOND, *FIRST, *range(6, LEGS.n)]
    return replace(run, q=run.q[:, other], v=run.v[:, other], tau=run.tau[:, other])


def found(run: Recording) -> Channelled:
    return channels_on_legs(BASE, [check_legs(LEGS, run, 0.1)], CUTOFF, 0.1)


def test_each_hypothesis_of_the_joints_undoes_what_it_publishes() -> None:
    tau = np.random.default_rng(0).normal(size=(3, LEGS.n))
    different = set()
    for kind, hypothesis in hypotheses(BASE):
        if isinstance(hypothesis, ImuFault):
            continue
        published = hypothesis.effect.publish(tau)
        np.testing.assert_allclose(hypothesis.effect.undo(Channels(tau, tau, published)).tau, tau, rtol=1e-9)
        different.add((kind, hypothesis.effect.id, hypothesis.joints, hypothesis.values))
    assert len(different) == sum(isinstance(h, Fault) for _, h in hypotheses(BASE)) > 100


def test_an_imu_may_be_turned_in_each_way_but_its_own() -> None:
    turns = [h.turn for kind, h in hypotheses(BASE) if kind == "turn" and isinstance(h, ImuFault)]
    assert len({tuple(turn.ravel()) for turn in turns}) == 23
    for turn in turns:
        np.testing.assert_allclose(turn @ turn.T, np.eye(3))
        assert np.linalg.det(turn) == pytest.approx(1.0)
        assert not np.allclose(turn, np.eye(3))


@pytest.mark.parametrize("words", ["+y, -x, +z", "+x, -y, -z", "other sign", "g and not"])
def test_an_undone_imu_shows_what_it_is_said_to(words: str) -> None:
    run, fault = recording(3), named(words)
    assert run.trunk is not None
    omega, force = fault.gain * run.trunk.omega @ fault.turn, run.trunk.force @ fault.turn / fault.force
    (told,), (truth,) = moments(with_imu(run, omega, force)), moments(run)
    for name in ("q", "v", "a", "tau"):
        a, b = (getattr(x.at_trunk, name) for x in (told.undone(fault), truth))
        # three turns of the trunk are low-passed by themselves, and are no vector to second order
        np.testing.assert_allclose(a, b, atol=0.02 * max(1.0, float(np.abs(b).max())))


def test_undone_joints_are_those_of_the_robot() -> None:
    run = recording(3)
    of_legs = (h for kind, h in hypotheses(BASE) if kind == "order")
    fault = next(h for h in of_legs if isinstance(h, Fault) and h.joints == (*FIRST, *SECOND))
    (told,), (truth,) = moments(swapped(run)), moments(run)
    for name in ("q", "v", "a", "tau"):
        np.testing.assert_allclose(getattr(told.undone(fault).motion, name), getattr(truth.motion, name), atol=1e-9)


def test_delays_are_those_of_the_samples() -> None:
    run = recording(3)
    late, same = moments(run, ((0.02, 0.0), (0.0, 0.0)))
    assert np.array_equal(late.motion.t, same.motion.t)
    assert np.array_equal(late.motion.q, same.motion.q)
    middle = middles(same.motion)
    ahead = middle.v[:, 3:FREE] + 0.02 * middle.a[:, 3:FREE]
    np.testing.assert_allclose(middles(late.motion).v[:, 3:FREE], ahead, atol=0.05)
    assert np.abs(middles(late.motion).v[:, 3:FREE] - middle.v[:, 3:FREE]).max() > 0.02


def test_stretches_that_are_too_short_for_a_delay_are_left_out() -> None:
    motion = moments(recording(3))[0].motion  # its samples stand for a stretch
    short = SmoothMotion(*(getattr(motion, name)[:9] for name in ("t", "q", "v", "a", "tau", "spoiled")))
    assert not len(_usable(short, 7))
    assert _usable(short, 4).tolist() == [4]
    assert _usable(short, 2).tolist() == [2, 3, 4, 5, 6]
    spoiled = short.spoiled.copy()
    spoiled[0, 3] = 10.0
    assert _usable(replace(short, spoiled=spoiled), 2).tolist() == [3, 4, 5, 6]


def test_a_gyro_in_degrees_is_told_by_the_legs_and_a_still_one_is_not() -> None:
    rng, turns = np.random.default_rng(1), 0.05
    z = turns * rng.normal(size=2000)
    noise = 0.01 * rng.normal(size=(2, 2000))
    gains = (1.0, -1.0, 180.0 / np.pi)

    def best(x: FloatArray, y: FloatArray) -> FloatArray:
        rows = np.stack([x, y])
        return np.array([_likelihood(rows @ rows.T / rows.shape[1], g) for g in gains])

    for k, gain in enumerate(gains):
        likely = best(gain * z + noise[0], z + noise[1])
        assert int(np.argmax(likely)) == k
        assert likely[k] - np.delete(likely, k).max() > 0.5
    still = best(*noise)
    assert np.ptp(still) < 1e-3


def test_jacobians_of_the_feet_are_those_of_the_robot() -> None:
    q = moments(recording(3))[0].motion.q[5]
    found, (_, told) = _jacobians(BASE, q), BASE.contacts.jacobians(q)
    np.testing.assert_allclose(found, np.stack([J[:3] for J in told]), atol=1e-12)


def test_feet_push_and_do_not_pull() -> None:
    (truth,) = moments(recording(3))
    motion = middles(truth.at_trunk)
    feet = FeetAlong.of(BASE, motion, 0.0)
    assert feet_push(BASE, motion, feet.forces)
    assert not feet_push(BASE, motion, -feet.forces)


def test_feet_that_stand_are_those_of_the_legs_whatever_the_gyro_shows() -> None:
    (truth,) = moments(recording(3))
    m = truth.motion
    v, a = m.v.copy(), m.a.copy()
    v[:, 3:FREE] *= 180.0 / np.pi
    a[:, 3:FREE] *= 180.0 / np.pi
    likelihoods = LegChannels(BASE)
    own, other = (likelihoods.standing(x).pairs for x in (truth, replace(truth, motion=replace(m, v=v, a=a))))
    np.testing.assert_array_equal(own, other)
    assert 0.3 < np.mean(own) < 1.0


@pytest.mark.parametrize("shaking", [0.05, 3.0])
def test_a_specific_force_is_of_gravity_s_size_in_the_mean(shaking: float) -> None:
    force = np.array([0.2, 0.0, 9.81]) + shaking * np.random.default_rng(2).normal(size=(400, 3))
    gravity = np.array([0.0, 0.0, 9.81])
    shown = {"right": force, "g": force / 9.81, "none": force - gravity}
    for name, x in shown.items():
        likely = {
            "right": gravity_likelihood(x, 1.0),
            "g": gravity_likelihood(9.81 * x, 9.81),
            "none": gravity_likelihood(x + gravity, 1.0),
        }
        assert max(likely, key=likely.__getitem__) == name


def test_efforts_in_another_unit_are_likelier_with_it_undone_and_others_are_not() -> None:
    (truth,) = moments(noisy(recording(4), 4))
    unit = next(h for kind, h in hypotheses(BASE) if kind == "unit" and isinstance(h, Fault) and h.values[0][2] == 100.0)
    likelihoods = LegChannels(BASE)
    truth = likelihoods.standing(truth)
    published = replace(truth, motion=replace(truth.motion, tau=100.0 * truth.motion.tau))
    for instants, better in ((published, True), (truth, False)):
        undone, kept = (float(np.sum(likelihoods.densities(x))) for x in (instants.undone(unit), instants))
        assert (undone > kept + 50.0) is better
        assert (kept > undone + 50.0) is not better


@pytest.mark.slow
def test_swapped_legs_are_named_and_undone() -> None:
    result = diagnose_on_legs(BASE, [swapped(noisy(recording(6), 6))])
    assert not result.causes
    (fault,) = result.data_faults
    assert fault.id == "joint_order"
    assert set(fault.joints) == {LEGS.joint_names[j] for j in (*FIRST, *SECOND)}
    assert fault.probability is not None
    assert fault.probability > 0.95
    assert fault.delta_bic is not None
    assert fault.delta_bic > 100.0
    assert result.verdict == "explained"
    assert any("undone" in note for note in result.notes)


@pytest.mark.slow
def test_a_joint_that_counts_backwards_is_named() -> None:
    run = noisy(recording(7), 7)
    q, tau = run.q.copy(), run.tau.copy()
    assert run.v is not None
    v = run.v.copy()
    for x in (q, v, tau):
        x[:, 4] *= -1.0
    (fault,) = found(replace(run, q=q, v=v, tau=tau)).faults
    assert (fault.effect.id, fault.joints) == ("joint_sign", (4,))


@pytest.mark.slow
@pytest.mark.parametrize("words", ["+y, -x, +z", "g and not", "no gravity"])
def test_an_imu_that_shows_something_else_is_refused_by_name(words: str) -> None:
    run, fault = noisy(recording(8), 8), named(words)
    assert run.trunk is not None
    force = (run.trunk.force @ fault.turn - [0.0, 0.0, fault.shift]) / fault.force
    other = with_imu(run, fault.gain * run.trunk.omega @ fault.turn, force)
    with pytest.raises(DataError) as refused:
        diagnose_on_legs(BASE, [other])
    assert words in str(refused.value)
    assert fault.cure in str(refused.value)


@pytest.mark.slow
def test_nothing_is_found_in_what_other_causes_do() -> None:
    run = noisy(recording(9, rubs=3.0), 9)
    late = np.stack([np.interp(run.t - 0.02, run.t, x) for x in run.tau.T], axis=1)
    offsets = np.random.default_rng(0).normal(0.0, 1.0, LEGS.n)
    for other in (run, replace(run, tau=late), replace(run, tau=run.tau + offsets)):
        channels = found(other)
        assert not channels.faults
        assert not channels.refusal
