"""Excitation criteria: how well a motion would determine the base parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray
from sysid_ros.torque.base_parameters import BaseParameters


@dataclass(frozen=True, slots=True)
class Criteria:
    """Of the information M that a sample holds on average about the r scaled base parameters.

    Attributes:
        d: ``log det M``, the larger the better: the volume of the joint confidence region is ``exp(-d / 2)``.
        a: ``trace(M^-1) / r``, the smaller the better: the mean variance.
        e: the smallest eigenvalue of M, the larger the better: the worst combination of parameters.
        condition_number: of the weighted regressor, each column scaled to unit length.
        unweighted_condition_number: the same with all joints weighted alike.
    """

    d: float
    a: float
    e: float
    condition_number: float
    unweighted_condition_number: float


class MotionRows(Protocol):
    """Columns of free effects along a motion, of which a state may be that of joints or that of a trunk over its feet.

    Attributes:
        names: of the p parameters. weight: of the m rows of a state, shape (m,).
        precision: of what is known of the parameters before any motion, shape (p, p), with weights that make the information of a
            sample that of the whole motion; None: nothing is known, and the size of the weights does not matter.
    """

    names: tuple[str, ...]
    weight: FloatArray
    precision: FloatArray | None

    def usual(self) -> FloatArray:
        """Columns at states spread over what the limits allow, shape (N, m, p)."""

    def columns(self, q: FloatArray, v: FloatArray, a: FloatArray, smooth: bool = False) -> FloatArray:
        """Columns at N states, shape (N, m, p); ``smooth``: dry friction has no step."""

    def gradient(self, q: FloatArray, v: FloatArray, a: FloatArray, columns: FloatArray, direction: FloatArray) -> FloatArray:
        """Derivative of ``<direction, columns>`` by q, v and a of each state, shape (3, N, n); columns smooth, (N, m, p)."""


class ExcitationCriteria:
    """Information about base parameters: ``M = 1/N sum_t S' Y' W Y S``.

    W weights each row by the inverse square of its noise; S picks the base columns of the free effects and scales each to unit
    power over random states within the limits. So criteria compare motions under the same limits. References: Gautier, Khalil
    1992; Swevers et al. 1997, section IV.

    Where something is known before, with a precision P, no parameter is left out: ``M = 1 + 1/N sum_t S' Y' W Y S`` with
    ``S S' = P^-1``, of which the log det is twice what the motion tells beyond it (Chaloner, Verdinelli 1995, section 2), and
    there are no condition numbers.

    Args:
        rows: of the free effects that are to be identified.

    Attributes:
        base: the base parameters. columns: the r columns that count. names: of their parameters. weight: of each row of a state,
            shape (m,).
    """

    def __init__(self, rows: MotionRows) -> None:
        self._rows, self.weight = rows, rows.weight
        Y = rows.usual()
        self.base = BaseParameters(np.einsum("kia,kib->ab", Y, Y) / len(Y), TOLERANCES.visible)
        self._known = 0.0 if rows.precision is None else 1.0
        self.columns = np.sort(self.base.independent) if rows.precision is None else np.arange(len(rows.names))
        self.names = tuple(rows.names[i] for i in self.columns)
        if rows.precision is None:
            weighted = self.weight[:, None] * Y[:, :, self.columns]
            self._scale: FloatArray = np.diag(1.0 / np.sqrt(np.einsum("kia,kia->a", weighted, weighted) / len(Y)))
        else:
            self._scale = np.linalg.inv(np.linalg.cholesky(rows.precision)).T

    def rows(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Base columns at N states, not scaled, shape (N, m, r)."""
        return self._rows.columns(q, v, a)[:, :, self.columns]

    def evaluate(self, q: FloatArray, v: FloatArray, a: FloatArray) -> Criteria:
        """Criteria of N states, evenly spaced in time, each of shape (N, n)."""
        Y = self.rows(q, v, a)
        weighted = (Y * self.weight[:, None]) @ self._scale
        values = np.linalg.eigvalsh(np.einsum("kia,kib->ab", weighted, weighted, optimize=True) / len(q)) + self._known
        if values[0] <= 1e-14 * values[-1]:
            return Criteria(-np.inf, np.inf, 0.0, np.inf, np.inf)
        return Criteria(
            d=float(np.sum(np.log(values))),
            a=float(np.mean(1.0 / values)),
            e=float(values[0]),
            condition_number=np.nan if self._known else _equilibrated_condition(weighted),
            unweighted_condition_number=np.nan if self._known else _equilibrated_condition(Y),
        )

    def negative_d(self, q: FloatArray, v: FloatArray, a: FloatArray) -> tuple[float, FloatArray, FloatArray, FloatArray]:
        """-D of N states and its derivatives by q, v and a, each of shape (N, n); dry friction smoothed.

        The derivative is ``dD = 2/N sum_t <W Y_b S M^-1 S, dY_b>``, with those of the columns by differences.
        """
        count, r = len(q), len(self.columns)
        rows = self._rows.columns(q, v, a, smooth=True)
        weighted = (rows[:, :, self.columns] * self.weight[:, None]) @ self._scale
        information = np.einsum("kia,kib->ab", weighted, weighted, optimize=True) / count + max(1e-12, self._known) * np.eye(r)
        sign, value = np.linalg.slogdet(information)
        assert sign > 0.0
        direction = np.zeros_like(rows)
        inner = (weighted @ np.linalg.inv(information) @ self._scale.T) * self.weight[:, None]
        direction[:, :, self.columns] = -2.0 / count * inner
        gradients = self._rows.gradient(q, v, a, rows, direction)
        return -float(value), gradients[0], gradients[1], gradients[2]


def _equilibrated_condition(rows: FloatArray) -> float:
    information = np.einsum("kia,kib->ab", rows, rows)
    scale = 1.0 / np.sqrt(np.diag(information))
    values = np.linalg.eigvalsh(information * np.outer(scale, scale))
    return float(np.sqrt(values[-1] / max(values[0], 1e-300)))
