"""How likely a hypothesis about a robot makes torques.

The torques of joint j, of a hypothesis with columns X_j of parameters that all joints share::

    y_j = m_j + X_j theta + d_j,    theta ~ N(0, I),    d_j ~ N(0, A_j + u_j^2 (O_j + kappa_j^2 D + s_j^2 I))

with the usual torque u_j, what the joint has of its own O_j, the discrepancy D that any model leaves and white noise. The
sizes kappa_j and s_j are those that make the joint's rows likeliest, given what the other joints say of theta. Each row is
predicted from the rows of the joints before it and from its own joint's rows before it: their product is the likelihood of all
rows, and what a hypothesis must learn before it predicts is what it pays for being broad.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, optimize, special

from sysid_ros.diagnosis.whose.robot_kernels import Dissipated, Prior
from sysid_ros.sample import FloatArray

LEAVES, LEAVES_ALL, _SPREAD = np.log(0.05), 0.0, np.log(3.0)
"""Logarithm of what a model of the robot, and one of no robot, leaves of a torque before any data: mean, standard deviation."""
_LOW, _HIGH = np.log([1e-3, 1e-3]), np.log([2.0, 2.0])
"""Ranges of noise and discrepancy over the usual torque; the filters alone are off by a thousandth of it."""
_STARTS = [np.log([s, k]) for s in (0.002, 0.01, 0.05, 0.3) for k in (0.02, 0.1, 0.5, 1.5)]
_APART = np.log(4.0)
"""A second search starts so far from the first: torques may be noise about a law, or a law that no model has."""
USUAL = np.log([0.02, 0.05])
"""Noise and discrepancy that a search begins with."""
_STEPS, _ROUNDED, _LOST = 20, 1e-14, 1e-12
"""Most steps of a search; what sums lose of their largest entry, of a few products and of those of some hundred rows."""
_SWEEPS, _SETTLED = 4, 0.5
"""Most rounds over the joints, and the log-likelihood by which a round must move them for another one."""
_DRIVEN = 0.003
"""Probability that what looks like a joint's friction is something that gives power (wind, a push), before any data."""
_SEGMENTS, _DRAWS = 20, 400
"""Stretches of time that are drawn from anew, and how often, for the scatter of a likelihood ratio."""


@dataclass(frozen=True, eq=False)
class JointTorques:
    """One joint's rows under a hypothesis.

    Attributes:
        residual: y - m of each of g forms of the hypothesis, shape (N, g). prior: X and A. own: O. pattern: D. usual: u.
        dissipated: what the joint's friction takes. leaves: expected logarithm of kappa.
    """

    residual: FloatArray
    prior: Prior
    own: FloatArray
    pattern: FloatArray
    usual: float
    dissipated: Dissipated
    leaves: float = LEAVES

    def doubt(self, sizes: FloatArray) -> float:
        """Negative log-density of kappa before any data, less that of its most usual value."""
        return 0.5 * float((sizes[1] - self.leaves) / _SPREAD) ** 2

    def fixed(self) -> FloatArray:
        """A + u^2 O, shape (N, N)."""
        return np.asarray(self.prior[1] + self.usual**2 * self.own)

    def covariance(self, sizes: FloatArray) -> FloatArray:
        """Covariance of d for logarithms of s and kappa, shape (N, N)."""
        s, kappa = np.exp(sizes) * self.usual
        out: FloatArray = self.fixed() + kappa**2 * self.pattern
        out[np.diag_indices_from(out)] += s**2
        return _rounded_up(out)

    def information(self, precision: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What the joint says of the shared parameters: X'PX, shape (p, p), and X'P r of the first form, shape (p,)."""
        weighted = precision @ self.prior[0]
        return self.prior[0].T @ weighted, weighted.T @ self.residual[:, 0]

    def sizes(
        self, mean: FloatArray, fixed: FloatArray, start: FloatArray | None = None, step: int = 1, near: bool = False
    ) -> tuple[FloatArray, float]:
        """Logarithms of s and kappa that make rows likeliest, shape (2,), and their log-likelihood.

        Args:
            mean: y less what is expected, shape (N,). fixed: covariance beside discrepancy and noise, shape (N, N). step: each of
                so many rows is taken. near: from the start alone.
        """
        loss = self._loss(mean, fixed, step)
        starts = [*([] if start is None else [start]), *([] if near else _STARTS)]
        starts = sorted(starts, key=loss.value)
        apart = [x for x in starts if abs(x[1] - starts[0][1]) > _APART]
        bounds, options = list(zip(_LOW, _HIGH, strict=True)), {"maxiter": _STEPS, "ftol": 1e-6}
        each = [
            optimize.minimize(loss, x, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
            for x in (starts[0], *apart[:1])
        ]
        found = min(each, key=lambda x: x.fun)
        return np.asarray(found.x), -float(found.fun)

    def usual_sizes(self, mean: FloatArray, fixed: FloatArray) -> FloatArray:
        """The likeliest of those with which a search begins."""
        return min(_STARTS, key=self._loss(mean, fixed, 1).value)

    def _loss(self, mean: FloatArray, fixed: FloatArray, step: int) -> _Loss:
        pattern = self.usual**2 * self.pattern[::step, ::step]
        return _Loss(mean[::step], fixed[::step, ::step], pattern, self.usual**2, self.leaves)


class _Loss:
    """Negative log-likelihood of rows by the logarithms of s and kappa, with its slope."""

    def __init__(self, mean: FloatArray, fixed: FloatArray, pattern: FloatArray, unit: float, leaves: float) -> None:
        self.mean, self.fixed, self.pattern, self.unit, self.leaves = mean, fixed, pattern, unit, leaves

    def value(self, x: FloatArray) -> float:
        """Without the slope."""
        return self._solved(x)[0]

    def _solved(self, x: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """The value, the Cholesky factor of the covariance, and its inverse times the rows."""
        K = self.fixed + float(np.exp(2.0 * x[1])) * self.pattern
        K[np.diag_indices_from(K)] += self.unit * float(np.exp(2.0 * x[0]))
        root, failed = linalg.lapack.dpotrf(K.T, lower=1, overwrite_a=1)
        if failed:
            return np.inf, root, np.zeros(len(K))
        alpha = linalg.lapack.dpotrs(root, self.mean, lower=1)[0]
        prior = 0.5 * ((x[1] - self.leaves) / _SPREAD) ** 2
        return 0.5 * float(self.mean @ alpha) + float(np.log(np.diag(root)).sum()) + prior, root, alpha

    def __call__(self, x: FloatArray) -> tuple[float, FloatArray]:
        value, root, alpha = self._solved(x)
        if not np.isfinite(value):
            return value, np.zeros(2)
        noise, kappa = self.unit * float(np.exp(2.0 * x[0])), float(np.exp(2.0 * x[1]))
        inverse = linalg.lapack.dpotri(root, lower=1, overwrite_c=1)[0]  # its lower half, below zeros
        diagonal = np.diag(inverse)
        trace = 2.0 * float(np.vdot(inverse, self.pattern)) - float(diagonal @ np.diag(self.pattern))
        slope = [
            noise * (diagonal.sum() - alpha @ alpha),
            kappa * (trace - alpha @ self.pattern @ alpha) + (x[1] - self.leaves) / _SPREAD**2,
        ]
        return value, np.array(slope)


def row_likelihoods(joints: Sequence[JointTorques]) -> FloatArray:
    """Log-likelihood of each row under each form of a hypothesis, over all joints, shape (g, N).

    Noise and discrepancy of each joint are those that make the first form's rows likeliest, or the likeliest form's; how unusual
    they are counts too, in equal parts on all rows.
    """
    rows = _with_likeliest_sizes(joints)
    if best := int(np.argmax(rows.sum(axis=1))):
        own = _with_likeliest_sizes([replace(x, residual=x.residual[:, [best]]) for x in joints])
        rows[best] = max(rows[best], own[0], key=np.sum)
    return rows


def rough_likelihoods(joints: Sequence[JointTorques]) -> FloatArray:
    """The same with noise and discrepancy of each joint as they are likeliest among a few, whatever the other joints say: for a
    first comparison, in a tenth of the time."""
    sizes = [x.usual_sizes(x.residual[:, 0], x.fixed() + x.prior[0] @ x.prior[0].T) for x in joints]
    return _densities_along(joints, [x.covariance(s) for x, s in zip(joints, sizes, strict=True)])


def _with_likeliest_sizes(joints: Sequence[JointTorques]) -> FloatArray:
    """Each step makes all rows of the first form likelier: that of one joint given all others is a factor of their likelihood."""
    sizes = [x.sizes(x.residual[:, 0], x.fixed() + x.prior[0] @ x.prior[0].T, step=2)[0] for x in joints]
    told = [x.information(inverse(x.covariance(s))) for x, s in zip(joints, sizes, strict=True)]
    unit, reached = np.eye(joints[0].prior[0].shape[1]), [-np.inf] * len(joints)
    for sweep in range(1 + _SWEEPS):
        before, half = sum(reached), sweep == 0  # half of the rows tell where the optima are, all of them which of two it is
        for j, x in enumerate(joints):
            X, rest = x.prior[0], [y for i, y in enumerate(told) if i != j]
            others = _factored(unit + sum(H for H, _ in rest))
            theta = linalg.cho_solve(others, sum((h for _, h in rest), np.zeros(len(unit))))
            left = x.residual[:, 0] - X @ theta
            sizes[j], reached[j] = x.sizes(left, x.fixed() + _spread(X, others), sizes[j], 1 + half, sweep > 1)
            told[j] = x.information(inverse(x.covariance(sizes[j])))
        if abs(sum(reached) - before) < _SETTLED:
            break
    rows = _densities_along(joints, [x.covariance(s) for x, s in zip(joints, sizes, strict=True)])
    return np.asarray(rows - sum(map(JointTorques.doubt, joints, sizes)) / rows.shape[1])


def inverse(covariance: FloatArray) -> FloatArray:
    """Of a positive definite matrix."""
    root, _ = linalg.lapack.dpotrf(covariance, lower=1)
    lower = np.tril(linalg.lapack.dpotri(root, lower=1)[0])
    return np.asarray(lower + np.tril(lower, -1).T)


def _densities_along(joints: Sequence[JointTorques], covariances: Sequence[FloatArray]) -> FloatArray:
    """Sum over the joints of the log-densities of their rows, each joint given those before it, shape (g, N)."""
    p, (rows, forms) = joints[0].prior[0].shape[1], joints[0].residual.shape
    G, g, out = np.eye(p), np.zeros((p, forms)), np.zeros((forms, rows))  # what the joints so far say of the shared parameters
    for x, K in zip(joints, covariances, strict=True):
        X, told = x.prior[0], _factored(G)
        out += _densities(x.residual - X @ linalg.cho_solve(told, g), K + _spread(X, told), x.dissipated)
        weighted = inverse(K) @ X
        G, g = G + X.T @ weighted, g + weighted.T @ x.residual
    return out


def _spread(columns: FloatArray, factored: tuple[FloatArray, bool]) -> FloatArray:
    """Covariance of columns times parameters of whose precision the Cholesky factor is given; it stays one under rounding."""
    root, lower = factored
    half = linalg.solve_triangular(root, columns.T, lower=lower, trans=0 if lower else 1, check_finite=False)
    return np.asarray(half.T @ half)


def _factored(precision: FloatArray) -> tuple[FloatArray, bool]:
    """The Cholesky factor of a precision, rounded up by what double precision loses of its largest entry."""
    root, lower = linalg.cho_factor(precision + _ROUNDED * np.diag(precision).max() * np.eye(len(precision)), check_finite=False)
    return root, bool(lower)


def _rounded_up(covariance: FloatArray) -> FloatArray:
    """Of rows, with what double precision loses of it on its diagonal; it is changed in place."""
    covariance[np.diag_indices_from(covariance)] += _LOST * np.diag(covariance).max()
    return covariance


def _densities(error: FloatArray, covariance: FloatArray, dissipated: Dissipated) -> FloatArray:
    """Log-density of each row given those before it, of errors of shape (N, g), shape (g, N).

    Friction takes power and gives none: the density with friction of either sign, times the probability after the rows that it
    takes some over that before them, which is a half; in equal parts on all rows. What acts in its place may give power, seldom.
    """
    root = linalg.cholesky(_rounded_up(covariance), lower=True, check_finite=False)
    both = np.column_stack([error, dissipated.beside])
    white = linalg.solve_triangular(root, both, lower=True, check_finite=False)
    error, beside = white[:, :-1], white[:, -1]
    left = max(dissipated.variance - float(beside @ beside), _ROUNDED * dissipated.variance)
    takes = special.log_ndtr(beside @ error / np.sqrt(left)) + np.log(2.0) if left > 0.0 else np.zeros(error.shape[1])
    takes = np.logaddexp(np.log1p(-_DRIVEN) + takes, np.log(_DRIVEN))
    rows = 0.5 * error**2 + np.log(np.diag(root))[:, None] + 0.5 * np.log(2.0 * np.pi)
    return np.asarray((takes / len(error) - rows).T)


def likeliest(forms: FloatArray) -> FloatArray:
    """Rows of the form that makes all rows likeliest, shape (N,), of those of shape (g, N)."""
    return np.asarray(forms[np.argmax(forms.sum(axis=1))])


def probabilities(rows: Sequence[FloatArray]) -> FloatArray:
    """Of hypotheses with log-likelihoods of the same rows, shape (N,) each: mean over what the rows could have been, drawn from
    them by stretches of time, of the share of each (pseudo-BMA with the Bayesian bootstrap; Yao, Vehtari, Simpson, Gelman 2018).

    A likelihood ratio that a few moments decide is so no certainty.
    """
    parts = np.stack([[s.sum() for s in np.array_split(x, _SEGMENTS)] for x in rows])
    weights = np.random.default_rng(0).dirichlet(np.ones(_SEGMENTS), _DRAWS) * _SEGMENTS
    total = parts @ weights.T
    share = np.exp(total - total.max(axis=0))
    return np.asarray(np.mean(share / share.sum(axis=0), axis=1))
