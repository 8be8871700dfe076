"""Effects registered at run time are hidden through the command: their columns stand in the efforts that are recorded."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")

from sysid_ros import effects
from sysid_ros.cli.main import sysid
from sysid_ros.effects import Depends, Effect, JointCurves, Knob, Motion
from sysid_ros.exceptions import SettingsError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.simulation.description import arm_description
from sysid_ros.simulation.hidden_effects import CAUSES, HiddenEffect, cause_of, realise, register_hidden
from sysid_ros.simulation.hidden_effects.payload import Payload
from sysid_ros.sources import BagSource

JOINT = "lbr_iiwa_joint_4"
RATE = 200


class GearRipple(JointCurves):
    """``tau_j = abs(tau_link) (s sin(N q) + c cos(N q))``."""

    id: ClassVar[str] = "gear_ripple"
    label: ClassVar[str] = "ripple of a loaded gear"
    depends_on: ClassVar[frozenset[Depends]] = frozenset({Depends.LOAD})
    symbols: ClassVar[tuple[str, ...]] = ("s", "c")
    symbol_units: ClassVar[tuple[str, ...]] = ("1", "1")
    slide_units: ClassVar[tuple[str, ...]] = ("1", "1")
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("N", 2.0, 12.0, "1/rev", False),)

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), N: float = 6.0) -> None:
        super().__init__(robot, joints)
        self.N = N

    @property
    def settings(self) -> dict[str, Any]:
        return {"N": self.N}

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        return np.asarray(np.abs(load) * np.stack([np.sin(self.N * state.q), np.cos(self.N * state.q)]))


class Wind(Effect):
    """A lift and a drag that load every joint: ``tau = sum_k sin(q_k) (lift 1 + drag v)``."""

    id: ClassVar[str] = "wind"
    label: ClassVar[str] = "wind"
    nonnegative: ClassVar[bool] = True

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self.parameter_names, self.units = ("lift", "drag"), ("N m", "N m s/rad")

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[:, 0] = np.sin(sample.q).sum()
        out[:, 1] = out[:, 0] * sample.v


@pytest.fixture(autouse=True)
def registered(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for effect in (GearRipple, Wind):
        effects.register(effect)
    yield
    for effect in (GearRipple, Wind):
        del effects.EFFECTS[effect.id]


def simulate(bag: Path, *arguments: str) -> tuple[dict[str, Any], FloatArray, FloatArray, FloatArray, FloatArray]:
    """Truth, t, q, v and effort of a bag that the command recorded without noise."""
    quiet = [x for name in ("encoder", "torque", "velocity") for x in (f"--{name}-noise", "0")]
    options = ["simulate", "arm", "--bag", str(bag), "--duration", "8", "--rate", str(RATE), *quiet, *arguments]
    result = CliRunner().invoke(sysid, options, catch_exceptions=False)
    assert result.exit_code == 0
    truth: dict[str, Any] = json.loads(bag.with_name(f"{bag.name}.truth.json").read_text())
    records = list(BagSource(bag))
    q, v, tau = (np.array([getattr(r, name) for r in records]) for name in ("position", "velocity", "effort"))
    return truth, np.array([r.stamp for r in records]), q, v, tau


def rms(x: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(x**2, axis=0)))


def left(t: FloatArray, q: FloatArray, v: FloatArray, tau: FloatArray) -> tuple[Motion, FloatArray]:
    """The motion that the messages tell, and what the URDF leaves of their efforts."""
    robot = RobotModel.from_urdf(arm_description())
    motion = Motion(robot, t - t[0], q, v, np.gradient(v, t, axis=0), tau)
    return motion, tau - motion.rigid_torque


def test_a_ripple_of_one_joint_is_in_the_recorded_efforts(tmp_path: Path) -> None:
    truth, *signals = simulate(tmp_path / "a", "--hide", f"gear_ripple@{JOINT}", "--hide-value", "N=5")
    (hidden,) = truth["effects"]
    value = {p["name"]: p["value"] for p in hidden["parameters"]}
    assert (hidden["name"], hidden["joints"], value["N"]) == ("gear_ripple", [JOINT], 5.0)
    assert {p["name"]: p["unit"] for p in hidden["parameters"]} == {"N": "1/rev", "s": "1", "c": "1"}
    motion, residual = left(*signals)
    j = motion.robot.joint_names.index(JOINT)
    law = np.abs(motion.rigid_torque[:, j]) * (
        value["s"] * np.sin(5.0 * motion.q[:, j]) + value["c"] * np.cos(5.0 * motion.q[:, j])
    )
    assert rms(residual[:, j] - law) < 0.02 * rms(law)
    assert rms(law) > 0.05 * rms(motion.tau[:, j])
    assert rms(np.delete(residual, j, axis=1)).max() < 0.02


def test_what_loads_every_joint_belongs_to_the_whole_arm(tmp_path: Path) -> None:
    truth, *signals = simulate(tmp_path / "a", "--hide", "wind", "--hide-seed", "2")
    (hidden,) = truth["effects"]
    assert hidden["joints"] == truth["joint_names"]
    lift, drag = (p["value"] for p in hidden["parameters"])
    assert lift > 0.0
    assert drag > 0.0
    motion, residual = left(*signals)
    law = np.sin(motion.q).sum(axis=1)[:, None] * (lift + drag * motion.v)
    assert rms(residual - law).max() < 0.02 * rms(law).max()
    with pytest.raises(SettingsError, match="can't be hidden on that joint"):
        simulate(tmp_path / "b", "--hide", f"wind@{JOINT}")


def test_the_load_is_that_of_the_true_links(tmp_path: Path) -> None:
    """A ripple by load beside a payload: the payload loads the gear too."""
    hide = ("--hide", f"gear_ripple@{JOINT}", "--hide-value", "N=4", "--hide-value", "s=0.3", "--hide-value", "c=0.0")
    truth, *signals = simulate(tmp_path / "a", "--hide", "payload", "--hide-value", "mass=4", *hide)
    body = next(e for e in truth["effects"] if e["name"] == "payload")
    parameters = {p["name"]: p["value"] for p in body["parameters"]}
    motion, residual = left(*signals)
    robot, j = motion.robot, motion.robot.joint_names.index(JOINT)
    effect = effects.Payload(robot, frame=robot.default_frame)
    inertia, com = np.array(body["settings"]["inertia_com"]), np.array(parameters["com"])
    shifted = inertia + parameters["mass"] * (com @ com * np.eye(3) - np.outer(com, com))
    theta = np.r_[parameters["mass"], parameters["mass"] * com, shifted[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]]
    carried = effect.columns_along(motion) @ theta
    law = carried[:, j] + 0.3 * np.abs(motion.rigid_torque + carried)[:, j] * np.sin(4.0 * motion.q[:, j])
    assert rms(residual[:, j] - law) < 0.02 * rms(law)


def test_knobs_and_sizes_are_drawn_within_their_ranges() -> None:
    from test_hidden_physics import usual

    for seed in range(4):
        c = usual(seed)
        effect = cause_of("gear_ripple").draw(c)
        assert all(2.0 <= n <= 12.0 for n in effect.per_joint("N").values())
        assert set(effect.per_joint("s")) == set(effect.joints)
        assert len(realise(c.robot, (effect,)).channels) == 1


def test_a_cause_of_its_own_goes_before_the_columns_and_is_registered_once() -> None:
    class HiddenWind(Payload):
        id = "wind"

    try:
        register_hidden(HiddenWind)
        assert cause_of("wind") is CAUSES["wind"]
        with pytest.raises(SettingsError, match="'wind' is registered already"):
            register_hidden(HiddenWind)
    finally:
        del CAUSES["wind"]
    with pytest.raises(SettingsError, match=r"gremlins.*must be one of"):
        realise(RobotModel.from_urdf(arm_description()), (HiddenEffect("gremlins", (), ()),))
