"""What every effect answers to whoever searches for causes, and what a robot's description holds of it."""

from __future__ import annotations

import numpy as np
import pytest
from motions import Motion as Motion_
from robots import random_body, random_sample, robot

from sysid_ros.effects import (
    EFFECTS,
    CoulombFriction,
    Effect,
    LoadDependentFriction,
    Motion,
    Payload,
    PreslidingHysteresis,
    Scope,
    forms_of,
)
from sysid_ros.effects.payload import COMPACT
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.inertial_parameters import from_com, to_com

ARM = "small_arm"
every_effect = pytest.mark.parametrize("effect_id", EFFECTS)


@every_effect
def test_the_forms_that_a_search_starts_from_can_be_made_and_reported(effect_id: str) -> None:
    """On each joint, or on the whole arm: columns, prior, possible values and parameters fit one another."""
    kind, model = EFFECTS[effect_id], robot(ARM)
    t = np.asarray(0.01 * np.arange(300.0))
    q, v, a = Motion_(model, 0)(t)
    recording = Motion(model, t, q, v, a, model.rnea_along(q, v, a))
    for joint in (None,) if kind.scope is Scope.ARM else range(model.n):
        for candidate in kind.candidates([recording], joint)[::10]:
            effect = kind.from_settings(model, () if joint is None else (model.joint_names[joint],), dict(candidate.settings))
            p = effect.p if candidate.basis is None else candidate.basis.shape[1]
            assert candidate.basis is None or candidate.basis.shape[0] == effect.p
            assert kind.scope is not Scope.JOINT or candidate.basis is None
            assert joint is None or effect.concerned[0] == joint
            assert np.all(effect.prior_std(candidate.form) > 0.0)
            torque = effect.reference_torque([recording])
            answers = [effect.possible(sign * np.ones(p), 0.1 * np.ones(p), candidate.form, torque) for sign in (1.0, -1.0)]
            assert all(isinstance(x, bool) for x in answers)
            values = np.append(0.1 * np.ones(p), [float(effect.settings.get(k.name, 1.0)) for k in kind.knobs])
            found = effect.as_parameters(values, 1e-6 * np.eye(len(values)), candidate.basis)
            assert found
            assert len({x.name for x in found}) == len(found)
            assert all(x.joint is None if joint is None else x.joint == model.joint_names[joint] for x in found)
            assert all(np.all(np.asarray(x.low) <= x.value) and np.all(x.value <= np.asarray(x.high)) for x in found if x.unit)


@every_effect
def test_effects_exclude_one_another_both_ways_but_for_what_they_include(effect_id: str) -> None:
    model = robot(ARM)
    one = EFFECTS[effect_id](model, model.joint_names[:1])
    assert one.excludes(EFFECTS[effect_id](model, model.joint_names[:1]))
    for other_id in EFFECTS:
        other = EFFECTS[other_id](model, model.joint_names[:1])
        if other_id not in one.includes and effect_id not in other.includes:
            assert one.excludes(other) == other.excludes(one)
    named = {one.companion, one.simpler, one.changes, *one.includes, *one.sum_of} - {""}
    assert named <= set(EFFECTS)


def test_the_forms_of_dry_friction_stand_in_order_the_simplest_first() -> None:
    forms = forms_of(CoulombFriction.family)
    assert forms[0] is CoulombFriction
    assert all(f.jumps for f in forms)
    assert forms_of("") == ()


def test_the_part_of_friction_that_grows_with_the_load_stands_beside_all_but_coulomb() -> None:
    """Alone it is the second column of the whole; with Coulomb friction beside it it would be the whole."""
    model, sample = robot(ARM), random_sample(robot(ARM), np.random.default_rng(3))
    joint = model.joint_names[1:2]
    whole, part = LoadDependentFriction(model, joint), LoadDependentFriction(model, joint, level=False)
    np.testing.assert_array_equal(part.columns(sample), whole.columns(sample)[:, 1:])
    assert (part.parameter_names, part.settings["level"]) == (whole.parameter_names[1:], False)
    for other in forms_of("dry friction"):
        beside = other.from_settings(model, joint, {})
        assert part.excludes(beside) == (other in (CoulombFriction, LoadDependentFriction)), other.id
        assert whole.excludes(beside), other.id
    with pytest.raises(ModelFileError, match="true or false"):
        LoadDependentFriction(model, level="no")  # type: ignore[arg-type]


def test_the_part_that_grows_with_the_load_builds_up_where_the_rest_does() -> None:
    model, joint = robot(ARM), robot(ARM).joint_names[1:2]
    late = LoadDependentFriction(model, joint, level=False, z_s=0.02)
    assert late.settings == {"level": False, "z_s": 0.02}
    assert LoadDependentFriction.from_settings(model, joint, late.settings).settings == late.settings
    for other in forms_of("dry friction"):
        beside = other.from_settings(model, joint, {})
        assert late.excludes(beside) == (other is not PreslidingHysteresis), other.id
    t = np.arange(4000) / 1000.0
    q = np.zeros((len(t), model.n))
    q[:, 1] = 0.5 * np.sin(2.0 * np.pi * t)
    v = np.zeros_like(q)
    v[:, 1] = np.pi * np.cos(2.0 * np.pi * t)
    a = -((2.0 * np.pi) ** 2) * q
    motion = Motion(model, t, q, v, a, np.zeros_like(q))
    turned, built = LoadDependentFriction(model, joint, level=False).columns_along(motion), late.columns_along(motion)
    bristles = PreslidingHysteresis(model, joint, z_s=0.02).columns_along(motion)
    load = np.abs(motion.link_torque[:, 1])
    np.testing.assert_allclose(built[:, 1, 0], bristles[:, 1, 0] * load, atol=1e-9)
    assert np.abs(built - turned).max() > 0.5 * np.abs(turned).max()  # not the same at a reversal
    with pytest.raises(ModelFileError, match="z_s"):
        LoadDependentFriction(model, z_s=-0.01)


def test_a_compact_body_is_a_body_whose_inertia_data_need_not_tell() -> None:
    """It costs what its mass and its centre cost, and its inertias are held where those of bodies are."""
    model = robot(ARM)
    t = np.asarray(0.01 * np.arange(300.0))
    q, v, a = Motion_(model, 0)(t)
    motion = Motion(model, t, q, v, a, np.zeros_like(q))
    for effect in (Payload, EFFECTS["link_inertia"], EFFECTS["payload_change"]):
        one = effect(model, model.joint_names[2:3])
        forms = {c.form: c for c in effect.candidates([motion], 2)}
        assert COMPACT in forms, effect.id
        assert one.free_parameters(COMPACT, 10) == 4 < one.free_parameters("", 10) == 10, effect.id
        std, full, basis = one.prior_std(COMPACT), one.prior_std(""), forms[COMPACT].basis
        mass = 1.0 if basis is None else basis[0, 0]  # of a link, which an error of its mass is a part of
        assert mass * std[0] == pytest.approx(max(model.pi[::10].sum(), 1.0)), effect.id
        assert np.all(std[4:] < 0.1), effect.id
        assert np.all(full[4:] == pytest.approx(0.1 * full[0])), effect.id


def test_curves_of_an_effect_that_writes_columns_only_are_those_columns() -> None:
    model = robot(ARM)
    t = np.asarray(0.01 * np.arange(50.0))
    q, v, a = Motion_(model, 0)(t)
    recording = Motion(model, t, q, v, a, np.zeros_like(q))
    for effect in (EFFECTS["spring"](model), EFFECTS["viscous_friction"](model)):
        np.testing.assert_array_equal(Effect.curves_along(effect, recording), effect.curves_along(recording))


def test_a_payload_is_a_part_of_the_link_that_carries_it() -> None:
    model = robot(ARM)
    rng = np.random.default_rng(5)
    mass, com, inertia = random_body(rng)
    theta = inertial_parameters.from_com(mass, com, inertia)
    payload = Payload(model)
    sample = random_sample(model, rng)
    carried = model.regressor(sample.q, sample.v, sample.a) @ payload.as_links(theta).ravel()
    np.testing.assert_allclose(carried, payload.torque(sample, theta), atol=1e-9)
    assert not EFFECTS["payload_change"](model).as_links(theta).any()


def test_parameters_of_a_combination_are_those_of_the_effect() -> None:
    effect = EFFECTS["spring"](robot(ARM), ["lift"])
    basis = np.array([[1.0], [2.0]])
    slope, level = Effect.as_parameters(effect, np.array([3.0]), np.array([[0.01]]), basis)
    assert (slope.name, slope.value, level.name, level.value) == ("along", 3.0, "across", 6.0)
    assert level.std == pytest.approx(np.hypot(0.2, 1e-3 * 6.0))


def test_a_link_that_is_off_has_the_inertia_that_goes_with_its_mass_and_place() -> None:
    """A heavier link of the same shape, elsewhere: its inertia differs by a square of how far at most."""
    model = robot(ARM)
    t = np.asarray(0.01 * np.arange(300.0))
    q, v, a = Motion_(model, 0)(t)
    motion, link = Motion(model, t, q, v, a, np.zeros_like(q)), EFFECTS["link_inertia"]
    (basis,) = [c.basis for c in link.candidates([motion], 1) if c.form == COMPACT]
    assert basis is not None
    mass, com, inertia = to_com(model.pi[10:20])
    for factor, shift in ((1.4, np.zeros(3)), (1.0, np.array([0.01, -0.02, 0.01])), (0.7, np.array([0.02, 0.01, 0.0]))):
        changed = from_com(factor * mass, com + shift, factor * inertia) - model.pi[10:20]
        own = np.asarray(np.linalg.solve(basis, changed), dtype=float)
        np.testing.assert_allclose(own[:4], [factor - 1.0, *factor * shift], atol=1e-9)
        assert np.abs(own[4:]).max() <= factor * mass * (shift @ shift) + 1e-9
        assert link(model, model.joint_names[1:2]).possible(own, np.full(10, np.inf), COMPACT)
