"""Efforts that come late by much, beside friction and a payload: what is fitted of the rest stands at its own instants."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from motions import Motion as Path_
from robots import robot
from test_diagnosis import ARM, NOISE, RATE

from sysid_ros.diagnosis.corrections import correct
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.knobs import sharpened
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared, prepare
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.effects import PreslidingHysteresis, TimeDelay
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.recording import Recording

LATE, BUILDS_UP = 0.06, 0.02
FRICTION = (1.2, 1.5, 0.6, 0.4)
VISCOUS = (1.0, 1.5, 0.5, 0.3)


def motion() -> Motion:
    """A motion of the arm with drives that have friction, and efforts that come late by ``LATE``."""
    model = robot(ARM)
    t = np.arange(0.0, 12.0, 0.01)
    q, v, a = Path_(model, 5, speed=1.2)(t)
    drive = model.rnea_along(q, v, a) + np.array(FRICTION) * np.tanh(v / 0.05)
    tau = np.stack([np.interp(t - LATE, t, x) for x in drive.T], axis=1)
    return Motion(model, t, q, v, a, tau, drive_torque=drive)


def test_columns_and_correction_are_those_of_advanced_efforts() -> None:
    """``tau + correction = tau(t + d) + d * column``: what the columns have beside the advanced effort is taken out by them."""
    m = motion()
    effect = TimeDelay(m.robot, around=LATE)
    correction = effect.correction_along(m)
    assert correction is not None
    rest = m.tau + correction - LATE * effect.columns_along(m)[:, :, 0] - m.drive_torque
    assert np.abs(rest[: -round(LATE / m.period) - 1]).max() < 1e-9 * np.abs(m.tau).max()
    assert TimeDelay(m.robot).correction_along(m) is None


def test_the_torque_of_a_delay_is_that_of_an_earlier_instant() -> None:
    m = motion()
    late = m.drive_torque + TimeDelay(m.robot, around=0.01).torque_along(m, np.array([LATE]))
    np.testing.assert_allclose(late, m.tau, atol=1e-9)


@cache
def searched() -> tuple[Prepared, Selection, list[Fit]]:
    """Fits with what is there and a delay, each made anew from the one before."""
    model = robot(ARM)
    rng = np.random.default_rng(3)
    t = np.arange(round(14.0 * RATE)) / RATE
    q, v, a = Path_(model, 3, speed=1.2)(t)
    own = np.array(FRICTION) * np.tanh(v / 0.02) + np.array(VISCOUS) * v
    drive = model.rnea_along(q, v, a) + own
    tau = np.stack([np.interp(t - LATE, t, x) for x in drive.T], axis=1) + NOISE * rng.normal(size=q.shape)
    train = prepare(model, [Recording("late", t, q, v, tau)], [])
    library = Library(model, train.band)
    selection = Selection(train.problem, library, train.nominal)
    joints = range(model.n)
    terms = [library.local(name, j) for name in ("coulomb_friction", "viscous_friction") for j in joints]
    selection.fit = train.problem.fit([*terms, library.whole("time_delay")], inexact=True)
    fits = [selection.fit]
    for _ in range(3):
        selection.refresh()
        fits.append(selection.fit)
    return train, selection, fits


def delay_of(fit: Fit) -> float:
    (term,) = [t for t in fit.terms if t.effect.corrects]
    return float(fit.theta_of(term)[0])


def test_a_long_delay_is_found_beside_friction() -> None:
    _, _, fits = searched()
    assert abs(delay_of(fits[-1]) - LATE) < 1e-3
    assert fits[-1].loglik > fits[0].loglik
    # where it is found another step finds it again
    assert delay_of(fits[-1]) == pytest.approx(delay_of(fits[-2]), abs=1e-4)


def test_friction_beside_a_long_delay_is_what_it_is() -> None:
    _, _, fits = searched()
    found: dict[str, list[float]] = {"coulomb_friction": [], "viscous_friction": []}
    for term in fits[-1].terms:
        if term.id in found:
            found[term.id].append(float(fits[-1].theta_of(term)[0]))
    np.testing.assert_allclose(found["coulomb_friction"], FRICTION, rtol=0.01)
    np.testing.assert_allclose(found["viscous_friction"], VISCOUS, rtol=0.03)


def test_without_a_delay_the_rows_are_those_that_were_measured() -> None:
    train, selection, fits = searched()
    before = train.problem.corrected
    measured: FloatArray = train.problem.measured
    selection.fit = train.problem.fit([t for t in fits[-1].terms if not t.effect.corrects], fits[-1].noise, inexact=True)
    selection.refresh()
    assert (before, train.problem.corrected) == (True, False)
    np.testing.assert_array_equal(train.problem.y, measured)


def test_friction_that_builds_up_and_a_delay_are_found_together() -> None:
    """Each follows the other slowly: what is late after a reversal may be either."""
    model, rng = robot(ARM), np.random.default_rng(7)
    t = np.asarray(np.arange(14000) * 1e-3, dtype=float)
    q, v, a = Path_(model, 7, speed=1.2)(t)
    bristles = PreslidingHysteresis(model, z_s=BUILDS_UP)
    exact = Motion(model, t, q, v, a, np.zeros_like(q))
    drive = exact.rigid_torque + bristles.torque_along(exact, np.array(FRICTION)) + np.array(VISCOUS) * v
    tau = np.stack([np.interp(t - LATE, t, x) for x in drive.T], axis=1) + NOISE * rng.normal(size=q.shape)
    train = prepare(model, [Recording("late", t, q, v, tau)], [])
    library, joints = Library(model, train.band), range(model.n)
    links = [m.link_torque for m in train.motions]
    friction = [library.local("presliding_hysteresis", j, z_s=1.4 * BUILDS_UP) for j in joints]
    terms = [*friction, *(library.local("viscous_friction", j) for j in joints), library.whole("time_delay", around=0.7 * LATE)]
    correct(train.problem, library, terms)
    first = train.problem.fit(terms, inexact=True)
    found = sharpened(train.problem, library, first, links, train.nominal)
    assert [t.key for t in found.terms] == [t.key for t in first.terms]
    assert found.loglik > first.loglik + 100.0
    assert delay_of(found) == pytest.approx(LATE, abs=1e-3)
    for term in found.terms[: model.n]:
        assert term.effect.settings["z_s"] == pytest.approx(BUILDS_UP, rel=0.05)
    again = sharpened(train.problem, library, found, links, train.nominal)
    assert again.loglik < found.loglik + 1.0
