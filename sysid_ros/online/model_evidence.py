"""ModelEvidence: by how much the arm's model is wrong, and how much of what the arm takes shows, as the rows so far tell it."""

from __future__ import annotations

import math

import numpy as np

from sysid_ros.online.evidence_kernels import (
    BEHIND,
    LOCAL,
    another_payload,
    close_block,
    learn_noise,
    likelihoods,
    reduced,
    settle,
    take,
    together,
    told_if_exact,
    without_payload,
)
from sysid_ros.online.evidence_words import not_shown
from sysid_ros.online.model_hypotheses import Hypotheses
from sysid_ros.online.rows import Rows
from sysid_ros.sample import FloatArray

ROTOR = 0.1
"""Prior standard deviation of a rotor's inertia behind its gear, for a joint's usual friction [kg m^2 per N m]."""
BY_LOAD = 0.05
"""Prior standard deviation of the part of what a joint carries that its gear loses."""
_EVERY = 0.05
"""Between rows that are taken in [s]: those between them tell hardly more."""
_PENDING = 0.25
"""So long rows wait, as a change of what is carried is found after it has happened [s]."""
_BLOCK = 2.0
"""Time over which sums tell the colour of the noise [s]."""
_MEMORY = 30.0
"""In which rows are forgotten [s]."""
_KEEP = math.exp(-_BLOCK / _MEMORY)
"""What is kept of blocks before, a block."""
_COLOUR, _WEIGHT = 5.0, 2.0
"""How many rows of noise count as one, before data tell it: noise of a quarter of a second; that counts like so many blocks."""
_FEWEST = 20
"""Rows of each joint that are taken in before anything is said."""
_ASK = 0.5
"""Between two looks [s]."""
_GAIN = 0.01
"""As which gains are asked for that are said to be exact."""
_CLEAR = math.log(20.0)
"""Logarithm of how much likelier a change must be than none, if nothing is wrong with the arm, where rows are asked more."""
_NEGLIGIBLE = 1e-3
"""A case that is so much less likely than the likeliest is none."""
_PAYLOAD = 10


class ModelEvidence:
    """Rows ``y = Y theta + Z z + F f - k d + noise`` of all joints, taken together: theta is what is carried and how the base is
    tilted, ``z ~ N(0, s^2)`` what the links are wrong by and ``N(0, g^2)`` what the efforts' gains are, f what each joint has for
    itself, rotors included, and k what the arm itself takes as it is known.

    Two questions are asked of their marginal likelihood. First by how much the model is further off than is said, s and g: the
    covariance that is given out grows with them (empirical Bayes; Robbins 1956, Morris 1983). Then whether efforts hold what the
    arm takes: all of it, but for what all gains have in common (``d ~ N(0, g^2)`` too), or any part of it (``d ~ N(0, 1)``), as
    after a driver that compensates gravity, or in another unit, each joint with its own factor perhaps. The noise of each joint
    is what the rows leave at the largest s and g, and as many rows count as one as sums of the residual over two seconds tell.

    A change of what is carried leaves what the rows before tell of the rest (the Schur complement).

    Args:
        n: joints. period: between rows [s]. shared_std: prior standard deviation of the payload's parameters and of the tilt,
            shape (10 + t,). local_std: of each joint's, shape (6, n). gain: of each joint's effort, as a part of it. weighs: asks
            for the mass, too; not where friction and rotors are known better than ``local_std`` has it.

    Attributes:
        every: rows of which one is to be added. waits: rows since the last one. ready: True once there were rows enough for a
            verdict. links, gains: rms of s and g, 1 where nothing speaks against what is said. times: the larger of the likeliest
            two. other: probability that efforts are not what they are said to be. factors: of each joint's effort beside the
            torque if so, shape (n,). share: of what the arm takes that shows then, and its standard deviation. not_shown: a
            sentence where that is the likelier, else empty. mass: what is carried and its standard deviation [kg], as these
            rows tell it with all that may be wrong with the arm; NaN where they are not asked, or not yet since it changed, and
            what it was.
    """

    def __init__(
        self, n: int, period: float, shared_std: FloatArray, local_std: FloatArray, gain: float, weighs: bool = True
    ) -> None:
        self._weighs = weighs
        self._n, self._shared_std, self._local_std, self._gain = n, shared_std, local_std, gain or _GAIN
        self.every = max(round(_EVERY / period), 1)
        self._wait = max(round(_PENDING / (self.every * period)), 1)
        self._keep = math.exp(-_PENDING / _MEMORY)
        self._asks, self._block = max(round(_ASK / (self.every * period)), 1), max(round(_BLOCK / (self.every * period)), 2)
        self.ready = False
        self.restart()

    def restart(self, links: int = 0) -> None:
        """Forget all rows, as what is known of the arm is another; ``links``: considered errors that are of the links."""
        self._count = self.waits = 0
        self._links, n, s = links, self._n, self._shared_std.size
        self.times = 1.0
        self.factors, self.share, self.not_shown = np.ones(n), (1.0, math.inf), ""
        self.mass = math.nan, 0.0
        self._first, width = s + LOCAL * n, s + LOCAL + links + BEHIND
        size = self._first + links + 1 + n
        self._moments, self._rows = np.zeros((3, n, width, width)), np.zeros((3, n))
        self._since, self._rows_since = np.zeros((n, width, width)), np.zeros(n)
        self._another: float | None = None
        self._past, self._before = np.zeros((size + 1, size + 1)), np.zeros((2, n))
        self._column, self._mean, self._noise = np.zeros(width), np.zeros(size), np.zeros(n)
        self._blocks, self._residual = 0.0, np.zeros((4, n))
        self._hypotheses = Hypotheses.of(links, n, self._gain)
        self._weigh(self._hypotheses.chance)
        self._widest = np.ones(size)
        self._widest[self._first :] = self._hypotheses.priors[-1]

    def add(self, rows: Rows, friction: slice, gained: int) -> None:
        """Take in a row; ``friction``: where its columns stand in Y. ``gained``: of the considered errors the last ones that are
        of the gains."""
        links = rows.considered.shape[1] - gained
        if links != self._links:
            self.restart(links)
        self.waits = 0
        self._take(rows, friction)
        if self._count % self._asks == 0 and (self._rows[0] + self._before[1]).min() >= _FEWEST:
            self._look()

    def _take(self, rows: Rows, friction: slice) -> None:
        self._add_to(self._moments[2], self._rows[2], self._residual, rows, friction)
        self._count += 1
        if self._count % self._block == 0:
            close_block(self._residual, self._block, _KEEP)
            self._blocks = _KEEP * self._blocks + 1.0
        if self._count % self._wait == 0:
            settle(self._moments, self._rows, self._past, self._before, self._keep)

    def _add_to(self, moments: FloatArray, counts: FloatArray, residual: FloatArray, rows: Rows, friction: slice) -> None:
        where = friction.start, friction.stop - friction.start
        take(
            rows.Y, rows.considered, rows.y, rows.tau, rows.acceleration, rows.speed, where, self._gain, self._shared_std,
            self._local_std, self._column, moments, counts, self._mean, residual,
        )  # fmt: skip

    def drop(self) -> None:
        """Something has changed, or may have: rows that wait are left out, and those that come stand apart."""
        self._moments[1:], self._rows[1:] = 0.0, 0.0
        self._forget_since()

    def add_since(self, rows: Rows, friction: slice, gained: int) -> None:
        """Take in a row after a change, or what may be one; as :meth:`add`."""
        if not rows.fresh and rows.considered.shape[1] - gained == self._links:
            self.waits = 0
            self._add_to(self._since, self._rows_since, np.zeros_like(self._residual), rows, friction)
            self._another = None

    def another(self, change: FloatArray) -> float:
        """Logarithm of how much likelier the rows since a change are of another payload than of the one before, with all that may
        be wrong with the arm the same before and since; infinite where they are too few to tell ``change``, that of the payload
        as it is estimated, shape (10,), even if nothing were wrong."""
        if not (self.ready and self._rows_since.all()):
            return math.inf
        if told_if_exact(self._since, self._noise, change / self._shared_std[:_PAYLOAD]) < _CLEAR:
            return math.inf
        if self._another is None:
            before = together(self._past, self._moments[0], self._noise, self._shared_std.size)
            about = self._noise, self._shared_std.size, self._first, self._hypotheses.priors, self._hypotheses.chance
            try:
                self._another = float(another_payload(before, self._since, *about))
            except np.linalg.LinAlgError:
                self._another = math.inf
        return self._another

    def same(self) -> None:
        """What is carried since is what was carried before."""
        self._moments[0] += self._since
        self._rows[0] += self._rows_since
        self._forget_since()

    def renew(self) -> None:
        """Something else is carried since the change; what the rows so far tell of the rest is kept."""
        self.mass = math.nan, self.mass[1]
        self._moments[1:], self._rows[1:] = 0.0, 0.0
        if self._noise.all():
            self._past = without_payload(together(self._past, self._moments[0], self._noise, self._shared_std.size))
            self._before[1] += self._rows[0]
            self._before[0] = self._noise / self._colour() * self._before[1]
        self._moments[0], self._rows[0] = self._since, self._rows_since
        self._forget_since()

    def _forget_since(self) -> None:
        self._since[:], self._rows_since[:], self._another = 0.0, 0.0, None

    def turn(self, by: FloatArray) -> None:
        """The known torque holds a tilt by two more angles, shape (2,) [rad], from now on."""
        tilt = slice(_PAYLOAD, self._shared_std.size)
        part = by / self._shared_std[tilt]
        whole = np.tril(self._moments) + np.swapaxes(np.tril(self._moments, -1), -1, -2)
        own, all_columns = np.eye(whole.shape[-1]), np.eye(len(self._past))
        for moved, missing in ((own, -BEHIND), (all_columns, self._first + self._links)):
            moved[tilt, missing] = moved[tilt, -1] = -part
        self._moments = np.ascontiguousarray(own.T @ whole @ own)
        since = np.tril(self._since) + np.swapaxes(np.tril(self._since, -1), -1, -2)
        self._since = np.ascontiguousarray(own.T @ since @ own)
        self._past = np.ascontiguousarray(all_columns.T @ self._past @ all_columns)

    def _look(self) -> None:
        """Work out what the rows tell."""
        s, colour = self._shared_std.size, self._colour()
        first = not self._noise.all()
        if first:
            self._noise = np.maximum(colour * self._moments[0, :, -1, -1] / self._rows[0], 1e-12)
        about = self._past, self._moments[0], self._rows[0], self._before, colour, self._widest, self._noise, s
        if first:
            self._blocks = self._residual[:] = 0.0  # of what no mean had been taken off
        try:
            self._mean = learn_noise(*about, 6 if first else 2)
            J, h = reduced(together(self._past, self._moments[0], self._noise, s), self._first)
            found = likelihoods(J, h, self._hypotheses.priors) + self._hypotheses.chance
            self._tell(J, h, found)
            self.mass = self._of_mass(J, h, found) if self._weighs else self.mass
            self.ready = True
        except np.linalg.LinAlgError:  # no two columns can be told apart yet
            return

    def _of_mass(self, J: FloatArray, h: FloatArray, found: FloatArray) -> tuple[float, float]:
        """See ``mass``: over all cases, each as likely as it was ``found``."""
        s, first, size = self._shared_std.size, self._first, self._widest.size
        whole = together(self._past, self._moments[0], self._noise, s)
        unit = np.linalg.solve(whole[:first, :first] + np.eye(first), np.eye(first, 1))[:, 0]
        by, own = unit @ whole[:first, first:size], unit @ whole[:first, size]
        chance = np.exp(found - found.max())
        cases = np.flatnonzero((chance > _NEGLIGIBLE) & ~self._hypotheses.other)
        mean, square, weight = 0.0, 0.0, max(float(chance[cases].sum()), 1e-300)
        for case in cases:
            covariance = np.linalg.inv(J + np.diag(self._hypotheses.priors[case]))
            mass, part = own - by @ covariance @ h, chance[case] / weight
            mean, square = mean + part * mass, square + part * (mass**2 + unit[0] + by @ covariance @ by)
        scale = float(self._shared_std[0])
        return scale * mean, scale * math.sqrt(max(square - mean**2, 0.0))

    def _tell(self, J: FloatArray, h: FloatArray, found: FloatArray) -> None:
        """From what the rows tell of links, missing torque and gains alone, and the logarithm of the chance of each case."""
        if not np.isfinite(found).all():
            return
        self._weigh(found)
        hypotheses = self._hypotheses
        best = hypotheses.priors[np.argmax(np.where(hypotheses.other, found, -math.inf))]
        covariance = np.linalg.inv(J + np.diag(best))
        mean, k = covariance @ h, self._links
        self.factors = 1.0 - mean[k] + self._gain * mean[k + 1 :]
        size = self._moments[0, :, -3, -3]
        weights = size / size.sum() if size.sum() > 0.0 else np.full(self._n, 1.0 / self._n)
        by = np.append(-1.0, self._gain * weights)
        self.share = float(weights @ self.factors), math.sqrt(float(by @ covariance[k:, k:] @ by))
        self.not_shown = not_shown(self.factors, self.share) if self.other > 0.5 else ""

    def _weigh(self, found: FloatArray) -> None:
        """From the logarithm of the chance of each case to how far off the model is."""
        hypotheses, chance = self._hypotheses, np.exp(found - found.max())
        self.other = float(chance[hypotheses.other].sum() / chance.sum())
        usual = np.where(hypotheses.other, 0.0, chance)
        if usual.any():
            of_links, of_gains = usual @ hypotheses.links, usual @ hypotheses.gains
            self.links, self.gains = math.sqrt(of_links / usual.sum()), math.sqrt(of_gains / usual.sum())
            likeliest = np.argmax(usual)
            self.times = math.sqrt(max(hypotheses.links[likeliest], hypotheses.gains[likeliest]))

    def _colour(self) -> FloatArray:
        """How many rows count as one, shape (n,)."""
        sums, rows = self._residual[2:]
        blocks = self._blocks if rows.all() else 0.0
        told = blocks * sums / np.maximum(rows, 1e-300)
        return np.asarray(np.clip((told + _COLOUR * _WEIGHT) / (blocks + _WEIGHT), 1.0, self._block))
