"""Long recordings: which stretches are searched, and that the causes found are judged on all of the rows."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from robots import robot
from test_diagnosis import ARM, coulomb, record
from test_diagnosis_events import changes

from sysid_ros.diagnosis.prepare import Prepared, prepare
from sysid_ros.diagnosis.sets import long_recordings
from sysid_ros.diagnosis.sets.long_recordings import searched, telling, thinned


@cache
def train() -> Prepared:
    return prepare(robot(ARM), [record(coulomb, 1, 60.0)], [])


def test_each_equal_part_of_the_recordings_has_one_stretch(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = train()
    monkeypatch.setattr(long_recordings, "_SEARCHED", 0.4 * whole.band.seconds)
    kept = telling(whole)
    parts = np.array_split(np.arange(whole.band.segments), len(kept))
    assert 1 < len(kept) < whole.band.segments
    assert all(sum(s in part for s in kept) == 1 for part in parts)


def test_the_choice_does_not_depend_on_the_torques_but_by_the_level_of_their_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = train()
    monkeypatch.setattr(long_recordings, "_SEARCHED", 0.4 * whole.band.seconds)
    kept, signs = telling(whole), np.random.default_rng(0).choice([-1.0, 1.0], whole.problem.y.shape)
    monkeypatch.setattr(whole.problem, "y", whole.problem.y * signs)
    assert telling(whole) == kept


def test_stretches_are_those_of_the_recording_with_its_times_and_torques() -> None:
    whole = train()
    part = thinned(robot(ARM), whole)
    for motion, nominal in zip(part.motions, part.nominal, strict=True):
        at = np.searchsorted(whole.motions[0].t, motion.t)
        np.testing.assert_array_equal(whole.motions[0].tau[at], motion.tau)
        np.testing.assert_array_equal(whole.nominal[0][at], nominal)
        np.testing.assert_array_equal(whole.motions[0].t[at], motion.t)
    assert part.band.seconds < whole.band.seconds
    assert set(part.names) == set(whole.names)


@pytest.mark.slow
def test_what_is_found_in_a_part_is_judged_on_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = train()
    monkeypatch.setattr(long_recordings, "_SEARCHED", 0.3 * whole.band.seconds)
    selection = searched(robot(ARM), whole, lambda sentence: None)
    assert selection.problem is whole.problem
    assert {t.id for t in selection.fit.terms} >= {"coulomb_friction"}
    assert len(selection.fit.residual) == len(whole.problem.y)


@pytest.mark.slow
def test_a_body_that_is_carried_between_the_stretches_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = prepare(robot(ARM), [record(changes((26.0, 1.2), (31.0, -1.2)), 1, 60.0)], [])
    monkeypatch.setattr(long_recordings, "_SEARCHED", 0.3 * whole.band.seconds)
    monkeypatch.setattr(long_recordings, "telling", lambda train: [0, 5, 7])
    first, *_, last = (m.t[0] for m in thinned(robot(ARM), whole).motions)
    assert first < 20.0 < 35.0 < last
    selection = searched(robot(ARM), whole, lambda sentence: None)
    events = {round(t.instant, 1): selection.fit.theta_of(t)[0] for t in selection.fit.terms if t.instant is not None}
    assert events == {26.0: pytest.approx(1.2, rel=0.03), 31.0: pytest.approx(-1.2, rel=0.03)}
