"""Temperatures in a diagnosis: shown, told from time as what friction follows, and kept in the model."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from diagnosis_bags import messages, write_temperatures
from motions import Motion as Path_
from robots import DATA, robot
from unsimulated import unsimulated as unsimulated

from sysid_ros.cli.main import run
from sysid_ros.diagnosis import Diagnosis, diagnose
from sysid_ros.effects import FrictionDrift
from sysid_ros.exceptions import ModelFileError
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.temperature import known_everywhere
from sysid_ros.sources import BagRecorder
from sysid_ros.torque.model_file import ModelFile

ARM = "small_arm"
RATE, NOISE = 200.0, 0.05
LEVEL, VISCOUS, PER_KELVIN, AT = 2.0, 0.5, -0.03, 25.0
JOINT = 1
Curve = Callable[[FloatArray], FloatArray]


def record(seed: int, warm: Curve, factor: Curve | None = None, seconds: float = 16.0) -> Recording:
    """An arm with friction on one joint that falls with its temperature, or by a factor of time."""
    model, rng = robot(ARM), np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    q, v, a = Path_(model, seed, speed=1.2)(t)
    part = 1.0 + PER_KELVIN * (warm(t) - AT) if factor is None else factor(t)
    tau = model.rnea_along(q, v, a) + NOISE * rng.normal(size=q.shape)
    tau[:, JOINT] += part * (LEVEL * np.sign(v[:, JOINT]) + VISCOUS * v[:, JOINT])
    temperature = np.full(q.shape, np.nan)
    temperature[:, JOINT] = np.round(warm(t) + 0.1 * rng.normal(size=len(t)), 1)
    return Recording(f"seed {seed}", 50.0 + t, np.round(q / 2e-5) * 2e-5, None, tau, temperature)


def warming(start: float, up: float, seconds: float = 8.0) -> Curve:
    return lambda t: start + up * (1.0 - np.exp(-t / seconds))


@cache
def diagnosed(what: str) -> Diagnosis:
    fit, judge = {
        "temperature": (record(1, warming(25.0, 15.0)), record(2, warming(33.0, 10.0), seconds=10.0)),
        "time": (
            record(1, lambda t: 30.0 + 4.0 * np.sin(t / 4.0), lambda t: 1.0 - 0.025 * t),
            record(2, lambda t: 30.0 + 4.0 * np.sin(t / 3.0), lambda t: 1.0 - 0.025 * t, 10.0),
        ),
        "either": (record(1, lambda t: 25.0 + 0.6 * t), record(2, lambda t: 25.0 + 0.6 * t, seconds=10.0)),
        "neither": (record(1, warming(25.0, 15.0), np.ones_like), record(2, warming(33.0, 10.0), np.ones_like, 10.0)),
    }[what]
    return diagnose(robot(ARM), [fit], [judge])


@pytest.mark.slow
def test_friction_that_falls_with_the_temperature_is_found_as_such() -> None:
    result = diagnosed("temperature")
    (found,) = result.findings
    assert (found.id, found.joints) == ("friction_drift", ("lift",))
    values = {p.name: p for p in found.parameters}
    assert values["rate_Fc"].unit == "N m/K"
    assert values["rate_Fc"].low < PER_KELVIN * LEVEL < values["rate_Fc"].high
    assert values["rate_b"].low < PER_KELVIN * VISCOUS < values["rate_b"].high
    assert found.drift is not None
    assert (found.drift["over"], found.drift["decided"]) == ("temperature", True)
    assert found.drift["delta_bic"] > 10.0
    assert found.drift["heldout_error"]["temperature"] < 1.3 < 3.0 < found.drift["heldout_error"]["time"]
    assert "temperature explains the drift better than time" in found.sentence
    assert "temperature" in found.signature
    assert result.verdict == "explained"
    facts = result.as_dict()["temperature"]
    assert facts["joints"] == ["lift"]
    assert facts["friction_before"][0] < -0.8
    assert abs(facts["friction_after"][0]) < 0.1


@pytest.mark.slow
def test_the_model_follows_the_temperature_where_it_is_known_and_stays_at_the_reference_elsewhere(tmp_path: Path) -> None:
    result = diagnosed("temperature")
    assert result.model is not None
    result.model.write(tmp_path / "model.yaml")
    again = ModelFile.read(tmp_path / "model.yaml")
    (block,) = [b for b in again.effects if b.effect == "friction_drift"]
    reference = block.settings["reference"]
    assert any("follows the temperature" in note and f"{reference:g} degrees" in note for note in again.notes(robot(ARM).urdf))
    (known,) = again.known_effects(robot(ARM))
    nothing, v = np.zeros(4), np.array([0.0, 1.0, 0.0, 0.0])
    level, b = LEVEL * (1.0 + PER_KELVIN * (reference - AT)), VISCOUS * (1.0 + PER_KELVIN * (reference - AT))
    for temperature, part in ((None, 0.0), (np.full(4, np.nan), 0.0), (np.full(4, reference + 10.0), 10.0)):
        torque = known.effect.torque(Sample(0.0, nothing, v, nothing, nothing, temperature), known.theta)[JOINT]
        assert torque == pytest.approx(level + b + PER_KELVIN * part * (LEVEL + VISCOUS), abs=0.05)
    # a robot whose friction is known to follow its temperature shows nothing more
    third = record(3, warming(30.0, 12.0))
    assert diagnose(robot(ARM), [third], known=again).verdict == "nothing_wrong"


@pytest.mark.slow
def test_what_friction_follows_is_told_only_where_the_recordings_tell() -> None:
    (in_time,) = diagnosed("time").findings
    assert in_time.drift is not None
    assert (in_time.drift["over"], in_time.drift["decided"]) == ("time", True)
    assert "Time explains the drift better" in in_time.sentence
    assert not diagnosed("time").record_next
    (either,) = diagnosed("either").findings
    assert either.drift is not None
    assert not either.drift["decided"]
    assert "don't tell whether" in either.sentence
    assert any("temperature" in s and "cold start" in s for s in diagnosed("either").record_next)


@pytest.mark.slow
def test_a_temperature_that_friction_does_not_follow_is_no_cause() -> None:
    result = diagnosed("neither")
    assert {f.id for f in result.findings} == {"coulomb_friction", "viscous_friction"}
    facts = result.as_dict()["temperature"]
    assert abs(facts["friction_before"][0]) < 0.2


def test_a_temperature_that_some_recordings_lack_is_no_cause() -> None:
    joints = robot(ARM).joint_names
    both = [record(s, warming(25.0, 15.0), seconds=3.0) for s in (1, 2)]
    for r in both:
        assert r.temperature is not None
        r.temperature[:, 3] = 30.0
    kept, notes = known_everywhere(both[:1], both[1:], joints)
    assert notes == ()
    np.testing.assert_array_equal(kept[0].temperature, both[0].temperature)
    assert both[1].temperature is not None
    both[1].temperature[7, JOINT] = np.nan
    kept, (note,) = known_everywhere(both[:1], both[1:], joints)
    assert "temperature of lift is not known in all" in note
    assert kept[0].temperature is not None
    assert np.isnan(kept[0].temperature[:, :3]).all()
    assert np.all(kept[0].temperature[:, 3] == 30.0)
    kept, (note,) = known_everywhere(both[:1], [replace(both[1], temperature=None)], joints)
    assert "temperature of lift, slide is not" in note
    assert len(FrictionDrift.candidates(motions(robot(ARM), kept[0]), JOINT)) == 1


def test_friction_follows_only_a_temperature_that_changes() -> None:
    model = robot(ARM)
    moved = motions(model, record(1, warming(25.0, 15.0), seconds=6.0))
    over_time, over_temperature = FrictionDrift.candidates(moved, JOINT)
    assert over_time.settings == {}
    assert over_temperature.settings["over"] == "temperature"
    assert over_temperature.settings["reference"] == pytest.approx(float(np.mean(moved[0].temperature[:, JOINT])), abs=0.06)  # type: ignore[index]
    assert len(FrictionDrift.candidates(motions(model, record(1, warming(25.0, 0.3), seconds=6.0)), JOINT)) == 1
    # two recordings, each at one temperature
    both = [m for start in (25.0, 35.0) for m in motions(model, record(1, warming(start, 0.0), seconds=4.0))]
    _, over_temperature = FrictionDrift.candidates(both, JOINT)
    assert over_temperature.settings["reference"] == pytest.approx(30.0, abs=0.1)


@pytest.mark.slow
def test_without_a_temperature_the_same_is_found_as_with_one_that_stays() -> None:
    known = [record(s, lambda t: 30.0 + 0.0 * t, lambda t: 1.0 - 0.025 * t, x) for s, x in ((1, 12.0), (2, 8.0))]
    bare = [replace(r, temperature=None) for r in known]
    one, other = (diagnose(robot(ARM), [fit], [judge]).as_dict() for fit, judge in (known, bare))
    assert one.pop("temperature")["joints"] == ["lift"]
    assert one == other


@pytest.mark.slow
def test_a_drift_over_one_recording_goes_on_in_the_part_that_is_held_out() -> None:
    whole = replace(record(1, lambda t: 30.0 + 0.0 * t, lambda t: 1.0 - 0.02 * t, 30.0), temperature=None)
    result = diagnose(robot(ARM), [whole])
    (found,) = result.findings
    assert (found.id, found.joints) == ("friction_drift", ("lift",))
    rate = next(p for p in found.parameters if p.name == "rate_Fc")
    assert rate.low < -0.02 * LEVEL < rate.high
    assert result.predictions is not None
    assert result.predictions.t[0] > 20.0  # since the first stamp of the recording, not of its part
    assert result.verdict == "explained"


@pytest.mark.slow
def test_what_is_left_is_said_to_follow_the_temperature() -> None:
    """A sensor whose zero follows the temperature is no effect of the library."""
    parts = []
    for seed, seconds in ((1, 14.0), (2, 10.0)):
        r = record(seed, lambda t: 30.0 + 6.0 * np.sin(0.9 * t), np.zeros_like, seconds)
        assert r.temperature is not None
        tau = r.tau.copy()
        tau[:, JOINT] += 0.15 * (30.0 + 6.0 * np.sin(0.9 * (r.t - r.t[0])) - 30.0)
        parts.append(replace(r, tau=tau))
    result = diagnose(robot(ARM), parts[:1], parts[1:])
    assert "temperature of lift" in result.unexplained
    assert result.verdict in ("unexplained", "partly_explained")


def test_channels_stay_together_and_a_stretch_knows_a_temperature_all_along_or_not() -> None:
    r = record(1, warming(25.0, 15.0), seconds=8.0)
    assert r.temperature is not None
    torn = r.at((r.t < 53.0) | (r.t > 54.0))
    assert torn.temperature is not None
    np.testing.assert_array_equal(torn.temperature[:, JOINT], r.temperature[np.isin(r.t, torn.t), JOINT])
    torn.temperature[-5, JOINT] = np.nan
    first, second = motions(robot(ARM), torn)
    assert first.temperature is not None
    assert second.temperature is not None
    np.testing.assert_allclose(first.temperature[:, JOINT], warming(25.0, 15.0)(first.t), atol=0.5)
    assert torn.at(slice(900, None)).start == r.t[0]
    assert np.isnan(second.temperature[:, JOINT]).all()
    assert np.isnan(first.temperature[:, 0]).all()


def test_a_drift_over_something_else_is_refused() -> None:
    with pytest.raises(ModelFileError, match="'humidity'; it must be one of time, temperature"):
        FrictionDrift(robot(ARM), over="humidity")


def test_the_command_reads_shows_and_warns(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    records = messages(5, 14.0)
    t = 100.0 + np.arange(0.0, 14.0, 0.5)
    with BagRecorder(tmp_path / "run") as recorder:
        recorder.write_joint_states(records)
        write_temperatures(recorder, "/lift/temperature", "", t, 30.0 + 0.5 * (t - 100.0))
        write_temperatures(recorder, "/imu/temperature", "imu_link", t, 40.0 + 0.0 * t)
    out = tmp_path / "out"
    assert run(["diagnose", str(tmp_path / "run"), "--urdf", str(DATA / "small_arm.urdf"), "--out", str(out)]) == 0
    told = " ".join(capfd.readouterr().err.split())
    assert "/imu/temperature (imu_link)" in told
    assert "no joint of turn, lift, elbow, slide" in told
    assert "run: it holds the temperature of lift." in told
    page = (out / "report.html").read_text()
    assert "temperature [\\u00b0C]" in page
    assert "not recorded" in page
    assert "<h2>Temperature</h2>" in page
    facts = json.loads((out / "diagnosis.json").read_text())["temperature"]
    assert facts["joints"] == ["lift"]
    assert abs(facts["friction_before"][0]) < 0.5
