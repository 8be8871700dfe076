"""A motor at its limit takes measured torque away, whatever it is: it must be likelier than a torque that no effect describes."""

from __future__ import annotations

import numpy as np
import pytest
from exam.candidate import recording_of
from exam.case import Case, draw_case

from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.diagnosis.sets.set_prior import SetPrior
from sysid_ros.diagnosis.sets.taken_away import TakenAway


def told(case: Case, joint: int, limit: float) -> float:
    """Probability of a motor's limit beside dry friction."""
    robot = case.nominal.model()
    train, later = (prepare(robot, [recording_of(r) for r in x], []) for x in (case.train, case.validate))
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


def test_no_form_that_takes_torque_away_is_a_candidate_where_it_is_not_to_be() -> None:
    case = draw_case(17, "single", "torque_saturation", "compiled")
    train = prepare(robot := case.nominal.model(), [recording_of(r) for r in case.train], [])
    joint = case.nominal.joint_names.index(case.truth["effects"][0]["joints"][0])
    every, fewer = (Library(robot, train.band, not_away=x) for x in ((), [("torque_saturation", joint)]))
    kinds = {t.effect.settings["kind"] for t in every.local_options("torque_saturation", joint)}
    assert kinds == {"motor", "sensor"}
    assert {t.effect.settings["kind"] for t in fewer.local_options("torque_saturation", joint)} == {"sensor"}
    assert fewer.local_options("coulomb_friction", joint) != []
