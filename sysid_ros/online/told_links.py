"""RowsSoFar: the rows since what is carried changed last, from which a tare learns what is known wrongly of the arm."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sysid_ros.estimators import Estimator
from sysid_ros.online.free_parameters import PAYLOAD, FreeParameters
from sysid_ros.online.front_end import FrontEnd
from sysid_ros.online.rows import Rows
from sysid_ros.robot.link_inexactness import principal_directions
from sysid_ros.sample import FloatArray

_SPAN = 10.0
"""So much of the time before a tare is kept [s]: what the node's queue of messages holds while it is worked through twice."""
_MOST = 2000
"""Rows that are kept at most: of so long a time at twice the usual rate."""
_LEFT_OUT = 1e-8
"""Part of the variance of the torque that the directions make together which are left out: beside a payload of which the rows may
tell little, what links and a tilt of the base still share is small, and is most of what the tilt is uncertain by."""
_NOTHING = (0.03, 5e-3, 5e-3, 5e-3, *[1e-3] * 6)
"""What may have been put on an arm that carries nothing, and is no change of the payload: standard deviations."""


class Told(NamedTuple):
    """What the rows tell.

    Attributes:
        estimator: of the payload from now on, with friction and noise as they are known.
        mass: of what was carried [kg], and its standard deviation. mean, root: of the errors x = [payload, z] of what is known of
            the arm, ``x = mean + root z'``, z' ~ N(0, 1), shapes (10 + c,) and (10 + c, c').
    """

    estimator: Estimator
    mass: tuple[float, float]
    mean: FloatArray
    root: FloatArray


class RowsSoFar:
    """Rows of ``y = Y theta + Y_f phi + Z z + noise`` with one payload theta, and friction phi.

    While a payload is estimated z is only considered: some of it makes the same torque as a payload does. At a tare that does
    not matter: what the links are wrong by and what is carried are one error of what is known of the arm, ``x = [theta, z]``,
    and the rows tell nearly all that x does. So with z among the parameters ``x | rows ~ N(m, C)``, and with ``C = M M'``

        y - [Y Z] m = Y theta' + Y_f phi + ([Y Z] M) z' + noise,      z' ~ N(0, 1)

    is the equation from then on, in which what is carried, theta', is nothing at first. phi given z' is learned from the same
    rows: as ``p(phi, x | rows) = p(phi | x, rows) p(x | rows)``, nothing is counted twice, and what the rows do not tell apart,
    as an offset and a mass, stays together. Of M those directions are kept that make torque on some motion. Errors z_g of the
    efforts' gains stay considered: they move m by ``S z_g``, which goes on beside M z' with what they make of the rows to come.

    Args:
        free: what is estimated.

    Attributes:
        rows: of one payload, the newest last; none of a robot whose links a tare does not learn.
    """

    def __init__(self, free: FreeParameters) -> None:
        self._free = free
        self.rows: deque[Rows] = deque(maxlen=_MOST if free.links_are_of_the_urdf else 0)

    def clear(self) -> None:
        """What is carried has changed, or what is known of the arm."""
        self.rows.clear()

    def tell(self, front_end: FrontEnd, floor: FloatArray) -> Told | None:
        """What all rows tell together; None where they do not. ``floor``: as of :meth:`.FreeParameters.make_estimator`."""
        free, p, error = self._free, self._free.model.p, self._free.model.error
        c = error.gains.shape[1] - error.gained
        while self.rows and not 0.0 <= self.rows[-1].t - self.rows[0].t <= _SPAN:
            self.rows.popleft()
        if not self.rows:
            return None
        both = free.make_again(front_end, floor, c)

        def free_of_links(Y: FloatArray, y: FloatArray, Z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            return np.concatenate([Y, Z[..., :c]], axis=-1), y, Z[..., c:]

        if not self._learn(free_of_links, both, front_end):
            return None
        where = np.r_[PAYLOAD, p : p + c]
        covariance, by_gains = both.noise_covariance()[np.ix_(where, where)], both.sensitivity[where]
        mean = np.append(both.theta[where], np.zeros(error.gained))
        if not (np.isfinite(mean).all() and np.linalg.eigvalsh(_scaled(covariance))[0] > 0.0):
            return None
        std = float(np.sqrt(both.covariance()[0, 0]))
        root = np.sqrt(covariance.diagonal())[:, None] * np.linalg.cholesky(_scaled(covariance))
        root = root @ principal_directions(free.model.robot, free.error_directions()[:, : where.size] @ root, left_out=_LEFT_OUT)
        behind = np.zeros((error.gained, root.shape[1]))
        root = np.block([[root, by_gains], [behind, np.eye(error.gained)]])
        again = free.make_again(front_end, floor)

        def corrected(Y: FloatArray, y: FloatArray, Z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            known = np.concatenate([Y[..., PAYLOAD], Z], axis=-1)
            nothing = Y.copy()
            nothing[..., PAYLOAD] = 0.0
            return nothing, y - known @ mean, known @ root

        if not self._learn(corrected, again, front_end):
            return None
        again.suppose(PAYLOAD, np.array(_NOTHING))
        return Told(again, (float(mean[0]), std), mean, root)

    def _learn(
        self,
        change: Callable[[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]],
        estimator: Estimator,
        front_end: FrontEnd,
    ) -> bool:
        """Let an estimator take in what ``change`` makes of Y, y and Z of all rows, and of what noise does to them; whether they
        are rows of one payload, with noise that is known."""
        for rows in self.rows:
            extra = self._free.extra_variance(rows, estimator, front_end.passed)
            Y, y, Z = map(np.ascontiguousarray, change(rows.Y, rows.y, rows.considered))
            estimator.update(Y, y, False, extra, Z)
            if rows.noise is not None:
                moved, made, also = rows.noise
                moved, made, also = map(np.ascontiguousarray, change(moved, made, also))
                estimator.compensate((moved, made, also), False, extra)
        return estimator.noise_known and not (estimator.jumps or estimator.misfits)


def _scaled(covariance: FloatArray) -> FloatArray:
    """As correlations."""
    std = np.sqrt(covariance.diagonal())
    return np.asarray(covariance / np.outer(std, std))
