"""draw_real: robots as they are. All is a little wrong on all joints at once, and nothing, one thing or two are wrong more.

The little wrongs are what the causes call ``as_built``: Stribeck or presliding friction of 2 to 10 % of the effort limit, viscous
friction of 1 to 5 % a rad/s, friction by load where there is load, rotors, offsets up to 1 %, gains of 2 % std, ripple of 0.2 to
0.8 %, links off by 6 % in mass (std) and 5 mm in centre of mass, efforts 1 to 5 ms late. Noise is white and coloured, the
encoders of some joints are coarse. What is fitted and what is judged on are two paths, each a Fourier series or pick and place
with rests. :mod:`exam.stage` has all of this.

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
from dataclasses import replace

import numpy as np

from exam.ambiguity import told_apart
from exam.arms import TEN_ARMS, arm
from exam.as_built import on_joints, without
from exam.baseline import Baseline, Rows
from exam.case import SIMULATORS, Case, physics
from exam.stage import Stage, rows_of, stage_of
from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects import (
    CAUSES,
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
    truth_of,
)

CLEAR = 1.5
APART = 0.5
ATTEMPTS, _PATIENCE, _PLACES, _LARGEST, _HOPELESS = 16, 4, 8, 3.0, 1.5
SEED = 7411


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
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, SEED, attempt])
        try:
            return _draw(seed, attempt // _PATIENCE, effect, simulator or simulator_of(seed), rng)
        except SettingsError:
            continue
    raise SettingsError(f"seed {seed} of level real: nothing was found in {ATTEMPTS} attempts that shows and the arm can bear.")


def _draw(seed: int, other: int, effect: str | None, simulator: str, rng: np.random.Generator) -> Case:
    name = TEN_ARMS[int(rng.integers(len(TEN_ARMS)))]
    stage = stage_of(name, rng)
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


def simulator_of(seed: int) -> str:
    """Each in turn, so that in 64 seeds every cause that leads has met both."""
    return SIMULATORS[(seed // 4 + seed // 32) % 2]


def turn_of(seed: int, other: int = 0) -> list[str]:
    """Ids of the larger causes of a seed: none, one in turn (or the ``other``-th after it), two; "" for what is drawn."""
    ids, turn = leading(), seed % 4
    if turn in (1, 2):
        return [ids[(seed // 4 * 2 + turn - 1 + other) % len(ids)]]
    return ["", ""] if turn == 3 else []


def _ids(seed: int, other: int, effect: str | None, rng: np.random.Generator) -> list[str]:
    """As :func:`turn_of`, with what is drawn: two that don't describe one thing twice, and don't change all the others."""
    turn = turn_of(seed, other)
    if len(turn) < 2:
        return [effect or id_ for id_ in turn]
    pool = [id_ for id_ in leading() if not CAUSES[id_].changes_input]
    first = effect or str(rng.choice(pool))
    family = cause_of(first).family
    return [first, str(rng.choice([x for x in pool if x != first and not (family and CAUSES[x].family == family)]))]


def _clear(id_: str, stage: Stage, rng: np.random.Generator) -> HiddenEffect:
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


def _drawn(cause: HiddenCause, stage: Stage, seed: int, scale: float) -> HiddenEffect:
    """The same place and direction from the same seed, at any scale."""
    stage.usual.rng, stage.usual.scale = np.random.default_rng(seed), scale
    return cause.draw(stage.usual)


def _told(effect: HiddenEffect, stage: Stage) -> bool:
    return told_apart(realise(stage.robot, (effect,)), stage.motions[0], stage.background, APART)


def _rise(effect: HiddenEffect, cause: HiddenCause, stage: Stage) -> float:
    """Held-out error of the baseline with this larger cause over that without it, where it has to show."""
    rows = _with_larger(effect, stage)
    times = Baseline.fitted(rows[0], stage.baseline, cause.plain).error(rows[1]) / stage.background
    needed = [stage.robot.joint_names.index(j) for j in cause.shows_on(effect)]
    return float(times[needed].min() if needed else times.max())


def _with_larger(effect: HiddenEffect, stage: Stage) -> list[Rows]:
    """Rows of the robot with a larger cause, without a simulation of all of it where that is not needed.

    Faults of the messages change what was published of the robot as built. A motor at its limit is simulated with all the rest.
    Other causes add what each does by itself, and take away what they stand in place of.
    """
    rest = without(stage.built, [effect])
    true, alone = realise(stage.robot, (*rest, effect)), realise(stage.robot, (effect,))
    if alone.channels:
        rng = np.random.default_rng(SEED)
        return [rows_of(stage.robot, publish("", true, m, stage.noise, rng)) for m in stage.moved]
    if np.any(np.isfinite(alone.joints.limit)):
        rng = np.random.default_rng(SEED)
        moved = [move(true, m, stage.rate, stage.stiffening) for m in stage.motions]
        return [rows_of(stage.robot, publish("", true, m, stage.noise, rng)) for m in moved]
    gone = [on_joints(e, taken) for e in stage.built if (taken := [j for j in e.joints if j not in _joints_of(e.id, rest)])]
    out = []
    for motion, rows in zip(stage.motions, stage.rows, strict=True):
        added = _by_itself(alone, motion, stage) - (_by_itself(realise(stage.robot, gone), motion, stage) if gone else 0.0)
        out.append(replace(rows, residual=rows.residual + added))
    return out


def _joints_of(id_: str, effects: Sequence[HiddenEffect]) -> set[str]:
    return {j for e in effects if e.id == id_ for j in e.joints}


def _by_itself(true: TrueRobot, motion: PlannedMotion, stage: Stage) -> FloatArray:
    """Residual of a robot that has nothing else and no noise, shape (K, n)."""
    silent = Noise(np.zeros(stage.robot.n), np.zeros(stage.robot.n), position=0.0, resolution=0.0)
    moved = move(true, motion, stage.rate, stage.stiffening)
    return rows_of(stage.robot, publish("", true, moved, silent, np.random.default_rng(SEED))).residual


def _recorded(name: str, true: TrueRobot, stage: Stage, which: int, simulator: str, rng: np.random.Generator) -> HiddenRecording:
    moved = physics(simulator)(true, stage.motions[which], stage.rate, stage.stiffening)
    return publish(name, true, moved, stage.noise, rng)
