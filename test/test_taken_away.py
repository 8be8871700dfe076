"""A motor at its limit takes measured torque away, whatever it is: it must be likelier than a torque that no effect describes."""

from __future__ import annotations

import numpy as np
import pytest
from exam.candidate import recording_of
from exam.case import Case, draw_case
from motions import Motion
from robots import robot as named_robot

from sysid_ros.diagnosis.heldout import HeldOut, split
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared, prepare
from sysid_ros.diagnosis.sets.set_prior import SetPrior
from sysid_ros.diagnosis.sets.taken_away import TakenAway
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording


def told(case: Case, joint: int, limit: float) -> float:
    """Probability of a motor's limit beside dry friction."""
    robot = case.nominal.model()
    train, later = (prepare(robot, [recording_of(r) for r in x], []) for x in (case.train, case.validate))
    return told_of(robot, train, later, joint, limit)


def told_of(robot: RobotModel, train: Prepared, later: Prepared, joint: int, limit: float) -> float:
    """The same of rows to fit and to judge on."""
    library = Library(robot, train.band)
    limited = library.local("torque_saturation", joint, limit=limit, kind="motor")
    fit = train.problem.fit([library.local("coulomb_friction", joint), limited], inexact=True)
    held, prior = HeldOut.of(robot, later, fit), SetPrior(library, train.problem.active.tolist())
    return TakenAway(train, held, library, fit, prior).probability(limited, joint)


@pytest.mark.parametrize("seed", [17, 19, 22])
def test_a_motor_at_its_limit_is_likelier_than_a_torque_that_no_effect_describes(seed: int) -> None:
    case = draw_case(seed, "single", "torque_saturation", "compiled")
    (hidden,) = case.truth["effects"]
    assert hidden["kind"] == "motor"
    assert told(case, case.nominal.joint_names.index(hidden["joints"][0]), hidden["parameters"][0]["value"]) > 0.99


@pytest.mark.parametrize("effect", ["outside_neighbour_friction", "outside_neighbour_damping"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_friction_that_no_effect_describes_is_likelier_than_a_limit_that_takes_it_away(effect: str, seed: int) -> None:
    case = draw_case(seed, "outside", effect, "compiled")
    joint = case.nominal.joint_names.index(case.truth["effects"][0]["joints"][0])
    limit = float(np.quantile(np.abs(case.train[0].tau[:, joint]), 0.8))
    assert told(case, joint, limit) < 0.01


@pytest.mark.parametrize("seed", [3, 4])
def test_noise_beyond_a_torque_that_is_flat_is_no_limit(seed: int) -> None:
    """On a wrist whose torque is nearly all dry friction, noise of a tenth of that is what exceeds a limit."""
    robot, rng = named_robot("iiwa"), np.random.default_rng(seed)
    t = np.arange(6000) / 200.0
    q, v, a = Motion(robot, seed)(t)
    tau = robot.rnea_along(q, v, a) + 6.0 * np.tanh(v / 5e-4) + 0.6 * rng.normal(size=q.shape)
    whole = Recording("flat", t, q + 1e-5 * rng.normal(size=q.shape), None, tau)
    train, later = (prepare(robot, x, []) for x in split([whole]))
    wrists, limits = (4, 5, 6), (6.2, 6.3, 6.6)
    odds = [told_of(robot, train, later, j, limit) for j in wrists for limit in limits]
    assert max(odds) < 0.9
    assert np.median(odds) < 0.5


def test_no_form_that_takes_torque_away_is_a_candidate_where_it_is_not_to_be() -> None:
    case = draw_case(17, "single", "torque_saturation", "compiled")
    train = prepare(robot := case.nominal.model(), [recording_of(r) for r in case.train], [])
    joint = case.nominal.joint_names.index(case.truth["effects"][0]["joints"][0])
    every, fewer = (Library(robot, train.band, not_away=x) for x in ((), [("torque_saturation", joint)]))
    kinds = {t.effect.settings["kind"] for t in every.local_options("torque_saturation", joint)}
    assert kinds == {"motor", "sensor"}
    assert {t.effect.settings["kind"] for t in fewer.local_options("torque_saturation", joint)} == {"sensor"}
    assert fewer.local_options("coulomb_friction", joint) != []
