"""A joint of two masses in closed loop: resonance, delay, filter and poles are found, and nothing where nothing is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from two_mass import FINE, TwoMass, model_of, multisine, published, sweep

from sysid_ros.effects import CoulombFriction
from sysid_ros.exceptions import DataError
from sysid_ros.files import plain
from sysid_ros.frequency_domain import JointCheck, check_frequency
from sysid_ros.identification import Recording
from sysid_ros.sample import FloatArray
from sysid_ros.torque.known_effect import KnownEffect

ELASTIC = TwoMass(stiffness=4000.0, spring_damping=4.0, damping=0.2)
RIGID = TwoMass()
SWEEP = sweep(24.0, 0.3, 25.0, 0.06)
NOISY: dict[str, Any] = {"torque_noise": 1.0, "encoder_noise": 5e-6}


def check(joint: TwoMass, seed: int = 0, reference: FloatArray = SWEEP, **channels: Any) -> JointCheck:
    robot, known = model_of(joint)
    return check_frequency(robot, [published(joint, reference, seed, **{**NOISY, **channels})], known).joints[0]


def test_the_generator_agrees_with_itself() -> None:
    """Torque on both masses is what accelerates them."""
    for joint in (ELASTIC, RIGID):
        motor, link, tau = joint.run(SWEEP, np.zeros(len(SWEEP)))
        v, a = np.gradient(motor, FINE), np.gradient(np.gradient(motor, FINE), FINE)
        b = np.gradient(np.gradient(link, FINE), FINE)
        error = tau - joint.motor * a - joint.link * b - joint.damping * v
        assert np.std(error[100:-100]) < 0.02 * np.std(tau)


@pytest.mark.slow
def test_a_rigid_joint_holds_and_has_no_unmodelled_pole() -> None:
    """And the document of it is plain."""
    for seed, colour in ((0, 0.0), (1, 0.97)):
        found = check(RIGID, seed, colour=colour)
        assert found.torque is not None
        assert found.torque.verdict.holds_to is not None
        assert found.torque.verdict.holds_to > 12.0
        assert found.torque.verdict.fails_from is None
        assert found.torque.cause is not None
        assert found.torque.cause.name == "nothing"
        assert found.modes is not None
        assert found.modes.unmodelled == ()
        assert found.modes.rigid.real == pytest.approx([-2.0 / 1.5, 0.0])
    document: dict[str, Any] = plain(found.as_dict())
    assert document["modes"]["rigid_poles"][0][0] == pytest.approx(-4.0 / 3.0)
    assert document["torque"]["holds_to_hz"] > 12.0
    assert len(document["torque"]["response"]["real"]) == len(document["torque"]["response"]["frequency_hz"])


def test_an_elastic_joint_is_named_with_its_stiffness() -> None:
    frequency, damping = ELASTIC.locked
    found = check(ELASTIC)
    assert found.torque is not None
    cause = found.torque.cause
    assert cause is not None
    assert cause.name.split("+")[-1] == "resonance"
    p, z = cause.required("frequency"), cause.required("damping")
    assert abs(p.value - frequency) < 3.0 * p.std + 1e-3 * frequency
    assert p.std < 0.01 * frequency
    assert abs(z.value - damping) < 3.5 * z.std + 0.1 * damping
    # the zero is the resonance of both masses
    zero = p.value * (1.0 + cause.required("zero_ratio").value)
    both = np.sqrt(4000.0 * 1.5 / 0.5) / (2.0 * np.pi)
    assert zero == pytest.approx(both, rel=0.03)
    assert any("about 4.0 kN m/rad" in s for s in found.sentences), found.sentences


def test_an_encoder_on_the_link_leaves_the_zero() -> None:
    cause = check(ELASTIC, on_link=True).torque.cause  # type: ignore[union-attr]
    assert cause is not None
    assert cause.name.split("+")[-1] == "anti_resonance"
    assert cause.required("frequency").value == pytest.approx(np.sqrt(4000.0 * 1.5 / 0.5) / (2.0 * np.pi), rel=0.01)


def test_state_space_poles_are_those_of_the_equations() -> None:
    true = next(x for x in ELASTIC.poles if x.imag > 0.0)
    modes = check(ELASTIC, 1, disturbance=0.3).modes
    assert modes is not None
    poles = [m for m in modes.unmodelled if m.kind == "pole"]
    zeros = [m for m in modes.unmodelled if m.kind == "zero"]
    assert len(poles) == 1, modes.modes
    assert len(zeros) == 1, modes.modes
    assert abs(poles[0].frequency - abs(true) / (2.0 * np.pi)) < 4.0 * poles[0].frequency_std + 0.05
    assert abs(poles[0].damping + true.real / abs(true)) < 4.0 * poles[0].damping_std + 0.01
    assert abs(zeros[0].frequency - ELASTIC.locked[0]) < 4.0 * zeros[0].frequency_std + 0.05


@pytest.mark.parametrize(
    ("channel", "name", "parameter", "value"),
    [
        ({"delay": 0.0081}, "delay", "delay", 0.0081),
        ({"low_pass": 14.0}, "low_pass", "cutoff", 14.0),
        ({"gain": 1.2}, "gain", "gain", 1.2),
    ],
)
def test_what_lies_between_torque_and_message_is_named(channel: dict[str, Any], name: str, parameter: str, value: float) -> None:
    found = check(RIGID, 1, **channel)
    assert found.torque is not None
    assert found.friction is None
    cause = found.torque.cause
    assert cause is not None
    assert cause.name == name
    p = cause.required(parameter)
    # the torque of a step of the loop is held for half a millisecond
    assert abs(p.value - value) < 3.0 * p.std + (FINE if name == "delay" else 0.005 * value)
    assert p.low < p.value < p.high


def test_a_delay_and_a_spring_together() -> None:
    cause = check(ELASTIC, 2, delay=0.006).torque.cause  # type: ignore[union-attr]
    assert cause is not None
    assert cause.name == "delay+resonance"
    assert cause.required("delay").value == pytest.approx(0.006, abs=5e-4)
    assert cause.required("frequency").value == pytest.approx(ELASTIC.locked[0], rel=0.01)


def test_a_velocity_that_lags_is_named_and_the_torque_is_not_blamed() -> None:
    found = check(RIGID, 0, velocity_lag=12.0)
    assert found.velocity is not None
    cause = found.velocity.cause
    assert cause is not None
    assert cause.name == "low_pass"
    assert cause.required("cutoff").value == pytest.approx(12.0, rel=0.01)
    assert found.torque is not None
    assert found.torque.cause is not None
    assert found.torque.cause.name == "nothing"


def test_whole_periods_are_used_as_such() -> None:
    reference = multisine(4.0, 6, np.arange(1.0, 90.0, 2.0), 0.008, 0)
    found = check(ELASTIC, 0, reference)
    assert found.torque is not None
    assert [n for _, n in found.torque.periods] == [4]
    assert found.torque.periods[0][0] == pytest.approx(4.0, abs=2e-3)
    assert found.torque.distortion is not None
    assert not found.torque.distortion.found
    cause = found.torque.cause
    assert cause is not None
    assert cause.required("frequency").value == pytest.approx(ELASTIC.locked[0], rel=0.01)


def cut(recording: Recording, rows: slice) -> Recording:
    return recording.at(rows)


def test_bad_recordings_are_refused_in_words() -> None:
    robot, known = model_of(RIGID)
    good = published(RIGID, SWEEP, 0)
    with pytest.raises(DataError, match="longest stretch without a gap"):
        check_frequency(robot, [cut(good, slice(0, 900))], known)
    with pytest.raises(DataError, match="a fifth of it"):
        check_frequency(robot, [good], known, top_hz=150.0)
    still = Recording("still", good.t, np.zeros_like(good.q), np.zeros_like(good.q), good.tau)
    with pytest.raises(DataError, match="no joint moves"):
        check_frequency(robot, [still], known)
    rows = np.arange(len(good.t))
    holes = cut(good, rows[(rows // 500) % 2 == 0])
    with pytest.raises(DataError, match="longest stretch without a gap of"):
        check_frequency(robot, [holes], known)


def test_a_gap_splits_a_recording_and_is_no_harm() -> None:
    robot, known = model_of(ELASTIC)
    good = published(ELASTIC, SWEEP, 0, **NOISY)
    rows = np.arange(len(good.t))
    broken = cut(good, rows[(rows < 4000) | (rows > 4500)])  # type: ignore[arg-type]
    result = check_frequency(robot, [broken], known)
    assert any("gap" in w for w in result.warnings)
    cause = result.joints[0].torque.cause  # type: ignore[union-attr]
    assert cause is not None
    assert cause.required("frequency").value == pytest.approx(ELASTIC.locked[0], rel=0.01)


@pytest.mark.slow
def test_intervals_of_resonance_and_modes_over_seeds() -> None:
    """95 % intervals of a resonance, and of poles by the bootstrap, hold the truth; healthy joints get no false pole."""
    rng = np.random.default_rng(5)
    by_response, by_modes, false = [], [], 0
    for seed in range(16):
        joint = TwoMass(stiffness=float(rng.uniform(1500.0, 6000.0)), spring_damping=float(rng.uniform(2.0, 6.0)), damping=0.2)
        found = check(joint, seed, torque_noise=2.0)
        assert found.torque is not None
        cause = found.torque.cause
        assert cause is not None
        p = cause.required("frequency")
        by_response.append(abs(p.value - joint.locked[0]) < 1.96 * p.std + 5e-4 * p.value)
        assert found.modes is not None
        true = next(x for x in joint.poles if x.imag > 0.0)
        truths = {"pole": abs(true) / (2.0 * np.pi), "zero": joint.locked[0]}
        by_modes += [
            abs(m.frequency - truths[m.kind]) < 1.96 * m.frequency_std + 0.005 * m.frequency for m in found.modes.unmodelled
        ]
        rigid = check(TwoMass(link=joint.stiffness / 4000.0), seed, torque_noise=2.0)
        false += bool(rigid.modes and rigid.modes.unmodelled)
    assert np.mean(by_response) >= 0.88
    assert len(by_modes) >= 16
    assert np.mean(by_modes) >= 0.85
    assert false <= 2


def test_friction_that_the_model_lacks_is_named_first() -> None:
    robot, known = model_of(RIGID)
    good = published(RIGID, sweep(24.0, 0.1, 6.0, 0.4), 0, **NOISY)
    assert good.v is not None
    rough = Recording("rough", good.t, good.q, good.v, good.tau + 4.0 * np.sign(good.v) + 3.0 * good.v)
    found = check_frequency(robot, [rough], known).joints[0]
    assert found.friction is not None
    assert found.friction.coulomb == pytest.approx(4.0, rel=0.1)
    assert found.friction.viscous == pytest.approx(3.0, rel=0.3)
    assert found.torque is not None
    assert found.torque.cause is None
    assert found.modes is None
    assert any("sysid identify" in s and "viscous" in s for s in found.sentences)
    assert check_frequency(robot, [good], known).joints[0].friction is None
    assert check(RIGID, 0, delay=0.02).friction is None


def test_dry_friction_of_the_model_has_a_response_of_its_own() -> None:
    """What the model has wrong of it at reversals is not put down to the rest: it still holds, and no cause is named."""
    robot, known = model_of(RIGID)
    known = [*known, KnownEffect(CoulombFriction(robot), np.array([4.0]))]
    good = published(RIGID, sweep(24.0, 0.3, 20.0, 0.1), 0, **NOISY)
    assert good.v is not None
    rough = Recording("rough", good.t, good.q, good.v, good.tau + 4.4 * np.tanh(good.v / 0.06))
    found = check_frequency(robot, [rough], known).joints[0]
    assert found.friction is None
    assert found.torque is not None
    assert found.torque.verdict.fails_from is None
    assert found.torque.verdict.holds_to is not None
    assert found.torque.cause is None or found.torque.cause.name == "nothing" or found.torque.cause.share < 0.9
