"""draw_case: a robot that hides something, as recordings to fit and to judge, all from a seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from exam.ambiguity import told_apart
from exam.arms import ARMS, Arm, arm, with_dynamics
from sysid_ros.exceptions import SettingsError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.hidden_effects import (
    CAUSES,
    Circumstances,
    DiagnosisMotion,
    HiddenEffect,
    HiddenRecording,
    Noise,
    PlannedMotion,
    TrueRobot,
    cause_of,
    move,
    nominal_residual,
    publish,
    realise,
    shown,
    shown_as_itself,
    stiffening_for,
    torque_scale,
    truth_of,
)
from sysid_ros.simulation.hidden_effects.channels import Signals

LEVELS = ("single", "hard", "pairs", "healthy", "outside", "real")
SIMULATORS = ("compiled", "mujoco")
_VISIBLE = 4.0
_VISIBLE_ITSELF = 3.0
_ATTEMPTS = 60
# what stays below the noise after so many attempts is drawn larger and larger
_PATIENCE = 15
_GROWTH = 1.03


@dataclass(frozen=True)
class Case:
    """What a diagnosis gets, and the truth.

    Attributes:
        seed, level: from which it was drawn. arm: its name.
        nominal: URDF and joint names. train, validate: recordings to fit and to judge.
        truth: what is hidden, see :func:`sysid_ros.simulation.hidden_effects.truth_of`.
    """

    seed: int
    level: str
    arm: str
    nominal: Arm
    train: tuple[HiddenRecording, ...]
    validate: tuple[HiddenRecording, ...]
    truth: dict[str, Any]

    @property
    def nominal_urdf(self) -> str:
        return self.nominal.urdf


@dataclass(frozen=True)
class _Settings:
    rate: int
    scale: float
    train: tuple[float, float]
    validate: tuple[float, float] = (7.0, 3.6)


def _settings(level: str, rng: np.random.Generator) -> _Settings:
    if level == "hard":
        return _Settings(250, float(rng.uniform(0.3, 0.4)), (7.6, 4.4))
    return _Settings(
        int(rng.choice([500, 1000], p=[0.7, 0.3])), 1.0, (float(rng.uniform(13.0, 14.0)), float(rng.uniform(8.6, 9.6)))
    )


def draw_case(seed: int, level: str = "single", effect: str | None = None, simulator: str | None = None) -> Case:
    """The case of a seed.

    Args:
        seed: below 10000 for development, others for examination.
        level: one of ``LEVELS``; ``real`` has its own, :func:`exam.real.draw_real`.
        effect: id of what is hidden; None: by the seed, each id in turn.
        simulator: one of ``SIMULATORS``; None: by the seed.
    """
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng([seed, LEVELS.index(level), attempt])
        try:
            return _draw(seed, level, effect, simulator, rng, _GROWTH ** max(attempt - _PATIENCE, 0))
        except SettingsError:
            continue
    raise SettingsError(
        f"seed {seed} of level {level}: nothing was found in {_ATTEMPTS} attempts that shows and that the arm can bear."
    )


def _draw(seed: int, level: str, effect: str | None, simulator: str | None, rng: np.random.Generator, larger: float) -> Case:
    name = ARMS[int(rng.integers(len(ARMS)))]
    simulator = simulator or SIMULATORS[(seed if level in ("single", "hard", "pairs") else seed // 4) % 2]
    settings = _settings(level, rng)
    nominal = arm(name)
    robot = nominal.model()
    motion = DiagnosisMotion(robot, rng, *settings.train)
    other = DiagnosisMotion(robot, rng, *settings.validate)
    noise = _noise(level, seed, robot, motion, rng)
    usual = Circumstances(robot, motion, rng, min(settings.scale * larger, 1.0), noise.torque)
    if level == "healthy" and seed % 2 == 1 and not np.any(noise.coloured):
        declared = realise(robot, _background(usual)).joints
        nominal = with_dynamics(nominal, declared.viscous, declared.coulomb_forward)
        robot = nominal.model()
        usual.robot = robot
    hidden = _hidden(level, seed, effect, usual)
    background = _background(usual) if level == "hard" else ()
    true = realise(robot, (*_without(background, hidden), *hidden))
    if level == "hard":
        true.scale_masses(1.0 + rng.choice([-0.02, 0.02], size=robot.n))
    stiffening = stiffening_for(usual.torque)
    for e in hidden:
        _require_visible(e, robot, motion, settings.rate, stiffening, noise)
    train = publish("train", true, physics(simulator)(true, motion, settings.rate, stiffening), noise, rng)
    then = [cause_of(e.id).at_another_time(e, other.duration, rng) for e in true.effects]
    true_then = realise(robot, then)
    true_then.scale_masses(true.mass_factors)
    validate = publish("validate", true_then, physics(simulator)(true_then, other, settings.rate, stiffening), noise, rng)
    truth = truth_of(true, noise, settings.rate, simulator, seed=seed, level=level, hidden=[e.id for e in hidden], arm=name)
    return Case(seed, level, name, nominal, (train,), (validate,), truth)


def physics(simulator: str) -> Callable[[TrueRobot, PlannedMotion, int, np.ndarray], Signals]:
    if simulator == "mujoco":
        from exam.mujoco_physics import move_in_mujoco

        return move_in_mujoco
    return move


def _noise(level: str, seed: int, robot: RobotModel, motion: DiagnosisMotion, rng: np.random.Generator) -> Noise:
    """0.1 to 0.3 N m at the strongest joint, less at weaker ones; with a memory in hard and in a quarter of the healthy cases."""
    q, v, a = motion.sample(np.arange(0.0, motion.duration, 0.05))
    usual = torque_scale(robot.rnea_along(q, v, a))
    white = rng.uniform(0.1, 0.3) * (usual / usual.max()) ** 0.25
    coloured = np.zeros(robot.n)
    if level == "hard" or (level == "healthy" and seed % 4 == 1):
        coloured = white * rng.uniform(0.4, 0.8)
    # encoders of 16 and of 18 bits
    resolution = float(rng.choice([1e-4, 2.5e-5]))
    memory = float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))
    return Noise(white, coloured, memory, position=0.2 * resolution, resolution=resolution)


def _background(usual: Circumstances) -> tuple[HiddenEffect, ...]:
    """What every joint of a usual robot has."""
    return tuple(CAUSES[id_].draw_everywhere(usual) for id_ in sorted(CAUSES) if CAUSES[id_].everywhere)


def _without(background: tuple[HiddenEffect, ...], hidden: tuple[HiddenEffect, ...]) -> tuple[HiddenEffect, ...]:
    """The background, less the dry friction of joints whose hidden friction stands in its place."""
    taken = {j for e in hidden if cause_of(e.id).dry for j in e.joints}
    out = []
    for e in background:
        kept = tuple(p for p in e.parameters if not cause_of(e.id).dry or p.joint not in taken)
        out.append(HiddenEffect(e.id, tuple(p.joint for p in kept), kept))  # type: ignore[misc]
    return tuple(out)


def _hidden(level: str, seed: int, effect: str | None, usual: Circumstances) -> tuple[HiddenEffect, ...]:
    if level == "healthy":
        return ()
    if level == "pairs":
        return _pair(effect, usual)
    if level == "outside":
        ids, turn = sorted(id_ for id_, cause in CAUSES.items() if cause.outside), seed
    else:
        inside = {id_: cause for id_, cause in CAUSES.items() if not cause.outside}
        ids, turn = [id_ for id_, cause in inside.items() if level != "hard" or not cause.everywhere], seed // 2
    return (cause_of(effect or ids[turn % len(ids)]).draw(usual),)


def _pair(effect: str | None, usual: Circumstances) -> tuple[HiddenEffect, ...]:
    """Two effects that don't describe one thing of the same joint twice."""
    ids = [id_ for id_, cause in CAUSES.items() if not (cause.outside or cause.changes_input)]
    one = cause_of(effect or str(usual.rng.choice(ids)))
    first = one.draw(usual)
    while True:
        other = CAUSES[str(usual.rng.choice([id_ for id_ in ids if id_ != first.id]))]
        second = other.draw(usual)
        if not (one.family and one.family == other.family and set(first.joints) & set(second.joints)):
            return (first, second)


def _require_visible(
    effect: HiddenEffect, robot: RobotModel, motion: DiagnosisMotion, rate: int, stiffening: np.ndarray, noise: Noise
) -> None:
    """The effect, alone, shows in the efforts, and as itself; a local one on each of its joints.

    Raises:
        SettingsError: it does not.
    """
    cause = cause_of(effect.id)
    if not cause.in_torque:
        return
    true = realise(robot, (effect,))
    exact = move(true, motion, rate, stiffening)
    for channel in true.channels:
        exact = channel(exact, exact)
    _, v, residual = nominal_residual(robot, exact)
    floor = noise.floor(rate)
    if not told_apart(true, motion, floor):
        raise SettingsError(f"{effect.id} can't be told from another cause in this motion. Hide something else.")
    seen, itself = shown(residual, floor), shown_as_itself(v, residual, floor, cause.plain)
    good = (seen >= _VISIBLE) & (itself >= _VISIBLE_ITSELF)
    needed = [robot.joint_names.index(j) for j in cause.shows_on(effect)]
    if not (np.all(good[needed]) if needed else np.any(good)):
        raise SettingsError(f"{effect.id} does not show: at most {seen.max():.1f} floors. Hide something larger.")
