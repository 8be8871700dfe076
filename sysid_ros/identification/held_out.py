"""Parts of the recordings that are fitted without each other, and the weight of the prior that predicts best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.effects import LinkInertia
from sysid_ros.identification.least_squares import Fit
from sysid_ros.identification.normal_equations import NormalEquations
from sysid_ros.identification.physical_consistency import PhysicalFit, PhysicalProblem
from sysid_ros.identification.prior_weight import WEIGHTS, choose_weight
from sysid_ros.identification.result import PriorChoice
from sysid_ros.identification.rows import BagRows
from sysid_ros.sample import FloatArray
from sysid_ros.torque_model import TorqueModel

_LOAD_SHARE = 0.3
"""Standard deviation of the friction coefficient by load before any data [1]."""

_SLACK = (0.01, 0.03)
_TOO_STRICT = 1.1
"""A joint that no inertials can improve must not keep all the others from theirs: where holding every joint to 1 % of what the
URDF's links reach costs more than a tenth of the error, 3 % is allowed."""


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known of the free effects before any data: mean and standard deviation, shape (p,) each."""

    mean: FloatArray
    std: FloatArray
    is_link: NDArray[np.bool_]

    @classmethod
    def of(cls, model: TorqueModel) -> Prior:
        """The URDF's links to half their mass; friction, rotors and offsets of the size of the effort limits."""
        robot = model.robot
        mean, std, is_link = np.zeros(model.p), np.zeros(model.p), np.zeros(model.p, dtype=bool)
        limit = np.where(np.isfinite(robot.effort_limit), robot.effort_limit, 100.0)
        by_unit = {"kg m^2": 0.05, "kg": 0.05, "1": 0.0}
        for effect, where in zip(model.free, model.slices, strict=True):
            if isinstance(effect, LinkInertia):
                mean[where] = effect.nominal
                is_link[where] = True
                mass = np.maximum(effect.nominal[::10], 0.5)
                std[where] = np.concatenate([np.array([0.5] + [0.1] * 3 + [0.03] * 6) * m for m in mass])
                continue
            per_joint = effect.p // max(len(effect.joints), 1)
            size = np.repeat(limit[effect.joints], per_joint)
            std[where] = [
                _LOAD_SHARE if unit == "1" else by_unit.get(unit, 0.2) * s for unit, s in zip(effect.units, size, strict=True)
            ]
        return cls(mean, std, is_link)

    def precision(self, weight: float = 1.0) -> FloatArray:
        """Inverse variances, shape (p,), those of the links times ``weight``."""
        precision: FloatArray = np.where(self.is_link, min(weight, 1e12), 1.0) / self.std**2
        return precision


@dataclass(frozen=True, slots=True)
class Solvers:
    """How parameters follow from data and the weight of the prior.

    The weight is tried out on many parts of the data, so this takes the prior's quadratic approximation about the URDF's links
    in place of the semidefinite program: ``theta = argmin theta' A theta / 2 - b' theta + w |theta - URDF|^2_H / 2``, H the
    curvature of the prior. Without physical consistency that is also the solution itself.

    Attributes:
        model: whose parameters they are. prior: before any data. curvature: H, shape (p, p). links: the URDF's links, or what
            the prior takes in their place, shape (p,). physical: whether the solution must be a robot that can exist.
    """

    model: TorqueModel
    prior: Prior
    curvature: FloatArray
    links: FloatArray
    physical: bool

    @classmethod
    def of(cls, model: TorqueModel, prior: Prior, found: Fit, physical: bool) -> Solvers:
        """For a model and the fit that its weights come from."""
        problem = PhysicalProblem(model, found.information, found.score)
        links = np.where(prior.is_link, problem.solve(math.inf).theta, 0.0)
        return cls(model, prior, problem.prior_curvature, links, physical)

    def approximate(self, information: FloatArray, score: FloatArray, weight: float) -> FloatArray:
        """theta, shape (p,), by the quadratic prior; ``inf`` keeps the links."""
        precision = np.where(self.prior.is_link, 0.0, self.prior.precision())
        if math.isinf(weight):
            free = ~self.prior.is_link
            theta = self.links.copy()
            A = information[np.ix_(free, free)] + np.diag(precision[free])
            theta[free] = np.linalg.solve(A, score[free] - information[np.ix_(free, ~free)] @ theta[~free])
            return theta
        # where neither data nor prior say anything of a link, as little as this keeps the matrix regular
        least = np.where(self.prior.is_link, 1e-9 / self.prior.std**2, precision)
        A = information + weight * self.curvature + np.diag(least)
        side = score + weight * self.curvature @ self.links + least * np.where(self.prior.is_link, self.links, self.prior.mean)
        return np.asarray(np.linalg.solve(A, side), dtype=np.float64)

    def solve(self, information: FloatArray, score: FloatArray, weight: float) -> tuple[FloatArray, PhysicalFit | None]:
        """theta, shape (p,), and how it was found where it must be physical."""
        if not self.physical:
            return self.approximate(information, score, weight), None
        # what is no link keeps its own prior, or a friction that these data hardly tell takes any value that is allowed
        precision = np.where(self.prior.is_link, 0.0, self.prior.precision())
        fitted = PhysicalProblem(self.model, information + np.diag(precision), score + precision * self.prior.mean).solve(weight)
        return fitted.theta, fitted


@dataclass(frozen=True, slots=True)
class Folds:
    """Sums of parts of the recordings, and which parts are held out together.

    Attributes:
        equations: a part each. weight: of a row of each part, shape (parts, n). held_out: parts, one entry a fold.
        of_one_bag: the first two folds are then its halves in time.
    """

    equations: NormalEquations
    weight: FloatArray
    held_out: tuple[tuple[int, ...], ...]
    of_one_bag: bool

    @classmethod
    def of(cls, bags: Sequence[BagRows], found: Fit) -> Folds:
        """One bag after the other; where there is one only, its halves in time, posture and speed.

        A periodic motion repeats in its second half what it showed in the first, so halves in time alone would not notice a fit
        that holds nowhere else.
        """
        if len(bags) > 1:
            return cls(found.equations, found.weight, tuple((b,) for b in range(len(bags))), False)
        (bag,) = bags
        sides = [np.arange(len(bag.t)) >= len(bag.t) // 2, _upper(_posture(bag)), _upper(_speed(bag))]
        cells = np.sum([side.astype(int) << k for k, side in enumerate(sides)], axis=0)
        rows = [found.rows[0] * (cells == c)[:, None] for c in range(8)]
        equations = NormalEquations.of([bag] * 8, rows)
        folds = [tuple(c for c in range(8) if (c >> k) & 1 == side) for k in range(3) for side in (0, 1)]
        return cls(equations, np.repeat(found.weight, 8, axis=0), tuple(folds), True)

    def without(self, fold: int) -> tuple[FloatArray, FloatArray]:
        """Information and score of all the parts that are not held out, shape (p, p) and (p,)."""
        rest = [c for c in range(len(self.weight)) if c not in self.held_out[fold]]
        part, weight = self.equations.only(rest), self.weight[rest]
        return part.information(weight), part.right_side(weight)

    def error(self, solvers: Solvers, weight: float) -> FloatArray:
        """rms of the held-out residual of every joint over all folds, shape (n,) [N m]."""
        squares, count = np.zeros(self.weight.shape[1]), np.zeros(self.weight.shape[1])
        for fold, held in enumerate(self.held_out):
            part = self.equations.only(held)
            squares += part.squares(solvers.approximate(*self.without(fold), weight)).sum(axis=0)
            count += part.count.sum(axis=0)
        error: FloatArray = np.sqrt(squares / np.maximum(count, 1e-12))
        return error


def choose_prior(folds: Folds, solvers: Solvers, given: float | None) -> PriorChoice:
    """The weight of the prior: as given, else by the error on the parts held out."""
    if given is not None:
        return PriorChoice(given, (given,), (math.nan,), "as given")
    errors = {weight: folds.error(solvers, weight) for weight in WEIGHTS}
    least = np.maximum(np.min(list(errors.values()), axis=0), 1e-300)

    def score(weight: float) -> float:
        return float(np.sqrt(np.mean((errors[weight] / least) ** 2)))

    choice, lenient = (choose_weight(errors.__getitem__, WEIGHTS, slack) for slack in _SLACK)
    if score(choice.weight) > _TOO_STRICT * score(lenient.weight):
        choice = lenient
    what = "halves in time, posture and speed, held out in turn" if folds.of_one_bag else "bags held out in turn"
    if math.isinf(choice.weight):
        reason = f"the URDF's own links predict {what}, as well as any others, so they are kept"
    else:
        reason = f"the most that predicts {what}, as well as the best, and no joint worse than the URDF's own links do"
    return PriorChoice(choice.weight, WEIGHTS, tuple(score(w) for w in WEIGHTS), reason)


def _upper(values: FloatArray) -> NDArray[np.bool_]:
    upper: NDArray[np.bool_] = values > np.median(values)
    return upper


def _posture(bag: BagRows) -> FloatArray:
    """Along the direction in which the posture varies most, shape (N,)."""
    deviation = bag.q - bag.q.mean(axis=0)
    _, vectors = np.linalg.eigh(deviation.T @ deviation)
    return np.asarray(deviation @ vectors[:, -1])


def _speed(bag: BagRows) -> FloatArray:
    """Speed of all joints, each in its own rms, shape (N,)."""
    size = np.sqrt(np.mean(bag.v**2, axis=0))
    return np.asarray(np.sum((bag.v / np.maximum(size, 1e-9)) ** 2, axis=1))
