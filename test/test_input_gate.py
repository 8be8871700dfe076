"""Bad inputs that real joint states show, one test a kind: what the gate does with each."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_ros.exceptions import SettingsError
from sysid_ros.input_gate import GateHealth, InputGate, Level, Rejection
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, JointStateRecord, Measurement
from sysid_ros.sources import BagSource

ROBOT = RobotModel.from_urdf((Path(__file__).parent / "data" / "small_arm.urdf").read_text())
NAMES = ROBOT.joint_names
RATE = 250.0
START = 1000.0
FRICTION = np.array([2.0, 4.0, 2.0, 3.0])
MIDDLE = np.array([0.0, 0.2, 0.3, 0.1])
MOTION = np.array([[0.8, 0.9], [0.9, 1.1], [1.0, 1.7], [0.04, 1.3]])  # amplitude [rad, m] and angular frequency of each joint


def motion(
    duration: float, start: float = START, effort: Callable[[np.ndarray], np.ndarray] | None = None
) -> list[JointStateRecord]:
    """A moving arm with friction and noise; ``effort`` changes the torques (N, n)."""
    rng = np.random.default_rng(1)
    t = np.arange(round(duration * RATE)) / RATE
    amplitude, w = MOTION.T
    q = amplitude * np.sin(w * t[:, None]) + MIDDLE
    v = amplitude * w * np.cos(w * t[:, None])
    a = -amplitude * w**2 * np.sin(w * t[:, None])
    tau = np.array([ROBOT.rnea(*row) for row in zip(q, v, a, strict=True)])
    tau += FRICTION * np.sign(v) + rng.normal(0.0, 0.2, tau.shape)
    tau = tau if effort is None else effort(tau)
    return [JointStateRecord(start + x, start + x + 1e-3, NAMES, q[k], v[k], tau[k]) for k, x in enumerate(t)]


def _of(values: Any) -> FloatArray:
    assert isinstance(values, np.ndarray)
    return values


def run(gate: InputGate, records: Iterable[JointStateRecord]) -> list[Measurement | Rejection]:
    return [gate.accept(record) for record in records]


def gate_of(**settings: object) -> InputGate:
    return InputGate(ROBOT, OnlineSettings(**settings))  # type: ignore[arg-type]


def health_after(gate: InputGate, records: Sequence[JointStateRecord], later: float = 0.0) -> GateHealth:
    run(gate, records)
    return gate.health(records[-1].receive_time + later)


def everything_rejected(records: Sequence[JointStateRecord], reason: str, word: str, **settings: object) -> None:
    """All are rejected for one reason, which the health says as an error that contains ``word``."""
    gate = gate_of(**settings)
    health = health_after(gate, records)
    assert gate.counts == {reason: len(records)}
    assert gate.accepted == 0
    assert health.level == Level.ERROR
    assert word in health.text
    assert health.recent.keys() == {reason}


def one_rejected(records: Sequence[JointStateRecord], at: int, reason: str) -> str:
    """Of a sound stream, the message at one place is rejected and nothing else; its text."""
    gate = gate_of()
    results = run(gate, records)
    assert gate.counts == {reason: 1}
    rejected = results[at]
    assert isinstance(rejected, Rejection)
    assert rejected.reason == reason
    return rejected.text


def with_one(records: list[JointStateRecord], at: int, **changes: object) -> list[JointStateRecord]:
    return [*records[:at], replace(records[at], **changes), *records[at + 1 :]]  # type: ignore[arg-type]


def all_with(records: list[JointStateRecord], **changes: object) -> list[JointStateRecord]:
    return [replace(record, **changes) for record in records]  # type: ignore[arg-type]


def row_01_effort_nan() -> None:
    everything_rejected(all_with(motion(1.0), effort=np.full(4, np.nan)), "effort_nan", "effort state interface")


def row_01_effort_of_one_joint_nan() -> None:
    text = one_rejected(with_one(motion(1.0), 9, effort=np.array([1.0, 2.0, np.nan, 4.0])), 9, "effort_nan")
    assert "elbow" in text


def row_02_effort_empty() -> None:
    everything_rejected(all_with(motion(1.0), effort=()), "effort_empty", "'effort'")


def row_02_position_empty() -> None:
    everything_rejected(all_with(motion(1.0), position=()), "position_empty", "'position'")


def row_02_velocity_empty_is_not_needed() -> None:
    gate = gate_of()
    assert all(m.v is None for m in run(gate, all_with(motion(1.0), velocity=())) if isinstance(m, Measurement))
    assert gate.accepted == 250


def row_02_velocity_empty_is_needed() -> None:
    everything_rejected(all_with(motion(1.0), velocity=()), "velocity_empty", "'velocity'", velocity_source="message")


def row_02_velocity_nan() -> None:
    records = all_with(motion(1.0), velocity=np.array([0.0, 0.0, np.nan, 0.0]))
    gate = gate_of()
    assert all(m.v is None for m in run(gate, records) if isinstance(m, Measurement))
    assert gate.accepted == len(records)
    everything_rejected(records, "velocity_nan", "velocity_source", velocity_source="message")


def row_03_length_mismatch() -> None:
    records = motion(1.0)
    for wrong in ({"effort": np.ones(3)}, {"effort": np.ones(5)}, {"position": np.ones(3)}, {"velocity": np.ones(5)}):
        assert "4 names" in one_rejected(with_one(records, 20, **wrong), 20, "length_mismatch")


def row_04_names_empty() -> None:
    everything_rejected(all_with(motion(1.0), names=(), position=(), velocity=(), effort=()), "names_empty", "'name'")


def row_04_names_duplicate() -> None:
    everything_rejected(all_with(motion(1.0), names=("turn", "lift", "lift", "slide")), "names_duplicate", "lift")


def row_05_other_order() -> None:
    rng = np.random.default_rng(0)
    straight = motion(1.0)
    shuffled = []
    for record in straight:
        order = rng.permutation(4)
        names = tuple(NAMES[i] for i in order)
        shuffled.append(
            replace(
                record,
                names=names,
                position=_of(record.position)[order],
                velocity=_of(record.velocity)[order],
                effort=_of(record.effort)[order],
            )
        )
    for a, b in zip(run(gate_of(), straight), run(gate_of(), shuffled), strict=True):
        assert isinstance(a, Measurement)
        assert isinstance(b, Measurement)
        np.testing.assert_array_equal([a.q, a.v, a.tau], [b.q, b.v, b.tau])


def row_06_extra_joints() -> None:
    gate = gate_of()
    for record in motion(1.0):
        gripper = replace(
            record,
            names=("finger", *NAMES, "wheel"),
            position=np.array([9e9, *record.position, np.nan]),
            velocity=np.array([np.nan, *record.velocity, 0.0]),
            effort=np.array([np.nan, *record.effort, 1e200]),
        )
        m = gate.accept(gripper)
        assert isinstance(m, Measurement)
        np.testing.assert_array_equal([m.q, m.v, m.tau], [record.position, record.velocity, record.effort])


def row_07_subset_of_joints() -> None:
    everything_rejected(
        [replace(r, names=NAMES[:3], position=r.position[:3], velocity=(), effort=r.effort[:3]) for r in motion(1.0)],
        "joints_missing",
        "slide",
    )


def row_07_gripper_on_the_same_topic_is_fine() -> None:
    gate = gate_of()
    records = []
    for record in motion(2.0):
        finger = JointStateRecord(record.stamp + 1e-4, record.receive_time + 1e-4, ("finger",), (0.1,), (), ())
        records += [record, finger]
    health = health_after(gate, records)
    assert health.level == Level.OK
    assert (gate.counts, gate.others, health.others) == ({}, 500, 500)
    assert (gate.received, gate.accepted) == (500, 500)
    (said,) = gate.notes
    assert "500 of finger" in said


def row_07_only_a_gripper_on_the_topic() -> None:
    gate = gate_of()
    fingers = [replace(r, names=("finger",), position=(0.1,), velocity=(), effort=()) for r in motion(1.0)]
    health = health_after(gate, fingers)
    assert health.level == Level.ERROR
    assert "finger" in health.text
    assert (gate.counts, gate.others, health.accepted) == ({}, len(fingers), 0)


def row_07_second_publisher_of_zeros() -> None:
    gate = gate_of()
    records = []
    for record in motion(2.0):
        zeros = JointStateRecord(record.stamp + 1e-4, record.receive_time + 1e-4, NAMES, np.zeros(4), np.zeros(4), ())
        records += [record, zeros]
    health = health_after(gate, records)
    assert gate.accepted == 500
    assert gate.counts == {"effort_empty": 500}
    assert health.level == Level.WARN


def row_08_stamp_zero() -> None:
    records = all_with(motion(1.0), stamp=0.0)
    everything_rejected(records, "stamp_zero", "allow_unstamped")
    gate = gate_of(allow_unstamped=True)
    assert [m.t for m in run(gate, records) if isinstance(m, Measurement)] == [r.receive_time for r in records]


def row_08_stamp_invalid() -> None:
    for stamp in (np.nan, -5.0, 1e300):
        one_rejected(with_one(motion(1.0), 50, stamp=stamp), 50, "stamp_invalid")


def row_09_stamp_duplicate() -> None:
    records = motion(1.0)
    one_rejected([*records[:50], records[49], *records[50:]], 50, "stamp_duplicate")


def row_10_stamp_out_of_order() -> None:
    records = motion(1.0)
    text = one_rejected([*records[:50], records[40], *records[50:]], 50, "stamp_out_of_order")
    assert f"{records[40].stamp:.6f}" in text
    assert f"{records[49].stamp:.6f}" in text


def row_11_clock_jumps_back() -> None:
    gate = gate_of()
    first = motion(3.0)
    again = [replace(record, receive_time=record.receive_time + 3.0) for record in first]
    results = run(gate, first + again)
    assert all(isinstance(m, Measurement) for m in results)
    assert gate.restarts == 1
    assert gate.gaps == 0
    assert "jumped back" not in gate.health(again[-1].receive_time).text
    run(gate, first[:100])
    assert "jumped back" in gate.health(first[99].receive_time).text


def row_11_bad_message_at_the_jump_counts_once() -> None:
    gate = gate_of()
    first = motion(3.0)
    run(gate, first + all_with(first[:5], effort=np.full(4, np.nan)) + first[5:])
    assert gate.restarts == 1
    assert gate.counts == {"effort_nan": 5}


def row_12_gap() -> None:
    gate = gate_of()
    records = motion(3.0)
    results = run(gate, records[:300] + records[400:450])
    assert all(isinstance(m, Measurement) for m in results)
    assert gate.gaps == 1
    assert "gap" in gate.health(records[449].receive_time).text


def row_13_stamp_of_another_clock() -> None:
    records = [replace(r, receive_time=r.receive_time + 5.0) for r in motion(2.0)]
    gate = gate_of()
    health = health_after(gate, records)
    assert gate.accepted == len(records)
    assert health.level == Level.WARN
    assert "Synchronise" in health.text


def row_14_simulated_time_on_one_side() -> None:
    records = [replace(r, receive_time=r.receive_time + 1.7e9) for r in motion(2.0)]
    health = health_after(gate_of(), records)
    assert health.level == Level.WARN
    assert "use_sim_time" in health.text


def row_15_effort_stuck_while_moving() -> None:
    records = motion(4.0)
    gate = gate_of()
    stuck = [replace(r, effort=records[250].effort) for r in records[250:750]]
    results = run(gate, records[:250] + stuck)
    assert gate.counts.keys() == {"effort_stuck"}
    late = results[250 + 80 :]
    assert all(isinstance(m, Rejection) for m in late)
    assert "fieldbus" in gate.health(stuck[-1].receive_time).text
    assert all(isinstance(m, Measurement) for m in run(gate, records[750:]))


def row_15_everything_stuck_at_speed() -> None:
    records = motion(2.0)
    last = records[100]
    stuck = [replace(last, stamp=r.stamp, receive_time=r.receive_time) for r in records[101:]]
    gate = gate_of()
    run(gate, records[:101] + stuck)
    assert gate.counts.keys() == {"effort_stuck"}


def row_15_nothing_of_what_is_stuck_enters() -> None:
    records = motion(2.0)
    last = records[100]
    stuck = [replace(last, stamp=r.stamp, receive_time=r.receive_time) for r in records[101:250]]
    gate = gate_of()
    taken = [m.t for r in records[:101] + stuck + records[250:] for m in gate.take(r)]
    assert taken == [r.stamp for r in records[:101] + records[250:]]
    assert gate.counts["effort_stuck"] == len(stuck)
    assert gate.accepted == len(taken)


def row_15_a_driver_that_publishes_faster_than_it_reads_loses_nothing() -> None:
    records = motion(2.0)
    read = [records[k - k % 4] for k in range(len(records))]
    shown = [replace(old, stamp=r.stamp, receive_time=r.receive_time) for old, r in zip(read, records, strict=True)]
    gate = gate_of()
    taken = [m.t for r in shown for m in gate.take(r)]
    assert taken == [r.stamp for r in records][: len(taken)]
    assert len(records) - len(taken) < 4


def row_15_standing_with_a_quantised_effort_is_fine() -> None:
    record = motion(1.0)[0]
    still = [replace(record, stamp=r.stamp, receive_time=r.receive_time, velocity=np.zeros(4)) for r in motion(3.0)]
    gate = gate_of()
    assert health_after(gate, still).level == Level.OK


def row_16_effort_zero() -> None:
    everything_rejected(all_with(motion(1.0), effort=np.zeros(4)), "effort_zero", "gravity")


def row_16_effort_zero_without_gravity_is_fine() -> None:
    record = motion(1.0)[0]
    still = [
        replace(record, stamp=r.stamp, receive_time=r.receive_time, velocity=np.zeros(4), effort=np.zeros(4)) for r in motion(1.0)
    ]
    weightless = InputGate(RobotModel.from_urdf(ROBOT.urdf, gravity=(0.0, 0.0, 0.0)), OnlineSettings(gravity=(0.0, 0.0, 0.0)))
    assert health_after(weightless, still).level == Level.OK
    assert health_after(gate_of(effort_type="external"), still).level == Level.OK


def row_17_absurd_values() -> None:
    records = motion(1.0)
    for key, value, reason in (
        ("effort", 1e224, "effort_range"),
        ("effort", 1e-310, "effort_range"),
        ("effort", np.inf, "effort_range"),
        ("effort", 2000.0, "effort_range"),
        ("position", -1e224, "position_range"),
        ("position", 90.0, "position_range"),
        ("position", -np.inf, "position_range"),
        ("position", np.nan, "position_nan"),
        ("velocity", 1e18, "velocity_range"),
        ("velocity", -np.inf, "velocity_range"),
    ):
        values = np.array(getattr(records[30], key))
        values[1] = value
        text = one_rejected(with_one(records, 30, **{key: values}), 30, reason)
        assert "lift" in text


def row_18_values_shifted_by_a_joint() -> None:
    records = motion(3.0)
    shifted = np.roll(records[400].position, 1)
    assert "mixed up" in one_rejected(with_one(records, 400, position=shifted), 400, "position_jump")


def row_18_a_position_that_stays_elsewhere_is_believed() -> None:
    records = motion(3.0)
    moved = [replace(r, position=r.position + np.array([0.0, 0.5, 0.0, 0.0])) for r in records[400:]]
    gate = gate_of()
    results = run(gate, records[:400] + moved)
    assert all(isinstance(m, Measurement) for m in results[450:])


def gravity_warning(word: str, factor: float | Sequence[float], level: Level) -> None:
    gate = gate_of()
    health = health_after(gate, motion(20.0, effort=lambda tau: tau * np.asarray(factor)))
    assert gate.accepted == 5000
    assert health.level == level
    assert word in health.text
    assert word in " ".join(gate.warnings)


def row_19_effort_in_another_unit() -> None:
    gravity_warning("effort_scale", 0.1, Level.WARN)
    gravity_warning("effort_scale", 8.0, Level.WARN)


def row_19_effort_scale_corrects_it() -> None:
    gate = gate_of(effort_scale=(10.0, 10.0, 10.0, 10.0))
    assert health_after(gate, motion(20.0, effort=lambda tau: tau * 0.1)).level == Level.OK


def row_19_a_loaded_arm_is_fine() -> None:
    frame = ROBOT.frame_id(ROBOT.default_frame)
    theta = np.array([4.0, 0.4, 0.0, 0.2, 0.02, 0.0, 0.06, 0.0, 0.0, 0.06])
    records = []
    for record in motion(20.0):
        a = -(MOTION[:, 1] ** 2) * (_of(record.position) - MIDDLE)
        load = ROBOT.payload_regressor(_of(record.position), _of(record.velocity), a, frame) @ theta
        records.append(replace(record, effort=record.effort + load))
    gate = gate_of()
    assert health_after(gate, records).level == Level.OK
    assert gate.warnings == ()


def row_20_gravity_is_compensated() -> None:
    compensated = []
    for record in motion(20.0):
        compensated.append(replace(record, effort=record.effort - ROBOT.gravity_torque(_of(record.position))))
    gate = gate_of()
    health = health_after(gate, compensated)
    assert health.level == Level.WARN
    assert "effort_type" in health.text
    assert health_after(gate_of(effort_type="external"), compensated).level == Level.OK


def row_21_sign_flipped() -> None:
    gravity_warning("effort_sign", -1.0, Level.ERROR)
    gravity_warning("lift", [1.0, -1.0, 1.0, 1.0], Level.ERROR)
    gate = gate_of(effort_sign=(-1.0, -1.0, -1.0, -1.0))
    assert health_after(gate, motion(20.0, effort=lambda tau: -tau)).level == Level.OK


def row_22_velocity_that_is_none() -> None:
    for velocity in (lambda r: np.zeros(4), lambda r: r.position, lambda r: np.array([4.0, 3.0, 3.0, 0.5])):
        for source in ("position", "message"):
            gate = gate_of(velocity_source=source)
            records = [replace(r, velocity=velocity(r)) for r in motion(8.0)]
            health = health_after(gate, records)
            assert gate.accepted == len(records)
            assert health.level == Level.WARN
            assert "velocity" in health.text
            last = gate.accept(replace(records[-1], stamp=records[-1].stamp + 0.004))
            assert isinstance(last, Measurement)
            assert last.v is None


def row_22_velocity_recovers() -> None:
    records = motion(16.0)
    gate = gate_of()
    run(gate, all_with(records[:2000], velocity=np.zeros(4)))
    health = health_after(gate, records[2000:])
    assert health.level == Level.OK
    assert gate.warnings != ()


def row_23_angle_wraps() -> None:
    gate = gate_of()
    turning = []
    for k, record in enumerate(motion(8.0)):
        angle = 2.0 * k / RATE
        position = _of(record.position).copy()
        position[0] = np.arctan2(np.sin(angle), np.cos(angle))
        turning.append(replace(record, position=position, velocity=()))
    q = np.array([m.q[0] for m in run(gate, turning) if isinstance(m, Measurement)])
    np.testing.assert_allclose(q, 2.0 * np.arange(2000) / RATE, atol=1e-9)


def row_23_step_of_a_full_turn() -> None:
    records = motion(2.0)
    turned = [replace(r, position=r.position + np.array([0.0, 2.0 * np.pi, 0.0, 0.0])) for r in records[250:]]
    gate = gate_of()
    results = run(gate, records[:250] + turned)
    found, expected = np.array([m.q for m in results if isinstance(m, Measurement)]), np.array([r.position for r in records])
    np.testing.assert_allclose(found, expected, atol=1e-9)


def row_24_prismatic_joint_is_not_wrapped() -> None:
    records = motion(1.0)
    jump = [replace(r, position=r.position + np.array([0.0, 0.0, 0.0, 2.0 * np.pi])) for r in records]
    gate = gate_of()
    run(gate, jump)
    assert gate.counts == {"position_range": 250}


def row_26_no_message() -> None:
    gate = gate_of()
    assert gate.health(START).level == Level.STALE
    health = health_after(gate, motion(1.0), later=3.0)
    assert health.level == Level.STALE
    assert "3.0 s" in health.text


def row_27_rate() -> None:
    gate = gate_of()
    health = health_after(gate, motion(3.0))
    assert health.level == Level.OK
    assert health.rate == pytest.approx(RATE, rel=0.02)
    slow = health_after(gate_of(), motion(3.0)[::10])
    assert slow.level == Level.WARN
    assert "rate" in slow.text


def row_27_burst_after_a_stall() -> None:
    gate = gate_of()
    records = motion(2.0)
    burst = [*records[:200], *(replace(r, receive_time=records[299].receive_time) for r in records[200:300]), *records[300:]]
    results = run(gate, burst)
    np.testing.assert_allclose(np.diff([m.t for m in results if isinstance(m, Measurement)]), 1.0 / RATE, rtol=1e-6)
    assert gate.accepted == 500


def row_31_values_that_are_no_numbers() -> None:
    records = motion(1.0)
    for wrong, reason in ((["a", "b", "c", "d"], "malformed"), ([[1.0, 2.0]] * 4, "malformed"), ([None] * 4, "position_nan")):
        one_rejected(with_one(records, 30, position=wrong), 30, reason)


ROWS = {name.removeprefix("row_"): check for name, check in sorted(globals().items()) if name.startswith("row_")}


@pytest.mark.parametrize("row", ROWS.values(), ids=ROWS.keys())
def test_bad_input(row: Callable[[], None]) -> None:
    row()


@pytest.mark.parametrize("convert", [list, tuple, lambda x: array("d", x), np.float32], ids=["list", "tuple", "array", "float32"])
def test_arrays_of_any_kind(convert: Callable[[object], Any]) -> None:
    record = motion(1.0)[3]
    as_received = replace(
        record, position=convert(record.position), velocity=convert(record.velocity), effort=convert(record.effort)
    )
    m = gate_of().accept(as_received)
    assert isinstance(m, Measurement)
    assert all(x.shape == (4,) and x.dtype == np.float64 and not x.flags.writeable for x in (m.q, _of(m.v), m.tau))
    np.testing.assert_allclose(m.tau, record.effort, rtol=1e-6)


def test_measurements_are_independent_of_the_next_message() -> None:
    gate = gate_of()
    records = motion(1.0)
    first = gate.accept(records[0])
    run(gate, records[1:])
    assert isinstance(first, Measurement)
    np.testing.assert_array_equal(first.q, records[0].position)


def test_names_that_never_repeat_take_no_memory() -> None:
    gate = gate_of()
    for k, record in enumerate(motion(4.0)):
        gate.accept(replace(record, names=tuple(f"{name}_{k}" for name in NAMES)))
    assert (gate.counts, gate.others) == ({}, 1000)
    assert len(gate._mappings) < 100
    assert len(gate._joined._kinds) < 100


def test_scale_and_sign_follow_the_order_of_joint_names() -> None:
    order = ("slide", "elbow", "lift", "turn")
    gate = gate_of(joint_names=order, effort_scale=(4.0, 3.0, 2.0, 1.0), effort_sign=(1.0, 1.0, 1.0, -1.0))
    record = motion(1.0)[0]
    m = gate.accept(record)
    assert isinstance(m, Measurement)
    np.testing.assert_allclose(m.tau, record.effort * np.array([-1.0, 2.0, 3.0, 4.0]))


@pytest.mark.parametrize(
    ("settings", "word"),
    [({"effort_scale": (1.0, 2.0)}, "4 joints"), ({"effort_sign": (1.0,)}, "4 joints"), ({"effort_sign": (0.5,) * 4}, "must be")],
)
def test_settings_that_do_not_fit(settings: dict[str, object], word: str) -> None:
    with pytest.raises(SettingsError, match=word):
        gate_of(**settings)


def test_health_says_how_much_is_rejected() -> None:
    records = [replace(r, effort=np.full(4, np.nan)) if k % 4 == 0 else r for k, r in enumerate(motion(2.0))]
    health = health_after(gate_of(), records)
    assert health.level == Level.WARN
    assert health.received == 500
    assert health.accepted == 375
    assert health.counts == {"effort_nan": 125}
    assert 55 <= health.recent["effort_nan"] <= 65
    assert health.last_stamp == records[-1].stamp
    assert health.age == 0.0


SHARED = Path(__file__).parents[2] / "shared" / "data"
UR10E = ["fourier14_noload", "fourier14_load", "fast20_noload", "fast20_load", "ptp_noload", "friction_joint2"]


@pytest.mark.parametrize(
    ("bag", "urdf"), [*((f"ur10e/{b}", "ur10e/ur10e.urdf") for b in UR10E), ("staubli_tx40/excitation", "staubli_tx40/tx40.urdf")]
)
def test_no_alarm_on_real_robots(bag: str, urdf: str) -> None:
    if not (SHARED / bag).exists():
        pytest.skip(f"{SHARED / bag} is not here")
    source = BagSource(SHARED / bag)
    gate = InputGate(RobotModel.from_urdf((SHARED / urdf).read_text(), source.joint_names), OnlineSettings())
    for k, record in enumerate(source):
        gate.accept(record)
        if k % 200 == 199:
            assert gate.health(record.receive_time).level == Level.OK
    assert gate.accepted == source.message_count
    assert gate.warnings == ()
