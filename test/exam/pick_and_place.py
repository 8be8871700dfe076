"""PickAndPlaceMotion: from place to place with rests, as an arm at work moves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_WIDEST, _ROOM = 2.4, 0.8
_AWAY = 0.12
_LIMIT_SHARE = 0.7
_PEAK_SPEED, _PEAK_ACCELERATION = 1.875, 5.7735
_TRIES = 50


class PickAndPlaceMotion:
    """Above a place, down to it, a rest, up again, and on to the next place, until the time is over.

    Each leg is a quintic from rest to rest in all joints, ``q = q0 + (q1 - q0) (10 s^3 - 15 s^4 + 6 s^5)`` with s from 0 to 1:
    its largest speed is 1.875, its largest acceleration 5.77 times the mean ones.

    Args:
        robot: its limits of position, velocity and effort.
        rng: places, their order, speeds and rests.
        duration: of all of it [s].

    Attributes:
        duration: [s].
    """

    def __init__(self, robot: RobotModel, rng: np.random.Generator, duration: float) -> None:
        self.duration = duration
        places = [_posture(robot, rng) for _ in range(int(rng.integers(3, 6)))]
        half = 0.5 * (np.minimum(robot.position_upper, _WIDEST) - np.maximum(robot.position_lower, -_WIDEST))
        above = [_inside(robot, p + _AWAY * half * rng.uniform(-1.0, 1.0, robot.n)) for p in places]
        speed = np.minimum(_LIMIT_SHARE * robot.velocity_limit, rng.uniform(1.2, 2.4))
        acceleration = rng.uniform(4.0, 8.0)
        at, here, place = float(rng.uniform(0.5, 1.0)), above[0], 0
        self._begin, self._length, self._from, self._to = [0.0], [at], [here], [here]
        while at < duration:
            slowly = rng.uniform(0.25, 0.5)
            stops = [(places[place], slowly), (above[place], slowly)]
            place = int(rng.choice([k for k in range(len(places)) if k != place]))
            for target, share in (*stops, (above[place], rng.uniform(0.5, 1.0))):
                step = np.abs(target - here)
                needed = max((step / speed).max() * _PEAK_SPEED / share, np.sqrt(step.max() * _PEAK_ACCELERATION / acceleration))
                self._append(at, float(needed), here, target)
                at, here = at + float(needed) + float(rng.choice([0.05, rng.uniform(0.3, 1.2)])), target

    def _append(self, begin: float, length: float, start: FloatArray, end: FloatArray) -> None:
        if begin + length > self.duration:  # the last leg does not end any more: the arm waits
            return
        self._begin.append(begin)
        self._length.append(length)
        self._from.append(start)
        self._to.append(end)

    def sample(self, t: NDArray[np.floating[Any]]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and acceleration, each of shape (len(t), n), at the times t [s]."""
        leg = np.maximum(np.searchsorted(self._begin, t, side="right") - 1, 0)
        length = np.array(self._length)[leg][:, None]
        s = np.clip((np.asarray(t) - np.array(self._begin)[leg])[:, None] / length, 0.0, 1.0)
        start = np.array(self._from)[leg]
        step = np.array(self._to)[leg] - start
        q = start + step * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        v = step / length * 30.0 * s**2 * (1.0 - s) ** 2
        a = step / length**2 * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
        return q, v, a


def _inside(robot: RobotModel, q: FloatArray) -> FloatArray:
    lower, upper = np.maximum(robot.position_lower, -_WIDEST), np.minimum(robot.position_upper, _WIDEST)
    margin = 0.05 * (upper - lower)
    return np.asarray(np.clip(q, lower + margin, upper - margin))


def _posture(robot: RobotModel, rng: np.random.Generator) -> FloatArray:
    """One that the arm can hold with room for what it carries."""
    lower, upper = np.maximum(robot.position_lower, -_WIDEST), np.minimum(robot.position_upper, _WIDEST)
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    for _ in range(_TRIES):
        q = middle + _ROOM * half * rng.uniform(-1.0, 1.0, robot.n)
        if np.all(np.abs(robot.gravity_torque(q)) < _LIMIT_SHARE * robot.effort_limit):
            break
    return np.asarray(q)
