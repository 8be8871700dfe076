"""TorqueModel: what is measured is what is known plus Y theta, whichever effects are known and free."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from robots import ROBOTS, random_sample, robot

from sysid_ros.effects import (
    CoulombFriction,
    Effect,
    LinkInertia,
    LoadDependentFriction,
    Motion,
    Payload,
    QuadraticFriction,
    RotorInertia,
    StribeckFriction,
    TimeDelay,
    TorqueOffset,
    ViscousFriction,
)
from sysid_ros.exceptions import ModelFileError, SysidError
from sysid_ros.identification import free_model
from sysid_ros.identification.expected_error import error_directions
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import Sample
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel

BESIDE = (Payload, ViscousFriction, CoulombFriction, RotorInertia, TorqueOffset)


def with_torque(sample: Sample, torque: np.ndarray) -> Sample:
    return Sample(sample.t, sample.q, sample.v, sample.a, torque)


@pytest.mark.parametrize("robot_name", ROBOTS)
@pytest.mark.parametrize("free", list(itertools.product([False, True], repeat=3)))
def test_torque_is_known_plus_columns_times_theta(robot_name: str, free: tuple[bool, ...]) -> None:
    model, rng = robot(robot_name), np.random.default_rng(0)
    links_free, friction_free, others_free = free
    effects: list[tuple[Effect, bool]] = [
        (LinkInertia(model), links_free),
        (ViscousFriction(model), friction_free),
        (CoulombFriction(model, model.joint_names[:2]), friction_free),
        (Payload(model), others_free),
        (TorqueOffset(model), others_free),
        (RotorInertia(model, model.joint_names[1:]), not others_free),
    ]
    theta = {id(e): rng.normal(size=e.p) for e, _ in effects}
    known = [KnownEffect(e, theta[id(e)]) for e, is_free in effects if not is_free]
    torque_model = TorqueModel(model, [e for e, is_free in effects if is_free], known)
    free_theta = np.concatenate([theta[id(e)] for e, is_free in effects if is_free])
    assert torque_model.p == free_theta.size
    for _ in range(5):
        sample = random_sample(model, rng)
        total = np.sum([e.torque(sample, theta[id(e)]) for e, _ in effects], axis=0)
        columns, rest = torque_model.split(with_torque(sample, total))
        assert columns.shape == (model.n, torque_model.p)
        np.testing.assert_allclose(columns @ free_theta, rest, atol=1e-8)
        np.testing.assert_allclose(rest, total - torque_model.known_torque(sample), atol=1e-8)


def test_names_units_and_slices_are_those_of_the_free_effects_side_by_side() -> None:
    model = robot("small_arm")
    effects = [kind(model) for kind in BESIDE]
    torque_model = TorqueModel(model, effects)
    assert torque_model.parameter_names == tuple(n for e in effects for n in e.parameter_names)
    assert torque_model.units == tuple(u for e in effects for u in e.units)
    sample = random_sample(model, np.random.default_rng(0))
    columns, _ = torque_model.split(sample)
    for effect, where in zip(effects, torque_model.slices, strict=True):
        np.testing.assert_array_equal(columns[:, where], effect.columns(sample))


def test_the_urdf_is_known_where_no_links_are_given_with_its_friction() -> None:
    model = robot("tree_robot")
    sample = random_sample(model, np.random.default_rng(1))
    known = TorqueModel(model, [Payload(model)]).known_torque(sample)
    j = model.joint_names.index("left_shoulder")
    expected = model.rnea(sample.q, sample.v, sample.a)
    expected[j] += 0.7 * sample.v[j] + 0.4 * np.sign(sample.v[j])
    np.testing.assert_allclose(known, expected, atol=1e-3)


def test_identified_links_replace_the_urdf_and_its_friction() -> None:
    model = robot("tree_robot")
    sample = random_sample(model, np.random.default_rng(1))
    links = LinkInertia(model)
    known = TorqueModel(model, [], [KnownEffect(links, links.nominal)]).known_torque(sample)
    np.testing.assert_allclose(known, model.rnea(sample.q, sample.v, sample.a), atol=1e-9)


def test_identified_links_of_some_joints_leave_the_urdf_for_the_others() -> None:
    model, rng = robot("tree_robot"), np.random.default_rng(1)
    sample = random_sample(model, rng)
    part = LinkInertia(model, ("left_wrist", "lift"))
    change = rng.normal(size=part.p)
    known = TorqueModel(model, [], [KnownEffect(part, part.nominal + change)]).known_torque(sample)
    np.testing.assert_allclose(known, model.rnea(sample.q, sample.v, sample.a) + part.torque(sample, change), atol=1e-9)


def test_the_robot_itself_is_left_out_where_effort_is_external() -> None:
    model, rng = robot("tree_robot"), np.random.default_rng(1)
    sample = random_sample(model, rng)
    links = LinkInertia(model)
    for known in ([], [KnownEffect(links, links.nominal)]):
        torque_model = TorqueModel(model, [Payload(model)], known, links=False)
        assert not torque_model.known_torque(sample).any()
        columns, rest = torque_model.split(sample)
        np.testing.assert_array_equal(rest, sample.tau)
        np.testing.assert_allclose(columns, Payload(model).columns(sample), atol=1e-12)


def test_split_into_overwrites_what_was_there() -> None:
    model, rng = robot("iiwa"), np.random.default_rng(2)
    torque_model = TorqueModel(model, [kind(model) for kind in BESIDE])
    columns, rest = np.zeros((7, torque_model.p)), np.zeros(7)
    for _ in range(5):
        sample = random_sample(model, rng)
        torque_model.split_into(sample, columns, rest)
        expected_columns, expected_rest = torque_model.split(sample)
        np.testing.assert_array_equal(columns, expected_columns)
        np.testing.assert_array_equal(rest, expected_rest)


def test_known_parameters_by_joint() -> None:
    model = robot("small_arm")
    friction = CoulombFriction(model, ("lift", "slide"))
    torque_model = TorqueModel(model, [], [KnownEffect(friction, np.array([3.0, 4.0]))])
    np.testing.assert_array_equal(torque_model.dry_friction() - model.friction, [0.0, 3.0, 0.0, 4.0])
    np.testing.assert_array_equal(torque_model.damping(), model.damping)
    assert not torque_model.armature().any()


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_the_error_of_what_is_known_is_as_large_as_its_covariance_says(robot_name: str) -> None:
    """Z Z' against Y C Y' in the range of the robot, with errors that are correlated: few directions stand for all."""
    model, rng = robot(robot_name), np.random.default_rng(0)
    free = free_model(model)
    root = rng.normal(size=(free.p, free.p)) * rng.uniform(0.001, 0.1, free.p)[:, None]
    covariance = root @ root.T
    directions = error_directions(free, covariance)
    assert directions.shape[0] == free.p
    assert directions.shape[1] < free.p
    known = [KnownEffect(e, np.zeros(e.p)) for e in free.free]
    torque_model = TorqueModel(model, [Payload(model)], known, uncertainty=directions)
    assert torque_model.error.c == directions.shape[1]
    Z = np.zeros((model.n, torque_model.error.c))
    ratios = []
    for _ in range(50):
        q = rng.uniform(np.maximum(model.position_lower, -3.0), np.minimum(model.position_upper, 3.0))
        sample = Sample(0.0, q, 0.5 * rng.normal(size=model.n), rng.normal(size=model.n), np.zeros(model.n))
        torque_model.split_into(sample, np.zeros((model.n, 10)), np.zeros(model.n), Z)
        Y, _ = free.split(sample)
        np.testing.assert_allclose(Z, Y @ directions, atol=1e-9 * max(np.abs(Z).max(), 1.0))
        ratios.append(np.diag(Z @ Z.T) / np.diag(Y @ covariance @ Y.T))
    assert np.all(np.mean(ratios, axis=0) > 0.85)
    assert np.max(ratios) < 1.0 + 1e-6


def test_without_an_uncertainty_nothing_is_considered() -> None:
    model = robot("small_arm")
    links = LinkInertia(model)
    known = [KnownEffect(links, links.nominal)]
    assert TorqueModel(model, [Payload(model)], known).error.c == 0
    assert TorqueModel(model, [Payload(model)], known, links=False, uncertainty=np.ones((40, 2))).error.c == 0
    with pytest.raises(ModelFileError, match=r"39 rows.*40 parameters"):
        TorqueModel(model, [Payload(model)], known, uncertainty=np.ones((39, 2)))


def test_what_does_not_fit() -> None:
    model = robot("small_arm")
    links = LinkInertia(model)
    with pytest.raises(SysidError, match=r"link_inertia.*both known and free"):
        TorqueModel(model, [links], [KnownEffect(links, links.nominal)])
    with pytest.raises(SysidError, match=r"viscous_friction.*4 parameters, 3"):
        TorqueModel(model, [], [KnownEffect(ViscousFriction(model), np.ones(3))])


def test_friction_may_be_known_and_corrected() -> None:
    model = robot("small_arm")
    friction = ViscousFriction(model)
    torque_model = TorqueModel(model, [friction], [KnownEffect(friction, np.ones(4))])
    sample = random_sample(model, np.random.default_rng(0))
    columns, rest = torque_model.split(sample)
    np.testing.assert_allclose(columns, np.diag(sample.v))
    np.testing.assert_allclose(rest, sample.tau - model.rnea(sample.q, sample.v, sample.a) - sample.v, atol=1e-9)


def test_links_that_are_known_in_two_parts() -> None:
    model, rng = robot("iiwa"), np.random.default_rng(1)
    sample = random_sample(model, rng)
    parts = [LinkInertia(model, model.joint_names[:3]), LinkInertia(model, model.joint_names[3:])]
    changes = [rng.normal(size=part.p) for part in parts]
    known = [KnownEffect(part, part.nominal + change) for part, change in zip(parts, changes, strict=True)]
    expected = model.rnea(sample.q, sample.v, sample.a)
    for part, change in zip(parts, changes, strict=True):
        expected = expected + part.torque(sample, change)
    np.testing.assert_allclose(TorqueModel(model, [], known).known_torque(sample), expected, atol=1e-9)


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_the_torque_along_a_motion_is_that_of_its_samples(robot_name: str) -> None:
    model, rng = robot(robot_name), np.random.default_rng(4)
    samples = [random_sample(model, rng) for _ in range(6)]
    q, v, a = (np.stack([getattr(s, name) for s in samples]) for name in ("q", "v", "a"))
    motion = Motion(model, 0.01 * np.arange(6.0), q, v, a, np.zeros_like(q))
    links = LinkInertia(model, model.joint_names[1:])
    friction, offset = CoulombFriction(model, model.joint_names[:1]), TorqueOffset(model)
    known = [KnownEffect(e, rng.normal(size=e.p)) for e in (friction, offset)]
    moved = KnownEffect(links, links.nominal + 0.1 * rng.normal(size=links.p))
    for effects in ([], known, [moved, *known]):
        torque_model = TorqueModel(model, [], effects)
        expected = np.stack([torque_model.known_torque(s) for s in samples])
        torques = torque_model.torques_along(motion)
        np.testing.assert_allclose(torque_model.torque_along(motion), expected, atol=1e-9 * np.abs(expected).max())
        np.testing.assert_allclose(torques.link, np.stack([_links(model, effects, s) for s in samples]), atol=1e-7)
        mass = torque_model.mass_along(q)
        np.testing.assert_allclose(mass, np.swapaxes(mass, 1, 2), atol=1e-9 * np.abs(mass).max())
        unit = np.eye(model.n)[0]
        push = _links(model, effects, samples[0], unit) - _links(model, effects, samples[0], 0.0 * unit)
        np.testing.assert_allclose(mass[0, :, 0], push, atol=1e-7)
    assert not TorqueModel(model, [LinkInertia(model)]).torque_along(motion).any()


def _links(model: RobotModel, known: list[KnownEffect], sample: Sample, a: np.ndarray | None = None) -> np.ndarray:
    only = [k for k in known if k.effect.replaces_links] or [KnownEffect(LinkInertia(model), model.pi)]
    return TorqueModel(model, [], only).known_torque(Sample(0.0, sample.q, sample.v, sample.a if a is None else a, sample.tau))


def test_effects_along_a_motion_see_what_comes_before_them() -> None:
    model = robot("small_arm")
    t = np.asarray(0.01 * np.arange(400.0))
    q = np.multiply.outer(np.sin(2.0 * t), np.full(model.n, 0.2))
    v, a = np.gradient(q, 0.01, axis=0), -4.0 * q
    motion = Motion(model, t, q, v, a, np.zeros_like(q))
    effects = [TimeDelay(model), LoadDependentFriction(model), TorqueOffset(model), Payload(model)]
    theta = [np.array([0.01]), np.tile([0.0, 0.1], model.n), np.full(model.n, 5.0), np.eye(10)[0]]
    known = [KnownEffect(e, x) for e, x in zip(effects, theta, strict=True)]
    torques = TorqueModel(model, [], known).torques_along(motion)
    link = motion.rigid_torque + motion.payload_regressor(model.default_frame) @ theta[3]
    np.testing.assert_allclose(torques.link, link, atol=1e-9)
    rub = 0.1 * np.abs(link) * np.tanh(v / 0.02)
    jumps = rub + model.friction * np.tanh(v / 0.02)
    np.testing.assert_allclose(torques.jumps, jumps, atol=1e-9)
    np.testing.assert_allclose(torques.drive, link + jumps + model.damping * v, atol=1e-9)
    late = torques.drive - 0.01 * np.gradient(torques.drive, 0.01, axis=0)
    np.testing.assert_allclose(torques.total, late + 5.0, atol=1e-9)


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_compiled_code_computes_the_same(robot_name: str) -> None:
    """Known and free effects of every kind: linear in the links, simple curves, and those that are asked."""
    model, rng = robot(robot_name), np.random.default_rng(3)
    linear, some = LinkInertia(model), model.joint_names[:1]
    kinds = [linear, CoulombFriction(model, some), ViscousFriction(model), StribeckFriction(model), RotorInertia(model)]
    known = [KnownEffect(effect, rng.normal(size=effect.p)) for effect in (*kinds, Payload(model))]
    directions = rng.normal(size=(sum(k.effect.p for k in known), 5))
    for torque_model in (
        TorqueModel(model, [Payload(model), TorqueOffset(model), QuadraticFriction(model)], known, uncertainty=directions),
        TorqueModel(model, [Payload(model)], inexact=rng.normal(size=(10 * model.n, 3))),
        TorqueModel(model, [Payload(model)], links=False),
    ):
        compiled, p = torque_model.compiled(), torque_model.p
        for _ in range(3):
            sample = random_sample(model, rng)
            Y, rest, Z = np.zeros((model.n, p)), np.empty(model.n), np.zeros((model.n, torque_model.error.c))
            torque_model.split_into(sample, Y, rest, Z)
            raw = compiled.empty.copy()
            compiled.fill(sample.t, np.stack([sample.q, sample.v, sample.a, sample.tau]), raw)
            size = max(float(np.abs(rest).max()), 1.0)
            np.testing.assert_allclose(raw[:, :p], Y, atol=1e-11 * size)
            np.testing.assert_allclose(raw[:, p], rest, atol=1e-11 * size)
            np.testing.assert_allclose(raw[:, p + 6 :], Z, atol=1e-11 * size)
