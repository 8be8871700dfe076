"""Dictionaries: functions of a state in which a nonlinear motion is (nearly) linear; those that a robot suggests among them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class Dictionary:
    """Functions of a state beside the state itself.

    Attributes:
        name: for people. lift: from states, shape (N, d), to functions, shape (N, l); l = 0 for none.
    """

    name: str
    lift: Callable[[FloatArray], FloatArray]

    def __call__(self, x: FloatArray) -> FloatArray:
        """The state, a constant, and the functions, shape (N, d + 1 + l)."""
        return np.column_stack([x, np.ones(len(x)), self.lift(x)])


def linear() -> Dictionary:
    """None: DMD with control (Proctor, Brunton, Kutz 2016)."""
    return Dictionary("linear", lambda x: np.zeros((len(x), 0)))


def polynomial(degree: int) -> Dictionary:
    """Products of up to ``degree`` of the state's entries.

    Raises:
        SettingsError: the degree is below 2.
    """
    if degree < 2:
        raise SettingsError(f"the degree is {degree}; it must be 2 or more.")

    def lift(x: FloatArray) -> FloatArray:
        d = x.shape[1]
        sets = [s for k in range(2, degree + 1) for s in combinations_with_replacement(range(d), k)]
        return np.column_stack([np.prod(x[:, list(s)], axis=1) for s in sets])

    return Dictionary(f"polynomial of degree {degree}", lift)


def thin_plates(centres: FloatArray) -> Dictionary:
    """``r^2 log r`` about centres, shape (c, d), each coordinate over its spread among them."""
    scale = np.maximum(np.std(centres, axis=0), 1e-12)

    def lift(x: FloatArray) -> FloatArray:
        r2 = np.sum(((x[:, None, :] - centres) / scale) ** 2, axis=2)
        return np.asarray(0.5 * r2 * np.log(np.maximum(r2, 1e-30)))

    return Dictionary(f"{len(centres)} thin plates", lift)


def robot(joints: int, harmonics: int = 1) -> Dictionary:
    """What the equations of a robot are made of, of a state that begins with q and v of its joints.

    sin and cos of k q, k up to ``harmonics``; products of velocities; velocities times sin and cos; dry friction.

    Args:
        joints: n; the state has 2 n entries or more.

    Raises:
        SettingsError: joints or harmonics are below 1.
    """
    if joints < 1 or harmonics < 1:
        raise SettingsError(f"joints {joints}, harmonics {harmonics}: both must be 1 or more.")

    def lift(x: FloatArray) -> FloatArray:
        q, v = x[:, :joints], x[:, joints : 2 * joints]
        waves = [f(k * q) for k in range(1, harmonics + 1) for f in (np.sin, np.cos)]
        squares = [v[:, [i]] * v[:, [j]] for i in range(joints) for j in range(i, joints)]
        turned = [w * v for w in waves[:2]]
        return np.column_stack([*waves, *squares, *turned, smoothed_sign(v)])

    return Dictionary(f"{joints} joints, {harmonics} harmonics", lift)
