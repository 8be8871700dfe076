"""On a tilted base what links differ by has gravity from another side: it stands in every column of links."""

from __future__ import annotations

import numpy as np
import pytest
from robots import robot
from test_diagnosis import ARM, record

from sysid_ros.diagnosis.corrections import correct
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.effects.base_tilt import tilted_gravity

TILT = np.array([0.08, -0.06])


def test_columns_of_links_and_of_the_tilt_add_up_to_the_torque_on_a_tilted_base() -> None:
    model = robot(ARM)
    train = prepare(model, [record(None, 1)], ())
    library, problem, rng = Library(model, train.band), train.problem, np.random.default_rng(0)
    off = 0.02 * rng.normal(size=problem.links.shape[1])
    change = 0.1 * model.pi[10:20]
    links = problem.links @ off
    links[10:20] += change
    gravity = tilted_gravity(model.gravity, *TILT)
    truth = []
    for m in train.motions:
        level, still = model.rnea_along(m.q, m.v, m.a), np.zeros_like(m.q)
        tilted = model.rnea_along(m.q, m.v, m.a, gravity)
        upright = model.link_torque_along(m.q, m.v, m.a, links)
        leaning = model.gravity_regressor_along(m.q, gravity - model.gravity) @ links
        truth.append(tilted - level + upright + leaning)
        np.testing.assert_allclose(
            model.gravity_regressor_along(m.q, gravity) @ model.pi, model.rnea_along(m.q, still, still, gravity)
        )
    straight = problem.nuisance.copy()
    tilt = library.whole("base_tilt", around=TILT.tolist(), links=links.tolist())
    link, payload = library.whole("link_inertia", (1,)), library.whole("payload")
    library.lean([tilt], [TILT])
    assert not library.follows(tilt)
    again, other = library.newest([link, payload])
    assert np.abs(other.columns - payload.columns).max() > 1e-6
    correct(problem, library, [tilt, again])
    rows = tilt.rows(TILT) + again.rows(change) + problem.nuisance @ off
    # what the tilt's own columns have of the links went to the measured rows
    np.testing.assert_allclose(rows - (problem.y - problem.measured), problem.band.rows(truth), atol=1e-9)
    library.lean([], [])
    assert library.follows(again)
    correct(problem, library, [link])
    np.testing.assert_array_equal(problem.nuisance, straight)
    assert not problem.corrected
    np.testing.assert_array_equal(library.remake(again).columns, link.columns)


@pytest.mark.parametrize("name", ["spring", "external_force"])
def test_other_causes_change_nothing_of_the_links(name: str) -> None:
    model = robot(ARM)
    train = prepare(model, [record(None, 1)], ())
    library = Library(model, train.band)
    term = library.local(name, 1) if name == "spring" else library.whole(name)
    library.lean([term], [np.ones(term.p)])
    assert not library.leans
