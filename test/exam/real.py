"""draw_real: robots as they are. All is a little wrong on all joints at once, and nothing, one thing or two are wrong more.

The little wrongs are what the causes call ``as_built``: Stribeck or presliding friction of 2 to 10 % of the effort limit, viscous
friction of 1 to 5 % a rad/s, friction by load where there is load, rotors, offsets up to 1 %, gains of 2 % std, ripple of 0.2 to
0.8 %, links off by 6 % in mass (std) and 5 mm in centre of mass, efforts 1 to 5 ms late. Noise is white and coloured, the
encoders of some joints are coarse. Motions are Fourier series, pick and place with rests, or a part of both; what is
judged on is another path.

The larger cause (a quarter of the seeds has none, half one, a quarter two) is one of those that say they can lead
(``HiddenCause.leads``) and stands in place of what the robot as built has of the same on the same joint. It is **clearly
visible above the background**: the held-out torque error of the plain baseline (:mod:`exam.baseline`) is at least ``CLEAR``
times that of the same robot, in the same motions, without it: on each joint that it must show on, or on one joint at least
where it belongs to the arm. A column of the baseline that is the cause itself (an offset's constant, a Coulomb friction's tanh)
is held at what the robot without it has, else the baseline would hide it. Each of two is judged by itself. And no other single
linear cause explains all of it to within ``APART`` times that error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from exam.ambiguity import told_apart
from exam.arms import TEN_ARMS, arm, rated_effort
from exam.baseline import Baseline, Rows
from exam.candidate import recording_of
from exam.case import SIMULATORS, Case, physics
from exam.pick_and_place import PickAndPlaceMotion
from sysid_ros.exceptions import SettingsError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects import (
    CAUSES,
    Circumstances,
    DiagnosisMotion,
    HiddenCause,
    HiddenEffect,
    HiddenRecording,
    Noise,
    PlannedMotion,
    TrueRobot,
    cause_of,
    move,
    publish,
    realise,
    stiffening_for,
    torque_scale,
    truth_of,
)
from sysid_ros.simulation.hidden_effects.channels import Signals

CLEAR = 1.5
APART = 0.5
_ATTEMPTS, _PATIENCE, _PLACES, _LARGEST, _HOPELESS = 16, 4, 8, 3.0, 1.5
_TRAIN, _VALIDATE = 30.0, 15.0
_RATES = (500, 500, 500, 250, 1000)
_SEED = 7411
# encoders of 12 to 14 bits on some joints of some robots; else of 16 or 18
_COARSE = (1.5e-3, 7.7e-4, 3.8e-4)


@dataclass
class _OneJoint(Circumstances):
    """What leads is on one joint."""

    def some_joints(self) -> list[int]:
        return [self.one_joint()]


@dataclass(frozen=True)
class _Stage:
    """A robot as built, its motions to fit and to judge, its noise, and what the plain baseline leaves of it: the background.

    Attributes:
        moved: motion and torque of the motors in both motions. rows: of what was published of them.
    """

    robot: RobotModel
    built: tuple[HiddenEffect, ...]
    motions: tuple[PlannedMotion, ...]
    noise: Noise
    rate: int
    usual: Circumstances
    stiffening: FloatArray
    moved: tuple[Signals, ...]
    rows: tuple[Rows, ...]
    baseline: Baseline
    background: FloatArray


def leading() -> list[str]:
    """Ids of the causes that can be the larger one, in the order of the catalogue."""
    return [id_ for id_, cause in CAUSES.items() if cause.leads]


def draw_real(seed: int, effect: str | None = None, simulator: str | None = None) -> Case:
    """The case of a seed of the level ``real``.

    Args:
        seed: below 10000 for development, others for examination; ``seed % 4`` says how many causes are larger: 0, 1, 1, 2.
        effect: id of the larger cause, or of the first of two; None: each in turn.
        simulator: of the recordings; None: each in turn.
    """
    for attempt in range(_ATTEMPTS):
        rng = np.random.default_rng([seed, _SEED, attempt])
        try:
            return _draw(seed, attempt // _PATIENCE, effect, simulator or SIMULATORS[(seed // 4 + seed // 32) % 2], rng)
        except SettingsError:
            continue
    raise SettingsError(f"seed {seed} of level real: nothing was found in {_ATTEMPTS} attempts that shows and the arm can bear.")


def _draw(seed: int, other: int, effect: str | None, simulator: str, rng: np.random.Generator) -> Case:
    name = TEN_ARMS[int(rng.integers(len(TEN_ARMS)))]
    stage = _stage(name, rng)
    hidden = [_clear(id_, stage, rng) for id_ in _ids(seed, other, effect, rng)]
    true = realise(stage.robot, (*without(stage.built, hidden), *hidden))
    train = _recorded("train", true, stage, 0, simulator, rng)
    then = realise(stage.robot, [cause_of(e.id).at_another_time(e, stage.motions[1].duration, rng) for e in true.effects])
    validate = _recorded("validate", then, stage, 1, simulator, rng)
    truth = truth_of(
        true,
        stage.noise,
        stage.rate,
        simulator,
        seed=seed,
        level="real",
        hidden=[e.id for e in hidden],
        larger=[e.as_dict() for e in hidden],
        arm=name,
        motions=[type(m).__name__ for m in stage.motions],
        background=stage.background.tolist(),
    )
    return Case(seed, "real", name, arm(name), (train,), (validate,), truth)


def _stage(name: str, rng: np.random.Generator) -> _Stage:
    robot, rated = arm(name).model(), rated_effort(name)
    motions = (_motion(robot, rng, _TRAIN), _motion(robot, rng, _VALIDATE))
    noise, rate = _noise(rated, rng), int(rng.choice(_RATES))
    usual = _OneJoint(robot, motions[0], rng, 1.0, noise.torque, rated=rated)
    stiffening = stiffening_for(usual.torque)
    built = as_built(usual)
    true = realise(robot, built)
    moved = tuple(move(true, m, rate, stiffening) for m in motions)
    rows = tuple(_rows(robot, publish("built", true, m, noise, rng)) for m in moved)
    # what is large is large beside what the motors really give
    usual.tau = np.column_stack([np.interp(usual.t, moved[0].t, x) for x in moved[0].tau.T])
    usual.torque = torque_scale(usual.tau)
    baseline = Baseline.fitted(rows[0])
    background = baseline.error(rows[1])
    return _Stage(robot, built, motions, noise, rate, usual, stiffening, moved, rows, baseline, background)


def _rows(robot: RobotModel, recording: HiddenRecording) -> Rows:
    return Rows.of(robot, [recording_of(recording)])


def _motion(robot: RobotModel, rng: np.random.Generator, duration: float) -> PlannedMotion:
    if rng.uniform() < 0.5:
        return PickAndPlaceMotion(robot, rng, duration)
    rest, fast = 0.8, rng.uniform(0.5, 0.7)
    moving = duration - 3.0 * rest
    return DiagnosisMotion(robot, rng, fast * moving, (1.0 - fast) * moving, rest)


def _noise(rated: FloatArray, rng: np.random.Generator) -> Noise:
    """White 0.1 to 0.4 % of the effort limit, and 0.3 to 0.8 of that with a memory of 0.3 to 3 s."""
    n = len(rated)
    white = rated * rng.uniform(0.001, 0.004)
    resolution = np.full(n, rng.choice([1e-4, 2.5e-5]))
    if rng.uniform() < 0.4:
        coarse = rng.uniform(size=n) < 0.5
        resolution = np.where(coarse, rng.choice(_COARSE), resolution)
    memory = float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))
    return Noise(white, white * rng.uniform(0.3, 0.8), memory, position=2e-5, resolution=resolution)


def as_built(usual: Circumstances) -> tuple[HiddenEffect, ...]:
    """All that is a little wrong, each cause on the joints it says; of causes of which a joint has one, one a joint."""
    out, words = [], {cause.either for cause in CAUSES.values() if cause.either}
    choice = {word: usual.rng.uniform(size=usual.robot.n) for word in sorted(words)}
    for cause in CAUSES.values():
        for effect in cause.as_built(usual):
            if cause.either:
                same = [id_ for id_, other in CAUSES.items() if other.either == cause.either]
                mine = np.floor(choice[cause.either] * len(same)) == same.index(cause.id)
                effect = _on(effect, [j for j, own in zip(usual.robot.joint_names, mine, strict=True) if own])
            out.append(effect)
    return tuple(e for e in out if e.joints)


def without(built: Sequence[HiddenEffect], larger: Sequence[HiddenEffect]) -> tuple[HiddenEffect, ...]:
    """What a robot as built has, less what a larger cause stands in place of."""
    out = []
    for effect in built:
        one = cause_of(effect.id)
        taken = {j for e in larger if _in_place(cause_of(e.id), one) for j in e.joints}
        if kept := [j for j in effect.joints if j not in taken]:
            out.append(_on(effect, kept))
    return tuple(out)


def _in_place(larger: HiddenCause, built: HiddenCause) -> bool:
    if larger.dry or built.dry:
        return larger.dry and built.dry
    return larger.id == built.id or (larger.family != "" and larger.family == built.family)


def _on(effect: HiddenEffect, joints: Sequence[str]) -> HiddenEffect:
    """The same effect on some of its joints."""
    if set(joints) == set(effect.joints):
        return effect
    kept = [j in joints for j in effect.joints]
    settings = {
        name: [x for x, own in zip(value, kept, strict=True) if own] if np.size(value) == len(kept) else value
        for name, value in effect.settings.items()
    }
    parameters = tuple(p for p in effect.parameters if p.joint in joints)
    return replace(effect, joints=tuple(j for j in effect.joints if j in joints), parameters=parameters, settings=settings)


def _ids(seed: int, other: int, effect: str | None, rng: np.random.Generator) -> list[str]:
    """Ids of the larger causes: none, one in turn (or the ``other``-th after it), two that don't describe one thing twice."""
    ids, turn = leading(), seed % 4
    if turn in (1, 2):
        return [effect or ids[(seed // 4 * 2 + turn - 1 + other) % len(ids)]]
    if turn == 0:
        return []
    pool = [id_ for id_ in ids if not CAUSES[id_].changes_input]
    first = effect or str(rng.choice(pool))
    family = cause_of(first).family
    return [first, str(rng.choice([x for x in pool if x != first and not (family and CAUSES[x].family == family)]))]


def _clear(id_: str, stage: _Stage, rng: np.random.Generator) -> HiddenEffect:
    """The cause somewhere, drawn larger and larger until it is clear.

    Raises:
        SettingsError: it is not, or can't be told from another, wherever it is.
    """
    cause = cause_of(id_)
    for _ in range(_PLACES):
        seed, scale = int(rng.integers(2**31)), 1.0
        if not _told(_drawn(cause, stage, seed, _LARGEST), stage):
            continue
        while True:
            effect = _drawn(cause, stage, seed, scale)
            seen = _rise(effect, cause, stage)
            if seen >= CLEAR and _told(effect, stage):
                return effect
            # an error beside the background's: the squares add up
            wanted = 1.15 * scale * float(np.sqrt((CLEAR**2 - 1.0) / max(seen**2 - 1.0, 1e-3)))
            if scale >= _LARGEST or wanted > _HOPELESS * _LARGEST:
                break
            scale = min(max(wanted, 1.2 * scale), _LARGEST)
    raise SettingsError(f"{id_} is not clear, or can't be told from another cause, in {_PLACES} places. Hide something else.")


def _drawn(cause: HiddenCause, stage: _Stage, seed: int, scale: float) -> HiddenEffect:
    """The same place and direction from the same seed, at any scale."""
    stage.usual.rng, stage.usual.scale = np.random.default_rng(seed), scale
    return cause.draw(stage.usual)


def _told(effect: HiddenEffect, stage: _Stage) -> bool:
    return told_apart(realise(stage.robot, (effect,)), stage.motions[0], stage.background, APART)


def _rise(effect: HiddenEffect, cause: HiddenCause, stage: _Stage) -> float:
    """Held-out error of the baseline with this larger cause over that without it, where it has to show."""
    rows = _with_larger(effect, stage)
    times = Baseline.fitted(rows[0], stage.baseline, cause.plain).error(rows[1]) / stage.background
    needed = [stage.robot.joint_names.index(j) for j in cause.shows_on(effect)]
    return float(times[needed].min() if needed else times.max())


def _with_larger(effect: HiddenEffect, stage: _Stage) -> list[Rows]:
    """Rows of the robot with a larger cause, without a simulation of all of it where that is not needed.

    Faults of the messages change what was published of the robot as built. A motor at its limit is simulated with all the rest.
    Other causes add what each does by itself, and take away what they stand in place of.
    """
    rest = without(stage.built, [effect])
    true, alone = realise(stage.robot, (*rest, effect)), realise(stage.robot, (effect,))
    if alone.channels:
        rng = np.random.default_rng(_SEED)
        return [_rows(stage.robot, publish("", true, m, stage.noise, rng)) for m in stage.moved]
    if np.any(np.isfinite(alone.joints.limit)):
        rng = np.random.default_rng(_SEED)
        moved = [move(true, m, stage.rate, stage.stiffening) for m in stage.motions]
        return [_rows(stage.robot, publish("", true, m, stage.noise, rng)) for m in moved]
    gone = [_on(e, taken) for e in stage.built if (taken := [j for j in e.joints if j not in _joints_of(e.id, rest)])]
    out = []
    for motion, rows in zip(stage.motions, stage.rows, strict=True):
        added = _by_itself(alone, motion, stage) - (_by_itself(realise(stage.robot, gone), motion, stage) if gone else 0.0)
        out.append(replace(rows, residual=rows.residual + added))
    return out


def _joints_of(id_: str, effects: Sequence[HiddenEffect]) -> set[str]:
    return {j for e in effects if e.id == id_ for j in e.joints}


def _by_itself(true: TrueRobot, motion: PlannedMotion, stage: _Stage) -> FloatArray:
    """Residual of a robot that has nothing else and no noise, shape (K, n)."""
    silent = Noise(np.zeros(stage.robot.n), np.zeros(stage.robot.n), position=0.0, resolution=0.0)
    moved = move(true, motion, stage.rate, stage.stiffening)
    return _rows(stage.robot, publish("", true, moved, silent, np.random.default_rng(_SEED))).residual


def _recorded(name: str, true: TrueRobot, stage: _Stage, which: int, simulator: str, rng: np.random.Generator) -> HiddenRecording:
    moved = physics(simulator)(true, stage.motions[which], stage.rate, stage.stiffening)
    return publish(name, true, moved, stage.noise, rng)
