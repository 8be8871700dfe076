"""Links that are inexact: what moves with them, how uncertain they leave a cause, and gains that stand in for a body."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest
from robots import random_body, robot
from scipy.stats import multivariate_normal
from test_diagnosis import ARM, payload, record

from sysid_ros.diagnosis.covariance import with_knobs
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import ARM as LEVER
from sysid_ros.diagnosis.prepare import SCALES, Prepared, inexact_links, prepare
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.set_search import SetSearch
from sysid_ros.diagnosis.sets.set_prior import SetPrior
from sysid_ros.diagnosis.term import Term
from sysid_ros.robot.inertial_parameters import by_centre, from_com
from sysid_ros.robot.link_inexactness import by_moments


@cache
def rows() -> tuple[Prepared, Library]:
    train = prepare(robot(ARM), [record(payload, 1, 12.0)], [])
    return train, Library(robot(ARM), train.band)


@pytest.mark.parametrize("seed", range(3))
def test_a_centre_of_mass_moves_with_its_inertia(seed: int) -> None:
    mass, com, inertia = random_body(np.random.default_rng(seed))
    body = from_com(mass, com, inertia)
    for k, axis in enumerate(1e-6 * np.eye(3)):
        sides = [from_com(mass, com + x, inertia) for x in (axis, -axis)]
        np.testing.assert_allclose(by_centre(body)[:, k], (sides[0] - sides[1]) / 2e-6, rtol=1e-6, atol=1e-9)


def test_principal_moments_are_those_about_the_centre_of_mass() -> None:
    rng = np.random.default_rng(0)
    mass, com, axes = 2.0, rng.normal(size=3), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    moments = np.array([0.1, 0.2, 0.25])
    body = from_com(mass, com, axes @ np.diag(moments) @ axes.T)
    for k, part in enumerate(0.1 * np.eye(3)):
        more = from_com(mass, com, axes @ np.diag(moments * (1.0 + part)) @ axes.T)
        np.testing.assert_allclose(0.1 * by_moments(body)[:, k], more - body, atol=1e-12)
    assert not by_moments(np.zeros(10)).any()


def test_inexact_links_are_bodies_that_move() -> None:
    model = robot(ARM)
    links, n = inexact_links(model), model.n
    basis = links.basis
    assert links.scaled_by.tolist() == [1] * n + [2] * 3 * n + [1] * (len(links.std) - 4 * n)
    moments = basis[:, 4 * n :].reshape(n, 10, -1)
    assert moments.any()
    assert not moments[:, :4].any()
    for j, body in enumerate(model.pi.reshape(-1, 10)):
        own = basis[10 * j : 10 * j + 10]
        np.testing.assert_allclose(own[:, j], body)
        np.testing.assert_allclose(own[:, n + 3 * j : n + 3 * j + 3], LEVER * by_centre(body))


def test_a_size_is_averaged_over_how_inexact_the_links_are() -> None:
    train, library = rows()
    problem, term = train.problem, library.whole("payload")
    each = {}
    noise = problem.fit([term], inexact=True).noise
    for k in (SCALES.index((0.3, 1.0)), SCALES.index((4.0, 1.0))):
        problem.scale = SCALES[k]
        fit = problem.fit([term], noise, 0, inexact=True)
        each[k] = with_knobs(problem, library, fit).of[term]
    narrow, wide = each
    only = with_knobs(problem, library, fit, np.eye(len(SCALES))[narrow]).of[term]
    rounding = 1e-4 * np.sqrt(np.diag(only.covariance))  # its last digits are those of sums in another order
    assert np.all(np.abs(only.values - each[narrow].values) < rounding)
    # how much more than the noise the rows scatter is judged from what each fit leaves
    np.testing.assert_allclose(np.diag(only.covariance), np.diag(each[narrow].covariance), rtol=0.05)
    both = with_knobs(problem, library, fit, 0.5 * np.eye(len(SCALES))[[narrow, wide]].sum(axis=0)).of[term]
    between = 0.25 * (each[narrow].values - each[wide].values) ** 2
    expected = 0.5 * np.diag(each[narrow].covariance + each[wide].covariance) + between
    np.testing.assert_allclose(np.diag(both.covariance), expected, rtol=0.05)
    assert both.covariance[0, 0] > each[narrow].covariance[0, 0]
    problem.scale = (1.0, 1.0)


def test_how_inexact_links_are_is_asked_of_the_marginal_likelihood() -> None:
    """Of all rows as one normal distribution."""
    train, library = rows()
    problem, terms = train.problem, [library.local("coulomb_friction", 1)]
    noise = problem.fit(terms, inexact=True).noise
    prior = SetPrior(library, [int(j) for j in problem.active])
    search = SetSearch(problem, [(problem, lambda t: t)], terms, prior, noise, np.zeros(robot(ARM).n), lambda fit, term: True)
    each = search.left_out.of_each
    found = {}
    for k in (SCALES.index((0.3, 0.3)), SCALES.index((1.0, 1.0)), SCALES.index((4.0, 4.0))):
        at, known = search._columns((0,), k)
        # rows with the same information and score
        X = np.linalg.cholesky(each.whole[np.ix_(at, at)] + 1e-9 * np.eye(len(at))).T
        y = np.linalg.solve(X.T, each.score[at])
        known = np.maximum(known, 1e-6)  # a prior of nothing is no distribution
        density = multivariate_normal.logpdf(y, cov=X / known @ X.T + np.eye(len(at)))
        found[k] = float(density + prior.of(prior.counts([prior.number(t) for t in terms]), 0.0, k))
    odds = search.odds_of_scales((0,))
    assert odds.sum() == pytest.approx(1.0)
    (first, a), *others = found.items()
    for k, b in others:
        assert np.log(odds[k] / odds[first]) == pytest.approx(b - a, abs=0.02)


def test_links_of_a_real_arm_are_not_exact() -> None:
    """Where most of what real arms have is found the links are not those of a simulation."""
    train, library = rows()
    joints = [int(j) for j in train.problem.active]
    prior = SetPrior(library, joints)
    usual = [library.local(name, j) for name in ("coulomb_friction", "viscous_friction", "rotor_inertia") for j in joints]
    exact, inexact = 0, SCALES.index((1.0, 1.0))

    def odds(terms: list[Term]) -> float:
        counts = prior.counts([prior.number(t) for t in terms])
        return prior.of(counts, 0.0, exact) - prior.of(counts, 0.0, inexact)

    assert odds(usual) < 0.0 < odds([])
    counts = prior.counts([prior.number(t) for t in usual])
    every = [prior.of(counts, 0.0, k) for k in range(len(SCALES))]
    assert np.logaddexp.reduce(every) == pytest.approx(prior.of(counts, 0.0))


def test_gains_made_of_the_torque_of_a_body_do_not_stand_in_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """All gains doubled and all links half as heavy are the links and, once more, what those gains are made of."""
    train = prepare(robot(ARM), [record(payload, 1, 12.0)], [])
    selection = Selection(train.problem, Library(robot(ARM), train.band), train.nominal)
    body = selection.library.whole("payload")
    selection.fit = train.problem.fit([*selection.fit.terms, body], inexact=True)
    selection.refresh()
    with_body = selection.fit
    gains = [selection.library.local("torque_scale", j) for j in range(robot(ARM).n)]
    asked_for: list[set[str]] = []

    def climbed(rows: Any, asked: Sequence[Term], thorough: bool) -> tuple[None, Fit, None]:
        asked_for.append({t.id for t in asked})
        if len(asked_for) > 1:
            return None, selection.fit, None
        kept = [t for t in selection.fit.terms if t.id != "payload"]
        train.problem.scale = (4.0, 4.0)
        return None, train.problem.fit([*kept, *gains], selection.fit.noise, 0, inexact=True), None

    monkeypatch.setattr(selection, "_climbed", climbed)
    monkeypatch.setattr(selection, "_asked", lambda: [*selection.fit.terms, *gains])
    selection.climb()
    assert ["torque_scale" in x for x in asked_for] == [True, False]
    assert {t.key for t in selection.fit.terms} == {t.key for t in with_body.terms}


def test_what_a_link_is_off_by_counts_all_that_it_may_be_inexact_by() -> None:
    """Where the mass of a link lies that is heavier as a whole is as uncertain as that of any link."""
    train, library = rows()
    problem, name = train.problem, robot(ARM).joint_names[1]
    found = []
    for form in ("scale", "compact"):
        term = next(t for t in library.whole_options(lambda kind: kind.replaces_links) if t.joints == (1,) and t.form == form)
        everything = with_knobs(problem, library, problem.fit([term], inexact=True))
        estimates = everything.of[term]
        assert estimates.basis is not None
        covariance = estimates.basis @ estimates.covariance @ estimates.basis.T
        np.testing.assert_allclose(everything.links[10:20, 10:20], covariance, rtol=1e-6, atol=1e-12)
        found.append(term.effect.as_parameters(estimates.values, estimates.covariance, estimates.basis))
    for mass, moment in found:
        assert mass.joint == name
        assert np.all(np.asarray(moment.std) > 1e-4)
    assert np.linalg.eigvalsh(everything.links).min() > -1e-12
