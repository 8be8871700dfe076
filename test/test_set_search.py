"""Sets of causes: what they predict of stretches that were left out, how usual they are, and the search over them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from robots import robot
from scipy import stats
from test_diagnosis import ARM, coulomb, record

from sysid_ros.diagnosis.fit import Estimated, allowed, visible
from sysid_ros.diagnosis.heldout import HeldOut, no_worse, plain_terms
from sysid_ros.diagnosis.left_out import LeftOut
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import SCALES, Prepared, before_gains, prepare, scales_beside
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.set_search import SetSearch
from sysid_ros.diagnosis.sets.moves import several
from sysid_ros.diagnosis.sets.never_known import unknown_columns, unknown_prior
from sysid_ros.diagnosis.sets.posterior import _Rival, _shares, posterior_of
from sysid_ros.diagnosis.sets.set_prior import _WORLDS, SetPrior
from sysid_ros.diagnosis.term import Term, conflict, conflicts
from sysid_ros.effects import EFFECTS, Scope
from sysid_ros.effects.traits import Knob
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


@cache
def rows() -> tuple[Prepared, Library]:
    train = prepare(robot(ARM), [record(coulomb, 1, 12.0)], [])
    return train, Library(robot(ARM), train.band)


def asked() -> tuple[LeftOut, list[Term]]:
    train, library = rows()
    terms = [library.local("coulomb_friction", 1), library.local("viscous_friction", 1), library.whole("payload")]
    terms.append(library.local("rotor_inertia", 2))
    noise = train.problem.fit(terms).noise
    return LeftOut([(train.problem, lambda term: term)], terms, noise, np.ones(robot(ARM).n)), terms


def columns(left_out: LeftOut, *which: int) -> np.ndarray:
    return np.concatenate([np.arange(left_out.of_each.slices[i].start, left_out.of_each.slices[i].stop) for i in which])


def test_a_set_with_more_or_less_is_predicted_as_if_it_had_been_made_anew() -> None:
    left_out, _ = asked()
    few, more = columns(left_out, 0, 3), columns(left_out, 0, 3, 2)
    prior = np.full(len(more), 1e-3)
    whole, part = left_out.of(more, prior), left_out.of(few, prior[: len(few)])
    np.testing.assert_allclose(left_out.plus(part, [columns(left_out, 2)], [prior[len(few) :]])[0], whole.likelihood, atol=1e-3)
    less = left_out.without(whole, np.arange(len(few), len(more)))
    np.testing.assert_allclose(less.likelihood, part.likelihood, atol=1e-3)
    np.testing.assert_allclose(less.theta, part.theta, rtol=1e-3, atol=1e-6)


def test_a_stretch_is_predicted_by_the_others_alone() -> None:
    """What one stretch holds changes the parameters with which every other one is predicted, and not its own."""
    train, library = rows()
    term = library.local("coulomb_friction", 1)
    noise = train.problem.fit([term]).noise
    before = LeftOut([(train.problem, lambda term: term)], [term], noise, np.zeros(robot(ARM).n))
    state = before.of(columns(before, 0), term.prior)
    for s in range(before.of_each.stretches):
        information = before.of_each.whole - before.of_each.G[s]
        score = before.of_each.score - before.of_each.b[s]
        at = state.at
        np.testing.assert_allclose(state.theta[s], np.linalg.solve(information[np.ix_(at, at)], score[at]), rtol=1e-5)


@pytest.mark.parametrize("id_", [e.id for e in EFFECTS.values() if e.scope is Scope.JOINT][:4])
def test_the_probabilities_of_all_sets_of_one_effect_add_up_to_one(id_: str) -> None:
    train, library = rows()
    joints = [int(j) for j in train.problem.active]
    prior = SetPrior(library, joints)
    terms = {j: library.local_options(id_, j)[0] for j in joints}
    free = {j: prior.cost(t) for j, t in terms.items()}  # a price of parameters and forms is no probability of a set
    sets = [[terms[j] for j, there in zip(joints, x, strict=True) if there] for x in product((0, 1), repeat=len(joints))]
    total = sum(np.exp(prior.log(s) + sum(free[t.joints[0]] for t in s)) for s in sets)
    # in each world: of an arm that has nothing else
    assert total == pytest.approx(sum(np.exp(prior._none[w] - prior._without(id_, f)) for w, f in enumerate(_WORLDS)), rel=1e-9)


def test_forms_of_one_thing_exclude_each_other_on_a_joint_and_not_on_two() -> None:
    _, library = rows()
    coulomb_, stribeck = library.local("coulomb_friction", 1), library.local("stribeck_friction", 1)
    assert conflict(coulomb_, stribeck)
    assert not conflict(coulomb_, library.local("stribeck_friction", 2))
    assert not conflict(coulomb_, library.local("viscous_friction", 1))


def test_a_model_that_predicts_worse_gives_way_to_the_plain_baseline() -> None:
    model = robot(ARM)
    train, library = rows()
    judged = prepare(model, [record(coulomb, 2, 8.0)], [])
    wrong = train.problem.fit([library.local("torque_offset_drift", 1)])
    held = HeldOut.of(model, judged, wrong)
    fit = no_worse(train.problem, library, wrong, held)
    assert "coulomb_friction" in {t.id for t in fit.terms}
    assert np.linalg.norm(held.rms(held.residual(fit))) < np.linalg.norm(held.rms(held.residual(wrong)))
    right = train.problem.fit([t for j in train.problem.active for t in plain_terms(library, int(j))])
    held.add(right.terms)
    assert no_worse(train.problem, library, right, held) is right


def test_one_joint_that_is_predicted_worse_takes_no_cause_from_the_others() -> None:
    model = robot(ARM)
    train, library = rows()
    judged = prepare(model, [record(coulomb, 2, 8.0)], [])
    cause, drift = library.local("coulomb_friction", 1), library.local("torque_offset_drift", 0)
    wrong = train.problem.fit([cause, drift])
    theta = wrong.theta.copy()
    theta[wrong.slices[wrong.terms.index(drift)]] = 50.0
    wrong = replace(wrong, theta=theta)
    held = HeldOut.of(model, judged, wrong)
    nothing = np.linalg.norm(held.rms(held.residual(train.problem.fit([]))))
    assert np.linalg.norm(held.rms(held.residual(wrong))) > 2.0 * nothing
    fit = no_worse(train.problem, library, wrong, held)
    assert cause in fit.terms
    assert drift not in fit.terms
    assert np.linalg.norm(held.rms(held.residual(fit))) < 0.5 * nothing


def pushing(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    """Friction of the wrong sign."""
    return 2.0 * tau - coulomb(model, t, q, v, a, tau)


def test_nothing_that_physics_forbids_takes_the_place_of_a_model_that_predicts_worse() -> None:
    model = robot(ARM)
    train, judged = (prepare(model, [record(pushing, seed, 12.0)], []) for seed in (1, 2))
    library = Library(model, train.band)
    wrong = train.problem.fit([library.local("torque_offset_drift", 1)])
    held = HeldOut.of(model, judged, wrong)
    baseline = train.problem.fit([t for j in train.problem.active for t in plain_terms(library, int(j))])
    assert min(float(baseline.theta_of(t)[0]) for t in baseline.terms if t.effect.nonnegative) < -0.1
    fit = no_worse(train.problem, library, wrong, held)
    assert all(float(fit.theta_of(t)[0]) > 0.0 for t in fit.terms if t.effect.nonnegative)


def test_the_probability_of_a_cause_is_shared_with_what_stands_in_for_it() -> None:
    train, library = rows()
    selection = Selection(train.problem, library, train.nominal)
    selection.run()
    judged = prepare(robot(ARM), [record(coulomb, 2, 8.0)], [])
    posterior = selection.judged_with(HeldOut.of(robot(ARM), judged, selection.fit))
    assert {t.id for t in posterior.probability} == {"coulomb_friction"}
    for term, probability in posterior.probability.items():
        assert 0.5 < probability <= 1.0
        assert probability + sum(posterior.instead[term].values()) <= 1.0 + 1e-9


def gear(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    """Friction that is higher when a joint starts, grows with its load, and is measured with a gain."""
    out = tau.copy()
    level = 1.5 + 0.9 * np.exp(-((v[:, 1] / 0.12) ** 2)) + 0.12 * np.abs(tau[:, 1])
    out[:, 1] = 1.2 * (tau[:, 1] + np.sign(v[:, 1]) * level + 1.1 * v[:, 1])
    return out


def test_what_grows_with_the_load_stands_beside_another_dry_friction_and_a_gain_is_one_of_both() -> None:
    model = robot(ARM)
    train = prepare(model, [record(gear, 1, 20.0)], [])
    selection = Selection(train.problem, Library(model, train.band), train.nominal)
    selection.run()
    held = HeldOut.of(model, prepare(model, [record(gear, 2, 8.0)], []), selection.fit)
    posterior = selection.judged_with(held)
    found = {t.id: selection.fit.theta_of(t) for t in selection.fit.terms if t.row == 1}
    assert set(found) == {"stribeck_friction", "load_dependent_friction", "viscous_friction", "torque_scale"}
    assert posterior.probability.keys() >= set(selection.fit.terms)
    np.testing.assert_allclose(found["torque_scale"], [0.2], atol=0.02)
    np.testing.assert_allclose(found["load_dependent_friction"], [0.12], atol=0.02)
    np.testing.assert_allclose(found["stribeck_friction"], [1.5, 2.4], rtol=0.08)
    np.testing.assert_allclose(found["viscous_friction"], [1.1], rtol=0.08)


def test_what_every_joint_has_comes_in_place_of_an_unusual_term_and_of_another_form_of_it() -> None:
    """Without it a friction with the square of the speed stays where a bump at slow speeds, viscous friction and friction by the
    load are more probable, and no one, two or two for one of these is."""
    _, library = rows()
    by_load = [t for j in (1, 2) for t in library.local_options("load_dependent_friction", j)]
    with_level, without = (next(t for t in by_load if t.row == 1 and t.effect.settings["level"] is x) for x in (True, False))
    pool = [library.local("quadratic_friction", 1), with_level, library.local("viscous_friction", 1)]
    pool += [library.local("stribeck_friction", 1), without, library.local("viscous_friction", 2)]
    wanted = several(pool, conflicts(pool), [0, 1], most_pairs=12)
    assert [2, 3, 4] in wanted[frozenset({0, 1})]
    assert all(not {1, 4} <= set(new) and not {1, 3} <= set(new) | {1} - gone for gone, each in wanted.items() for new in each)
    assert not any(5 in new for gone, each in wanted.items() if 0 in gone for new in each)
    assert all(0 in gone or len(new) < 3 for gone, each in wanted.items() for new in each)


def test_what_is_too_small_to_be_told_is_in_the_model_all_the_same() -> None:
    """What an effect makes must not be left to others because it is too small for a name of its own."""
    train, library = rows()
    fit = train.problem.fit([library.local("coulomb_friction", 1), library.local("viscous_friction", 1)])
    viscous = fit.terms[1]
    fit.theta[fit.slices[1]] = 1e-3
    assert not visible(train.problem, fit, viscous)
    assert allowed(train.problem, fit, viscous)


def test_what_is_told_in_place_of_the_most_probable_set_is_no_more_probable_for_that() -> None:
    """Each of many weak terms alone may be as good as none; all of them together are not."""
    train, library = rows()
    joints = [int(j) for j in train.problem.active]
    terms = [t for j in joints for t in plain_terms(library, j)]
    noise = train.problem.fit(terms).noise
    prior = SetPrior(library, joints)
    search = SetSearch(train.problem, [(train.problem, lambda t: t)], terms, prior, noise, np.ones(robot(ARM).n), lambda *_: True)
    plain = search.state(range(len(terms)), 0)
    (true,) = [i for i, t in enumerate(terms) if t.id == "coulomb_friction" and t.row == 1]
    best = search.state([true], 0)
    assert best.score > plain.score + 10.0
    alone, beside = posterior_of(search, plain), posterior_of(search, plain, best)
    assert beside.probability[terms[true]] > 0.99
    others = [t for i, t in enumerate(terms) if i != true]
    assert max(beside.probability[t] for t in others) < 1e-3
    assert all(beside.probability[t] <= alone.probability[t] + 1e-9 for t in others)
    gone = {frozenset(set(plain.members) - set(members)) for members, _ in search.without_effect(plain)}
    assert gone == {frozenset(i for i, t in enumerate(terms) if t.id == name) for name in {t.id for t in terms}}


def test_friction_that_turns_late_is_no_inertia() -> None:
    """A sign that follows the velocity late, hard or soft, is among what is never known of a joint."""
    train, _ = rows()
    (motion,) = train.motions
    dry = np.full(robot(ARM).n, 20.0)
    known = unknown_columns(train.problem, dry)
    assert known.shape[0] == len(unknown_prior(1.0))
    for width in (0.005, 0.05):
        late = 20.0 * (np.tanh((motion.v + 0.0005 * motion.a) / width) - np.tanh(motion.v / width))
        column = train.problem.band.curves([late[None]])[0]
        left = column[:, 1] - known[:, :, 1].T @ np.linalg.lstsq(known[:, :, 1].T, column[:, 1], rcond=None)[0]
        assert np.linalg.norm(left) < 0.3 * np.linalg.norm(column[:, 1])


def far_off(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
    """Friction that is measured with a gain of more than twice what it should be."""
    out = tau.copy()
    out[:, 1] = 2.6 * (tau[:, 1] + 1.5 * np.sign(v[:, 1]) + 1.1 * v[:, 1])
    return out


def test_a_gain_far_from_one_leaves_friction_that_takes_power() -> None:
    """Friction by a gain of links alone is as large as that gain; divided by it only once it would change its sign."""
    model = robot(ARM)
    train = prepare(model, [record(far_off, 1, 12.0)], [])
    selection = Selection(train.problem, Library(model, train.band), train.nominal)
    library = selection.library
    terms = [library.local(x, 1) for x in ("coulomb_friction", "viscous_friction", "torque_scale")]
    selection.fit = train.problem.fit(terms)
    selection.refresh()  # now the gain is of the links' torque, and friction is there
    links = before_gains(selection.fit)
    library.apart = False
    selection.fit = links
    selection.refresh()
    theta = {t.id: float(selection.fit.theta_of(t)[0]) for t in selection.fit.terms}
    np.testing.assert_allclose([theta[t.id] for t in terms], [1.5, 1.1, 1.6], rtol=0.03)


def test_a_rival_that_physics_forbids_is_weighed_without_what_it_forbids() -> None:
    train, library = rows()
    _, terms = asked()
    noise = train.problem.fit(terms).noise
    prior = SetPrior(library, [int(j) for j in train.problem.active])
    beside_coulomb = terms[1]

    def needs_coulomb(fit: Estimated, term: Term) -> bool:
        return term is not beside_coulomb or terms[0] in fit.terms

    search = SetSearch(train.problem, [(train.problem, lambda t: t)], terms, prior, noise, np.zeros(robot(ARM).n), needs_coulomb)
    assert search.lawful([0, 1, 3], 0) == (0, 1, 3)
    assert search.lawful([1, 3], 0) == (3,)
    posterior = posterior_of(search, search.state([0, 1], 0))
    assert posterior.probability[terms[0]] > 0.99
    assert set(posterior.probability) == set(terms[:2])


def test_a_knob_is_searched_in_its_range() -> None:
    knob = Knob("harmonic", 3.0, 60.0, "1/rev", False, reach=0.6)
    assert knob.around(3.25) == (3.0, 3.85)
    assert knob.around(60.0) == (60.0 - 0.6, 60.0)
    assert knob.around(2.0) == (2.0, 2.6)  # a value that was given


@pytest.mark.parametrize("carried", [False, True])
def test_a_body_is_weighed_against_links_that_are_all_more_inexact(carried: bool) -> None:
    """A wrong link, and what is carried: links 5 mm elsewhere were told as a payload of three grams."""
    train, library = rows()
    bodies = [t for t in library.whole_options() if t.effect.replaces_links or t.effect.carried]
    link = next(t for t in bodies if t.effect.carried is carried)
    terms = [library.local("coulomb_friction", 1), link]
    prior = SetPrior(library, [int(j) for j in train.problem.active])
    noise = train.problem.fit(terms, inexact=True).noise
    plain = [(train.problem, lambda t: t)]
    search = SetSearch(train.problem, plain, terms, prior, noise, np.zeros(robot(ARM).n), lambda fit, term: True)
    state = search.state([0, 1], 1)
    (rival,) = search.all_inexact(state)
    assert rival.members == (0,)
    # no step from there, nor from where it started, is better
    assert rival.score >= max(
        search.state([0], scale).score for scale in (state.scale, *scales_beside(state.scale), *scales_beside(rival.scale))
    )
    assert search.all_inexact(search.state([0], 1)) == []
    # the recordings are those of the URDF's bodies: a link of its own is less likely than that
    assert posterior_of(search, state).probability[link] < 0.5


def test_masses_and_places_are_inexact_each_by_itself() -> None:
    """Moments of inertia follow the masses."""
    train, _ = rows()
    problem, n = train.problem, robot(ARM).n
    of_masses, of_places = problem.prior_of((4.0, 0.05)), problem.prior_of((0.05, 4.0))
    usual = problem.prior_of((1.0, 1.0))
    moments = len(usual) - 4 * n
    assert moments > 0
    np.testing.assert_allclose(of_masses / usual, [*[1 / 16] * n, *[400] * 3 * n, *[1 / 16] * moments])
    np.testing.assert_allclose(of_places / usual, [*[400] * n, *[1 / 16] * 3 * n, *[400] * moments])
    every = range(len(SCALES))
    assert all(i in scales_beside(k) for k in every for i in every if k in scales_beside(i))
    reached, grown = {0}, {0}
    while grown:
        grown = {k for i in grown for k in scales_beside(i)} - reached
        reached |= grown
    assert reached == set(range(len(SCALES)))


@pytest.mark.parametrize(("part", "told"), [(0.01, False), (0.15, True)])
def test_an_offset_is_told_where_it_is_more_than_dry_friction_differs_by_direction(part: float, told: bool) -> None:
    """However small the noise is."""
    dry = 20.0

    def off(model: RobotModel, t: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> FloatArray:
        out = coulomb(model, t, q, v, a, tau).copy()
        out[:, 1] += part * dry
        return out

    train = prepare(robot(ARM), [record(off, 1, 12.0)], [])
    library = Library(robot(ARM), train.band)
    terms = [library.local("coulomb_friction", 1), library.local("torque_offset", 1)]
    noise = train.problem.fit(terms).noise
    level = np.zeros(robot(ARM).n)
    level[1] = dry
    prior = SetPrior(library, [int(j) for j in train.problem.active])
    search = SetSearch(train.problem, [(train.problem, lambda t: t)], terms, prior, noise, level, lambda *_: True)
    probability = posterior_of(search, search.state([0, 1], 0)).probability
    assert probability[terms[0]] > 0.99
    assert (probability[terms[1]] > 0.5) is told


def test_rows_that_scatter_more_than_their_noise_tell_less() -> None:
    rng = np.random.default_rng(3)
    rivals = [_Rival("", -6.0 + rng.normal(size=200), 2.0)]
    surely, less = (1.0 - float(_shares(rivals, scatter).sum()) for scatter in (1.0, 4.0))
    assert surely > 0.9
    assert less < 0.5


@pytest.mark.parametrize(("effect", "size"), [("external_force", 5.0), ("torque_scale", 0.5)])
def test_a_cause_that_is_far_smaller_than_on_robots_costs_what_its_usual_size_makes_of_it(effect: str, size: float) -> None:
    """Occam's factor of a normal prior of the usual size: ``log(size / std)`` a parameter, one of which a prediction pays."""
    train, library = rows()
    problem = train.problem
    prior = SetPrior(library, [int(j) for j in problem.active])
    term = library.whole(effect) if effect == "external_force" else library.local(effect, 1)
    variance = np.full(problem.y.shape, 1e-12)
    std = term.std_alone(variance, problem.active)
    (cost,) = prior.costs([term], variance, problem.active)
    row = 0.5 * np.log(len(train.band.f)) - 1.0
    assert cost == pytest.approx(prior.cost(term) + np.sum(np.log(size / std) - 1.0 - row))
    rough = np.full(problem.y.shape, 1e6)
    assert prior.costs([term], rough, problem.active) == pytest.approx(prior.cost(term))  # of rows that tell no small ones
    quiet = library.local("viscous_friction", 1)
    assert prior.costs([quiet], variance, problem.active) == pytest.approx(prior.cost(quiet))  # any size is usual


def test_a_cause_that_is_a_far_smaller_share_of_the_torque_than_on_robots_costs_more() -> None:
    train, library = rows()
    problem = train.problem
    prior, term = SetPrior(library, [int(j) for j in problem.active]), library.local("spring", 1)
    usual = float(np.sqrt(np.mean(np.concatenate([m.tau[:, 1] for m in library.motions]) ** 2)))
    sizes = term.sizes_that_make(term.effect.share * usual)
    np.testing.assert_allclose(np.sqrt(np.mean((term.columns * sizes) ** 2, axis=0)), term.effect.share * usual)
    variance = np.full(problem.y.shape, 1e-12)
    (cost,) = prior.costs([term], variance, problem.active)
    row = 0.5 * np.log(len(train.band.f)) - 1.0
    std = term.std_alone(variance, problem.active)
    assert cost == pytest.approx(prior.cost(term) + np.sum(np.log(sizes / std) - 1.0 - row))


def test_a_cause_is_as_probable_as_what_is_known_of_its_size_allows() -> None:
    """The ratio of Savage and Dickey against the integral of the likelihood over the prior."""
    train, library = rows()
    prior, term = SetPrior(library, [int(j) for j in train.problem.active]), library.local("torque_scale", 1)
    gains = np.linspace(-4.0, 4.0, 80001)
    before = stats.norm.pdf(gains, scale=term.effect.size)
    for value, std in ((0.02, 0.01), (0.3, 0.05), (0.0, 0.2)):
        likelihood = stats.norm.pdf(value, loc=gains, scale=std)
        ratio = np.trapezoid(likelihood * before, gains) / stats.norm.pdf(value, scale=std)
        odds = ratio * np.exp(prior.log([term]) + prior.cost(term) - prior.log([]))
        known = std**-2.0 + term.prior[0]  # a fit has what is known before any data in it
        told = prior.surely(term, [], np.array([value * std**-2.0 / known]), np.array([[1.0 / known]]))
        assert told == pytest.approx(odds / (1.0 + odds), rel=1e-3)
    friction = library.local("viscous_friction", 1)
    assert prior.surely(friction, [], np.zeros(1), np.eye(1)) == 1.0  # of any size


def test_a_body_of_which_data_tell_nothing_is_as_probable_as_before_them() -> None:
    train, library = rows()
    prior = SetPrior(library, [int(j) for j in train.problem.active])
    term = library.whole("payload")
    odds = np.exp(prior.log([term]) + prior.cost(term) - prior.log([]))
    assert prior.surely(term, [], np.zeros(term.p), np.diag(1.0 / term.prior)) == pytest.approx(odds / (1.0 + odds), rel=1e-3)


def test_what_rows_tell_of_a_term_alone_is_what_a_fit_of_it_alone_says() -> None:
    train, library = rows()
    for term in (library.local("viscous_friction", 1), library.whole("external_force")):
        fit = train.problem.fit([replace(term, columns=term.columns[..., :1])])
        std = term.std_alone(fit.variance, train.problem.active)
        np.testing.assert_allclose(std[:1], fit.std_of(fit.terms[0]), rtol=1e-6)


def test_what_is_impossible_by_less_than_its_noise_is_allowed() -> None:
    """A rotor that a slow motion leaves at -.007 +- .06: no set that has it is impossible for that."""
    _, library = rows()
    rotor, shares = library.local("rotor_inertia", 2), library.local("load_dependent_friction", 1)
    assert rotor.possible(np.array([-0.007]), np.array([0.06]))
    assert not rotor.possible(np.array([-0.2]), np.array([0.06]))
    assert shares.possible(np.full(shares.p, -0.01), np.full(shares.p, 0.02))
    assert not shares.possible(np.full(shares.p, -0.1), np.full(shares.p, 0.02))


@pytest.mark.parametrize("size", [0.5, 3.0])
def test_a_term_that_takes_measured_torque_away_costs_what_that_would_as_a_signal(size: float) -> None:
    """As noise that is so much stronger, in the time that it lasts."""
    train, library = rows()
    problem, rng = train.problem, np.random.default_rng(1)
    prior, variance = SetPrior(library, [int(j) for j in problem.active]), rng.uniform(0.5, 2.0, size=problem.y.shape)
    limit = float(np.quantile(np.abs(library.motions[0].tau[:, 1]), 0.8))
    term = library.local("torque_saturation", 1, limit=limit, kind="motor")
    lasts = library.lasts(term)
    assert lasts == pytest.approx(0.2, abs=0.01)
    drawn = size * np.sqrt(variance[:, 1]) * rng.normal(size=len(variance))
    each = stats.norm.logpdf(drawn, scale=np.sqrt(variance[:, 1])) + 0.5 * drawn**2 / variance[:, 1]  # of noise that is 0
    own = stats.norm.logpdf(drawn, scale=np.sqrt((1.0 + size**2) * variance[:, 1]))
    taken = replace(term, columns=np.sqrt(lasts) * drawn[:, None])
    assert prior.unsaid(taken, variance) == pytest.approx(lasts * np.sum(each - own), rel=0.05)
    assert prior.costs([taken], variance, problem.active)[0] > prior.cost(term) + 0.5 * prior.unsaid(taken, variance)
    never = library.local("torque_saturation", 1, limit=1e3, kind="motor")
    of_motion = library.local("torque_saturation", 1, limit=limit, kind="sensor")
    assert prior.unsaid(never, variance) == prior.unsaid(of_motion, variance) == 0.0
