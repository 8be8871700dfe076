"""Left out: how well any set of terms predicts each stretch of the recordings without having seen it.

The whitened rows go back into time and are cut into stretches. A set's parameters without a stretch follow from normal equations
less those of the stretch, so what any set predicts costs no new pass over the rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sysid_ros.diagnosis.band import RowNoise
from sysid_ros.diagnosis.sets.block_scatter import scatter_ratios
from sysid_ros.diagnosis.sets.prediction_spread import (
    Axes,
    Spread,
    held_out_rows,
    powers,
    powers_with_more,
    principal_axes,
    spread_of,
    spread_without,
)
from sysid_ros.diagnosis.sets.stretches import Indices, Rows, Stretches
from sysid_ros.diagnosis.term import Term
from sysid_ros.estimators.symmetric import inverse_of, scaled_to_one
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, eq=False)
class Predicted:
    """What a set of columns predicts.

    Attributes:
        at: indices of the columns, shape (a,). prior: inverse variances of their parameters before any data, shape (a,).
        covariance: of the parameters without each stretch, shape (S, a, a).
        theta: shape (S, a). left: whitened rows that are left of each joint, stretch by stretch, shape (S, n, L).
        likelihood: of each stretch, with its part of the log-prior of the parameters, shape (S,).
        information, score: of all fitted rows, shape (a, a) with the prior and (a,).
        spread: of the rows of the held-out stretches.
    """

    at: Indices
    prior: FloatArray
    covariance: FloatArray
    theta: FloatArray
    left: FloatArray
    likelihood: FloatArray
    information: FloatArray
    score: FloatArray
    spread: Spread

    @cached_property
    def axes(self) -> Axes:
        """Principal axes of that."""
        return principal_axes(self.spread)

    @cached_property
    def with_all_rows(self) -> tuple[FloatArray, FloatArray]:
        """Covariance and parameters with no stretch left out."""
        covariance = inverse_of(self.information)
        return covariance, covariance @ self.score


class LeftOut:
    """Normal equations of all columns that are asked, stretch by stretch.

    A stretch of a held-out recording counts as likely as the parameters, as uncertain as they are, make its rows
    (:mod:`.prediction_spread`); one that the fit sees but for itself, which asks for nothing that the others do not tell, as
    likely as its parameters make it, and each of those costs as much as it spoils a prediction.

    Args:
        rows: those that are predicted: of the fitted recordings, each stretch from the others, then of held-out ones, from all
            that are fitted. terms: all that are asked.
        noise: what the rows are weighted by. dry: level of the dry friction on each joint, shape (n,) [N m].

    Attributes:
        of_each: the rows and their normal equations.
    """

    def __init__(self, rows: Sequence[Rows], terms: Sequence[Term], noise: RowNoise, dry: FloatArray) -> None:
        self.of_each = Stretches(rows, terms, noise, dry)

    def of(self, at: Indices, prior: FloatArray) -> Predicted:
        """What columns predict, with the inverse variances of their parameters before any data, shape (a,)."""
        M, score = self.equations(at)
        M[:, np.arange(len(at)), np.arange(len(at))] += prior
        covariance = inverse_of(M)
        return self._predicted(at, prior, covariance, (covariance @ score[:, :, None])[:, :, 0])

    def equations(self, at: Indices) -> tuple[FloatArray, FloatArray]:
        """Information of columns in all rows but each stretch, shape (S, a, a), and their score, shape (S, a)."""
        return self.of_each.without_each(at, at), self.of_each.score[at] - self.of_each.b[:, at]

    def with_all(self, at: Indices, prior: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Covariance and parameters of columns with all fitted rows, shape (a, a) and (a,)."""
        covariance = inverse_of(self.of_each.whole[np.ix_(at, at)] + np.diag(prior))
        return covariance, covariance @ self.of_each.score[at]

    def marginal(self, at: Indices, prior: FloatArray) -> float:
        """Logarithm of the likelihood of all fitted rows with the parameters of columns integrated out, but for the determinant
        of their prior and for what is common to all columns."""
        information, score = self.of_each.whole[np.ix_(at, at)] + np.diag(prior), self.of_each.score[at]
        scaled, scale = scaled_to_one(information)
        determinant = np.linalg.slogdet(scaled)[1] - 2.0 * np.sum(np.log(scale))
        return float(0.5 * score @ (inverse_of(information) @ score) - 0.5 * determinant)

    def without(self, state: Predicted, where: Indices) -> Predicted:
        """What is predicted without some of a set's columns. Args: where: their places in ``state.at``."""
        rest, cross, given, theta = _given(state, where)
        covariance = block(state.covariance, rest, rest)
        covariance -= cross @ given
        return self._predicted(state.at[rest], state.prior[rest], covariance, theta, self._spread_without(state, where))

    def likelihood_without(self, state: Predicted, where: Indices) -> FloatArray:
        """Likelihood of each stretch without some of a set's columns, shape (S,). Args: where: as :meth:`without` has it."""
        rest, _, _, theta = _given(state, where)
        spread = {j: K[None] for j, K in self._spread_without(state, where).items()}
        return np.asarray(self.likelihood(state.at[rest], state.prior[None, rest], theta[None], spread)[0])

    def _spread_without(self, state: Predicted, where: Indices) -> Spread:
        return spread_without(self.of_each, state.spread, state.at, state.covariance[self.of_each.predicting], where)

    def likelihood(self, at: Indices, priors: FloatArray, thetas: FloatArray, spread: Spread) -> FloatArray:
        """Likelihood of each stretch with one of several parameters of the same columns, shape (k, S).

        Args:
            priors: inverse variances of each of them before any data, shape (k, a). thetas: shape (k, S, a).
            spread: with each of them, shape (k, H, L, L) a joint.
        """
        known = np.einsum("ksa,ka->sk", thetas**2, priors)
        power = np.empty((self.of_each.stretches, len(thetas), self.of_each.y.shape[1]))
        half, held_out = np.zeros_like(power), ~self.of_each.fitted
        for j, left in enumerate(self._left(at, thetas)):
            power[:, :, j] = np.einsum("skl,skl->sk", left, left)
            if j in spread:
                found = powers(spread[j], left[held_out].swapaxes(0, 1), self.of_each.size[held_out, j])
                power[held_out, :, j], half[held_out, :, j] = (x.T for x in found)
        return self._likelihood(power, known, half).T

    def _left(self, at: Indices, thetas: FloatArray) -> Iterator[FloatArray]:
        """What parameters of shape (k, S, a) leave of the rows of each joint, one after the other, shape (S, k, L)."""
        for j in range(self.of_each.y.shape[1]):
            left = np.repeat(self.of_each.y[:, j, None], len(thetas), axis=1)
            if j in self.of_each.x:
                place = self.of_each.place[j][at]
                left -= np.ascontiguousarray(thetas[:, :, place >= 0].swapaxes(0, 1)) @ self.of_each.x[j][:, place[place >= 0]]
            yield left

    def _predicted(
        self, at: Indices, prior: FloatArray, covariance: FloatArray, theta: FloatArray, spread: Spread | None = None
    ) -> Predicted:
        if spread is None:
            spread = spread_of(self.of_each, at, covariance[self.of_each.predicting])
        left = np.concatenate(list(self._left(at, theta[None])), axis=1)
        likelihood = self.likelihood(at, prior[None], theta[None], {j: K[None] for j, K in spread.items()})[0]
        information = self.of_each.whole[np.ix_(at, at)] + np.diag(prior)
        return Predicted(at, prior, covariance, theta, left, likelihood, information, self.of_each.score[at], spread)

    def plus(self, state: Predicted, each: Sequence[Indices], priors: Sequence[FloatArray]) -> FloatArray:
        """Likelihood of each stretch with more columns, one of several sets of them at a time, shape (m, S)."""
        out = np.empty((len(each), self.of_each.stretches))
        for width in {len(at) for at in each}:
            which = [i for i, at in enumerate(each) if len(at) == width]
            out[which] = self._plus(state, np.stack([each[i] for i in which]), np.stack([priors[i] for i in which]))
        return out

    def _plus(self, state: Predicted, at: Indices, prior: FloatArray) -> FloatArray:
        """As :meth:`plus`, for sets of equally many columns, shape (m, c) both."""
        m, c = at.shape
        a, S = len(state.at), self.of_each.stretches
        cross = self.of_each.without_each(state.at, at.reshape(-1))
        own = self.of_each.whole[at[:, :, None], at[:, None, :]] - self.of_each.G[:, at[:, :, None], at[:, None, :]]
        own[:, :, np.arange(c), np.arange(c)] += prior + 1e-9 * np.diagonal(self.of_each.whole)[at]
        taken = state.covariance @ cross
        score = self.of_each.score[at] - self.of_each.b[:, at] - (state.theta[:, None] @ cross).reshape(S, m, c)
        each = taken.reshape(S, a, m, c)
        rest = own - cross.reshape(S, a, m, c).transpose(0, 2, 3, 1) @ each.transpose(0, 2, 1, 3)
        rest += np.maximum(1e-9 * np.diagonal(own, axis1=2, axis2=3), 1e-30)[..., None] * np.eye(c)
        step = score / rest[..., 0] if c == 1 else np.linalg.solve(rest, score[..., None])[..., 0]
        change = -(each * step[:, None]).sum(axis=3).swapaxes(1, 2)
        power = np.empty((S, m, self.of_each.y.shape[1]))
        half, held_out, first = np.zeros_like(power), ~self.of_each.fitted, self.of_each.predicting
        for j in range(self.of_each.y.shape[1]):
            left = np.repeat(state.left[:, j, None], m, axis=1)
            if j in self.of_each.x:
                place = self.of_each.place[j][state.at]
                left -= change[:, :, place >= 0] @ self.of_each.x[j][:, place[place >= 0]]
                place = self.of_each.place[j][at]
                for k in range(c):
                    here = np.flatnonzero(place[:, k] >= 0)
                    left[:, here] -= self.of_each.x[j][:, place[here, k]] * step[:, here, k, None]
            power[:, :, j] = np.einsum("sml,sml->sm", left, left)
            if j in state.axes:
                columns, size = self._alone(j, state.at, at, taken[first]), self.of_each.size[held_out, j]
                found = powers_with_more(state.axes[j], left[held_out], columns, rest[first], size)
                power[held_out, :, j], half[held_out, :, j] = found
        known = np.sum((state.theta[:, None] + change) ** 2 * state.prior, axis=2)
        known += np.sum(step**2 * prior, axis=2)
        return self._likelihood(power, known, half).T

    def _alone(self, joint: int, others: Indices, at: Indices, taken: FloatArray) -> FloatArray:
        """Columns of shape (m, c) in the held-out rows of a joint less what others follow of them, shape (H, m, c, L); ``taken``:
        how much of each of the others follows each of them, shape (a, m c)."""
        X, loads = held_out_rows(self.of_each, joint, others)
        own, here = held_out_rows(self.of_each, joint, at.reshape(-1))
        out = -(taken[loads].T @ X)
        out[:, here] += own
        return np.asarray(out.reshape(len(X), *at.shape, X.shape[2]))

    def most(self, state: Predicted, gone: Indices, each: Sequence[Indices], priors: Sequence[FloatArray]) -> FloatArray:
        """What all rows gain at most, about, with one of several sets of columns in place of some of a state's, shape (m,).

        It follows from normal rows with no stretch left out: Student's gain no more than twice what those gain, and lose the
        least where one stretch of one joint, one as long as a row is usually in, loses it all. It is no strict bound, for
        held-out rows are taken to gain as many times more as there are more of them, and a stretch to be left out is not.

        Args:
            gone: places of the columns in ``state.at``. each: the other columns; a set may be empty.
        """
        covariance, theta = state.with_all_rows
        loss, rest = 0.0, np.delete(np.arange(len(state.at)), gone)
        if len(gone):
            cross = covariance[np.ix_(rest, gone)]
            given = np.linalg.lstsq(covariance[np.ix_(gone, gone)], np.column_stack([cross.T, theta[gone]]), rcond=1e-12)[0]
            loss = 0.5 * float(theta[gone] @ given[:, -1])
            covariance, theta = covariance[np.ix_(rest, rest)] - cross @ given[:, :-1], theta[rest] - cross @ given[:, -1]
        net = np.full(len(each), -loss)
        for width in {len(at) for at in each} - {0}:
            which = [i for i, at in enumerate(each) if len(at) == width]
            at = np.stack([each[i] for i in which])
            net[which] += self._gained(state.at[rest], covariance, theta, at, np.stack([priors[i] for i in which]))
        size = self.of_each.size
        least = float(np.sum(size**2) / np.sum(size))
        return np.where(net > 0.0, 2.0 * self.of_each.all_over_fitted * net, -least * np.log1p(np.maximum(-net, 0.0) / least))

    def _gained(self, rest: Indices, covariance: FloatArray, theta: FloatArray, at: Indices, prior: FloatArray) -> FloatArray:
        """Likelihood that normal rows gain with columns of shape (m, c) beside others, all rows fitted, shape (m,)."""
        m, c = at.shape
        cross = self.of_each.whole[rest[:, None], at.reshape(-1)]
        taken = (covariance @ cross).reshape(-1, m, c).transpose(1, 0, 2)
        score = self.of_each.score[at] - (theta @ cross).reshape(m, c)
        left = self.of_each.whole[at[:, :, None], at[:, None, :]] - cross.reshape(-1, m, c).transpose(1, 2, 0) @ taken
        left[:, np.arange(c), np.arange(c)] += prior + 1e-9 * np.diagonal(self.of_each.whole)[at] + 1e-30
        inverse = np.linalg.pinv(left, rcond=1e-12, hermitian=True)
        return np.asarray(0.5 * np.einsum("mc,mcd,md->m", score, inverse, score))

    def _likelihood(self, power: FloatArray, known: FloatArray, half: FloatArray) -> FloatArray:
        """Of each stretch, shape (S, m), up to a constant. What is known of the parameters before any data counts once in all.

        The level of a joint's noise in one stretch is known as well as that many rows tell it (a scaled inverse chi-squared
        prior), so that the rows have Student's distribution: noise that comes and goes is not proof.

        Args:
            power: what is left of each stretch and joint, shape (S, m, n). known: twice the log-prior of the parameters with the
                other sign, shape (S, m).
            half: half the logarithm of the determinant of what the rows spread by, beside the noise, shape (S, m, n).
        """
        size = self.of_each.size[:, None]
        counted = size / self.of_each.length[:, None, None]
        return np.asarray(-np.sum(size * np.log1p(power / size) + counted * half, axis=2) - 0.5 * known / self.of_each.stretches)

    def scatter(self, state: Predicted) -> FloatArray:
        """By how much more the parameters of a set scatter from stretch to stretch than its noise explains, variance over
        variance, at least 1, shape (a,)."""
        each = self.of_each.G[self.of_each.fitted][:, state.at[:, None], state.at]
        scores = self.of_each.b[self.of_each.fitted][:, state.at] - each @ state.with_all_rows[1]
        return scatter_ratios(scores, each, state.information)


def block(matrices: FloatArray, rows: Indices, columns: Indices) -> FloatArray:
    """Rows and columns of several matrices, shape (S, r, c)."""
    return np.asarray(matrices.take(rows, axis=1).take(columns, axis=2))


def _given(state: Predicted, where: Indices) -> tuple[Indices, FloatArray, FloatArray, FloatArray]:
    """Of a set without some of its columns: which are left, their covariance with those, that over the variance of those, and
    the parameters that are left."""
    rest = np.delete(np.arange(len(state.at)), where)
    some = state.covariance[:, :, where]
    cross, own = some[:, rest], some[:, where]
    own = own + np.maximum(1e-9 * np.diagonal(own, axis1=1, axis2=2), 1e-30)[:, :, None] * np.eye(len(where))
    given = np.linalg.solve(own, cross.swapaxes(1, 2))
    theta = state.theta[:, rest] - (state.theta[:, None, where] @ given)[:, 0]
    return np.asarray(rest), cross, np.asarray(given), theta
