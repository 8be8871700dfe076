"""Base parameters: the combinations of parameters that the torque depends on at all."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from sysid_ros.sample import FloatArray

_ROUNDING = 1e-7
"""Of a pivot, where the information comes in squares: the root of what a double rounds away."""

_CLEAR = 1e-3
"""Pivots above it always count; the clearest gap is looked for below."""


class BaseParameters:
    """Numerical base of a regressor by QR with column pivoting (Gautier 1991).

    ``Y theta = Y[:, independent] (theta[independent] + combination theta[dependent])``

    Args:
        information: ``sum Y' Y`` over motion that excites everything the robot can do, shape (p, p).
        tolerance: relative size under which a pivot counts as zero; by default the pivots end at the widest gap between two of
            them below a thousandth. A URDF that rounds its angles (rpy="1.5708") tells columns apart that are one on the robot,
            by a few millionths: no motion could determine these.

    Attributes:
        independent: indices of the columns kept, shape (r,).
        dependent: indices of the others, shape (p - r,).
        combination: shape (r, p - r).
        singular_values: of the scaled independent columns, shape (r,).
        rounded: pivots above rounding that were left out.
    """

    def __init__(self, information: FloatArray, tolerance: float | None = None) -> None:
        power = np.diag(information)
        zero = power <= 1e-12 * float(np.max(power))
        scale = np.where(zero, 1.0, np.sqrt(np.maximum(power, 0.0)))
        scaled = np.where(zero[:, None] | zero, 0.0, information / np.outer(scale, scale))
        values, vectors = np.linalg.eigh(scaled)
        root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
        _, triangular, pivots = linalg.qr(root, mode="economic", pivoting=True)
        diagonal = np.abs(np.diag(triangular))
        pivot = diagonal / diagonal[0] if diagonal[0] > 0.0 else diagonal
        rank = _rank(pivot) if tolerance is None else int(np.sum(pivot > tolerance))
        self.rounded = int(np.sum(pivot[rank:] > _ROUNDING))
        independent, dependent = pivots[:rank], pivots[rank:]
        solved = linalg.solve_triangular(triangular[:rank, :rank], triangular[:rank, rank:])
        self.combination: FloatArray = solved * scale[dependent] / scale[independent][:, None]
        self.combination[np.abs(self.combination) < 1e-6] = 0.0
        self.independent, self.dependent = independent, dependent
        self.singular_values: FloatArray = np.linalg.svd(triangular[:rank, :rank], compute_uv=False)

    @property
    def rank(self) -> int:
        """Number of base parameters."""
        return len(self.independent)

    @property
    def condition_number(self) -> float:
        """Of the independent columns, each scaled to unit length."""
        return float(self.singular_values[0] / self.singular_values[-1])


def _rank(pivot: FloatArray) -> int:
    """Number of pivots above the widest gap, each relative to the first."""
    size = np.maximum(pivot, _ROUNDING)
    ratio = np.where(size[1:] < _CLEAR, size[:-1] / size[1:], 0.0)
    return int(np.argmax(ratio)) + 1 if ratio.size and ratio.max() > 1.0 else int(np.sum(pivot > _ROUNDING))
