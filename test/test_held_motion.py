"""The gain in simulation: a controller holds the recorded motion; healthy robots show their noise, a cause that is found none."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from motions import Motion as Path_
from robots import robot
from test_diagnosis import ARM, CAUSES, record

from sysid_ros.cli.main import run
from sysid_ros.diagnosis import Diagnosis, diagnose
from sysid_ros.diagnosis.gain import SimulationError
from sysid_ros.effects import EFFECTS
from sysid_ros.exceptions import RobotModelError, SettingsError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation import simulators
from sysid_ros.simulation.held_motion import Controller, Reference, hold
from sysid_ros.simulation.simulators import SIMULATORS, installed, is_installed, simulated
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel

pytestmark = pytest.mark.skipif(installed() is None, reason=simulators.MISSING)
EACH = [pytest.param(s, marks=pytest.mark.skipif(not is_installed(s), reason=f"{s} is not installed")) for s in SIMULATORS]


def known(model: RobotModel) -> TorqueModel:
    """A robot with rotors and viscous friction."""
    rotors, viscous = EFFECTS["rotor_inertia"](model), EFFECTS["viscous_friction"](model)
    return TorqueModel(model, [], [KnownEffect(rotors, np.full(model.n, 0.2)), KnownEffect(viscous, np.full(model.n, 1.5))])


def reference(model: RobotModel, seconds: float = 3.0) -> Reference:
    t = np.arange(0.0, seconds, 5e-3)
    return Reference.of(t, Path_(model, 1, 1.2)(t)[0])


@pytest.mark.parametrize("simulator", EACH)
@pytest.mark.parametrize("name", ["small_arm", "tree_robot", "iiwa"])
def test_an_arm_that_is_the_model_follows_without_help(name: str, simulator: str) -> None:
    ball = np.array([0.2, 0.0, 0.0, 0.0, 2e-3, 0.0, 2e-3, 0.0, 0.0, 2e-3])
    model = known(robot(name).with_links(np.tile(ball, robot(name).n)))
    motion = reference(model.robot)
    arm = simulated(model, simulator)
    needed = motion.needed(model)
    controller = Controller.of([model], motion.q[::50], np.ones(model.robot.n), 8.0)
    try:
        held = hold(arm, motion, needed, np.zeros_like(needed), model.damping(), controller)
        pushed = hold(arm, motion, needed, np.full_like(needed, 0.5), model.damping(), controller)
    finally:
        arm.close()
    assert np.abs(held.position).max() < 1e-9
    assert np.abs(held.added).max() < 1e-6
    # a torque too much is what the controller takes back, and bends it by that over its stiffness
    np.testing.assert_allclose(np.mean(pushed.added, axis=0), -0.5, rtol=0.05)
    np.testing.assert_allclose(np.mean(pushed.position, axis=0), 0.5 / controller.stiffness, rtol=0.05)


@pytest.mark.parametrize("simulator", EACH)
def test_a_link_that_weighs_something_else_shows(simulator: str) -> None:
    """The links are the simulator's own: those of another arm do not follow."""
    model = TorqueModel(robot(ARM), [])
    heavier = TorqueModel(robot(ARM).with_links(0.1 * robot(ARM).pi), [])
    motion = reference(model.robot)
    needed = motion.needed(model)
    arm = simulated(heavier, simulator)
    try:
        controller = Controller.of([model], motion.q[::50], np.ones(model.robot.n), 50.0)
        held = hold(arm, motion, needed, np.zeros_like(needed), model.damping(), controller)
    finally:
        arm.close()
    missing = motion.needed(heavier) - needed
    np.testing.assert_allclose(held.added[100:], missing[100:], atol=0.02 * np.abs(missing).max())


def test_inertias_of_no_body_move_as_the_model_says_or_are_refused() -> None:
    """As placeholders in URDFs are, which break the triangle inequality, and points without inertia."""
    broken, point = np.zeros((2, robot(ARM).n, 10))
    broken[-1, 4] = 0.05
    point[-1] = np.array([0.2, *[0.0] * 9]) - robot(ARM).pi[-10:]
    if is_installed("pybullet"):
        with pytest.raises(RobotModelError, match=r"link 'hand'.*no body.*mujoco"):
            simulated(TorqueModel(robot(ARM).with_links(broken.ravel()), []), "pybullet")
    if not is_installed("mujoco"):
        pytest.skip("MuJoCo is not installed")
    for change, allowed in ((broken, 1e-9), (point, 1e-6)):
        model = TorqueModel(robot(ARM).with_links(change.ravel()), [])
        motion = reference(model.robot)
        needed = motion.needed(model)
        controller = Controller.of([model], motion.q[::50], np.ones(model.robot.n), 8.0)
        held = hold(simulated(model, "mujoco"), motion, needed, np.zeros_like(needed), model.damping(), controller)
        assert np.abs(held.position).max() < allowed


@cache
def diagnosed(name: str) -> Diagnosis:
    cause = CAUSES[name][0] if name else None
    return diagnose(robot(ARM), [record(cause, 1, 20.0)], [record(cause, 2, 20.0)])


def simulation(result: Diagnosis) -> SimulationError:
    assert result.simulation is not None
    return result.simulation


def over_noise(s: SimulationError, which: str) -> FloatArray:
    """Position, velocity and (over the joints) torque error as multiples of what noise alone makes."""
    torque = np.sqrt(np.mean((getattr(s, f"torque_rmse_{which}") / s.torque_rmse_perfect) ** 2))
    ratios = [getattr(s, f"{name}_rmse_{which}") / getattr(s, f"{name}_rmse_perfect") for name in ("position", "velocity")]
    return np.array([*ratios, torque])


@pytest.mark.parametrize(
    "name", ["payload", *(pytest.param(x, marks=pytest.mark.slow) for x in ("coulomb_friction", "torque_scale", "time_delay"))]
)
def test_a_cause_that_is_found_leaves_noise_in_the_simulation(name: str) -> None:
    s = simulation(diagnosed(name))
    assert 12.0 < s.horizon_s < 21.0
    np.testing.assert_allclose(over_noise(s, "after"), 1.0, atol=0.1)
    assert over_noise(s, "before")[2] > 3.0
    assert np.all(over_noise(s, "before") > over_noise(s, "after"))


@pytest.mark.slow
def test_efforts_in_another_unit_are_simulated_in_newton_metres() -> None:
    published, s = diagnosed("torque_unit").torque, simulation(diagnosed("torque_unit"))
    assert published is not None
    assert np.all(s.torque_rmse_before < 1e-2 * published.before)


@pytest.mark.parametrize("name", ["payload", pytest.param("coulomb_friction", marks=pytest.mark.slow)])
def test_the_torque_that_holds_the_motion_is_off_by_the_error_on_held_out_data(name: str) -> None:
    s, torque = simulation(diagnosed(name)), diagnosed(name).torque
    assert torque is not None
    np.testing.assert_allclose(s.torque_rmse_before, torque.before, rtol=0.1)
    np.testing.assert_allclose(s.torque_rmse_after, torque.after, rtol=0.1)


@pytest.mark.slow
def test_a_healthy_robot_shows_the_same_before_and_after() -> None:
    s = simulation(diagnosed(""))
    np.testing.assert_allclose(over_noise(s, "before"), over_noise(s, "after"), rtol=0.05)
    np.testing.assert_allclose(over_noise(s, "after"), 1.0, atol=0.1)


@pytest.mark.slow
def test_healthy_robots_show_what_their_noise_makes() -> None:
    """Over recordings, since each is one draw of its noise."""
    ratios = []
    for seed in range(12):
        s = simulation(diagnose(robot(ARM), [record(None, 100 + seed, 20.0)], [record(None, 200 + seed, 20.0)]))
        before, after = over_noise(s, "before"), over_noise(s, "after")
        np.testing.assert_allclose(before, after, rtol=0.05)
        ratios.append(after)
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1.0, atol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    "hidden",
    [
        "",
        "payload",
        "time_delay",
        *(pytest.param(x, marks=pytest.mark.long) for x in ("coulomb_friction", "viscous_friction", "torque_scale")),
    ],
)
def test_a_simulated_arm_ends_at_its_noise(hidden: str, tmp_path: Path) -> None:
    pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")
    bags = [str(tmp_path / name) for name in ("one", "other")]
    for seed, path in enumerate(bags):
        more = ["--hide", hidden, "--hide-seed", "3"] if hidden else []
        assert run(["simulate", "arm", "--bag", path, "--duration", "30", "--seed", str(1 + seed), *more]) == 0
    out = tmp_path / "out"
    assert run(["diagnose", bags[0], "--validate", bags[1], "--out", str(out)]) == 0
    s = json.loads((out / "diagnosis.json").read_text())["simulation"]
    allowed = 0.1 if hidden else 0.05
    for which in ["after"] if hidden else ["before", "after"]:
        assert s[f"position_rmse_{which}"] == pytest.approx(s["position_rmse_perfect"], rel=allowed)
        ratio = np.array(s[f"torque_rmse_{which}"]) / s["torque_rmse_perfect"]
        assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, rel=allowed)


@pytest.mark.slow
def test_both_simulators_say_the_same() -> None:
    if any(not is_installed(s) for s in SIMULATORS):
        pytest.skip("one of the simulators is not installed")
    cause = CAUSES["payload"][0]
    found = [diagnose(robot(ARM), [record(cause, 1, 12.0)], [record(cause, 2, 8.0)], simulator=s) for s in SIMULATORS]
    one, other = (json.loads(json.dumps(x.as_dict()["simulation"])) for x in found)
    assert (one.pop("simulator"), other.pop("simulator")) == SIMULATORS
    for key, value in one.items():
        np.testing.assert_allclose(other[key], value, rtol=1e-3)


def test_without_a_simulator_there_is_a_sentence_and_no_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulators, "is_installed", lambda name: False)
    with pytest.raises(SettingsError, match="MuJoCo is not installed"):
        installed("mujoco")
    with pytest.raises(SettingsError, match="one of mujoco, pybullet"):
        installed("gazebo")
    result = diagnose(robot(ARM), [record(None, 3, 10.0)])
    assert result.simulation is None
    assert any("pip install" in note for note in result.notes)
    values = result.as_dict()["simulation"]
    assert {"horizon_s", "position_rmse_before", "position_rmse_after", "velocity_rmse_before"} <= set(values)
    assert set(values.values()) == {None}
