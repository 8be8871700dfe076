"""Control laws: the torque that they are made of, what they promise, and what they believe."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from robots import ROBOTS, random_body, random_sample, robot, urdf, with_body

from sysid_ros.control import (
    ArmTorque,
    ComputedTorque,
    ControlSettings,
    Reference,
    SlotineLi,
    believed_payload,
    make_law,
)
from sysid_ros.control.feedback import Feedback, postures
from sysid_ros.effects import CoulombFriction, Payload, RotorInertia, ViscousFriction
from sysid_ros.exceptions import ModelFileError, SettingsError
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.known_effect import KnownEffect

SETTINGS = ControlSettings()


def loaded(name: str, theta: np.ndarray) -> RobotModel:
    """The robot with a body of these parameters at its default frame."""
    return RobotModel.from_urdf(with_body(urdf(name), robot(name).default_frame, *inertial_parameters.to_com(theta)))


def body(seed: int) -> np.ndarray:
    return inertial_parameters.from_com(*random_body(np.random.default_rng(seed)))


@pytest.mark.parametrize("name", ROBOTS)
def test_the_torque_is_that_of_christoffels_coriolis_matrix(name: str) -> None:
    model, theta = robot(name), body(1)
    arm, heavy, rng = ArmTorque(model), loaded(name, theta), np.random.default_rng(2)
    for _ in range(3):
        s = random_sample(model, rng)
        w, still = rng.normal(size=model.n), np.zeros(model.n)
        columns, rest = arm.split(s.q, s.v, w, s.a, still)
        mass = pin.crba(heavy.model, heavy.data, s.q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        coriolis = pin.computeCoriolisMatrix(heavy.model, heavy.data, s.q, s.v)
        assert rest + columns @ theta == pytest.approx(mass @ s.a + coriolis @ w + heavy.gravity_torque(s.q), abs=1e-8)
        columns, rest = arm.split(s.q, s.v, s.v, s.a, still)
        assert rest + columns @ theta == pytest.approx(heavy.rnea(s.q, s.v, s.a), abs=1e-8)
        assert arm.inertial_torque(s.q, w, theta) == pytest.approx(mass @ w, abs=1e-8)


def test_friction_is_taken_at_a_velocity_of_its_own() -> None:
    model, rng = robot("small_arm"), np.random.default_rng(3)
    b, fc, rotor = rng.uniform(0.1, 1.0, (3, model.n))
    known = [
        KnownEffect(ViscousFriction(model), b),
        KnownEffect(CoulombFriction(model), fc),
        KnownEffect(RotorInertia(model), rotor),
    ]
    s, u = random_sample(model, rng), rng.normal(size=model.n)
    still = np.zeros(model.n)
    plain, arm = ArmTorque(model), ArmTorque(model, known)
    for w in (s.v, u):
        more = arm.split(s.q, s.v, w, s.a, u)[1] - plain.split(s.q, s.v, w, s.a, still)[1]
        own = model.damping * u + model.friction * np.tanh(u / 0.02)
        assert more == pytest.approx(b * u + fc * np.tanh(u / 0.02) + rotor * s.a + own, abs=1e-9)


def test_a_model_that_carries_something_is_refused() -> None:
    model = robot("small_arm")
    with pytest.raises(ModelFileError, match="empty arm"):
        ArmTorque(model, [KnownEffect(Payload(model), body(4))])


@pytest.mark.parametrize("name", ["iiwa", "small_arm"])
@pytest.mark.parametrize("delay", [1e-4, 0.01])
def test_computed_torque_makes_the_error_fall_as_it_promises(name: str, delay: float) -> None:
    settings = ControlSettings(loop_delay=delay)
    model, theta = robot(name), settings.expected_payload
    law, heavy, rng = ComputedTorque(ArmTorque(model), settings, theta), loaded(name, theta), np.random.default_rng(5)
    s = random_sample(model, rng)
    wanted = Reference(s.q + 0.1 * rng.normal(size=model.n), np.zeros(model.n), 3.0 * rng.normal(size=model.n))
    a = heavy.forward_dynamics(s.q, s.v, law.torque(s.q, s.v, wanted, 0.001))
    w = law.feedback.bandwidth
    feedback = w**2 * (wanted.q - s.q) + 2.0 * w * (wanted.v - s.v)
    if law.feedback.share == 1.0:
        assert w == settings.bandwidth
        assert a == pytest.approx(wanted.a + feedback, rel=1e-6)
    mass = np.column_stack([heavy.rnea(s.q, np.zeros(model.n), e) - heavy.gravity_torque(s.q) for e in np.eye(model.n)])
    assert mass @ (a - wanted.a) == pytest.approx(law.feedback.weighted(s.q, feedback), rel=1e-6)


@pytest.mark.parametrize("weighted", [1.0, 2.0])
@pytest.mark.parametrize("name", ["iiwa", "small_arm"])
def test_feedback_is_as_firm_as_the_delay_allows(name: str, weighted: float) -> None:
    arm, shares = ArmTorque(robot(name)), []
    for delay in (1e-4, 1e-3, 4e-3, 0.01, 0.1):
        feedback = Feedback(arm, ControlSettings(loop_delay=delay), weighted)
        shares.append(feedback.share)
        fastest = 0.0
        for q in postures(arm):
            bare = np.column_stack([arm.inertial_torque(q, e, np.zeros(10)) for e in np.eye(arm.robot.n)])
            damping = feedback.bandwidth * ((2.0 - weighted) * bare + weighted * feedback.matrix(q))
            rates = np.linalg.eigvals(np.linalg.solve(bare, damping))
            fastest = max(fastest, float(np.abs(rates).max()))
        assert fastest * delay <= 0.5 * (1.0 + 1e-6)
        assert bool(feedback.notes) == (feedback.share < 0.5 or feedback.bandwidth < 20.0)
    assert shares == sorted(shares, reverse=True)
    assert feedback.bandwidth == pytest.approx(2.5)


def test_a_new_payload_is_taken_over_without_a_jump() -> None:
    model = robot("small_arm")
    law, theta = ComputedTorque(ArmTorque(model), SETTINGS), body(6)
    s = random_sample(model, np.random.default_rng(7))
    wanted = Reference(s.q, s.v, s.a)
    law.carry(theta)
    masses = []
    for _ in range(round(SETTINGS.blend / 0.01)):
        law.torque(s.q, s.v, wanted, 0.01)
        assert inertial_parameters.is_physical(law.payload)
        masses.append(law.payload[0])
    assert np.diff([0.0, *masses]) == pytest.approx(0.01 / SETTINGS.blend * theta[0])
    assert law.payload == pytest.approx(theta)


@pytest.mark.parametrize(("name", "seed"), [pytest.param("iiwa", 8, marks=pytest.mark.slow), ("small_arm", 9)])
def test_lyapunovs_function_never_grows_and_the_error_vanishes(name: str, seed: int) -> None:
    model, theta = robot(name), body(seed)
    # no dead zone, and steps that are short beside the loop
    settings = ControlSettings(dead_zone=0.0, loop_delay=5e-4)
    arm, heavy, step = ArmTorque(model), loaded(name, theta), 5e-4
    law = SlotineLi(arm, settings)
    inverse = np.linalg.inv(law.gain)
    rng = np.random.default_rng(seed)
    centre = 0.5 * (np.maximum(model.position_lower, -2.0) + np.minimum(model.position_upper, 2.0))
    frequency = rng.uniform(1.5, 3.0, model.n)
    q, v = centre + 0.05 * rng.normal(size=model.n), np.zeros(model.n)
    energies, errors, damped = [], [], 0.0
    for k in range(6000):
        angle = frequency * k * step
        wanted = Reference(centre + 0.4 * np.sin(angle), 0.4 * frequency * np.cos(angle), -0.4 * frequency**2 * np.sin(angle))
        s = v - wanted.v + settings.bandwidth * (q - wanted.q)
        mass = pin.crba(heavy.model, heavy.data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        away = law.payload - theta
        energies.append(0.5 * s @ mass @ s + 0.5 * away @ inverse @ away)
        errors.append(np.abs(s).max())
        damped += float(step * law.feedback.bandwidth * s @ law.feedback.weighted(q, s))
        tau = law.torque(q, v, wanted, step)
        assert law.payload[0] >= 0.0
        assert np.linalg.eigvalsh(inertial_parameters.pseudo_inertia(law.payload)).min() > -1e-9
        middle = v + 0.5 * step * heavy.forward_dynamics(q, v, tau)
        v = v + step * heavy.forward_dynamics(q + 0.5 * step * v, middle, tau)
        q = q + step * middle
    # what the torque's being held over a step adds is far below what the function starts with
    assert np.diff(energies).max() < 2e-3 * energies[0]
    # the damping takes it, and the projection onto bodies that can exist takes more
    assert energies[0] - energies[-1] > 0.95 * damped > 0.0
    assert np.mean(errors[-1000:]) < 0.5 * np.mean(errors[:1000])


def test_the_adaptive_law_learns_nothing_from_noise_in_its_dead_zone() -> None:
    model = robot("small_arm")
    s = random_sample(model, np.random.default_rng(10))
    wanted = Reference(s.q, s.v + 0.9 * SETTINGS.dead_zone, s.a)
    law = SlotineLi(ArmTorque(model), SETTINGS)
    law.torque(s.q, s.v, wanted, 0.001)
    assert np.all(law.payload == 0.0)
    law.torque(s.q, s.v, Reference(s.q, s.v + 10.0 * SETTINGS.dead_zone, s.a), 0.001)
    assert np.any(law.payload != 0.0)


def test_only_the_composite_law_is_drawn_towards_what_it_hears() -> None:
    model, theta = robot("small_arm"), body(11)
    s = random_sample(model, np.random.default_rng(12))
    at_rest = Reference(s.q, s.v, s.a)
    deaf, composite = (SlotineLi(ArmTorque(model), SETTINGS, composite=c) for c in (False, True))
    for law in (deaf, composite):
        law.tell(theta)
        for _ in range(1000):
            law.torque(s.q, s.v, at_rest, 0.002)
    assert np.all(deaf.payload == 0.0)
    left = (1.0 - 0.002 / SETTINGS.composite_time) ** 1000
    assert composite.payload == pytest.approx((1.0 - left) * theta)
    composite.tell(None)
    before = composite.payload
    composite.torque(s.q, s.v, at_rest, 0.1)
    assert composite.payload == pytest.approx(before)


def test_certainty_equivalence_keeps_what_it_was_told_last() -> None:
    model, theta = robot("small_arm"), body(13)
    s = random_sample(model, np.random.default_rng(14))
    law = make_law("certainty_equivalence", ArmTorque(model), SETTINGS)
    law.tell(theta)
    law.tell(None)
    law.torque(s.q, s.v, Reference(s.q, s.v, s.a), 1.0)
    assert law.payload == pytest.approx(theta)


@pytest.mark.parametrize(
    ("status", "mass_std", "believed"),
    [
        ("ok", 0.05, "theta"),
        ("not_excited", 0.05, "theta"),
        ("no_payload", 0.05, "nothing"),
        ("ok", 0.5, None),
        ("ok", math.nan, None),
        ("warming_up", 0.05, None),
        ("inconsistent", 0.05, None),
        ("not_physical", 0.05, None),
        ("stale", 0.05, None),
    ],
)
def test_what_is_believed_of_an_estimate(status: str, mass_std: float, believed: str | None) -> None:
    theta = body(15)
    estimate = PayloadEstimate(
        0.0, "tip", theta, np.diag([mass_std**2] + [1e-6] * 9), status, "", np.ones(10, dtype=bool), np.zeros(3), np.zeros(3)
    )
    found = believed_payload(estimate, 0.2)
    if believed is None:
        assert found is None
    else:
        assert found == pytest.approx(theta if believed == "theta" else np.zeros(10))


@pytest.mark.parametrize("change", [{"bandwidth": 0.0}, {"blend": -1.0}, {"expected_mass": math.nan}, {"dead_zone": math.inf}])
def test_a_setting_out_of_range_is_named(change: dict[str, float]) -> None:
    with pytest.raises(SettingsError, match=next(iter(change))):
        ControlSettings(**change)
