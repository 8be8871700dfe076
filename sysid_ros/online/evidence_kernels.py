"""What :class:`.ModelEvidence` works out in compiled code: moments of the rows, their noise, and marginal likelihoods."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

LOCAL = 6
"""Columns of each joint for itself: offset, Coulomb and viscous friction, rotor inertia, friction that is higher at low speed and
by the load."""
BEHIND = 3
"""Columns of a joint behind those of the links: what is missing of the known torque, its gain, y."""
_PAYLOAD = 10
_STRIBECK = 0.1
"""Speed beyond which friction is not higher any more [rad/s]."""
_ABSURD = 1e12
"""No torque [N m]."""
_AT_LEAST = 0.2
"""Part of the rows that are not fitted, whatever is free."""
_LEAST = 1e-12
"""Variance of the noise of a row at least [(N m)^2]."""


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def take(
    Y: FloatArray,
    Z: FloatArray,
    y: FloatArray,
    tau: FloatArray,
    acceleration: FloatArray,
    speed: FloatArray,
    friction: tuple[int, int],
    gain: float,
    shared_std: FloatArray,
    local_std: FloatArray,
    column: FloatArray,
    moments: FloatArray,
    rows: FloatArray,
    mean: FloatArray,
    residual: FloatArray,
) -> None:
    """Add a row of each of n joints to its moments, all columns by their prior standard deviations, and what ``mean`` leaves of
    it and the square of that to the sums of a block.

    Args:
        Y, Z: columns of the parameters, shape (n, p), and of the considered errors, (n, c), of which the gains' are not asked.
        y, tau, acceleration, speed: of :class:`.Rows`, shape (n,). friction: where its columns stand in Y, and how many they are.
        gain: standard deviation of an effort's gain. shared_std, local_std: as of :class:`.ModelEvidence`.
        column: to work in, shape (w,). moments, rows: those that grow, lower triangles (n, w, w) and counts (n,).
        mean: parameters as they are known, in the order of :func:`together`. residual: shape (4, n), the first two rows grow.
    """
    n, s, width = y.size, shared_std.size, column.size
    c = width - s - LOCAL - BEHIND
    for i in range(n):
        if not abs(tau[i]) + abs(y[i]) < _ABSURD:
            continue
        for k in range(s):  # the tilt stands behind friction
            column[k] = shared_std[k] * Y[i, k if k < _PAYLOAD else k + friction[1]]
        for k in range(3):
            column[s + k] = local_std[k, i] * Y[i, friction[0] + k * n + i] if friction[1] else 0.0
        column[s + 3] = local_std[3, i] * acceleration[i]
        sign = Y[i, friction[0] + n + i] if friction[1] else 0.0
        column[s + 4] = local_std[4, i] * sign * np.exp(-speed[i] / _STRIBECK)
        column[s + 5] = local_std[5, i] * sign * abs(tau[i] - y[i])
        for k in range(c):
            column[s + LOCAL + k] = Z[i, k]
        column[width - 3] = y[i] - tau[i]
        column[width - 2] = gain * (tau[i] - y[i])  # of what is known: tau holds the noise of y
        column[width - 1] = y[i]
        left = y[i]
        for a in range(width):
            if column[a] != 0.0:
                for b in range(a + 1):
                    moments[i, a, b] += column[a] * column[b]
                if a < width - 1:
                    left -= column[a] * mean[_place(a, i, n, s, width)]
        rows[i] += 1.0
        residual[0, i] += left
        residual[1, i] += left * left


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def close_block(residual: FloatArray, length: int, keep: float) -> None:
    """A block of so many rows has ended."""
    residual[2] = keep * residual[2] + residual[0] ** 2 / length
    residual[3] = keep * residual[3] + residual[1] / length
    residual[:2] = 0.0


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def settle(moments: FloatArray, rows: FloatArray, past: FloatArray, before: FloatArray, keep: float) -> None:
    """Rows that have waited are taken in, and those before forgotten by a part.

    Args:
        moments, rows: of those taken in, of those that wait and of the newest, shapes (3, n, w, w) and (3, n).
        past, before: as of :func:`learn_noise`. keep: part that is kept of what was.
    """
    past *= keep
    before *= keep
    moments[0] = keep * moments[0] + moments[1]
    moments[1] = moments[2]
    moments[2] = 0.0
    rows[0] = keep * rows[0] + rows[1]
    rows[1] = rows[2]
    rows[2] = 0.0


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _place(a: int, i: int, n: int, s: int, width: int) -> int:
    """Where column a of joint i stands among all: shared, each joint's own, links, what is missing, gains, y."""
    if a < s:
        return a
    if a < s + LOCAL:
        return a + LOCAL * i
    if a < width - 2:
        return a + LOCAL * (n - 1)
    return width - 2 + LOCAL * (n - 1) + (i if a == width - 2 else n)


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def together(past: FloatArray, moments: FloatArray, noise: FloatArray, s: int) -> FloatArray:
    """Information of all rows on all columns, shape (k, k): shared ones, each joint's own, links, what is missing, gains, y.

    Args:
        past: of rows of other payloads, shape (k, k). moments: lower triangles, shape (n, w, w). noise: variance of a row, a
            joint, shape (n,) [(N m)^2]. s: number of shared columns.
    """
    n, width = moments.shape[0], moments.shape[1]
    whole = past.copy()
    for i in range(n):
        for a in range(width):
            p = _place(a, i, n, s, width)
            for b in range(a + 1):
                r, x = _place(b, i, n, s, width), moments[i, a, b] / noise[i]
                whole[p, r] += x
                if a != b:
                    whole[r, p] += x
    return whole


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def without_payload(whole: FloatArray) -> FloatArray:
    """What all rows tell of all but the payload, whatever it is: the Schur complement of an information, (k, k) -> (k, k)."""
    payload, rest = whole[:_PAYLOAD, :_PAYLOAD] + np.eye(_PAYLOAD), np.ascontiguousarray(whole[:_PAYLOAD, _PAYLOAD:])
    left = np.zeros_like(whole)
    left[_PAYLOAD:, _PAYLOAD:] = whole[_PAYLOAD:, _PAYLOAD:] - rest.T @ np.linalg.solve(payload, rest)
    return left


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def learn_noise(
    past: FloatArray,
    moments: FloatArray,
    rows: FloatArray,
    before: FloatArray,
    colour: FloatArray,
    widest: FloatArray,
    noise: FloatArray,
    s: int,
    times: int,
) -> FloatArray:
    """Let the noise of each joint, the variance of one of so many rows that count as one, become what the rows leave where all is
    as free as ``widest``, the prior information, allows, by as many as it fits fewer (MacKay 1992); the parameters then.

    ``before``: of rows that are in the past, sum of what they left and how many they were, shape (2, n).
    """
    n, width = moments.shape[0], moments.shape[1]
    size = past.shape[0] - 1
    mean = np.zeros(size)
    for _ in range(times):
        whole = together(past, moments, noise, s)
        covariance = np.linalg.inv(whole[:size, :size] + np.diag(widest))
        mean = covariance @ np.ascontiguousarray(whole[:size, size])
        for i in range(n):
            left, fitted = moments[i, width - 1, width - 1], 0.0
            for a in range(width - 1):
                p = _place(a, i, n, s, width)
                left -= 2.0 * moments[i, width - 1, a] * mean[p]
                for b in range(a + 1):
                    r, x = _place(b, i, n, s, width), moments[i, a, b] if a == b else 2.0 * moments[i, a, b]
                    left += x * mean[p] * mean[r]
                    fitted += x * covariance[p, r] / noise[i]
            count = (rows[i] + before[1, i]) / colour[i]
            noise[i] = max((max(left, 0.0) + before[0, i]) / max(count - fitted, _AT_LEAST * count), _LEAST)
    return mean


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def reduced(whole: FloatArray, first: int) -> tuple[FloatArray, FloatArray]:
    """Information and response of the columns from ``first`` on, whatever those before are."""
    size = whole.shape[0] - 1
    others, cross = whole[:first, :first] + np.eye(first), np.ascontiguousarray(whole[:first, first:])
    left = whole[first:, first:] - cross.T @ np.linalg.solve(others, cross)
    return np.ascontiguousarray(left[: size - first, : size - first]), np.ascontiguousarray(left[: size - first, size - first])


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def evidence(whole: FloatArray, first: int, priors: FloatArray) -> FloatArray:
    """Logarithms of the marginal likelihood of all rows, but for what is common to all of the same noise, shape (m,): columns
    before ``first`` have the prior variance 1, those from there on the inverse of each of the ``priors``, shape (m, d)."""
    size = whole.shape[0] - 1
    root = np.linalg.cholesky(whole[:first, :first] + np.eye(first))
    way = np.linalg.solve(root, np.ascontiguousarray(whole[:first, size]))
    J, h = reduced(whole, first)
    free: FloatArray = likelihoods(J, h, priors)
    free += 0.5 * (way @ way - whole[size, size]) - np.log(np.diag(root)).sum()
    return free


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def told_if_exact(since: FloatArray, noise: FloatArray, change: FloatArray) -> float:
    """Logarithm of how much likelier rows with the moments ``since`` would be on average with another payload, the ``change`` by
    its prior standard deviations, shape (10,), than with none, if all else were known."""
    information = np.zeros((_PAYLOAD, _PAYLOAD))
    for i in range(noise.size):
        for a in range(_PAYLOAD):
            for b in range(a + 1):
                information[a, b] += since[i, a, b] / noise[i]
    for a in range(_PAYLOAD):
        for b in range(a):
            information[b, a] = information[a, b]
    root = np.linalg.cholesky(information + np.eye(_PAYLOAD))
    return float(0.5 * change @ (information @ change) - np.log(np.diag(root)).sum())


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def another_payload(
    before: FloatArray, since: FloatArray, noise: FloatArray, s: int, first: int, priors: FloatArray, chance: FloatArray
) -> float:
    """Logarithm of how much likelier another payload since a change makes all rows than the one before it.

    Args:
        before: information of the rows before, shape (k, k). since: moments of the others, as ``moments`` of :func:`together`.
        chance: of each prior, logarithm, shape (m,). noise, s, first, priors: as of :func:`together` and :func:`evidence`.
    """
    same = evidence(together(before, since, noise, s), first, priors) + chance
    other = evidence(together(without_payload(before), since, noise, s), first, priors) + chance
    root = np.linalg.cholesky(before[:_PAYLOAD, :_PAYLOAD] + np.eye(_PAYLOAD))
    most = max(same.max(), other.max())
    return float(np.log(np.exp(other - most).sum()) - np.log(np.diag(root)).sum() - np.log(np.exp(same - most).sum()))


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def likelihoods(J: FloatArray, h: FloatArray, priors: FloatArray) -> FloatArray:
    """Logarithms of the marginal likelihood of rows with information J (d, d) and response h (d,), but for what is common to all,
    for prior informations (m, d) of independent parameters."""
    count, d = priors.shape  # the priors lie side by side, so that the compiler makes vector instructions of their loops
    out, root, way, x = np.zeros(count), np.empty((d, d, count)), np.empty((d, count)), np.empty(count)
    for a in range(d):
        for b in range(a + 1):
            x[:] = J[a, b]
            if a == b:
                x += priors[:, a]
            for k in range(b):
                for m in range(count):
                    x[m] -= root[a, k, m] * root[b, k, m]
            root[a, b] = np.sqrt(x) if a == b else x / root[b, b]
        out += 0.5 * np.log(priors[:, a] / x)
        x[:] = h[a]
        for k in range(a):
            for m in range(count):
                x[m] -= root[a, k, m] * way[k, m]
        way[a] = x / root[a, a]
        out += 0.5 * way[a] ** 2
    return out
