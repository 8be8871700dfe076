"""What channels of a robot on legs may be in place of what they are named: legs in another order, signs, units, an IMU that is
turned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np
from numpy.typing import NDArray

from sysid_ros.diagnosis.channel_faults import Fault, all_signs, faults_of_signs, faults_of_units
from sysid_ros.effects import JointOrder
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.sample import FREE, FloatArray

_EVERY_ORDER = 4
"""Legs up to which each order of them is asked; of more, each two that are swapped."""
_GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class ImuFault:
    """What an IMU shows in place of what it is said to show: ``turn`` takes it back, ``force`` times the specific force, with
    ``shift`` added [m/s^2]. ``gain`` is what the gyro shows of the angular velocity; it is asked of the legs and not undone: that
    torques know less of a gyro's noise if it counts for less says nothing.

    Attributes:
        words: what it is. cure: what to do.
    """

    words: str
    cure: str
    turn: FloatArray
    force: float = 1.0
    gain: float = 1.0
    shift: float = 0.0

    def undo(self, omega: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Of angular velocities or accelerations, and specific forces, shape (N, 3) each."""
        shifted = self.force * (force @ self.turn.T)
        shifted[:, 2] += self.shift
        return omega @ self.turn.T, shifted


Hypothesis = Fault | ImuFault


def hypotheses(base: FloatingBase) -> Iterator[tuple[str, Hypothesis]]:
    """With the kind of each."""
    names, n = base.legs.joint_names, base.legs.n
    legs = [np.flatnonzero(row) for row in base.contacts.carriers[:, FREE:]]
    yield from faults_of_signs(n, positions=True)
    for source in dict.fromkeys([*_orders_of_legs(legs, n), *_orders_in_legs(legs, n)]):
        moved = [j for j in range(n) if source[j] != j]
        values = tuple(("takes_from", j, names[source[j]], "") for j in moved)
        for efforts_only in (True, False):
            yield (
                "order of efforts" if efforts_only else "order",
                Fault(JointOrder(list(source), efforts_only), tuple(moved), values),
            )
    yield "signs", all_signs(n)
    yield from faults_of_units(n)
    yield from _imu_faults()


def _orders_of_legs(legs: Sequence[NDArray[np.intp]], n: int) -> Iterator[tuple[int, ...]]:
    """From which joint each channel takes its values where legs stand under the names of others."""
    whole = range(len(legs))
    if len(legs) <= _EVERY_ORDER:
        orders = [order for order in permutations(whole) if order != tuple(whole)]
    else:
        orders = [tuple(b if k == a else a if k == b else k for k in whole) for a, b in combinations(whole, 2)]
    for order in orders:
        if all(len(legs[k]) == len(legs[order[k]]) for k in whole):
            source = np.arange(n)
            for k in whole:
                source[legs[k]] = legs[order[k]]
            yield tuple(int(j) for j in source)


def _orders_in_legs(legs: Sequence[NDArray[np.intp]], n: int) -> Iterator[tuple[int, ...]]:
    """The same where two joints of a leg, or of each leg, do."""
    for a, b in combinations(range(max(len(leg) for leg in legs)), 2):
        for some in [[leg] for leg in legs] + [list(legs)]:
            source = np.arange(n)
            for leg in some:
                if b < len(leg):
                    source[[leg[a], leg[b]]] = leg[b], leg[a]
            yield tuple(int(j) for j in source)


def _imu_faults() -> Iterator[tuple[str, ImuFault]]:
    """An IMU turned by right angles, of the other sign, in another unit, or without gravity."""
    same = np.eye(3)
    for axes in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = same[list(axes)] * np.array(signs)[:, None]
            if np.linalg.det(turn) < 0.0 or np.allclose(turn, same):
                continue
            shown = ", ".join(f"{'+' if turn[i].sum() > 0 else '-'}{'xyz'[int(np.argmax(np.abs(turn[i])))]}" for i in range(3))
            words = f"the trunk's x, y and z axes are the IMU's {shown}"
            yield "turn", ImuFault(words, "correct imu_rpy, or the IMU's frame in the URDF (imu_frame)", turn)
    force, rate = "publish linear_acceleration", "publish angular_velocity"
    yield "imu", ImuFault("the accelerometer has the other sign", f"{force} as it is at rest: +9.81 m/s^2 upward", same, -1.0)
    yield "imu", ImuFault("the accelerometer shows g and not m/s^2", f"{force} in m/s^2", same, _GRAVITY)
    yield "imu", ImuFault("the accelerometer shows no gravity", f"{force} with gravity", same, shift=_GRAVITY)
    yield "imu", ImuFault("the gyro has the other sign", f"{rate} in the axes of the acceleration", same, gain=-1.0)
    yield "imu", ImuFault("the gyro shows degrees", f"{rate} in rad/s", same, gain=float(180.0 / np.pi))
