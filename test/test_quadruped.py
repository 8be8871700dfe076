"""What a walking robot carries: the recorded trot in bags/, and simulated gaits, through gate and estimation as the node does."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sysid_ros.cli import main
from sysid_ros.input_gate import gate_for
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.replay import Replay, replay
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import ContactRecord, ImuRecord, JointStateRecord
from sysid_ros.sources import BagRecorder, BagSource, FloatingBagSource

BAG = Path(__file__).resolve().parents[1] / "bags" / "quadruped_trot"
TRUTH = json.loads(BAG.with_name("quadruped_trot.truth.json").read_text())
THETA = np.array(TRUTH["payload"]["theta"])
START = TRUTH["start_time"]

Run = Callable[..., tuple[int, str]]
Record = JointStateRecord | ImuRecord | ContactRecord


@cache
def bag() -> BagSource:
    return BagSource(BAG)


def source() -> FloatingBagSource:
    return FloatingBagSource(bag())


@cache
def trot() -> list[Record]:
    return list(source())


@cache
def quadruped() -> RobotModel:
    return RobotModel.for_messages(bag().robot_description or "", bag().joint_names)


def estimated(records: Iterable[Record], legs: RobotModel | None = None, **settings: object) -> Replay:
    legs = legs or quadruped()
    chosen = OnlineSettings(**settings)  # type: ignore[arg-type]
    estimation = OnlineEstimation(legs, chosen)
    return replay(records, gate_for(legs, estimation.base, chosen), estimation)


def assert_covers(result: Replay, theta: np.ndarray = THETA, sigmas: float = 4.0) -> None:
    final = result.final
    assert np.all(np.abs(final.theta - theta)[:4] < sigmas * final.std[:4])


@pytest.fixture(scope="module")
def plain() -> Replay:
    return estimated(trot())


def test_the_recorded_trot_tells_the_box_and_when_it_was_put_on(plain: Replay) -> None:
    assert plain.used == plain.read
    assert plain.status == "ok"
    assert plain.final.mass == pytest.approx(THETA[0], rel=0.05)
    assert plain.final.com[:2] == pytest.approx(THETA[1:3] / THETA[0], abs=0.01)
    assert_covers(plain)
    assert [event.kind for event in plain.events] == ["pick"]
    assert plain.events[0].t == pytest.approx(TRUTH["pick_time"], abs=0.3)
    before = [e for e in plain.series if e.t < TRUTH["pick_time"]][-1]
    assert abs(before.mass) < max(0.1, 1.96 * before.mass_std)
    assert before.status == "no_payload" or before.status == "warming_up"
    assert plain.final.residual.shape == plain.final.payload_effort.shape == (quadruped().n,)


def test_without_contact_messages_the_stance_is_inferred_and_the_estimate_is_the_same(plain: Replay) -> None:
    result = estimated(r for r in trot() if not isinstance(r, ContactRecord))
    assert any("inferred" in sentence for sentence in result.warnings)
    assert result.feet["contact_inferred"] > 0
    assert result.final.mass == pytest.approx(plain.final.mass, abs=0.3 * plain.final.mass_std + 0.01)


def changed(change: Callable[[ContactRecord, float], ContactRecord]) -> list[Record]:
    return [change(r, r.receive_time - START) if isinstance(r, ContactRecord) else r for r in trot()]


def test_a_wrong_contact_flag_is_counted_and_does_no_harm(plain: Replay) -> None:
    def lying(record: ContactRecord, t: float) -> ContactRecord:
        values = np.array(record.values)
        if t > 4.0:
            values[0] = 1.0
        return replace(record, values=values)

    result = estimated(changed(lying))
    assert result.feet["contact_wrong"] > 20
    assert any(TRUTH["contact_frames"][0] in sentence and "otherwise" in sentence for sentence in result.warnings)
    assert_covers(result)
    assert result.final.mass == pytest.approx(plain.final.mass, abs=plain.final.mass_std)


def test_in_the_air_nothing_is_updated_and_nothing_claimed() -> None:
    def lifted(record: ContactRecord, t: float) -> ContactRecord:
        return replace(record, values=np.zeros(4)) if 4.0 < t < 5.2 else record

    result = estimated(changed(lifted))
    by_time = {round(e.t - START, 3): e for e in result.series}
    held = [e for t, e in by_time.items() if 4.7 < t < 6.1]
    assert held
    assert all(e.status == "stale" for e in held)
    assert all(e.mass == 0.0 and e.mass_std >= 1.0 for e in held)
    assert result.feet["not_standing"] > 200
    assert result.status == "warming_up"
    assert result.final.mass == pytest.approx(THETA[0], rel=0.05)
    assert_covers(result)


def test_hung_up_it_claims_nothing_whatever_the_contacts_say() -> None:
    """The legs hang on the trunk, gravity is felt, the feet carry nothing."""
    estimation = OnlineEstimation(quadruped(), OnlineSettings())
    base = estimation.base
    assert base is not None
    gate = gate_for(quadruped(), base, estimation.settings)
    rng = np.random.default_rng(0)
    q, still, zero = np.tile([0.0, 0.8, -1.6], 4), np.zeros(quadruped().n), np.zeros(3)
    up = np.array([0.0, 0.0, 9.81])
    tau = base.robot.rnea(*base.state(q, still, still, zero, up, zero))[6:]
    records: list[Record] = []
    for k in range(600):
        t = START + 0.005 * k
        records += [
            ContactRecord(t, np.ones(4)),
            ImuRecord(t, t, base.trunk, (0, 0, 0, 1), 0.005 * rng.standard_normal(3), up + 0.05 * rng.standard_normal(3)),
            JointStateRecord(t, t, quadruped().joint_names, q, (), tau + 0.2 * rng.standard_normal(quadruped().n)),
        ]
    result = replay(records, gate, estimation)
    assert result.status == "stale"
    assert "feet" in result.reason
    assert result.final.mass == 0.0
    assert not result.events


def test_two_seconds_of_another_force_on_the_robot_are_forgotten() -> None:
    """Somebody leans on the robot: the torques of one leg are wrong for a while."""
    records: list[Record] = []
    for r in trot():
        if isinstance(r, JointStateRecord) and 4.2 < r.receive_time - START < 4.5:
            records.append(replace(r, effort=np.array(r.effort) + 6.0 * np.sin(np.arange(quadruped().n) + 40.0 * r.receive_time)))
        else:
            records.append(r)
    result = estimated(records)
    assert result.feet["outlier"] > 0
    assert result.final.mass == pytest.approx(THETA[0], rel=0.05)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def call(*arguments: str) -> tuple[int, str]:
        code = main.run(["replay", *arguments])
        captured = capsys.readouterr()
        return code, captured.out + captured.err

    return call


def test_replay_writes_what_a_robot_on_legs_carries(run: Run, tmp_path: Path) -> None:
    code, _ = run(str(BAG), "--json", str(tmp_path / "out.json"))
    assert code == 0
    document = json.loads((tmp_path / "out.json").read_text())
    assert document["frame"] == TRUTH["frame"]
    assert document["payload"]["mass"] == pytest.approx(THETA[0], rel=0.05)
    assert document["samples"]["used"] == document["samples"]["read"] > 0
    assert document["observable"][:3] == [True, True, True]


def bag_with(path: Path, records: Iterable[Record]) -> str:
    with BagRecorder(path) as recorder:
        recorder.write_robot_description(bag().robot_description or "", START)
        for r in records:
            if isinstance(r, ImuRecord):
                recorder.write_imu(r)
            elif isinstance(r, ContactRecord):
                recorder.write_contacts(r)
            else:
                recorder.write_joint_states((r,))
    return str(path)


@pytest.mark.parametrize(
    ("change", "arguments", "cure"),
    [
        (lambda r: None if isinstance(r, ImuRecord) else r, [], "--imu-topic|Record it too"),
        (lambda r: replace(r, frame_id="camera") if isinstance(r, ImuRecord) else r, [], "Set imu_frame"),
        (lambda r: replace(r, stamp=r.stamp + 1.0) if isinstance(r, ImuRecord) else r, [], "Synchronise the clocks"),
        (lambda r: r, ["--imu-topic", "/other"], "Correct --imu-topic"),
        (lambda r: r, ["--contact-topic", "/imu"], "Correct --contact-topic"),
    ],
    ids=["no IMU", "frame", "stamps", "IMU topic", "contact topic"],
)
def test_bad_input_is_named_with_the_cure(
    run: Run, tmp_path: Path, change: Callable[[Record], Record | None], arguments: list[str], cure: str
) -> None:
    records = [r for r in map(change, trot()[:900]) if r is not None]
    code, text = run(bag_with(tmp_path / "bag", records), *arguments)
    assert code == 2
    assert re.search(cure, " ".join(text.split()))


def test_a_foot_that_the_urdf_lacks_is_named(run: Run, tmp_path: Path) -> None:
    config = tmp_path / "node.yaml"
    config.write_text("contact_frames: [FL_toe, paw]\n")
    code, text = run(str(BAG), "--config", str(config))
    assert code == 2
    assert "paw" in text
    assert "contact_frames" in text


@pytest.mark.slow
def test_lifted_off_the_ground_and_set_down_it_finds_the_box_again() -> None:
    pytest.importorskip("pybullet", reason="PyBullet is not installed (extra sim)")
    from sysid_ros.simulation.quadruped_record import simulate_quadruped
    from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario

    scenario = QuadrupedScenario(duration=15.0, rate=250, hoist_time=5.5, hoist_duration=3.0, payload_mass=2.0)
    record = simulate_quadruped(scenario)
    for contacts in (True, False):
        result = estimated(record.records(contacts=contacts), RobotModel.from_urdf(record.urdf))
        status = {round(e.t, 2): e.status for e in result.series}
        assert all(word in ("warming_up", "ok") for t, word in status.items() if t < 5.4)
        assert [word for t, word in status.items() if 5.2 < t < 5.4][-1] == "ok"
        assert all(word != "ok" for t, word in status.items() if 6.0 < t < 8.5)
        assert all(word == "stale" for t, word in status.items() if 7.0 < t < 7.8)
        assert result.status == "ok"
        assert result.final.mass == pytest.approx(2.0, rel=0.03)
        assert not result.events


@pytest.mark.slow
@pytest.mark.parametrize("contacts", [True, False], ids=["told", "inferred"])
def test_on_three_feet_the_box_is_found(contacts: bool) -> None:
    pytest.importorskip("pybullet", reason="PyBullet is not installed (extra sim)")
    from sysid_ros.simulation.quadruped_record import simulate_quadruped
    from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario

    scenario = QuadrupedScenario(
        duration=7.0, rate=250, lifted_foot="FR_toe", pick_time=5.0, payload_mass=1.5, payload_com=(0.0, 0.0, 0.1)
    )
    record = simulate_quadruped(scenario)
    result = estimated(record.records(contacts=contacts), RobotModel.from_urdf(record.urdf))
    assert result.status == "ok"
    assert result.final.mass == pytest.approx(1.5, rel=0.03)
    assert [event.kind for event in result.events] == ["pick"]
    assert ("contact_inferred" in result.feet) != contacts


@pytest.mark.slow
def test_a_box_that_is_taken_off_in_the_air_is_a_drop() -> None:
    pytest.importorskip("pybullet", reason="PyBullet is not installed (extra sim)")
    from sysid_ros.simulation.quadruped_record import simulate_quadruped
    from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario

    scenario = QuadrupedScenario(duration=12.5, rate=250, hoist_time=5.5, hoist_duration=3.0, payload_mass=2.0, drop_time=7.0)
    record = simulate_quadruped(scenario)
    result = estimated(record.records(), RobotModel.from_urdf(record.urdf))
    assert result.status == "no_payload"
    assert [event.kind for event in result.events] == ["drop"]
    assert 7.0 < result.events[0].t < 9.0


@pytest.mark.slow
@pytest.mark.parametrize("gait", ["stand", "sway", "trot"])
def test_a_bias_of_the_imu_is_told_from_the_box(gait: str) -> None:
    pytest.importorskip("pybullet", reason="PyBullet is not installed (extra sim)")
    from sysid_ros.simulation.quadruped_record import simulate_quadruped
    from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario

    bias = (0.06, -0.05, 0.09)
    record = simulate_quadruped(
        QuadrupedScenario(gait=gait, duration=7.0, pick_time=3.0, payload_mass=2.0, slope=5.0, accelerometer_bias=bias)
    )
    legs, theta = RobotModel.from_urdf(record.urdf), np.array(record.truth["payload"]["theta"])
    believing = estimated(record.records(), legs)
    assert any("accelerometer_bias_std" in sentence for sentence in believing.warnings)
    assert 0.08 < abs(believing.final.mass - 2.0) < 1.96 * believing.final.mass_std
    freed = estimated(record.records(), legs, accelerometer_bias_std=0.1)
    assert freed.final.mass == pytest.approx(2.0, rel=0.03)
    assert_covers(freed, theta)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gait", "wait", "allowed"), [("stand", 1.0, 0.03), ("sway", 3.0, 0.02), ("trot", 4.0, 0.05)], ids=["stand", "sway", "trot"]
)
def test_a_box_anywhere_on_the_back(gait: str, wait: float, allowed: float) -> None:
    pytest.importorskip("pybullet", reason="PyBullet is not installed (extra sim)")
    from sysid_ros.simulation.quadruped_record import simulate_quadruped
    from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario

    z = []
    for seed in range(3):
        rng = np.random.default_rng(100 + seed)
        com = (rng.uniform(-0.15, 0.15), rng.uniform(-0.08, 0.08), rng.uniform(0.07, 0.2))
        record = simulate_quadruped(
            QuadrupedScenario(
                gait=gait, seed=seed, duration=2.5 + wait, slope=5.0 * seed, slope_heading=100.0 * seed,
                payload_mass=rng.uniform(0.5, 5.0), payload_com=com, pick_time=2.5,
            )
        )  # fmt: skip
        legs = RobotModel.from_urdf(record.urdf)
        result = estimated(record.records(), legs, contact_frames=record.truth["contact_frames"])
        theta = np.array(record.truth["payload"]["theta"])
        empty = [e for e in result.series if e.t < 2.45][-1]
        assert abs(empty.mass) < max(0.1, 1.96 * empty.mass_std)
        error = abs(result.final.mass - theta[0]) / theta[0]
        assert error < 2.0 * allowed
        if gait == "sway":
            assert np.abs(result.final.com[:2] - theta[1:3] / theta[0]).max() < 0.02
        z.append((result.final.theta - theta)[:3] / result.final.std[:3])
    assert np.sqrt(np.mean(np.square(z))) < 2.0
