"""What is put on an arm while it stands, and friction could hide it, is not denied."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from motions import Motion, measurements
from robots import robot

from sysid_ros.effects import CoulombFriction, Payload
from sysid_ros.estimators import JumpRule, Problem, VariableForgetting
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.online.rows import Rows
from sysid_ros.online.standstill import Standstill
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray, Measurement

RATE, START = 250.0, 100.0
STOPS, GOES = 8.0, 10.0
MODEL = robot("iiwa")


class Stopping(Motion):
    """Stands from ``STOPS`` to ``GOES`` [s]."""

    def __call__(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        at = t - START
        ramp = np.clip(np.maximum(STOPS - at, at - GOES) / 0.6, 0.0, 1.0)
        speed = ramp**2 * (3.0 - 2.0 * ramp)
        h = float(np.median(np.diff(t)))
        q, v, a = super().__call__(START + np.cumsum(speed) * h)
        rate = np.gradient(speed, h)[:, None]
        return q, v * speed[:, None], a * speed[:, None] ** 2 + v * rate


def stream(mass: float, at: float, seed: int, seconds: float = 14.0) -> list[Measurement]:
    """An arm with dry friction of 3 N m that is given a payload [kg] at ``at`` [s]."""
    body = inertial_parameters.from_com(mass, np.array([0.03, -0.02, 0.08]), 0.004 * mass * np.eye(3))
    effects = [(CoulombFriction(MODEL), np.full(MODEL.n, 3.0)), (Payload(MODEL), body, at, np.inf)]
    return measurements(Stopping(MODEL, seed=seed), seconds, RATE, effects, 0.1, 1e-5, velocity=False)  # type: ignore[arg-type]


def estimates(recording: list[Measurement]) -> list[PayloadEstimate]:
    return [e for e in map(OnlineEstimation(MODEL, OnlineSettings()).step, recording) if e is not None]


@pytest.mark.parametrize(("seed", "mass"), [(1, 1.0), (2, 2.0)])
def test_a_pick_of_a_standing_arm_is_not_denied(seed: int, mass: float) -> None:
    pick = 9.0
    series = estimates(stream(mass, pick, seed))
    during = [e for e in series if pick + 0.3 <= e.t - START < GOES]
    assert during
    assert all(e.status not in ("ok", "no_payload") for e in during)
    assert any("while the arm stood" in e.reason for e in during)
    assert series[-1].status == "ok"
    assert abs(series[-1].mass - mass) < 4.0 * series[-1].mass_std
    denied = [e for e in series if e.t - START > pick + 0.3 and e.status == "no_payload"]
    assert not denied


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_drop_at_the_instant_of_the_stop_is_not_denied(seed: int) -> None:
    """When the arm has come to rest all torques are those of after the drop already."""
    full, empty = stream(2.0, 3.0, seed), stream(0.0, np.inf, seed)
    dropped = START + STOPS
    series = estimates([a if a.t < dropped else b for a, b in zip(full, empty, strict=True)])
    standing = [e for e in series if dropped + 0.3 <= e.t < START + GOES]
    assert standing
    assert not [e for e in standing if e.status == "ok"]
    assert abs(series[-1].mass) < 4.0 * series[-1].mass_std


def test_to_stop_is_no_change() -> None:
    """Friction that the motion had turned falls back; no payload would do that."""
    standing = [e for e in estimates(stream(2.0, 3.0, 4)) if START + STOPS + 0.3 <= e.t < START + GOES]
    assert {e.status for e in standing} == {"ok"}


def test_a_long_stand_keeps_nothing_and_stamps_that_jump_back_end_it() -> None:
    watch, n = Standstill(np.ones(10)), MODEL.n
    nothing = VariableForgetting(
        Problem(np.full(10, 1e-3), np.full(n, 1e-4), 0.01, 60.0, JumpRule(slice(0, 10), np.full(10, np.inf), 0.0))
    )

    def row(t: float, jump: float = 0.0, quiet: bool = True) -> None:
        zero = np.zeros(n)
        rows = Rows(np.ones((n, 10)), np.full(n, jump), zero, zero, zero, zero, np.zeros((n, 0)), t, zero, zero)
        watch.add(rows, quiet, nothing, np.full(n, 0.1), 0.1, np.zeros(10))

    for k in range(3000):
        row(0.01 * k, 20.0 if k > 50 else 0.0)
    assert watch.told
    assert len(watch._before) < 20
    row(30.0, quiet=False)
    assert watch.told
    row(1.0, quiet=False)  # the bag is played again
    assert not watch.told
    assert not watch.lasts


def test_friction_that_creeps_while_the_arm_stands_is_no_change() -> None:
    recording = stream(0.0, np.inf, seed=1, seconds=GOES)
    creep = np.linspace(-1.0, 1.0, MODEL.n)
    begins = START + STOPS + 0.3
    crept = [replace(m, tau=m.tau + creep * (1.0 - np.exp(-max(m.t - begins, 0.0) / 1.0))) for m in recording]
    standing = [e for e in estimates(crept) if e.t > begins]
    assert len(standing) > 50
    assert {e.status for e in standing} == {"no_payload"}


@pytest.mark.parametrize("tared", [False, True])
def test_what_friction_would_hide_of_any_payload_shows_of_the_one_that_is_known(tared: bool) -> None:
    """The torques change by what is carried, 1.5 of the standard deviations of what friction may hide a joint: ten parameters
    more would not be worth that; but where what is carried counts as nothing, nothing was put down."""
    n, rng = MODEL.n, np.random.default_rng(3)
    carries = VariableForgetting(
        Problem(np.full(10, 1e-3), np.full(n, 1e-6), 0.01, 60.0, JumpRule(slice(0, 10), np.full(10, np.inf), 0.0))
    )
    load, columns, zero = rng.standard_normal(10), rng.standard_normal((n, 10)), np.zeros(n)
    carries.shift(slice(0, 10), load)
    # of 0.2 of variance, 0.4 (1 - exp(-0.2)) may change within 0.1 s
    columns *= (1.5 * np.sqrt(0.4 * (1.0 - np.exp(-0.2))) / np.abs(columns @ load))[:, None]
    watch = Standstill(np.full(10, 100.0))
    for k in range(30):
        y = columns @ load if k < 15 else zero
        rows = Rows(columns, y, zero, zero, zero, zero, np.zeros((n, 0)), 0.01 * k, zero, zero)
        watch.add(rows, True, carries, np.full(n, 0.2), 0.1, load if tared else np.zeros(10))
    assert bool(watch.told) != tared
