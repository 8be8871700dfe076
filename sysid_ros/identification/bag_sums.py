"""BagRows: rows of the equation from one recording; BagSums: all that least squares needs to know of some."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FREE, FloatArray

BoolArray = NDArray[np.bool_]

_CHUNK = 4096

_IN_MEMORY = 400e6
"""Bytes of one recording's rows above which they are kept in a temporary file."""


@dataclass(frozen=True, slots=True)
class BagRows:
    """Rows of one recording: ``y = Y theta + noise``.

    Attributes:
        name: where they come from. t: shape (N,) [s]. period: time between rows [s].
        Y: shape (N, n, p). y: what the known effects leave of the torque, shape (N, n) [N m]. tau: measured torque, shape (N,
            n) [N m].
        moving: rows of joints whose friction is determined, shape (N, n), bool.
        q, v, a: smooth motion at the rows, shape (N, n). cutoff_hz: of the low-pass that both sides went through [Hz].
        floats: the rows are those of a robot on legs, see :class:`.FeetAlong`; those that may not be used are zero.
    """

    name: str
    t: FloatArray
    period: float
    Y: FloatArray
    y: FloatArray
    tau: FloatArray
    moving: BoolArray
    q: FloatArray
    v: FloatArray
    a: FloatArray
    cutoff_hz: float
    floats: bool = False

    @property
    def moves(self) -> BoolArray:
        """Rows in which each joint moves, whether or not its torque can be used, shape (N, n)."""
        if not self.floats:
            return self.moving
        out = np.abs(self.v) > TOL.slow
        out[:, :FREE] = self.moving[:, :FREE]
        return out

    def part(self, where: slice | BoolArray, name: str) -> BagRows:
        """Some of the rows, under another name."""
        Y, y, tau, q, v, a = (x[where] for x in (self.Y, self.y, self.tau, self.q, self.v, self.a))
        return BagRows(name, self.t[where], self.period, Y, y, tau, self.moving[where], q, v, a, self.cutoff_hz, self.floats)


@dataclass(frozen=True, slots=True)
class BagSums:
    """Sums over the rows of moving joints, a bag and a joint each: B bags, n joints, p parameters.

    Attributes:
        normal: Y' Y, shape (B, n, p, p). score: Y' y, shape (B, n, p). power: y' y, shape (B, n). count: rows, shape (B, n).
    """

    normal: FloatArray
    score: FloatArray
    power: FloatArray
    count: FloatArray

    @classmethod
    def of(cls, bags: Sequence[BagRows], weights: Sequence[FloatArray] | None = None) -> BagSums:
        """Sum up rows, in pieces.

        Args:
            weights: of each row of each bag, shape (N, n); by default 1 where the joint moves, else 0.
        """
        n, p = bags[0].y.shape[1], bags[0].Y.shape[2]
        shape = (len(bags), n)
        normal, score, power, count = np.zeros((*shape, p, p)), np.zeros((*shape, p)), np.zeros(shape), np.zeros(shape)
        for b, bag in enumerate(bags):
            weight = bag.moving.astype(float) if weights is None else weights[b]
            for first in range(0, len(bag.t), _CHUNK):
                rows = slice(first, first + _CHUNK)
                for j in range(n):
                    w = weight[rows, j]
                    used = w > 0.0
                    Y, y, w = bag.Y[rows, j][used], bag.y[rows, j][used], w[used]
                    # links that a joint does not move have no columns in its rows
                    here = np.flatnonzero(Y.any(axis=0))
                    Y = np.ascontiguousarray(Y[:, here])
                    weighted = Y.T * w
                    normal[b, j][np.ix_(here, here)] += weighted @ Y
                    score[b, j, here] += weighted @ y
                    power[b, j] += float(w * y @ y)
                    count[b, j] += float(w.sum())
        return cls(normal, score, power, count)

    def only(self, bags: Sequence[int]) -> BagSums:
        """Those of some of the bags."""
        which = list(bags)
        return BagSums(self.normal[which], self.score[which], self.power[which], self.count[which])

    def columns(self, which: NDArray[np.intp]) -> BagSums:
        """Those of some of the parameters."""
        return BagSums(self.normal[:, :, which][:, :, :, which], self.score[:, :, which], self.power, self.count)

    def information(self, weight: FloatArray) -> FloatArray:
        """``sum w Y' Y``, shape (p, p), for weights of bags and joints of shape (B, n)."""
        return np.asarray(np.einsum("bj,bjac->ac", weight, self.normal))

    def right_side(self, weight: FloatArray) -> FloatArray:
        """``sum w Y' y``, shape (p,)."""
        return np.asarray(np.einsum("bj,bja->a", weight, self.score))

    def squares(self, theta: FloatArray) -> FloatArray:
        """Sum of the squared residuals of a bag and a joint, shape (B, n) [(N m)^2]."""
        quadratic = np.einsum("bjac,a,c->bj", self.normal, theta, theta)
        return np.asarray(np.maximum(self.power - 2.0 * self.score @ theta + quadratic, 0.0))


def space_for(count: int, n: int, p: int) -> FloatArray:
    """Room for the columns of some rows, shape (count, n, p), in memory or, of very long recordings, in a temporary file."""
    if count * n * p * 8 <= _IN_MEMORY:
        return np.empty((count, n, p))
    with tempfile.TemporaryFile(prefix="sysid_rows_") as file:
        return np.memmap(file, dtype=np.float64, mode="w+", shape=(count, n, p))
