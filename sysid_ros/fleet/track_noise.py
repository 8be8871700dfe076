"""Noise of all joints together: coloured, and shared, for a position's noise is in the torque of every joint that it moves."""

from __future__ import annotations

import numpy as np
from scipy import fft, ndimage

from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray

_BAND_HZ = 1.0
"""Half of the band over which a spectrum is averaged: noise behind the low-pass changes over several hertz."""
_FEWEST_BINS = 8
"""Frequencies that are averaged at least, on each side."""
_LONGEST_GAP = 256
"""Rows left empty for a gap: what is longer decorrelates anyway."""


def score_covariance(
    rows: BagRows, Y: FloatArray, left: FloatArray, weight: FloatArray, root: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """``Cov(sum_tj w_tj Y_tj e_tj)``, shape (p, p), and the mean noise variance of each joint's rows where the motion has its
    power, shape (n,) [(N m)^2].

    With the cross-spectra S(f) of the residuals, shape (n, n), averaged over neighbouring frequencies (Daniell), and Z(f) the
    transform of the weighted rows, shape (n, p), it is ``sum_f Z' S Z``: the spectral form of the covariance of Newey, West
    (1987) for several equations. What a fit takes out of the residual where its columns have their power is given back by its
    leverage there, as in :func:`sysid_ros.identification.coloured_noise.coloured_information`.

    Args:
        rows: whose times are used. Y, left: derivatives (N, n, p) and residual (N, n). weight: of each row, 0 where it is not
            used, (N, n). root: R, shape (p, p), with ``R R'`` the inverse of ``sum w Y' Y + prior``.
    """
    steps = np.rint(np.diff(rows.t) / rows.period)
    steps = np.where(steps < 1.0, _LONGEST_GAP, np.clip(steps, 1, _LONGEST_GAP))
    place = np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)
    size = fft.next_fast_len(int(place[-1]) + 1 + _LONGEST_GAP, real=True)
    n, p = Y.shape[1:]
    scaled = np.sqrt(weight)
    columns, noise, used = np.zeros((size, n, p)), np.zeros((size, n)), np.zeros((size, n))
    columns[place], noise[place], used[place] = scaled[:, :, None] * Y, scaled * left, scaled > 0.0
    Z, E = fft.rfft(columns, axis=0), fft.rfft(noise, axis=0)
    followed = np.sum(np.abs(Z @ root) ** 2, axis=2)
    overlap = used.T @ used
    count = np.maximum(np.diag(overlap), 1.0)
    reach = max(round(_BAND_HZ * size * rows.period), _FEWEST_BINS)
    power = _averaged(E[:, :, None] * E[:, None, :].conj(), reach)
    freedom = np.sqrt(np.maximum(_averaged(count - followed, reach) / count, TOL.least_freedom))
    S = power / (np.maximum(overlap, 1.0) * freedom[:, :, None] * freedom[:, None, :])
    both_sides = np.full(len(S), 2.0)
    both_sides[0] = 1.0
    if size % 2 == 0:
        both_sides[-1] = 1.0
    spread = (both_sides / size)[:, None, None] * (S @ Z)
    # score = sum w Y e, and the scaled rows hold sqrt(w) each
    total = np.real(Z.conj().reshape(-1, p).T @ spread.reshape(-1, p))
    own = np.real(np.diagonal(S, axis1=1, axis2=2)) * both_sides[:, None]
    where = np.maximum(np.sum(both_sides[:, None] * followed, axis=0), 1e-300)
    mean_weight = weight.sum(axis=0) / count
    level = np.where(mean_weight > 0.0, np.sum(own * followed, axis=0) / where / np.maximum(mean_weight, 1e-300), 0.0)
    return 0.5 * (total + total.T), level


def _averaged(values: FloatArray, reach: int) -> FloatArray:
    """Mean over the neighbouring frequencies on both sides; a spectrum goes on mirrored at its ends."""
    averaged: FloatArray = ndimage.uniform_filter1d(values, 2 * reach + 1, axis=0, mode="mirror")
    return averaged
