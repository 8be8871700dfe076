"""Rows that were not fitted are as likely as parameters, as uncertain as they are, make them."""

from __future__ import annotations

from functools import cache

import numpy as np
from robots import robot
from test_diagnosis import ARM, coulomb, record

from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.left_out import LeftOut, Predicted
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import SCALES, prepare
from sysid_ros.diagnosis.set_search import SetSearch
from sysid_ros.diagnosis.sets.link_scales import LinkScales
from sysid_ros.diagnosis.sets.prediction_spread import powers
from sysid_ros.diagnosis.sets.set_prior import SetPrior
from sysid_ros.sample import FloatArray


@cache
def searched() -> SetSearch:
    """Four terms and inexact links, with a held-out recording."""
    model = robot(ARM)
    train, judged = (prepare(model, [record(coulomb, seed, seconds)], []) for seed, seconds in ((1, 12.0), (2, 8.0)))
    library = Library(model, train.band)
    terms = [library.local("coulomb_friction", 1), library.local("viscous_friction", 1), library.whole("payload")]
    terms.append(library.local("rotor_inertia", 2))
    fit = train.problem.fit(terms)
    held = HeldOut.of(model, judged, fit)
    held.add(terms)
    rows = [(train.problem, lambda term: term), (held.prepared.problem, lambda term: held.terms[term])]
    prior = SetPrior(library, [int(j) for j in train.problem.active])
    return SetSearch(train.problem, rows, terms, prior, fit.noise, np.ones(model.n), lambda *_: True)


def columns(left_out: LeftOut, *which: int) -> np.ndarray:
    return np.concatenate([np.arange(left_out.of_each.slices[i].start, left_out.of_each.slices[i].stop) for i in which])


def by_definition(left_out: LeftOut, state: Predicted) -> FloatArray:
    """Student's density with the spread of the rows, for each held-out stretch."""
    each, out = left_out.of_each, []
    C = np.linalg.inv(each.whole[np.ix_(state.at, state.at)] + np.diag(state.prior))
    for s in np.flatnonzero(~each.fitted):
        total = -0.5 * float(state.theta[s] ** 2 @ state.prior) / each.stretches
        for j, x in each.x.items():
            place = each.place[j][state.at]
            X = np.where(place[:, None] >= 0, x[s][place], 0.0)
            r, K = each.y[s, j] - state.theta[s] @ X, X.T @ C @ X
            size, counted, one = each.size[s, j], each.size[s, j] / each.length[s], np.eye(X.shape[1])
            level = max(r @ np.linalg.solve(one + K, r) / size, 1.0)
            A = one + K / level
            total -= size * np.log1p(r @ np.linalg.solve(A, r) / size) + 0.5 * counted * np.linalg.slogdet(A)[1]
        out.append(total)
    return np.array(out)


def test_the_density_is_that_of_rows_with_the_covariance_of_the_parameters() -> None:
    left_out = searched().left_out
    at = np.concatenate([columns(left_out, 0, 2, 3), left_out.of_each.inexact])
    state = left_out.of(at, np.full(len(at), 500.0))
    held_out = ~left_out.of_each.fitted
    assert 4 < held_out.sum() < left_out.of_each.stretches
    np.testing.assert_allclose(state.likelihood[held_out], by_definition(left_out, state), rtol=1e-6)


def test_a_set_with_more_or_less_is_as_likely_as_if_it_had_been_made_anew() -> None:
    left_out = searched().left_out
    for extra in (1, 2):  # of one parameter, and of several
        few, new = columns(left_out, 0, 3), columns(left_out, extra)
        prior = np.full(len(few) + len(new), 1e-3)
        whole, part = left_out.of(np.r_[few, new], prior), left_out.of(few, prior[: len(few)])
        np.testing.assert_allclose(left_out.plus(part, [new], [prior[len(few) :]])[0], whole.likelihood, atol=2e-3)
        gone = np.arange(len(few), len(prior))
        np.testing.assert_allclose(left_out.without(whole, gone).likelihood, part.likelihood, atol=2e-3)
        np.testing.assert_allclose(left_out.likelihood_without(whole, gone), part.likelihood, atol=2e-3)


def test_links_are_weighed_at_every_scale_as_if_the_set_had_been_made_anew() -> None:
    search = searched()
    scales = list(range(1, len(SCALES)))
    at = search._columns((0, 2), 1)[0]
    priors = np.stack([search._columns((0, 2), k)[1] for k in scales])
    likelihood, narrowed = LinkScales(search.left_out, at, priors).of(range(len(scales)))
    for k, found, cost in zip(scales, likelihood, narrowed, strict=True):
        state = search.state((0, 2), k)
        np.testing.assert_allclose(found, state.likelihood, rtol=1e-6, atol=1e-4)
        assert abs(cost - state.narrowed) < 1e-3


def drawn(level: float) -> tuple[float, float]:
    """Mean power of a row, with the parameters taken as known and as they are known, over the noise's, where the parameters are
    as the posterior says and the noise of the held-out rows has some level."""
    rng, left_out = np.random.default_rng(0), searched().left_out
    each = left_out.of_each
    at = np.concatenate([columns(left_out, 2), each.inexact])
    state = left_out.of(at, np.full(len(at), 1.0))
    C, held_out = state.covariance[each.predicting], ~each.fitted
    raw, turned = [], []
    for _ in range(200):
        error = rng.multivariate_normal(np.zeros(len(at)), C, method="eigh")
        for j, x in each.held_out_x.items():
            place = each.place[j][at]
            loads = place >= 0
            noise = np.sqrt(level) * rng.normal(size=(len(x), x.shape[2]))
            r = error[loads] @ x[:, place[loads]] + noise
            raw.append(np.mean(r**2) / level)
            power, _ = powers(state.spread[j][None], r[None], each.size[held_out, j])
            turned.append(float(np.mean(power)) / x.shape[2] / level)
    return float(np.mean(raw)), float(np.mean(turned))


def test_an_error_as_large_as_the_parameters_are_uncertain_says_nothing() -> None:
    raw, turned = drawn(1.0)
    assert raw > 1.015
    assert 0.985 < turned < 1.01


def test_noise_of_another_level_makes_no_parameter_more_uncertain() -> None:
    """Else what no cause explains would be explained by any whose size is not known well."""
    raw, turned = drawn(400.0)
    assert 0.98 < turned / raw < 1.0
