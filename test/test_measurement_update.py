"""The measurement update against the rational solution, and against Joseph's form in numpy."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from sysid_ros.estimators.kernels import joseph_update
from sysid_ros.sample import FloatArray


def inverse(matrix: list[list[Fraction]]) -> list[list[Fraction]]:
    size = len(matrix)
    rows = [[*row, *(Fraction(int(i == j)) for j in range(size))] for i, row in enumerate(matrix)]
    for i in range(size):
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for k in range(size):
            if k != i:
                rows[k] = [x - rows[k][i] * y for x, y in zip(rows[k], rows[i], strict=True)]
    return [row[size:] for row in rows]


def rational(Y: FloatArray, variance: float) -> list[list[Fraction]]:
    """Covariance after rows (N, p) of one variance, of parameters that had the covariance 1."""
    p = Y.shape[1]
    exact = [[Fraction(x) for x in row] for row in Y.tolist()]
    sums = [[sum((y[a] * y[b] for y in exact), Fraction(0)) / Fraction(variance) + (a == b) for b in range(p)] for a in range(p)]
    return inverse(sums)


def row_by_row(P: FloatArray, Y: FloatArray, variance: float) -> FloatArray:
    """Joseph's form, expanded."""
    for y in Y:
        h = P @ y
        s = float(y @ h) + variance
        g = h / s
        P = P - np.outer(g, h) - np.outer(h, g) + s * np.outer(g, g)
    return P


@pytest.mark.parametrize("surer", [1e2, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("apart", [1.0, 1e-4])
def test_the_update_is_as_exact_as_josephs_form_can_be(surer: float, apart: float) -> None:
    """Of rows that are so many times as sure as the prior, and that are parallel but for a part."""
    p, m, count = 6, 4, 6
    errors = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        Y = rng.normal(size=(count, 1, p)) + apart * rng.normal(size=(count, m, p))
        exact = rational(Y.reshape(-1, p), 1.0 / surer)
        std = np.sqrt([float(exact[a][a]) for a in range(p)])
        theta, P, other = np.zeros(p), np.eye(p), np.eye(p)
        for rows in Y:
            joseph_update(theta, P, rows, np.zeros(m), np.full(m, 1.0 / surer))
            other = row_by_row(other, rows, 1.0 / surer)
        np.testing.assert_array_equal(P, P.T)
        assert np.linalg.eigvalsh(P / np.outer(std, std))[0] > 0.0
        off = [[[float(Fraction(x[a, b]) - exact[a][b]) for b in range(p)] for a in range(p)] for x in (P, other)]
        errors.append([float(np.abs(np.array(x) / np.outer(std, std)).max()) for x in off])
    own, josephs = np.median(errors, axis=0)
    assert own < max(10.0 * josephs, 1e-12)
