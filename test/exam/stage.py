"""Stage: an arm as built in its motions, before anything is wrong with it more than with any other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exam.arms import arm, rated_effort
from exam.as_built import as_built
from exam.baseline import Baseline, Rows
from exam.candidate import recording_of
from exam.pick_and_place import PickAndPlaceMotion
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects import (
    Circumstances,
    DiagnosisMotion,
    HiddenEffect,
    HiddenRecording,
    Noise,
    PlannedMotion,
    move,
    publish,
    realise,
    stiffening_for,
    torque_scale,
)
from sysid_ros.simulation.hidden_effects.channels import Signals

_TRAIN, _VALIDATE = 30.0, 15.0
_RATES = (500, 500, 500, 250, 1000)
# encoders of 12 to 14 bits on some joints of some robots; else of 16 or 18
_COARSE = (1.5e-3, 7.7e-4, 3.8e-4)


@dataclass
class _OneJoint(Circumstances):
    """What leads is on one joint."""

    def some_joints(self) -> list[int]:
        return [self.one_joint()]


@dataclass(frozen=True)
class Stage:
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


def stage_of(name: str, rng: np.random.Generator) -> Stage:
    robot, rated = arm(name).model(), rated_effort(name)
    motions = (_motion(robot, rng, _TRAIN), _motion(robot, rng, _VALIDATE))
    noise, rate = _noise(rated, rng), int(rng.choice(_RATES))
    usual = _OneJoint(robot, motions[0], rng, 1.0, noise.torque, rated=rated)
    stiffening = stiffening_for(usual.torque)
    built = as_built(usual)
    true = realise(robot, built)
    moved = tuple(move(true, m, rate, stiffening) for m in motions)
    rows = tuple(rows_of(robot, publish("built", true, m, noise, rng)) for m in moved)
    # what is large is large beside what the motors really give
    usual.tau = np.column_stack([np.interp(usual.t, moved[0].t, x) for x in moved[0].tau.T])
    usual.torque = torque_scale(usual.tau)
    baseline = Baseline.fitted(rows[0])
    background = baseline.error(rows[1])
    return Stage(robot, built, motions, noise, rate, usual, stiffening, moved, rows, baseline, background)


def rows_of(robot: RobotModel, recording: HiddenRecording) -> Rows:
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
