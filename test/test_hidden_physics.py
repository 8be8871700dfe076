"""The physics of what is hidden: links against pinocchio, joints against their equations, one simulator against the others."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")

from robots import ROBOTS, robot
from scipy.signal import butter, sosfiltfilt

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.hidden_effects import (
    CAUSES,
    Circumstances,
    DiagnosisMotion,
    HiddenEffect,
    Noise,
    move,
    nominal_residual,
    publish,
    realise,
    stiffening_for,
)
from sysid_ros.simulation.hidden_effects.bullet_run import move_in_pybullet
from sysid_ros.simulation.hidden_effects.chain import chain_of, force_torque, inverse_dynamics, mass_matrix, place
from sysid_ros.simulation.hidden_effects.channels import Signals

RATE = 1000


def usual(seed: int = 0, robot_model: RobotModel | None = None) -> Circumstances:
    model = robot_model or robot("iiwa")
    rng = np.random.default_rng(seed)
    motion = DiagnosisMotion(model, rng, fast=3.4, slow=2.4, rest=0.4)
    return Circumstances(model, motion, rng, 1.0, np.full(model.n, 0.05))


def run(effect: HiddenEffect, c: Circumstances, how: Callable[..., Signals] = move, channels: bool = True) -> Signals:
    true = realise(c.robot, (effect,))
    out = moved = how(true, c.motion, RATE, stiffening_for(c.torque))
    for channel in true.channels if channels else ():
        out = channel(out, moved)
    return out


def extra_torque(c: Circumstances, signals: Signals) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """t, q, v, a and what the URDF leaves of the torque, by central differences."""
    h = signals.t[1] - signals.t[0]
    q = signals.q[1:-1]
    v, a = (signals.q[2:] - signals.q[:-2]) / (2.0 * h), (signals.q[2:] - 2.0 * q + signals.q[:-2]) / h**2
    return signals.t[1:-1], q, v, a, signals.tau[1:-1] - c.robot.rnea_along(q, v, a)


def below(x: np.ndarray) -> np.ndarray:
    """Below 8 Hz, away from the ends."""
    return np.asarray(sosfiltfilt(butter(4, 8.0, fs=RATE, output="sos"), x, axis=0)[RATE // 4 : -RATE // 4])


@pytest.mark.parametrize("name", ROBOTS)
def test_links_are_those_of_the_robot_model(name: str) -> None:
    model, rng = robot(name), np.random.default_rng(0)
    n = model.n
    chain = chain_of(model, model.pi, model.gravity)
    rotation, offset, work, out, mass = (
        np.zeros((n, 3, 3)),
        np.zeros((n, 3)),
        np.zeros((6, n + 1, 3)),
        np.zeros(n),
        np.zeros((n, n)),
    )
    for _ in range(5):
        q, v, a = rng.uniform(-1.5, 1.5, (3, n))
        force = rng.normal(size=3)
        place(chain, q, rotation, offset)
        inverse_dynamics(chain, rotation, offset, v, a, 1.0, out, work)
        assert out == pytest.approx(model.rnea(q, v, a), abs=1e-10)
        mass_matrix(chain, rotation, offset, mass, work)
        assert mass @ a == pytest.approx(model.rnea(q, 0 * v, a) - model.gravity_torque(q), abs=1e-10)
        force_torque(chain, rotation, offset, force, out)
        jacobian = model.frame_jacobian_along(q[None], model.frame_id(model.default_frame))[0]
        assert out == pytest.approx(jacobian.T @ force, abs=1e-10)


def friction_law(e: HiddenEffect, t: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Friction of joint e.joints[0] at its velocity (N,), written down once more."""
    p = {
        name: e.per_joint(name).get(e.joints[0], 0.0)
        for name in ("Fc", "Fs", "vs", "F_pos", "F_neg", "b", "c", "rate_Fc", "rate_b")
    }
    rise = (p["Fs"] - p["Fc"]) * np.exp(-((v / p["vs"]) ** 2)) if p["vs"] else 0.0
    level = p["Fc"] + rise + np.where(v > 0.0, p["F_pos"], p["F_neg"]) + p["rate_Fc"] * t
    return np.asarray(np.sign(v) * level + (p["b"] + p["rate_b"] * t) * v + p["c"] * np.abs(v) * v)


@pytest.mark.parametrize(
    "id_",
    [
        "viscous_friction",
        "coulomb_friction",
        "quadratic_friction",
        "stribeck_friction",
        "asymmetric_coulomb_friction",
        "friction_drift",
    ],
)
def test_friction_is_its_equation_where_the_joint_moves(id_: str) -> None:
    c = usual(1)
    effect = CAUSES[id_].draw(c)
    t, _, v, _, extra = extra_torque(c, run(effect, c))
    for joint in effect.joints:
        j = c.robot.joint_names.index(joint)
        one = HiddenEffect(id_, (joint,), tuple(p for p in effect.parameters if p.joint == joint))
        moving = np.abs(v[:, j]) > 0.03
        error = (extra[:, j] - friction_law(one, t, v[:, j]))[moving]
        assert np.abs(error).max() < 0.01 * np.abs(extra[:, j]).max()
    elsewhere = [j for j, joint in enumerate(c.robot.joint_names) if joint not in effect.joints]
    assert not elsewhere or np.abs(extra[:, elsewhere]).max() < 0.05


@pytest.mark.parametrize(
    "id_", [id_ for id_ in CAUSES if "friction" in id_ or id_ in ("presliding_hysteresis", "outside_neighbour_damping")]
)
def test_friction_takes_power(id_: str) -> None:
    c = usual(2)
    effect = CAUSES[id_].draw(c)
    _, _, v, _, extra = extra_torque(c, run(effect, c))
    j = c.robot.joint_names.index(effect.joints[0])
    power = extra[:, j] * v[:, j]
    assert power.sum() > 0.0
    if id_ != "presliding_hysteresis":  # a bent bristle gives a little back
        assert power.min() > -1e-3 * power.max()


def test_rotor_spring_and_ripple_are_their_equations() -> None:
    c = usual(3)
    for id_ in ("rotor_inertia", "spring", "cogging"):
        effect = CAUSES[id_].draw(c)
        j = c.robot.joint_names.index(effect.joints[0])
        _, q, _, a, extra = extra_torque(c, run(effect, c))
        p = {x.name: float(x.value) for x in effect.parameters if x.joint == effect.joints[0]}  # type: ignore[arg-type]
        if id_ == "rotor_inertia":
            law = p["J"] * a[:, j]
        elif id_ == "spring":
            law = p["k"] * (np.sin(q[:, j] - p["q0"]) if effect.kind == "balancer" else q[:, j] - p["q0"])
        else:
            law = p["amp"] * np.sin(p["harmonic"] * q[:, j] + effect.settings["phase"][0])
        assert below(extra)[:, j] == pytest.approx(below(law[:, None])[:, 0], abs=0.01 * np.abs(law).max())


def test_an_elastic_joint_gives_by_its_load() -> None:
    c = usual(4)
    effect = CAUSES["joint_elasticity"].draw(c)
    j = c.robot.joint_names.index(effect.joints[0])
    signals = run(effect, c)
    k = effect.per_joint("stiffness")[effect.joints[0]]
    at_rest = signals.q[RATE // 5].copy()
    load = signals.tau[RATE // 5]
    at_rest[j] -= load[j] / k
    assert load == pytest.approx(c.robot.gravity_torque(at_rest), abs=0.02 * np.abs(load).max())


def test_channels_do_what_they_say() -> None:
    c = usual(5)
    names = c.robot.joint_names
    moved = move(realise(c.robot), c.motion, RATE, stiffening_for(c.torque))
    checks: dict[str, Callable[[HiddenEffect, Signals, Signals], Any]] = {
        "torque_sign": lambda e, x, y: np.allclose(np.abs(x.tau), np.abs(y.tau)) and not np.allclose(x.tau, y.tau),
        "joint_sign": lambda e, x, y: np.allclose(np.abs(x.q), np.abs(y.q)) and not np.allclose(x.q, y.q),
        "joint_order": lambda e, x, y: (
            np.allclose(np.sort(x.tau, axis=1), np.sort(y.tau, axis=1)) and not np.allclose(x.tau, y.tau)
        ),
        "joint_offset": lambda e, x, y: np.allclose((x.q - y.q)[:, names.index(e.joints[0])], e.per_joint("delta")[e.joints[0]]),
        "time_delay": lambda e, x, y: np.allclose(
            np.interp(y.t[200:], x.t, x.tau[:, 1]), np.interp(y.t[200:] - e.vector("delay")[0], y.t, y.tau[:, 1]), atol=1e-6
        ),
        "gravity_compensated_effort": lambda e, x, y: np.allclose(
            (x.tau - y.tau)[100], e.vector("coef")[0] * c.robot.gravity_torque(y.q[100])
        ),
        "torque_quantisation": lambda e, x, y: all(
            len(np.unique(x.tau[:, names.index(j)])) <= np.ptp(y.tau[:, names.index(j)]) / s + 2
            for j, s in e.per_joint("step").items()
        ),
        "torque_unit": lambda e, x, y: np.allclose(x.tau, y.tau * np.array(list(e.per_joint("factor").values()))),
    }
    for id_, check in checks.items():
        effect = CAUSES[id_].draw(c)
        told = moved
        for channel in realise(c.robot, (effect,)).channels:
            told = channel(told, moved)
        assert check(effect, told, moved), id_


def test_a_lagging_velocity_is_a_first_order_low_pass() -> None:
    c = usual(6)
    effect = CAUSES["velocity_lag"].draw(c)
    told, true = run(effect, c), run(effect, c, channels=False)
    x = np.gradient(told.v, told.t, axis=0) / (2.0 * np.pi * effect.vector("cutoff")[0]) + told.v
    assert np.abs(x - true.v)[10:-10].max() < 0.02 * np.abs(true.v).max()


def test_noise_has_its_size_and_its_memory() -> None:
    noise = Noise(np.array([0.2, 0.1]), np.array([0.1, 0.3]), memory=0.5)
    x = noise.of_torque(200_000, 0.01, np.random.default_rng(0))
    assert x.std(axis=0) == pytest.approx(np.hypot(noise.torque, noise.coloured), rel=0.05)
    after = np.array([np.mean(x[50:, j] * x[:-50, j]) for j in range(2)])
    assert after == pytest.approx(noise.coloured**2 * np.exp(-1.0), rel=0.15)


def test_noise_does_not_change_the_motion_and_stamps_start_where_asked() -> None:
    c = usual(7)
    true = realise(c.robot)
    moved = move(true, c.motion, RATE, stiffening_for(c.torque))
    quiet = Noise(np.zeros(7), np.zeros(7), position=0.0, resolution=0.0, velocity=0.0)
    recording = publish("x", true, moved, quiet, np.random.default_rng(0), start=5.0)
    assert recording.t[0] == 5.0
    assert np.array_equal(recording.tau, recording.exact.tau)
    loud = publish("x", true, moved, Noise(np.full(7, 0.1), np.zeros(7)), np.random.default_rng(0))
    assert np.std(loud.tau - loud.exact.tau) == pytest.approx(0.1, rel=0.05)
    assert np.allclose(loud.q / 1e-4, np.round(loud.q / 1e-4))


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_that_hides_nothing_is_its_urdf(seed: int) -> None:
    c = usual(seed)
    _, _, _, _, extra = extra_torque(c, move(realise(c.robot), c.motion, RATE, stiffening_for(c.torque)))
    assert np.sqrt(np.mean(extra**2, axis=0)).max() < 0.002
    assert np.abs(extra).max() < 0.05  # the quotients, where the jerk jumps


@pytest.mark.parametrize("id_", ["payload_change", "link_inertia", "load_dependent_friction"])
def test_pybullet_says_the_same(id_: str) -> None:
    c = usual(8)
    effect = CAUSES[id_].draw(c)
    assert not realise(c.robot, (effect,)).needs_short_steps
    agree(c, effect, run(effect, c), run(effect, c, move_in_pybullet), 0.03)


@pytest.mark.parametrize("id_", ["coulomb_friction"])
def test_mujoco_says_the_same(id_: str) -> None:
    c = usual(9)
    effect = CAUSES[id_].draw(c)
    agree(c, effect, run(effect, c), run(effect, c, mujoco()), 0.03)


@pytest.mark.slow
@pytest.mark.parametrize("id_", list(CAUSES))
def test_mujoco_says_the_same_of_every_effect(id_: str) -> None:
    c = usual(10)
    effect = CAUSES[id_].draw(c)
    # play rattles: when a flank is hit is not the same to a millisecond
    agree(c, effect, run(effect, c), run(effect, c, mujoco()), 0.2 if CAUSES[id_].rattles else 0.05)


def mujoco() -> Callable[..., Signals]:
    pytest.importorskip("mujoco", reason="the second simulator needs MuJoCo: pip install 'sysid_ros[dev]'")
    from exam.mujoco_physics import move_in_mujoco

    return move_in_mujoco


def agree(c: Circumstances, effect: HiddenEffect, one: Signals, other: Signals, part: float) -> None:
    """What the URDF leaves is the same in both, to a part of it and to a few millinewton metres."""
    mine, theirs = (nominal_residual(c.robot, x)[2] for x in (one, other))
    assert np.abs(one.q - other.q).max() < 0.02
    assert np.sqrt(np.mean((mine - theirs) ** 2)) < part * np.sqrt(np.mean(mine**2)) + 0.005, effect
