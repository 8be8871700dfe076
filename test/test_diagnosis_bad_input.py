"""Bad input of ``sysid diagnose``: each is refused with the reason and the cure, or the fault is named."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnosis_bags import bag, changed, messages
from robots import DATA, urdf
from unsimulated import unsimulated as unsimulated

from sysid_ros.cli.main import run
from sysid_ros.sample import FloatArray, JointStateRecord

JOINTS = ("turn", "lift", "elbow", "slide")
BAD_INPUT = 2
Records = Sequence[JointStateRecord]
TORQUE_CONSTANTS = np.array([11.0, 14.0, 7.0, 9.0])


def diagnosis(folder: Path, records: Records, *arguments: str, text: str | None = None) -> tuple[int, dict[str, Any]]:
    """Exit code and diagnosis.json of the command."""
    path = DATA / "small_arm.urdf"
    if text is not None:
        path = folder / "given.urdf"
        path.write_text(text)
    recorded, out = bag(folder / "bag", records), folder / "out"
    code = run(["diagnose", str(recorded), "--urdf", str(path), "--out", str(out), *arguments])
    assert (out / "report.html").stat().st_size > 1000
    document: dict[str, Any] = json.loads((out / "diagnosis.json").read_text())
    return code, document


def without(records: Records, joint: int) -> list[JointStateRecord]:
    """The messages without a joint."""

    def rest(values: Sequence[float] | FloatArray) -> FloatArray:
        return np.delete(np.asarray(values), joint)

    names = tuple(np.delete(JOINTS, joint))
    return [replace(r, names=names, position=rest(r.position), velocity=rest(r.velocity), effort=rest(r.effort)) for r in records]


def held(column: int) -> Callable[[FloatArray], FloatArray]:
    """One channel that keeps its first value."""
    return lambda x: np.where(np.arange(x.shape[1]) == column, x[0], x)


def frozen_position() -> Records:
    """The elbow's position stays while its velocity goes on."""
    records = messages()
    return [replace(r, position=f.position) for r, f in zip(records, changed(records, position=held(2)), strict=True)]


SEARCHED = "efforts that have nothing to do with the motion"
"""The one that is refused only after a search."""

REFUSED: dict[str, tuple[Callable[[], Records], tuple[str, ...]]] = {
    "degrees": (lambda: changed(messages(), position=np.rad2deg), ("degrees", "Publish radians")),
    "at rest": (lambda: changed(messages(), position=lambda x: np.full_like(x, 0.1)), ("at rest", "record a motion")),
    "two seconds": (lambda: messages(seconds=2.0), ("2.0 s", "Record 15 to 30 s")),
    "frozen effort": (lambda: changed(messages(), effort=held(1)), ("effort of lift stays at", "Correct the driver")),
    "frozen position": (
        frozen_position,
        ("position of elbow stays at", "encoder"),
    ),
    "no effort": (lambda: [replace(r, effort=()) for r in messages()], ("no effort of any joint", "Switch on")),
    "effort of one joint is no number": (
        lambda: changed(messages(), effort=lambda x: np.where(np.arange(4) == 3, np.nan, x)),
        ("no effort of slide", "joint_names"),
    ),
    "a joint of the arm is missing": (lambda: without(messages(), 1), ("do not hold lift", "Record all")),
    "no stamps": (lambda: [replace(r, stamp=0.0) for r in messages()], ("stamp is 0", "allow_unstamped")),
    SEARCHED: (
        lambda: changed(messages(), effort=lambda x: np.cumsum(np.random.default_rng(0).normal(size=x.shape), axis=0) * 0.5),
        ("does not explain these torques", "--urdf"),
    ),
}


@pytest.mark.parametrize("case", [pytest.param(x, marks=[pytest.mark.slow] if x == SEARCHED else []) for x in REFUSED])
def test_what_can_not_be_judged_is_refused_with_reason_and_cure(case: str, tmp_path: Path) -> None:
    make, words = REFUSED[case]
    code, document = diagnosis(tmp_path, make())
    assert code == BAD_INPUT
    assert document["verdict"] == "refused"
    assert document["effects"] == []
    for word in words:
        assert word in document["refusal"]


OTHER_ROBOTS = {
    "axes and masses": (
        ('axis xyz="0 0 1"', 'axis xyz="0 1 0"'),
        ('axis xyz="1 0 0"', 'axis xyz="0 0 1"'),
        ('value="3"', 'value="9"'),
    ),
    "names": (("turn", "joint_a"), ("lift", "joint_b"), ("elbow", "joint_c"), ("slide", "joint_d")),
}


@pytest.mark.parametrize("case", [pytest.param("axes and masses", marks=pytest.mark.slow), "names"])
def test_another_robots_urdf_is_refused(case: str, tmp_path: Path) -> None:
    text = urdf("small_arm")
    for old, new in OTHER_ROBOTS[case]:
        text = text.replace(old, new)
    code, document = diagnosis(tmp_path, messages(), text=text)
    assert (code, document["verdict"]) == (BAD_INPUT, "refused")
    assert "--urdf" in document["refusal"]


def test_a_bag_of_another_robot_to_judge_on_is_refused(tmp_path: Path) -> None:
    other = bag(tmp_path / "other", without(messages(seed=1), 3))
    code, document = diagnosis(tmp_path, messages(), "--validate", str(other))
    assert (code, document["verdict"]) == (BAD_INPUT, "refused")
    assert "Use bags of the same robot" in document["refusal"]


def swapped(x: FloatArray) -> FloatArray:
    return x[:, [0, 2, 1, 3]]


def repeated() -> Records:
    """Every ninth message is sent twice, the second time with a stamp of its own."""
    records = messages()
    return [replace(records[i - (i % 9 == 4)], stamp=r.stamp) for i, r in enumerate(records)]


def overtaken() -> Records:
    """Every tenth message overtakes the one before."""
    records = messages()
    for i in range(9, len(records), 10):
        records[i - 1], records[i] = records[i], records[i - 1]
    return records


def late() -> Records:
    """Every fifteenth message holds what was measured 20 ms before its stamp."""
    records = messages()
    return [replace(records[i - 4 * (i % 15 == 14)], stamp=r.stamp) for i, r in enumerate(records)]


def in_disorder() -> Records:
    """All of it at once, and every fortieth message lost."""
    records = list(overtaken())
    for i in range(4, len(records), 27):
        records[i] = replace(records[i - 1], stamp=records[i].stamp)
    for i in range(14, len(records), 45):
        records[i] = replace(records[i - 4], stamp=records[i].stamp)
    return [r for i, r in enumerate(records) if i % 40 != 22]


SLOW = pytest.mark.slow
NAMED = [
    pytest.param(
        lambda: changed(messages(), effort=lambda x: x / TORQUE_CONSTANTS), "torque_unit", JOINTS, id="amperes", marks=SLOW
    ),
    pytest.param(lambda: changed(messages(), effort=lambda x: 1e3 * x), "torque_unit", JOINTS, id="N mm", marks=SLOW),
    pytest.param(lambda: changed(messages(), effort=swapped), "joint_order", ("lift", "elbow"), id="efforts swapped", marks=SLOW),
    pytest.param(
        lambda: changed(messages(), swapped, swapped), "joint_order", ("lift", "elbow"), id="joints swapped", marks=SLOW
    ),
    pytest.param(in_disorder, "message_faults", JOINTS, id="messages in disorder"),
    pytest.param(repeated, "message_faults", JOINTS, id="messages repeated", marks=SLOW),
    pytest.param(overtaken, "message_faults", JOINTS, id="messages out of order", marks=SLOW),
    pytest.param(late, "message_faults", JOINTS, id="messages late", marks=SLOW),
    pytest.param(
        lambda: [r for i, r in enumerate(messages()) if i % 11 != 3], "message_faults", JOINTS, id="messages lost", marks=SLOW
    ),
]


@pytest.mark.parametrize(("make", "name", "joints"), NAMED)
def test_a_fault_of_the_messages_is_named_and_the_rest_is_found_all_the_same(
    make: Callable[[], Records], name: str, joints: tuple[str, ...], tmp_path: Path
) -> None:
    code, document = diagnosis(tmp_path, make())
    assert code == 0
    found = {e["name"]: e for e in document["effects"]}
    assert set(found) == {name, "coulomb_friction"}
    assert set(found[name]["joints"]) == set(joints)
    assert document["verdict"] == "explained"
