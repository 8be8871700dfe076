"""That what is carried was put down is seen where no single row shows it, and is not seen where it was not."""

from __future__ import annotations

import numpy as np
import pytest

from sysid_ros.online.put_down import SELDOM, with_row
from sysid_ros.sample import FloatArray

M, P, PERIOD = 7, 17, 0.01
FOUND = float(np.log(SELDOM / PERIOD))
NOISE = 0.1
EMPTY, NONE, WHITE = np.zeros(10), np.zeros(M), (np.full(M, NOISE**2), np.full(M, NOISE**2))


def rows(seed: int, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Columns (count, M, P), parameters (P,) whose payload makes half a standard deviation of a row, and noise (count, M)."""
    rng = np.random.default_rng(seed)
    Y, theta = rng.standard_normal((count, M, P)), rng.standard_normal(P)
    theta[:10] *= 0.5 * NOISE / np.linalg.norm(theta[:10])
    return Y, theta, NOISE * rng.standard_normal((count, M))


def found_after(Y: FloatArray, y: FloatArray, theta: FloatArray, empty: FloatArray = EMPTY) -> int | None:
    each = sums(Y, y, theta, empty, WHITE)
    return int(np.argmax(each > FOUND)) + 1 if np.any(each > FOUND) else None


def sums(Y: FloatArray, y: FloatArray, theta: FloatArray, empty: FloatArray, noise: tuple[FloatArray, FloatArray]) -> FloatArray:
    """After each row, shape (count,)."""
    out = [0.0]
    for columns, row in zip(Y, y, strict=True):
        out.append(with_row(out[-1], columns, row, theta, empty, *noise, 1.0, NONE, 1.0))
    return np.array(out[1:])


@pytest.mark.parametrize("part", [1.0, 1.5])
def test_what_is_still_carried_or_more_is_not_put_down(part: float) -> None:
    for seed in range(5):
        Y, theta, noise = rows(seed, 2000)
        true = np.concatenate([part * theta[:10], theta[10:]])
        assert found_after(Y, Y @ true + noise, theta) is None


def test_a_load_that_no_row_shows_is_missed_as_soon_as_can_be() -> None:
    """Information of a row over the noise is half of ``M / 4``; 600 s of 100 Hz are worth a logarithm of 11."""
    delays = []
    for seed in range(40):
        Y, theta, noise = rows(seed, 200)
        true = np.concatenate([EMPTY, theta[10:]])
        delays.append(found_after(Y, Y @ true + noise, theta))
    assert np.mean([d for d in delays if d is not None]) == pytest.approx(np.log(600.0 / PERIOD) / (M / 8.0), rel=0.25)
    assert None not in delays


def test_nothing_is_what_was_tared() -> None:
    Y, theta, noise = rows(1, 200)
    tared = np.linspace(-1.0, 1.0, 10)
    theta[:10] += tared
    true = np.concatenate([tared, theta[10:]])
    assert found_after(Y, Y @ true + noise, theta, tared) is not None
    assert found_after(Y, Y @ theta + noise, theta, tared) is None


def test_coloured_noise_counts_by_its_long_run() -> None:
    """AR(1) of 0.9: rows of which twenty say what one of the same variance says."""
    keep, false = 0.9, 0
    for seed in range(10):
        Y, theta, white = rows(seed, 3000)
        Y[:] = Y[0]  # what the load makes keeps its sign, as the noise does for a while
        noise = np.empty_like(white)
        noise[0] = white[0]
        for k in range(1, len(white)):
            noise[k] = keep * noise[k - 1] + np.sqrt(1.0 - keep**2) * white[k]
        variance = WHITE[0] * (1.0 + keep) / (1.0 - keep), WHITE[1]
        false += bool(np.any(sums(Y, Y @ theta + noise, theta, EMPTY, variance) > FOUND))
    assert false == 0


def test_a_row_that_is_no_number_says_nothing() -> None:
    Y, theta, noise = rows(2, 200)
    y = Y @ np.concatenate([EMPTY, theta[10:]]) + noise
    before = float(sums(Y, y, theta, EMPTY, WHITE)[5])
    assert before > 0.0
    assert with_row(before, Y[0], np.full(M, np.nan), theta, EMPTY, *WHITE, 1.0, NONE, 1.0) == before
    assert with_row(before, Y[0], y[0], theta, EMPTY, np.full(M, np.nan), WHITE[1], 1.0, NONE, 1.0) == before
    assert with_row(before, Y[0], y[0], theta, EMPTY, *WHITE, 1.0, NONE, 1.0) != before


def test_noise_that_cancels_over_a_long_run_does_not_within_a_beat() -> None:
    """A beat of ten rows: its mean is nothing, but half of it looks like a load that is gone."""
    Y, theta, _ = rows(3, 1000)
    Y[:] = Y[0]
    beat = np.sign(np.sin(2.0 * np.pi * (np.arange(len(Y)) + 0.5) / 10.0))[:, None] * (Y[0, :, :10] @ theta[:10])
    y, small = Y @ theta - 1.5 * beat, WHITE[0] / 100.0
    single = 5.0 * np.mean((1.5 * beat) ** 2, axis=0)  # five rows after the low-pass say what one does
    found = [bool(np.any(sums(Y, y, theta, EMPTY, (small, x)) > FOUND)) for x in (small, single)]
    assert found == [True, False]
