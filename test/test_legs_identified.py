"""Identification of robots on legs: rows that hold whatever the feet do, what is said of IMU and feet, and the whole command."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_ros.effects import TRUNK_EFFECTS, AccelerometerBias, Motion
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.floating.feet_along import STANDS, FeetAlong
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.sticking import without_sticking
from sysid_ros.identification.base_groups import widened
from sysid_ros.identification.free_effects import free_model_on_legs
from sysid_ros.identification.from_legs import identify_on_legs, learned
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.identify import Choices
from sysid_ros.identification.least_squares import fit
from sysid_ros.identification.rows import BagRows, SmoothRecording
from sysid_ros.online.leg_drives import LegDrives
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.shown_gravity import shown_gravity
from sysid_ros.signals.trunk_channels import TrunkChannels, TrunkSetup
from sysid_ros.torque.model_file import EffectBlock, ModelFile
from sysid_ros.torque.torque_model import TorqueModel

pytest.importorskip("pybullet_data", reason="PyBullet, which brings the quadruped, is not installed (extra sim)")

from sysid_ros.simulation.description import quadruped_description

LEGS = RobotModel.from_urdf(quadruped_description())
BASE = FloatingBase(LEGS, foot_radius=1e-6)
PERIOD, SECONDS = 0.005, 12.0
PLACE = np.array([0.03, -0.02, 0.05])
POSTURE = np.tile([0.05, 0.8, -1.5], 4)
FRICTION, VISCOUS, ROTOR = 0.3, 0.05, 0.01


def sines(
    rng: np.random.Generator, t: FloatArray, count: int, size: float, most_hz: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums of sines and their derivatives, (N, c) each."""
    out = np.zeros((3, len(t), count))
    for _ in range(4):
        w, phase = 2 * np.pi * rng.uniform(0.2, most_hz, count), rng.uniform(0, 6, count)
        x = w * t[:, None] + phase
        out += 0.5 * size * np.array([np.sin(x), w * np.cos(x), -(w**2) * np.sin(x)])
    return out[0], out[1], out[2]


def recording(seed: int, setup: TrunkSetup | None = None, rubs: float = 0.0, scale: float = 1.0, name: str = "run") -> Recording:
    """A robot whose feet are pushed by forces that carry it, each in turn by none, as its IMU and its drives tell of it.

    Its trunk turns and its legs move as they like: the equations of motion do not ask whether a foot slides.
    """
    rng, setup = np.random.default_rng(seed), setup or TrunkSetup()
    t: FloatArray = np.asarray(100.0 + PERIOD * np.arange(round(SECONDS / PERIOD)), dtype=np.float64)
    moved, v, a = sines(rng, t, 12, 0.12, 1.5)
    q = POSTURE + moved
    _, w, dw = sines(rng, t, 3, 0.1, 1.0)
    s = np.array([0.0, 0.0, 9.81]) + sines(rng, t, 3, 0.02, 1.5)[2]
    tau, radius = np.empty_like(q), BASE.foot_radius + [setup.radius.get(foot, 0.0) for foot in BASE.contact_frames]
    for i in range(len(t)):
        state = BASE.state(q[i], v[i], a[i], w[i], s[i], dw[i])
        needed = scale * BASE.robot.rnea(*state)
        _, jacobians = BASE.contacts.jacobians(state[0])
        up = s[i] / np.linalg.norm(s[i])
        arms = [-r * up for r in radius]
        points = np.concatenate([J[:3] - np.cross(np.eye(3), arm) @ J[3:] for J, arm in zip(jacobians, arms, strict=True)])
        share = np.ones(4)
        share[int(t[i] / 0.75) % 4] = np.clip(np.abs((t[i] / 0.75) % 1.0 - 0.5) * 5.0 - 1.5, 0.0, 1.0)
        D, P = np.repeat(share, 3), points[:, :FREE]
        f = D * (P @ np.linalg.solve((P.T * D) @ P, needed[:FREE]))
        tau[i] = needed[FREE:] - points[:, FREE:].T @ f
    tau += rubs * (FRICTION * smoothed_sign(v) + VISCOUS * v + ROTOR * a)
    place = PLACE + setup.lever
    felt = s + np.cross(dw, place) + np.cross(w, np.cross(w, place))
    late = np.stack([np.interp(t - setup.delay, t, x) for x in (*w.T, *felt.T)], axis=1)
    omega, force = late[:, :3] @ setup.rotation, late[:, 3:] @ setup.rotation + setup.bias
    return Recording(name, t, q, v, tau, trunk=TrunkChannels(omega, force, PLACE))


def rows_of(run: Recording, setup: TrunkSetup | None = None, stands: float = STANDS[2]) -> tuple[TorqueModel, BagRows]:
    model = free_model_on_legs(BASE)
    return model, SmoothRecording.of(LEGS, run, run.name, base=BASE, setup=setup, stands=stands).rows(model)


def truth(model: TorqueModel, setup: TrunkSetup | None = None, rubs: float = 0.0) -> FloatArray:
    """The parameters of a recording."""
    theta = Prior.of(model, BASE).mean.copy()
    drives = dict(zip(("coulomb_friction", "viscous_friction", "rotor_inertia"), (FRICTION, VISCOUS, ROTOR), strict=True))
    for effect, where in zip(model.free, model.slices, strict=True):
        if effect.id in drives:
            theta[where] = rubs * drives[effect.id]
        said = effect.of_setup(setup or TrunkSetup())
        theta[where] = theta[where] if said is None else said
    return theta


def left(bag: BagRows, theta: FloatArray) -> FloatArray:
    """Largest residual of each row over the largest torque of its kind, shape (18,)."""
    residual = np.abs(bag.y - bag.Y @ theta).max(axis=0)
    return np.concatenate([residual[:3] / 120.0, residual[3:6] / 20.0, residual[6:] / 3.0])


def test_rows_hold_whatever_carries_the_robot_and_those_of_joints_where_their_foot_is_in_the_air() -> None:
    model, bag = rows_of(recording(0))
    assert bag.floats
    assert bag.moving[:, :FREE].all()
    assert 0.02 < bag.moving[:, FREE:].mean() < 0.25  # a foot in four is in the air
    assert left(bag, truth(model))[:FREE].max() < 1e-3
    assert np.median(np.abs(bag.y - bag.Y @ truth(model))[bag.moving]) < 0.02
    unused = ~bag.moving
    assert not bag.Y[unused].any()
    assert not bag.tau[unused].any()


SETUPS = {
    "tilt": TrunkSetup(tilt=np.array([0.02, -0.03, 0.01])),
    "lever": TrunkSetup(lever=np.array([0.03, -0.02, 0.02])),
    "bias": TrunkSetup(bias=np.array([0.1, -0.05, 0.08])),
    "delay": TrunkSetup(delay=0.004),
    "radius": TrunkSetup(radius={BASE.contact_frames[1]: 0.01}),
}


@pytest.mark.parametrize("what", SETUPS)
def test_what_is_otherwise_of_imu_and_feet_is_corrected_exactly_and_is_a_column_to_first_order(what: str) -> None:
    setup = SETUPS[what]
    run = recording(1, setup)
    model, bag = rows_of(run)
    theta, nothing = truth(model, setup), truth(model)
    _, corrected = rows_of(run, setup)
    column, exact, neither = (left(*x)[:FREE] for x in ((bag, theta), (corrected, theta), (bag, nothing)))
    assert neither.max() > 4e-3
    assert np.abs(column - exact).max() < 0.1 * neither.max()
    if not setup.radius:  # the feet of this robot are not on one plane, which the direction of a radius is found by
        assert max(column.max(), exact.max()) < 0.1 * neither.max()


def test_a_setup_goes_through_its_effects_and_back() -> None:
    model = free_model_on_legs(BASE)
    setup = sum(SETUPS.values(), TrunkSetup())
    again, known = learned(model, truth(model, setup))
    for name in ("tilt", "lever", "bias"):
        assert getattr(again, name) == pytest.approx(getattr(setup, name))
    assert again.delay == setup.delay
    assert {name: x for name, x in again.radius.items() if x} == setup.radius
    assert not {k.effect.id for k in known.known} & {*TRUNK_EFFECTS, AccelerometerBias.id}


def test_friction_rotors_and_mass_are_found_from_two_runs() -> None:
    runs = [recording(seed, rubs=1.0, scale=1.03, name=str(seed)) for seed in (2, 3)]
    made = [rows_of(run) for run in runs]
    model, bags = made[0][0], [bag for _, bag in made]
    prior = Prior.of(model, BASE)
    found = fit(bags, prior.mean, prior.std)
    setup, known = learned(model, found.theta)
    assert known.dry_friction()[FREE:] == pytest.approx(np.full(12, FRICTION), rel=0.15)
    assert known.armature()[FREE:] == pytest.approx(np.full(12, ROTOR), abs=0.006)
    assert known.links()[::10].sum() == pytest.approx(1.03 * BASE.mass, rel=0.02)
    assert np.abs(setup.tilt).max() < 0.01


def test_intervals_are_wider_where_recordings_differ() -> None:
    alike = [rows_of(recording(seed, rubs=1.0, name=str(seed)))[1] for seed in (2, 3)]
    model, other = rows_of(recording(3, rubs=2.5))
    prior = Prior.of(model, BASE)
    grown = []
    for bags in (alike, [alike[0], other]):
        found = fit(bags, prior.mean, prior.std)
        grown.append(float(widened(found, prior).covariance[0, 0] / found.covariance[0, 0]))
    assert 1.0 <= grown[0] < grown[1]
    single = fit(alike[:1], prior.mean, prior.std)
    assert widened(single, prior) is single


def test_gravity_tells_the_bias_of_an_accelerometer_along_it() -> None:
    run = recording(4, TrunkSetup(bias=np.array([0.0, 0.0, 0.05])))
    assert run.trunk is not None
    shown = shown_gravity([(run.t, run.trunk)], 9.81)
    assert shown is not None
    assert shown.excess == pytest.approx(0.05, abs=3.0 * shown.std)
    _, std = shown.bias(0.1)
    assert std[2] < 0.05 < std[0]
    assert shown_gravity([(run.t[:100], run.trunk.at(slice(0, 100)))], 9.81) is None


def test_what_standing_joints_hide_leaves_no_trace_and_the_rest_stays() -> None:
    rng = np.random.default_rng(0)
    lever = rng.normal(size=(40, FREE, 12))
    hidden = np.where(np.arange(12) < 2, lever, 0.0)
    held, other = np.zeros((40, 18)), np.zeros((40, 18))
    for first in range(0, 40, 20):  # the same torque in a block of half a second
        held[first : first + 20, :FREE] = hidden[first : first + 20] @ np.r_[rng.normal(size=2), np.zeros(10)]
    other[:, :FREE] = rng.normal(size=(40, FREE))
    before = other.copy()
    without_sticking(hidden, lever, 0.025, held, other)
    assert np.abs(held).max() < 0.1 * np.abs(hidden @ np.r_[1.0, 1.0, np.zeros(10)]).max()
    assert np.corrcoef(other[:, :FREE].ravel(), before[:, :FREE].ravel())[0, 1] > 0.95


def test_reported_contacts_are_believed_where_the_forces_agree() -> None:
    run = recording(5)
    smooth = SmoothRecording.of(LEGS, run, "run", base=BASE)
    stretch = smooth.stretches[0]
    stands = np.ones((len(stretch.t), 4))
    without = FeetAlong.of(BASE, stretch, 0.03).loaded
    always = FeetAlong.of(BASE, stretch, 0.03, reported=stands).loaded
    assert np.array_equal(always, without)  # a sensor that always says so is wrong a quarter of the time
    assert not without.all()


def saved(setup: TrunkSetup) -> ModelFile:
    """A model.yaml of a robot with some friction and a setup."""
    model = free_model_on_legs(BASE)
    theta, std = truth(model, setup, 1.0), Prior.of(model, BASE).std
    blocks = tuple(
        EffectBlock(e.id, e.joint_names, e.settings, theta[s], e.parameter_names, e.units, np.diag((0.1 * std[s]) ** 2))
        for e, s in zip(model.free, model.slices, strict=True)
    )
    nothing = np.zeros(BASE.robot.n)
    return ModelFile("robot", BASE.robot.joint_names, "", blocks, nothing, nothing, np.eye(model.p)[:, :3])


def test_a_model_file_gives_torques_and_what_is_known_of_imu_and_feet_apart(tmp_path: Path) -> None:
    setup = sum(SETUPS.values(), TrunkSetup())
    saved(setup).write(tmp_path / "model.yaml")
    torques, directions, again, std = ModelFile.read(tmp_path / "model.yaml").on_legs(BASE.robot)
    assert again.tilt == pytest.approx(setup.tilt)
    assert again.radius[BASE.contact_frames[1]] == pytest.approx(0.01)
    assert std.delay == pytest.approx(1e-3)
    assert directions is not None
    assert directions.shape == (sum(k.effect.p for k in torques), 3)
    base = FloatingBase(LEGS, foot_radius=1e-6)
    base.set_up(again, std)
    assert base.foot_radius - BASE.foot_radius == pytest.approx([0.0, 0.01, 0.0, 0.0])
    drives = LegDrives(base, TorqueModel(base.robot, [], torques))
    usual = LegDrives(base)
    assert np.all(drives.prior_std < usual.prior_std)
    assert np.all(drives.rest > 0.5 * FRICTION)  # at rest it still hides what it is known to be


def test_a_floating_base_comes_off_its_urdf_again() -> None:
    again = RobotModel.from_urdf(BASE.unhung(BASE.robot.urdf))
    assert again.joint_names == LEGS.joint_names
    assert FloatingBase(again).robot.pi == pytest.approx(BASE.robot.pi)


@pytest.mark.parametrize(
    ("choices", "word"),
    [(Choices(friction="stribeck"), "friction"), (Choices(form="momentum"), "form"), (Choices(effects=("cogging",)), "effects")],
)
def test_what_holds_for_arms_only_is_refused(choices: Choices, word: str) -> None:
    with pytest.raises(SettingsError, match=word):
        identify_on_legs(BASE, [recording(6)], [], {}, choices)


def test_efforts_that_do_not_carry_the_robot_and_a_missing_imu_are_named() -> None:
    run = recording(6)
    with pytest.raises(DataError, match="IMU"):
        identify_on_legs(BASE, [replace(run, trunk=None)], [], {})
    with pytest.raises(DataError, match="effort"):
        identify_on_legs(BASE, [replace(run, tau=0.1 * run.tau)], [], {})
    with pytest.raises(DataError, match="weigh the same"):
        identify_on_legs(BASE, [run, recording(7, scale=1.1, name="loaded")], [], {})


def test_columns_of_imu_and_feet_are_nothing_on_an_arm() -> None:
    motion = Motion(LEGS, np.arange(3.0), *np.zeros((4, 3, LEGS.n)))
    motion.by_radius = None
    effect = TRUNK_EFFECTS["foot_radius"](LEGS)
    assert effect.columns_along(motion).shape == (3, LEGS.n, 0)


@pytest.mark.slow
def test_a_robot_that_was_identified_in_mujoco_estimates_its_load_better(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra mujoco)")
    from sysid_ros.input_gate import gate_for
    from sysid_ros.online.online_estimation import OnlineEstimation
    from sysid_ros.online.replay import replay
    from sysid_ros.online_settings import OnlineSettings
    from sysid_ros.robot.packaged import packaged
    from sysid_ros.simulation.legged_record import LeggedRecord, simulate_legged
    from sysid_ros.simulation.legged_scenario import LeggedScenario
    from sysid_ros.torque.urdf_export import export_urdf

    if packaged("go2") is None:
        pytest.skip("example-robot-data is not installed (extra dev)")
    drives: dict[str, Any] = {"leg_friction": 0.3, "leg_damping": 0.05, "rotor_inertia": 0.01}
    hidden: dict[str, Any] = drives | {"mass_error": 0.04, "trunk_com": (0.01, 0.0, 0.0)}

    def simulated(gait: str, **more: Any) -> LeggedRecord:
        return simulate_legged(LeggedScenario(robot="go2", gait=gait, seed=5, duration=12.0, **hidden, **more), start_time=100.0)

    def recorded(record: LeggedRecord, base: FloatingBase) -> Recording:
        gate = gate_for(base.legs, base, OnlineSettings())
        return Recording.from_measurements("run", (m for x in record.records() for m in gate.take(x)))

    records = [simulated(gait) for gait in ("sway", "trot", "flying_trot")]
    base = FloatingBase(RobotModel.from_urdf(records[0].urdf))
    sway, trot, other = (recorded(record, base) for record in records)
    result = identify_on_legs(base, [sway, trot], [other], {})
    (judged,) = result.validation
    assert np.all(judged.residual[:3] < 0.6 * judged.nominal[:3])
    result.model.write(tmp_path / "model.yaml")
    export_urdf(base.robot, result.model, tmp_path / "found.urdf", base)
    found = FloatingBase(RobotModel.from_urdf((tmp_path / "found.urdf").read_text()))
    assert found.robot.pi == pytest.approx(learned(free_model_on_legs(base), result.theta)[1].links(), abs=1e-6)
    loaded = simulated("trot", payload_mass=3.0, payload_com=(0.03, -0.02, 0.1))
    errors = []
    for model in (None, ModelFile.read(tmp_path / "model.yaml")):
        legs = RobotModel.from_urdf(loaded.urdf)
        estimation = OnlineEstimation(legs, OnlineSettings(), model)
        last = replay(list(loaded.records()), gate_for(legs, estimation.base, OnlineSettings()), estimation).series[-1]
        errors.append(abs(last.theta[0] - 3.0))
    assert errors[1] < max(0.5 * errors[0], 0.06)
    assert errors[1] < 3.0 * last.mass_std
