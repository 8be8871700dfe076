"""Channels of one joint that stand while the joint moves: found by themselves, said by name, and over when they are over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from test_input_gate import MIDDLE, NAMES, RATE, ROBOT, START, motion

from sysid_ros.input_gate import InputGate, Level, Rejection
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, JointStateRecord

BEGIN, OVER = 500, 1000
"""Messages between which a channel stands."""
JOINTS = range(len(NAMES))


def frozen(records: Sequence[JointStateRecord], channel: str, joint: int, to: float | None = None) -> list[JointStateRecord]:
    """The same with what one joint publishes on a channel held, at a value of its own where one is given."""
    held = float(getattr(records[BEGIN], channel)[joint]) if to is None else to
    out = list(records)
    for k in range(BEGIN, OVER):
        values = np.array(getattr(records[k], channel))
        values[joint] = held
        out[k] = replace(records[k], effort=values) if channel == "effort" else replace(records[k], position=values)
    return out


def rejected(gate: InputGate, records: Sequence[JointStateRecord]) -> list[int]:
    """Indices of the messages that are not used."""
    return [k for k, record in enumerate(records) if isinstance(gate.accept(record), Rejection)]


def fresh(robot: RobotModel = ROBOT, **settings: object) -> InputGate:
    return InputGate(robot, OnlineSettings(**settings))  # type: ignore[arg-type]


@pytest.mark.parametrize("with_velocities", [True, False])
@pytest.mark.parametrize("joint", JOINTS)
def test_a_frozen_effort_is_found_while_its_joint_moves_and_named(joint: int, with_velocities: bool) -> None:
    records = frozen(motion(6.0), "effort", joint)
    if not with_velocities:
        records = [replace(r, velocity=()) for r in records]
    gate = fresh()
    lost = rejected(gate, records[:OVER])
    assert gate.counts.keys() == {"effort_frozen"}
    assert BEGIN + 0.4 * RATE < lost[0] < BEGIN + 0.9 * RATE
    assert NAMES[joint] in gate.last_texts["effort_frozen"]
    assert gate.health(records[OVER - 1].receive_time).level == Level.ERROR
    assert not rejected(gate, records[OVER:])


@pytest.mark.parametrize("joint", JOINTS)
def test_a_frozen_position_is_found_by_the_velocity_and_named(joint: int) -> None:
    records = frozen(motion(6.0), "position", joint, float(motion(6.0)[BEGIN].position[joint]))
    gate = fresh()
    lost = rejected(gate, records[:OVER])
    assert set(gate.counts) <= {"position_frozen", "position_jump"}
    assert lost[0] < BEGIN + 0.6 * RATE
    assert NAMES[joint] in gate.last_texts["position_frozen"]


def test_positions_whose_velocities_are_none_are_not_called_frozen() -> None:
    records = [replace(r, velocity=(0.5, -0.5, 0.5, 0.2)) for r in frozen(motion(6.0), "position", 1)]
    gate = fresh()
    rejected(gate, records)
    assert "position_frozen" not in gate.counts


@pytest.mark.parametrize("step", [0.1, 0.5])
def test_efforts_in_coarse_steps_are_not_frozen(step: float) -> None:
    coarse = motion(20.0, effort=lambda tau: step * np.round(tau / step))
    gate = fresh()
    assert not rejected(gate, coarse), gate.last_texts


def test_an_effort_that_stands_while_its_joint_does_is_sound() -> None:
    records = [
        replace(r, position=_with(r.position, 2, MIDDLE[2]), velocity=_with(r.velocity, 2, 0.0), effort=_with(r.effort, 2, 3.0))
        for r in motion(6.0)
    ]
    assert not rejected(fresh(), records)


def test_a_drive_at_its_limit_repeats_it_and_is_believed() -> None:
    limit = float(ROBOT.effort_limit[1])
    assert not rejected(fresh(), frozen(motion(6.0), "effort", 1, limit))


def test_a_clock_that_starts_again_forgets_what_stood() -> None:
    records = frozen(motion(6.0), "effort", 1)
    gate = fresh()
    rejected(gate, records[: BEGIN + 100])
    again = [replace(r, stamp=r.stamp - 100.0) for r in motion(6.0)]
    assert records[0].stamp == START
    assert not rejected(gate, again)


def _with(values: Sequence[float] | FloatArray, joint: int, value: float) -> FloatArray:
    out = np.array(values, dtype=float)
    out[joint] = value
    return out
