"""Faults of the channels that data refute which were left out."""

from __future__ import annotations

from functools import partial

import pytest
from robots import robot
from test_diagnosis import ARM, coulomb, record

from sysid_ros.diagnosis.channel_faults import Fault, faults_to_try, undone
from sysid_ros.diagnosis.heldout import HeldOut, plain_terms
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import prepare
from sysid_ros.diagnosis.whose.left_out_channels import refuted_elsewhere

MODEL = robot(ARM)
SWAPPED = next(f for kind, f in faults_to_try(MODEL.joint_names) if f.effect.id == "joint_order")
SIGN = next(f for kind, f in faults_to_try(MODEL.joint_names) if f.effect.id == "torque_sign" and f.joints == (1,))
UNIT = next(f for kind, f in faults_to_try(MODEL.joint_names) if f.effect.absorbs)


def refuted(fault: Fault, there: bool) -> list[Fault]:
    """What is refuted of a fault that is undone, whether the channels have it or not."""
    published = [record(coulomb, 1, 12.0)], [record(coulomb, 2, 8.0)]
    if there:  # signs and swaps undo themselves
        published = [undone(r, [fault]) for r in published[0]], [undone(r, [fault]) for r in published[1]]
    rows = partial(prepare, MODEL, known=[])
    train, judged = (rows([undone(r, [fault]) for r in x]) for x in published)
    library = Library(MODEL, train.band)
    fit = train.problem.fit([t for j in train.problem.active for t in plain_terms(library, int(j))])
    return refuted_elsewhere(MODEL, [fault], fit, HeldOut.of(MODEL, judged, fit), rows, published)


@pytest.mark.parametrize("fault", [SWAPPED, SIGN], ids=lambda f: f.effect.id)
def test_a_fault_that_is_there_stands_and_one_that_is_not_is_refuted(fault: Fault) -> None:
    assert refuted(fault, True) == []
    assert refuted(fault, False) == [fault]


def test_factors_are_told_by_the_data_that_were_fitted() -> None:
    assert refuted(UNIT, False) == []
