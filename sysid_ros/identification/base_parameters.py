"""Base parameters: the combinations of parameters that the torque depends on at all."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from sysid_ros.sample import FloatArray


class BaseParameters:
    """Numerical base of a regressor by QR with column pivoting (Gautier 1991).

    ``Y theta = Y[:, independent] (theta[independent] + combination theta[dependent])``

    Args:
        information: ``sum Y' Y`` over motion that excites everything the robot can do, shape (p, p).
        tolerance: relative size under which a pivot counts as zero.

    Attributes:
        independent: indices of the columns kept, shape (r,).
        dependent: indices of the others, shape (p - r,).
        combination: shape (r, p - r).
        singular_values: of the scaled independent columns, shape (r,).
    """

    def __init__(self, information: FloatArray, tolerance: float = 1e-7) -> None:
        power = np.diag(information)
        zero = power <= 1e-12 * float(np.max(power))
        scale = np.where(zero, 1.0, np.sqrt(np.maximum(power, 0.0)))
        scaled = np.where(zero[:, None] | zero, 0.0, information / np.outer(scale, scale))
        values, vectors = np.linalg.eigh(scaled)
        root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
        _, triangular, pivots = linalg.qr(root, mode="economic", pivoting=True)
        diagonal = np.abs(np.diag(triangular))
        rank = int(np.sum(diagonal > tolerance * diagonal[0]))
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
