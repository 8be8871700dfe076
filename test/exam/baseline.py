"""The plain baseline: what any engineer writes in ten lines, and what no diagnosis may be worse than.

Per joint, by least squares on the training rows: the URDF's torque plus ``o + Fc tanh(v / 0.02) + b v``. Rows are those of the
diagnosis: its smooth motions, and its low-pass with straight lines over rests, so that errors here and ``torque_rmse`` in
``diagnosis.json`` are the same quantity.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from exam.candidate import recording_of
from exam.case import Case
from sysid_ros.diagnosis.band import Band
from sysid_ros.effects import Motion
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.recording import Recording

COLUMNS = ("constant", "sign", "velocity")
_SLOW = 0.02


@dataclass(frozen=True)
class Rows:
    """A recording below the cut-off: residual (K, n) of the URDF's torque and columns (K, n, 3), for ``samples`` of time."""

    residual: FloatArray
    columns: FloatArray
    samples: int

    @classmethod
    def of(cls, robot: RobotModel, recordings: Sequence[Recording]) -> Rows:
        """Rows of recordings.

        Raises:
            DataError: the channels do not fit.
        """
        found: list[Motion] = [m for r in recordings for m in motions(robot, r)]
        band = Band(found)
        residual = band.rows([m.tau - robot.rnea_along(m.q, m.v, m.a) for m in found])
        columns = band.rows([np.stack([np.ones_like(m.v), np.tanh(m.v / _SLOW), m.v], axis=-1) for m in found])
        return cls(residual, columns, sum(len(m.t) for m in found))


@dataclass(frozen=True)
class Baseline:
    """Coefficients of the ``COLUMNS`` of each joint, shape (n, 3)."""

    theta: FloatArray

    @classmethod
    def fitted(cls, rows: Rows, held: Baseline | None = None, names: Collection[str] = ()) -> Baseline:
        """By least squares, each joint for itself.

        Args:
            names: columns whose coefficients are those of ``held``.
        """
        theta = np.zeros(rows.columns.shape[1:])
        free = np.array([name not in names for name in COLUMNS])
        if held is not None:
            theta[:, ~free] = held.theta[:, ~free]
        for j in range(len(theta)):
            wanted = rows.residual[:, j] - rows.columns[:, j] @ theta[j]
            theta[j, free] = np.linalg.lstsq(rows.columns[:, j][:, free], wanted, rcond=None)[0]
        return cls(theta)

    def error(self, rows: Rows) -> FloatArray:
        """Root mean square over time of what it leaves, shape (n,) [N m]."""
        left = rows.residual - np.einsum("kjp,jp->kj", rows.columns, self.theta)
        return np.asarray(np.sqrt(np.sum(left**2, axis=0) / rows.samples))


def baseline_error(case: Case) -> FloatArray:
    """Held-out error of the baseline in a case, shape (n,) [N m]."""
    robot = case.nominal.model()
    train, validate = (Rows.of(robot, [recording_of(r) for r in part]) for part in (case.train, case.validate))
    return Baseline.fitted(train).error(validate)
