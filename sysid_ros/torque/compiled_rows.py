"""CompiledRows: known torque and free columns of a sample in one pass over the links, in compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sysid_ros.effects import Curve, Effect
from sysid_ros.robot.joint_motion import MOTION, joint_table
from sysid_ros.robot.link_products import LANES, in_lanes, link_products, own_blocks
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.causal_filters import fill_beside
from sysid_ros.signals.low_pass import LowPassBank, low_pass
from sysid_ros.torque.known_effect import KnownEffect

BESIDE: Final = 6
"""Channels of a raw row between its free columns and what is considered: the torque that is left for the free effects, v, a, tau,
how far the joint is from moving, and 1."""
_ONE, _SPEED, _SIGN = int(Curve.ONE), int(Curve.SPEED), int(Curve.SIGN)
_JIT = {"cache": True, "error_model": "numpy", "nogil": True}


class CompiledRows:
    """``raw = [Y | tau - known, v, a, tau, slowness, 1 | Z]``, a row a joint, of one sample.

    All that is linear in the link inertials, which are known torque, payload and the errors of the links, comes from one pass of
    :func:`.link_products`; simple curves of a joint's motion are compiled too. Only what is neither is asked by
    :meth:`.Effect.fill` and :meth:`.Effect.torque`.

    Args:
        robot: whose. free, slices: free effects and where their columns stand. links: known link inertials, shape (10 n,).
        curves: known simple curves as of :meth:`.Effect.simple_curves`, with the parameter of each behind, shape (k, 4).
        spread: what the errors of these do, shape (k, c). others: known effects that are neither.
        error_of_links: shape (10 n, c), and errors of effects that are no simple curves: as of :class:`.KnownError`.
        left_out: ids of the free effects that are not needed now.

    Attributes:
        empty: a row of nothing, shape (n, p + 6 + c). p: number of free columns.
    """

    def __init__(
        self,
        robot: RobotModel,
        free: Sequence[Effect],
        slices: Sequence[slice],
        links: FloatArray,
        curves: FloatArray,
        spread: FloatArray,
        others: Sequence[KnownEffect],
        error_of_links: FloatArray,
        errors: Sequence[tuple[Effect, FloatArray]],
        left_out: set[int],
    ) -> None:
        self._robot, self._others, self._errors, self._left_out = robot, others, errors, left_out
        self.p, n, c = slices[-1].stop if slices else 0, robot.n, error_of_links.shape[1]
        self.empty: FloatArray = np.zeros((n, self.p + BESIDE + c))
        self.empty[:, self.p + BESIDE - 1] = 1.0
        blocks, places = [links[:, None], error_of_links], [np.array([self.p]), self.p + BESIDE + np.arange(c)]
        columns = [np.zeros((0, 4))]
        self._asked: list[tuple[Effect, slice]] = []
        for effect, where in zip(free, slices, strict=True):
            linear, simple = effect.link_columns(), effect.simple_curves()
            if linear is not None:
                blocks.append(linear)
                places.append(np.arange(where.start, where.stop))
            elif simple is not None:
                columns.append(np.column_stack([simple, np.arange(where.start, where.stop)]))
            else:
                self._asked.append((effect, where))
        self._asked_ids = {id(effect) for effect, _ in self._asked}
        self._joints, self._lanes = joint_table(robot.model), in_lanes(np.hstack(blocks))
        self._own = own_blocks(self._lanes)
        self._room, self._wrench = np.zeros((n, MOTION)), np.zeros((n, self._lanes.shape[1], 6 * LANES))
        self._places, self._columns = np.concatenate(places), np.ascontiguousarray(np.vstack(columns))
        self._curves, self._spread = np.ascontiguousarray(curves), np.ascontiguousarray(spread)
        self._torque: FloatArray = np.zeros(n)
        self._about = (
            self._joints, self._lanes, self._own, self._room, self._wrench, self._places, self._columns, self._curves,
            self._spread, self._torque,
        )  # fmt: skip

    def fill(self, t: float, motion: FloatArray, raw: FloatArray) -> None:
        """Write the row of a sample, whose q, v, a, tau are the rows of ``motion``, shape (4, n), over another one, or over
        :attr:`empty`."""
        self._ask(t, motion, raw)
        _fill(*self._about, self._robot.gravity, motion, raw, self.p)
        self._add_errors(t, motion, raw)

    def push(self, t: float, motion: FloatArray, raw: FloatArray, part: float, bank: LowPassBank) -> None:
        """As :meth:`fill`, and a ``part`` of it into a low-pass that is at work."""
        if self._errors:
            self.fill(t, motion, raw)
            bank.push(part * raw)
            return
        self._ask(t, motion, raw)
        _fill_and_pass(*self._about, self._robot.gravity, motion, raw, self.p, part, bank.sections, bank.state, bank.output)

    def _ask(self, t: float, motion: FloatArray, raw: FloatArray) -> None:
        """What is neither linear in the links nor a simple curve."""
        if not self._others and self._left_out.issuperset(self._asked_ids):
            return
        q, v, a, tau = motion
        sample = Sample(t, q, v, a, tau)
        self._robot.rnea(q, v, a)
        self._torque[:] = 0.0
        for k in self._others:
            self._torque += k.effect.torque(sample, k.theta)
        for effect, where in self._asked:
            if id(effect) not in self._left_out:
                effect.fill(sample, raw[:, where])

    def _add_errors(self, t: float, motion: FloatArray, raw: FloatArray) -> None:
        for effect, rows in self._errors:
            effect.add_spread(Sample(t, *motion), rows, raw[:, self.p + BESIDE :])


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _curve(kind: float, width: float, v: float, a: float) -> float:
    if kind == _ONE:
        return 1.0
    if kind == _SPEED:
        return v
    if kind == _SIGN:
        return float(np.tanh(v / width))
    return a


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _fill(
    joints: FloatArray,
    lanes: FloatArray,
    own: NDArray[np.int64],
    room: FloatArray,
    wrench: FloatArray,
    places: NDArray[np.int64],
    columns: FloatArray,
    curves: FloatArray,
    spread: FloatArray,
    others: FloatArray,
    gravity: FloatArray,
    motion: FloatArray,
    raw: FloatArray,
    p: int,
) -> None:
    """All of a raw row but the columns of effects that are asked.

    Args:
        joints, lanes, own, room, wrench, places, gravity: as of :func:`.link_products`.
        columns: curve, width, joint, column of the free simple curves. curves, spread: as of :class:`CompiledRows`.
        others: torque of the other known effects, (n,). motion: q, v, a, tau, (4, n).
    """
    q, v, a, tau = motion[0], motion[1], motion[2], motion[3]
    link_products(joints, gravity, lanes, own, q, v, a, room, wrench, places, raw)
    for i in range(v.size):
        raw[i, p] = tau[i] - raw[i, p] - others[i]
    fill_beside(raw, p + 1, v, a, tau)
    for k in range(columns.shape[0]):
        j = int(columns[k, 2])
        raw[j, int(columns[k, 3])] = _curve(columns[k, 0], columns[k, 1], v[j], a[j])
    for k in range(curves.shape[0]):
        j = int(curves[k, 2])
        curve = _curve(curves[k, 0], curves[k, 1], v[j], a[j])
        raw[j, p] -= curve * curves[k, 3]
        for s in range(spread.shape[1]):
            raw[j, p + BESIDE + s] += curve * spread[k, s]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _fill_and_pass(
    joints: FloatArray,
    lanes: FloatArray,
    own: NDArray[np.int64],
    room: FloatArray,
    wrench: FloatArray,
    places: NDArray[np.int64],
    columns: FloatArray,
    curves: FloatArray,
    spread: FloatArray,
    others: FloatArray,
    gravity: FloatArray,
    motion: FloatArray,
    raw: FloatArray,
    p: int,
    part: float,
    sections: FloatArray,
    state: FloatArray,
    passed: FloatArray,
) -> None:
    """:func:`_fill`, then ``part`` times the row through :func:`.low_pass`; the last three are of the :class:`.LowPassBank`."""
    flat, fetched = raw.reshape(-1), 0.0
    for k in range(0, flat.size, 8):  # of a row that is in no near cache all is fetched at once; its stores would wait in line
        fetched += flat[k]
    room[0, 0] = fetched
    _fill(joints, lanes, own, room, wrench, places, columns, curves, spread, others, gravity, motion, raw, p)
    low_pass(sections, state, flat, part, passed.reshape(-1))
