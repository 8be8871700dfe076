"""Parts of the recordings that are fitted without each other, and how parameters follow from data and a prior."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.effects import Effect
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.leg_priors import DRY, OFFSET, ROTOR, VISCOUS, standing_torque
from sysid_ros.identification.bag_sums import BagSums
from sysid_ros.identification.free_effects import place_of
from sysid_ros.identification.least_squares import Fit
from sysid_ros.identification.physical_consistency import PhysicalFit, PhysicalProblem
from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.torque.torque_model import TorqueModel

_HELD = 1e8
"""Weight beside which the data of a link count for nothing: it stands for infinity where others are finite."""


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known of the free effects before any data: mean and standard deviation, shape (p,) each."""

    mean: FloatArray
    std: FloatArray
    is_link: NDArray[np.bool_]

    @classmethod
    def of(cls, model: TorqueModel, base: FloatingBase | None = None) -> Prior:
        """The URDF's links to half their mass; friction, rotors and offsets of the size of the effort limits, or of a robot on
        legs, ``base``, of what its legs hold while it stands."""
        robot = model.robot
        mean, std, is_link = np.zeros(model.p), np.zeros(model.p), np.zeros(model.p, dtype=bool)
        limit = np.where(np.isfinite(robot.effort_limit), robot.effort_limit, TOL.usual_effort)
        by_joint = dict(zip(robot.joint_names, limit.tolist(), strict=True))
        for effect, where in zip(model.free, model.slices, strict=True):
            mean[where] = effect.nominal
            if effect.replaces_links:
                is_link[where] = True
                mass = np.maximum(effect.nominal[::10], TOL.least_link_mass)
                std[where] = np.concatenate([np.array(TOL.link_std) * m for m in mass])
                continue
            if effect.of_setup(TrunkSetup()) is not None:
                std[where] = effect.prior_std()
                continue
            if base is not None:
                torque = standing_torque(base.mass)
                std[where] = [torque * _on_legs(effect, unit) for unit in effect.units]
                continue
            sizes = [by_joint.get(place_of(name), float(limit.max())) for name in effect.parameter_names]
            std[where] = [_prior_std(unit, size) for unit, size in zip(effect.units, sizes, strict=True)]
        return cls(mean, std, is_link)

    def precision(self, weight: float = 1.0) -> FloatArray:
        """Inverse variances, shape (p,), those of the links times ``weight``."""
        return np.asarray(np.where(self.is_link, min(weight, 1e12), 1.0) / self.std**2)


def _prior_std(unit: str, effort: float) -> float:
    """Of a parameter that is no link's, by its unit, for a joint of some greatest effort."""
    if unit == "1":
        return TOL.part_std
    return effort * (TOL.inertia_std if unit in ("kg m^2", "kg") else TOL.torque_std)


def _on_legs(effect: Effect, unit: str) -> float:
    """Of a parameter of a leg's drive over the torque of standing, by its unit."""
    sizes = {"kg m^2": ROTOR, "N m s/rad": VISCOUS}
    return sizes.get(unit, DRY if effect.jumps else OFFSET)


@dataclass(frozen=True, slots=True)
class Solvers:
    """How parameters follow from data and the weights of the prior, one a link or one for all.

    The weights are tried out on many parts of the data, so this takes the prior's quadratic approximation about the URDF's links
    in place of the semidefinite program: ``theta = argmin theta' A theta / 2 - b' theta + sum_k w_k |theta_k - URDF_k|^2_H / 2``,
    H the curvature of the prior. Without physical consistency that is also the solution itself.

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

    @property
    def link_joints(self) -> list[int]:
        """Joints whose links have parameters."""
        return [int(j) for effect in self.model.free if effect.replaces_links for j in effect.joints]

    def _each(self, weights: FloatArray | float) -> FloatArray:
        """The weight of the prior of each parameter, shape (p,), 0 of those that are no link's."""
        out = np.zeros(len(self.links))
        out[self.prior.is_link] = np.repeat(np.broadcast_to(weights, len(self.link_joints)), 10)
        return out

    def approximate(self, information: FloatArray, score: FloatArray, weights: FloatArray | float) -> FloatArray:
        """theta, shape (p,), by the quadratic prior; ``inf`` keeps a link."""
        each = self._each(weights)
        kept = np.isinf(each)
        each = np.where(kept, 0.0, each)
        is_link = self.prior.is_link
        # where neither data nor prior say anything of a link, as little as this keeps the matrix regular
        least = np.where(is_link, 1e-9 / self.prior.std**2, self.prior.precision())
        root = np.sqrt(each)
        pull = root[:, None] * self.curvature * root
        A = information + pull + np.diag(least)
        side = score + pull @ self.links + least * np.where(is_link, self.links, self.prior.mean)
        theta, free = self.links.copy(), ~kept
        theta[free] = np.linalg.solve(A[np.ix_(free, free)], side[free] - A[np.ix_(free, kept)] @ theta[kept])
        return theta

    def solve(
        self, information: FloatArray, score: FloatArray, weights: FloatArray | float
    ) -> tuple[FloatArray, PhysicalFit | None]:
        """theta, shape (p,), and how it was found where it must be physical."""
        if not self.physical:
            return self.approximate(information, score, weights), None
        # what is no link keeps its own prior, or a friction that these data hardly determine takes any value that is allowed
        precision = np.where(self.prior.is_link, 0.0, self.prior.precision())
        least = float(np.min(weights, initial=math.inf))
        A, b = information + np.diag(precision), score + precision * self.prior.mean
        if math.isfinite(least):
            # links that are held more firmly than the loosest one are so by the quadratic of what is more
            more = np.sqrt(np.where(self.prior.is_link, np.minimum(self._each(weights), max(_HELD, least)) - least, 0.0))
            pull = more[:, None] * self.curvature * more
            A, b = A + pull, b + pull @ self.links
        fitted = PhysicalProblem(self.model, A, b).solve(least)
        return fitted.theta, fitted


@dataclass(frozen=True, slots=True)
class Folds:
    """Sums of parts of the recordings, each predicted by a fit to others.

    Attributes:
        sums: a part each. weight: of a row of each part, shape (parts, n). fitted: for each part, the parts that are fitted
            where it is held out. split: for each part, which way of splitting the data it belongs to.
    """

    sums: BagSums
    weight: FloatArray
    fitted: tuple[tuple[int, ...], ...]
    split: tuple[int, ...]

    @classmethod
    def of(cls, bags: Sequence[BagRows], found: Fit) -> Folds:
        """One bag after the other; where there is one only, its halves in time, posture, speed and acceleration.

        A periodic motion repeats in its second half what it showed in the first, so halves in time alone would not notice a fit
        that holds nowhere else.
        """
        if len(bags) > 1:
            every = range(len(bags))
            others = tuple(tuple(c for c in every if c != b) for b in every)
            return cls(found.sums, found.weight, others, tuple(every))
        (bag,) = bags
        sides = [np.arange(len(bag.t)) >= len(bag.t) // 2, *map(_upper, (*_postures(bag), _size(bag.v), _size(bag.a)))]
        rows = [found.rows[0] * (side == upper)[:, None] for side in sides for upper in (False, True)]
        parts = range(len(rows))
        sums = BagSums.of([bag] * len(rows), rows)
        weight = np.repeat(found.weight, len(rows), axis=0)
        return cls(sums, weight, tuple((c ^ 1,) for c in parts), tuple(c // 2 for c in parts))

    def without(self, part: int) -> tuple[FloatArray, FloatArray]:
        """Information and score of what is fitted where a part is held out, shape (p, p) and (p,)."""
        rest = self.sums.only(self.fitted[part])
        weight = self.weight[list(self.fitted[part])]
        return rest.information(weight), rest.right_side(weight)

    def errors(self, predictions: Sequence[FloatArray]) -> FloatArray:
        """Mean squared residual of every joint in every split, shape (s, n) [(N m)^2].

        Args:
            predictions: for each part, the parameters found without it, shape (p,).
        """
        shape = (max(self.split) + 1, self.weight.shape[1])
        squares, count = np.zeros(shape), np.zeros(shape)
        for part, (split, theta) in enumerate(zip(self.split, predictions, strict=True)):
            here = self.sums.only([part])
            squares[split] += here.squares(theta)[0]
            count[split] += here.count[0]
        return np.asarray(squares / np.maximum(count, 1e-12))


def _upper(values: FloatArray) -> NDArray[np.bool_]:
    upper: NDArray[np.bool_] = values > np.median(values)
    return upper


def _postures(bag: BagRows) -> FloatArray:
    """Along the directions in which the posture varies most, three at most, shape (3, N)."""
    deviation = bag.q - bag.q.mean(axis=0)
    _, vectors = np.linalg.eigh(deviation.T @ deviation)
    return np.asarray((deviation @ vectors[:, :-4:-1]).T)


def _size(values: FloatArray) -> FloatArray:
    """Of all joints, each in its own rms, shape (N,)."""
    scale = np.sqrt(np.mean(values**2, axis=0))
    return np.asarray(np.sum((values / np.maximum(scale, 1e-9)) ** 2, axis=1))
