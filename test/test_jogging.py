"""Diagnosis of an arm that moves one joint at a time: a joint that stands says nothing, and its rests are no data."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from robots import robot
from test_diagnosis import ARM, payload, record
from unsimulated import unsimulated as unsimulated

from sysid_ros.diagnosis import diagnose
from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.claims import Judged
from sysid_ros.diagnosis.fit import Problem
from sysid_ros.diagnosis.heldout import plain_terms
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import SCALES, prepare, torques
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.recording import Recording

RATE, DRY, NOISE = 200.0, 1.5, 0.05


def path(seed: int, seconds: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions, velocities, accelerations, shape (N, n): one joint after the other goes somewhere, with rests between."""
    rng, n = np.random.default_rng(seed), robot(ARM).n
    q, v, a = (np.zeros((round(seconds * RATE), n)) for _ in range(3))
    begin, j = 40, 0
    while begin < len(q):
        way = float(rng.uniform(0.4, 1.2)) * (-1.0 if q[begin - 1, j] > 0.0 else 1.0)
        count = min(round(RATE * np.sqrt(6.0 * abs(way))), len(q) - begin)
        s, T = np.arange(count) / count, count / RATE
        now = slice(begin, begin + count)
        q[now, j] += way * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        v[now, j] = way * 30.0 * s**2 * (1.0 - s) ** 2 / T
        a[now, j] = way * 60.0 * s * (1.0 - 3.0 * s + 2.0 * s**2) / T**2
        q[begin + count :, j] += way
        begin, j = begin + count + 40, (j + 1) % n
    return q, v, a


def jogged(seed: int, seconds: float = 24.0) -> Recording:
    """With dry friction; at rest it holds part of the load, another one each time."""
    model, rng = robot(ARM), np.random.default_rng(100 + seed)
    q, v, a = path(seed, seconds)
    held = np.zeros(model.n)
    tau = model.rnea_along(q, v, a) + NOISE * rng.normal(size=q.shape)
    for i, speed in enumerate(v):
        held = np.where((speed == 0.0) & (v[i - 1] != 0.0), rng.uniform(-DRY, DRY, model.n), held)
        tau[i] += np.where(speed == 0.0, held, DRY * np.sign(speed))
    return Recording(f"jog {seed}", 50.0 + np.arange(len(q)) / RATE, q, v, tau)


@cache
def band() -> Band:
    return Band(motions(robot(ARM), jogged(1)))


def test_a_rest_counts_no_longer_than_what_its_ends_are_the_means_of() -> None:
    whole = band().rows([np.ones_like(m.q) for m in band().motions])
    samples, rests = sum(len(m.t) for m in band().motions), [np.count_nonzero(np.diff(x, axis=0), axis=0) for x in band().moving]
    part = np.sum(whole**2, axis=0) / samples
    ends = 0.15 * np.sum(rests, axis=0) / band().seconds
    assert np.all(part > band().moves)
    assert np.all(part < band().moves + 1.05 * ends)


def test_parameters_of_joints_that_mostly_stand_scatter_as_is_said() -> None:
    """Columns and noise of one joint of 24 s, 200 times: the squared errors over their variances are those of chance."""
    rows = band()
    library, none = Library(robot(ARM), rows), np.zeros(0)
    terms = plain_terms(library, 1)
    nees, levels = [], []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        noise = rows.rows([NOISE * rng.normal(size=m.q.shape) for m in rows.motions])
        fit = Problem(rows, noise, np.zeros((*noise.shape, 0)), none, none.astype(np.intp)).fit(terms)
        size = len(fit.theta)
        nees.append(float(fit.theta @ np.linalg.solve(fit.inverse[:size, :size], fit.theta)) / size)
        levels.append(float(np.mean(fit.noise.along(rows)[:, 1])))
    assert rows.moves[1] < 0.35
    assert 0.7 < np.mean(nees) < 1.35
    assert np.mean(levels) == pytest.approx(NOISE**2, rel=0.15)


@pytest.mark.slow
@pytest.mark.usefixtures("unsimulated")
def test_friction_of_an_arm_that_moves_one_joint_at_a_time_is_found_and_nothing_beside_it() -> None:
    found = diagnose(robot(ARM), [jogged(1)], [jogged(2)])
    friction = next(x for x in found.findings if x.id == "coulomb_friction")
    assert found.verdict == "explained"
    assert friction.joints == robot(ARM).joint_names
    assert [p.value for p in friction.parameters] == pytest.approx([DRY] * robot(ARM).n, rel=0.1)
    claimed = {x.id for x in found.findings if (x.probability or 0.0) > 0.5}
    assert claimed <= {"coulomb_friction", "viscous_friction", "torque_offset", "rotor_inertia"}


def test_the_torque_of_a_joint_that_stands_is_the_measured_one_less_what_its_sensor_adds() -> None:
    model, offset = robot(ARM), np.array([0.4, -0.3, 0.2, -0.1])
    plain = jogged(1)
    train = prepare(model, [Recording(plain.name, plain.t, plain.q, plain.v, plain.tau + offset)], [])
    library = Library(model, train.band)
    fit = train.problem.fit([t for j in range(model.n) for t in plain_terms(library, j)])
    (held,) = torques(library, fit, [m.link_torque for m in library.motions], train.nominal)[3]
    (motion,), (true,) = library.motions, prepare(model, [plain], []).motions
    stands = ~library.band.moving[0]
    assert np.sqrt(np.mean((motion.link_torque - true.tau)[stands] ** 2)) > 0.4 * DRY
    assert np.abs(held - true.tau)[stands].max() < 3.0 * NOISE
    library.update(*torques(library, fit, [m.link_torque for m in library.motions], train.nominal))
    np.testing.assert_array_equal(library.motions[0].held_torque, held)
    np.testing.assert_array_equal(library.motions[0].drive_torque[~stands], held[~stands])


def test_a_payload_is_as_uncertain_as_the_links_even_if_exact_links_predict_better() -> None:
    model = robot(ARM)
    train = prepare(model, [record(payload, 1, 12.0)], [])
    library = Library(model, train.band)
    term, scales = library.whole("payload"), np.zeros(len(SCALES))

    def std(likely: tuple[float, float]) -> float:
        of = scales.copy()
        of[SCALES.index(likely)] = 1.0
        fit = train.problem.fit([term])
        judged = Judged(
            train, cast(Any, SimpleNamespace(library=library, fit=fit)), cast(Any, SimpleNamespace(scales=of)), cast(Any, None)
        )
        return float(np.sqrt(judged.values.of[term].covariance[0, 0]))

    exact, usual = std((0.0, 0.0)), std((1.0, 1.0))
    assert usual > 3.0 * exact
    assert usual > 0.02 * float(model.pi[-10])
