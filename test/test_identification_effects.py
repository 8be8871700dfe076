"""Effects that this file alone registers, asked for by the command: found where they are, and taken by what follows."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from arm_recordings import hidden_parameters, recorded
from click.testing import CliRunner, Result
from motions import Motion
from robots import robot, urdf

from sysid_ros.cli.main import sysid
from sysid_ros.effects import EFFECTS, Acts, Depends, Effect, JointCurves, Knob, register
from sysid_ros.effects import Motion as SmoothMotion
from sysid_ros.exceptions import SettingsError
from sysid_ros.identification import Choices, Recording, identify_recordings
from sysid_ros.identification.free_effects import free_model, own_knobs, places, usual_effects, wishes
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, JointStateRecord, Sample
from sysid_ros.sources import BagRecorder

MODEL = robot("small_arm")
TRUTH = hidden_parameters(MODEL, 1, links=0.0)
ELBOW = "elbow"


class LoadRipple(JointCurves):
    """``tau_j = |tau_link| (s sin(N q) + c cos(N q))``."""

    id: ClassVar[str] = "load_ripple"
    label: ClassVar[str] = "gear ripple that grows with the load"
    depends_on: ClassVar[frozenset[Depends]] = frozenset({Depends.LOAD})
    symbols: ClassVar[tuple[str, ...]] = ("s", "c")
    symbol_units: ClassVar[tuple[str, ...]] = ("1", "1")
    slide_units: ClassVar[tuple[str, ...]] = ("1", "1")
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("N", 2.0, 40.0, "1/rev", False),)

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), N: float = 10.0) -> None:
        super().__init__(robot, joints)
        self.N = float(N)

    @property
    def settings(self) -> dict[str, Any]:
        return {"N": self.N}

    def curves(self, state: Sample | SmoothMotion, load: FloatArray) -> FloatArray:
        return np.asarray(np.abs(load) * np.stack([np.sin(self.N * state.q), np.cos(self.N * state.q)]))


class SidewaysPull(Effect):
    """``tau = G_y(q) pull``: all links are pulled along y, as gravity pulls them down; it loads all joints."""

    id: ClassVar[str] = "sideways_pull"
    label: ClassVar[str] = "sideways pull"
    acts: ClassVar[Acts] = Acts.LINK

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self.parameter_names, self.units = ("pull",), ("m/s^2",)

    def _along(self, q: FloatArray) -> FloatArray:
        still = np.zeros_like(q)
        return self.robot.rnea_along(q, still, still, np.array([0.0, -1.0, 0.0]))

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[:, 0] = self._along(sample.q[None])[0]

    def columns_along(self, motion: SmoothMotion) -> FloatArray:
        return self._along(motion.q)[:, :, None]


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    for effect in (LoadRipple, SidewaysPull):
        register(effect)
    yield
    for effect in (LoadRipple, SidewaysPull):
        del EFFECTS[effect.id]


def with_effects(seed: int, *hidden: tuple[Effect, FloatArray]) -> Recording:
    recording = recorded(MODEL, TRUTH, seed, seconds=20.0, torque_noise=0.1)
    t = recording.t - recording.t[0]
    q, v, a = Motion(MODEL, seed, speed=0.8)(t)
    motion = SmoothMotion(MODEL, t, q, v, a, np.zeros_like(q))
    tau = recording.tau + sum(effect.torque_along(motion, theta) for effect, theta in hidden)
    return Recording(recording.name, recording.t, recording.q, recording.v, tau)


def bag_of(folder: Path, recording: Recording) -> Path:
    with BagRecorder(folder, "mcap") as recorder:
        recorder.write_robot_description(urdf("small_arm"), float(recording.t[0]))
        rows = zip(recording.t.tolist(), recording.q, recording.tau, strict=True)
        recorder.write_joint_states([JointStateRecord(t, t, MODEL.joint_names, q, [], tau) for t, q, tau in rows])
    return folder


def run(*arguments: object) -> Result:
    return CliRunner().invoke(sysid, [str(a) for a in arguments], catch_exceptions=False)


@pytest.mark.parametrize(("size", "accepted"), [(-0.4, False), pytest.param(0.4, True, marks=pytest.mark.slow)])
def test_friction_that_would_give_power_is_refused(size: float, accepted: bool) -> None:
    effect = EFFECTS["quadratic_friction"](MODEL, [ELBOW])
    bags = [with_effects(seed, (effect, np.array([size]))) for seed in (1, 2)]
    found = identify_recordings(MODEL, bags, [], {}, Choices(effects=(effect.id,)), 8.0)
    own = [p.value for p in found.parameters if p.effect == effect.id]
    assert bool(own) == accepted
    assert all(value >= 0.0 for value in own)


@pytest.mark.slow
def test_effects_of_a_test_file_are_found_by_the_command(tmp_path: Path) -> None:
    ripple = LoadRipple(MODEL, [ELBOW], N=9.0), np.array([0.20, 0.15])
    bags = [bag_of(tmp_path / f"bag{k}", with_effects(k, ripple, (SidewaysPull(MODEL), np.array([0.4])))) for k in (1, 2)]
    model, out = tmp_path / "model.yaml", tmp_path / "out.json"
    asked = ("--effect", LoadRipple.id, "--effect", SidewaysPull.id)
    result = run("identify", *bags, *asked, "--cutoff", 8, "--out", model, "--json", out)
    assert result.exit_code == 0, result.output
    found = json.loads(out.read_text())
    own = {p["name"]: p for p in found["parameters"] if p["effect"] in (LoadRipple.id, SidewaysPull.id)}
    assert set(own) == {f"s[{ELBOW}]", f"c[{ELBOW}]", "pull"}
    (knob,) = found["knobs"]
    assert knob["name"] == "N"
    assert knob["joint"] == ELBOW
    assert knob["determined"]
    assert knob["value"] == pytest.approx(9.0, abs=0.05)
    sine, cosine, pull = own[f"s[{ELBOW}]"], own[f"c[{ELBOW}]"], own["pull"]
    amplitude, std = np.hypot(sine["value"], cosine["value"]), np.hypot(sine["std"], cosine["std"])
    assert abs(amplitude - 0.25) < 3.0 * std
    assert std < 0.05
    assert pull["ci95"][0] <= 0.4 <= pull["ci95"][1]
    assert pull["std"] < 0.05
    for word in ("N of elbow", "sideways pull", "s: gear ripple"):
        assert word in result.output
    replayed = run("replay", bags[0], "--model", model, "--json", tmp_path / "replay.json")
    assert replayed.exit_code == 0, replayed.output
    assert abs(json.loads((tmp_path / "replay.json").read_text())["payload"]["mass"]) < 0.15


@pytest.mark.slow
def test_what_is_not_there_does_not_become_free() -> None:
    recordings = [with_effects(seed) for seed in (1, 2)]
    choices = Choices(effects=(LoadRipple.id, SidewaysPull.id, "cogging"))
    result = identify_recordings(MODEL, recordings, [], {}, choices, cutoff_hz=8.0)
    assert {p.effect for p in result.parameters} == {effect.id for effect in usual_effects()}
    assert result.knobs == ()


def test_an_effect_of_a_family_takes_the_place_of_the_usual_one() -> None:
    hysteresis = EFFECTS["presliding_hysteresis"](MODEL, [ELBOW])
    model = free_model(MODEL, [hysteresis])
    dry = [e for e in model.free if e.family == hysteresis.family]
    assert {name: e.id for e in dry for name in e.joint_names}[ELBOW] == hysteresis.id
    assert sorted(name for e in dry for name in e.joint_names) == sorted(MODEL.joint_names)
    assert [k.name for k in own_knobs(EFFECTS["stribeck_friction"])] == ["vs"]


def test_where_an_effect_is_asked_for() -> None:
    assert places(LoadRipple, MODEL) == [(name,) for name in MODEL.joint_names]
    assert places(SidewaysPull, MODEL) == [()]
    assert places(EFFECTS["payload"], MODEL) == [()]


@pytest.mark.parametrize(
    ("friction", "effects", "message"),
    [
        ("sticky", (), "load_dependent"),
        ("auto", ("no_such",), "no_such"),
        ("auto", ("link_inertia",), "free anyway"),
        ("auto", ("torque_offset_drift",), "time"),
    ],
)
def test_effects_that_cannot_be_asked_for(friction: str, effects: tuple[str, ...], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        wishes(friction, effects)


def test_the_help_shows_how() -> None:
    output = run("identify", "--help").output
    assert "--effect ID" in output
    assert "--effect cogging --effect spring" in output
