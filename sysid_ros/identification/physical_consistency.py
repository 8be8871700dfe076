"""Physical consistency: the full standard parameters of bodies that can exist, by semidefinite programming."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.identification.log_det_least_squares import BASIS, LogDetLeastSquares, symmetric, vector
from sysid_ros.identification.tolerances import TOL
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel

_BLIND = 1e-13
"""Part of the information, each parameter in its own unit of it, under which a direction counts as unseen."""

_ROUNDED = 1e-14
"""Part of the largest entry of the information that sums of products lose in double precision."""
_MARGIN = 1e-10
"""Least eigenvalue of a pseudo-inertia over its greatest, in units of the URDF's."""


@dataclass(frozen=True, slots=True)
class PhysicalFit:
    """Parameters that a real robot can have.

    Attributes:
        theta: shape (p,). weight: of the prior, as used.
        divergence: of every link from the URDF's, shape (k,), 0 where it is the URDF's.
        at_bound: names of the parameters that would be negative without their bound.
        loss: what the constraints and the prior cost: ``(theta - free)' A (theta - free) / 2`` above the unconstrained fit.
        curvature: second derivative of the weighted prior at ``theta``, shape (p, p): what it adds to the information. Zero in
            the rows of what is no link; 0 altogether where the weight is infinite.
        notes: links of the URDF that are no bodies and what the prior takes in their place; a weight that had to be raised.
    """

    theta: FloatArray
    weight: float
    divergence: FloatArray
    at_bound: tuple[str, ...]
    loss: float
    curvature: FloatArray
    notes: tuple[str, ...]


class PhysicalProblem:
    """``min theta' A theta / 2 - b' theta + w sum_k D(P_k || U_k)`` over ``P_k`` positive definite and friction, rotors >= 0.

    P_k is the pseudo-inertia of link k, U_k the URDF's, and ``D(P || U) = tr(U^-1 P) - log det(U^-1 P) - 4`` the entropic
    divergence (Lee, Wensing, Park 2020). D depends neither on units nor on the frame of the link. With A the
    information of weighted least squares the whole cost is without unit: about a link whose ten parameters are uncertain by a
    part s of themselves has ``w = 1 / s^2``.

    Inside, every P_k is written ``C_k X_k C_k'`` with ``U_k = C_k C_k'``, so that the unknowns are near the identity whatever
    the robot's size.

    Args:
        model: whose free effects the columns of A belong to; friction and rotors are those that say ``nonnegative``.
        information: A, shape (p, p), positive semidefinite, of the data, without a prior of the links. score: b, shape (p,).

    Attributes:
        notes: links of the URDF that are no bodies and what the prior takes in their place.

    Raises:
        DataError: A and b do not fit the model, are not finite, or A is not positive semidefinite.
    """

    def __init__(self, model: TorqueModel, information: FloatArray, score: FloatArray) -> None:
        p = model.p
        if information.shape != (p, p) or score.shape != (p,):
            raise DataError(
                f"the information has shape {information.shape} and the score {score.shape}; the model has {p} parameters, so "
                f"({p}, {p}) and ({p},) are needed. Build both with this model."
            )
        if not (np.isfinite(information).all() and np.isfinite(score).all()):
            raise DataError(
                "the information or the score of the least squares is not finite; a recording holds NaN or infinite values. "
                "Leave it out."
            )
        self._names = model.parameter_names
        blocks = list(zip(model.free, model.slices, strict=True))
        links = [(effect, where) for effect, where in blocks if effect.replaces_links]
        joints = np.concatenate([effect.joints for effect, _ in links]) if links else np.zeros(0, dtype=np.intp)
        self._starts = [start for _, where in links for start in range(where.start, where.stop, 10)]
        references, self.notes = reference_bodies(model.robot, joints)
        bounded = [j for effect, where in blocks if effect.nonnegative for j in range(where.start, where.stop)]
        self._bounded = np.array(bounded, dtype=np.intp)
        self._information, self._score = 0.5 * (information + information.T), score
        # the unit of every parameter that is no link is what the data can just distinguish from zero
        power = np.maximum(np.diag(self._information), 0.0)
        self._to_theta = np.diag(np.where(power > 0.0, 1.0 / np.sqrt(np.where(power > 0.0, power, 1.0)), 1.0))
        for start, reference in zip(self._starts, references, strict=True):
            self._to_theta[start : start + 10, start : start + 10] = _by_upper_triangle(np.linalg.cholesky(reference))
        self._rows, self._target = self._square_root()
        self._solver = LogDetLeastSquares(self._rows, self._target, self._starts, self._bounded)

    def _square_root(self) -> tuple[FloatArray, FloatArray]:
        """R (r, p) and z (r,) with ``theta' A theta / 2 - b' theta = |R x - z|^2 / 2 + constant``, theta = T x."""
        information = self._to_theta.T @ self._information @ self._to_theta
        score = self._to_theta.T @ self._score
        # what is below the rounding of the largest entry is nothing, whatever its sign: a joint that stood in all of these rows
        size = np.sqrt(np.maximum(np.diag(information), max(_ROUNDED * float(np.diag(information).max()), 1e-300)))
        values, vectors = np.linalg.eigh(information / np.outer(size, size))
        if values[0] < -1e-8 * max(values[-1], 1e-300):
            raise DataError(
                f"the information matrix has the eigenvalue {values[0]:.2g} beside {values[-1]:.2g}; it must have none below "
                "zero. It is to be the sum of Y' W Y over all rows."
            )
        seen = values > _BLIND * max(values[-1], 1e-300)
        root = vectors[:, seen] * np.sqrt(values[seen])
        return (root * size[:, None]).T, (vectors[:, seen] / np.sqrt(values[seen])).T @ (score / size)

    @property
    def prior_curvature(self) -> FloatArray:
        """Second derivative of the prior at the URDF's links, for weight 1, shape (p, p)."""
        return self._curvature([np.eye(4) for _ in self._starts], 1.0)

    def solve(self, weight: float) -> PhysicalFit:
        """The parameters for one weight of the prior.

        Args:
            weight: above 0; ``inf`` for the URDF's own links.

        Raises:
            SettingsError: the weight is not positive. DataError: the solver finds no solution.
        """
        if not weight > 0.0:
            raise SettingsError(
                f"the weight of the prior is {weight}; it must be above 0, or directions that no motion shows stay undetermined."
            )
        notes = list(self.notes)
        if math.isinf(weight):
            x = self._solver.at_identity()
        else:
            found, used, words = self._solver.solve(weight)
            if used > TOL.raised * max(weight, 1.0):
                raise DataError(
                    f"no physical parameters were found with the prior's weight {weight:g}: {words}. Give the prior more weight, "
                    "or record a motion that moves every joint."
                )
            if used > weight:
                notes.append(
                    f"The data contradict every physical robot so much that the prior's weight was raised from {weight:g} to "
                    f"{used:g}; the URDF, the joints' order or the torques are likely wrong."
                )
            x, weight = found, used
            for start in self._starts:
                x[start : start + 10] = _off_the_border(x[start : start + 10])
        theta = self._to_theta @ x
        matrices = [symmetric(x[start : start + 10]) for start in self._starts]
        free, *_ = np.linalg.lstsq(self._rows, self._target, rcond=None)
        pull = self._to_theta.T @ (self._information @ theta - self._score)
        return PhysicalFit(
            theta=theta,
            weight=weight,
            divergence=np.array([np.trace(m) - np.linalg.slogdet(m)[1] - 4.0 for m in matrices]),
            at_bound=tuple(self._names[j] for j in self._bounded if x[j] <= 1e-9 and pull[j] > 1e-3),
            loss=0.5 * float(np.sum((self._rows @ (x - free)) ** 2)),
            curvature=np.zeros((len(x),) * 2) if math.isinf(weight) else self._curvature(matrices, weight),
            notes=tuple(notes),
        )

    def _curvature(self, matrices: list[FloatArray], weight: float) -> FloatArray:
        out = np.zeros((len(self._names),) * 2)
        for start, matrix in zip(self._starts, matrices, strict=True):
            block = slice(start, start + 10)
            steps = np.linalg.inv(matrix) @ BASIS
            back = np.linalg.inv(self._to_theta[block, block])
            out[block, block] = weight * back.T @ np.einsum("aij,bji->ab", steps, steps) @ back
        return out


def _off_the_border(upper: FloatArray) -> FloatArray:
    """X with no eigenvalue below a ten-thousand-millionth of its greatest, so that its product with C keeps its sign."""
    values, vectors = np.linalg.eigh(symmetric(upper))
    if values[0] >= _MARGIN * values[-1]:
        return upper
    return vector((vectors * np.maximum(values, _MARGIN * values[-1])) @ vectors.T)


def _by_upper_triangle(factor: FloatArray) -> FloatArray:
    """Derivative (10, 10) of the ten parameters by the upper triangle of X, for the pseudo-inertia C X C'."""
    return np.column_stack([inertial_parameters.from_pseudo_inertia(factor @ basis @ factor.T) for basis in BASIS])


def reference_bodies(robot: RobotModel, joints: np.ndarray[tuple[int], np.dtype[np.intp]]) -> tuple[FloatArray, tuple[str, ...]]:
    """Pseudo-inertias of the URDF's links, shape (k, 4, 4), each positive definite, and what had to be changed, in words.

    A link without mass becomes a round body with a tenth of the median mass of the others (1 kg where none has a mass). A link
    whose inertia no body can have keeps its mass and centre of mass; the second moments about it are raised to a
    ten-thousandth of their greatest.

    Args:
        robot: the model. joints: indices of the joints whose links are meant, shape (k,).
    """
    masses = robot.pi[::10]
    heavy = masses[masses > 0.0]
    spare = TOL.spare_mass * float(np.median(heavy)) if heavy.size else 1.0
    out, notes = [], []
    for joint in joints:
        theta = robot.pi[10 * int(joint) : 10 * int(joint) + 10]
        name = robot.body_names[int(joint)]
        gyration = TOL.gyration * _length(robot, int(joint))
        if not theta[0] > 0.0:
            body = inertial_parameters.from_com(spare, np.zeros(3), 2.0 * spare * gyration**2 * np.eye(3))
            notes.append(
                f"The URDF states a mass of {theta[0]:g} kg for link '{name}'; the prior takes a round body of {spare:.2g} kg."
            )
            out.append(inertial_parameters.pseudo_inertia(body))
            continue
        matrix, changed = _thickened(inertial_parameters.pseudo_inertia(theta), gyration)
        if changed:
            notes.append(
                f"The URDF's inertia of link '{name}' belongs to no body of positive density (or to one without thickness); "
                "the prior takes the nearest that has some, with the same mass and centre of mass."
            )
        out.append(matrix)
    return np.array(out).reshape(-1, 4, 4), tuple(notes)


def _thickened(matrix: FloatArray, gyration: float) -> tuple[FloatArray, bool]:
    """The pseudo-inertia with second moments about the centre of mass that are not too small, and whether they were."""
    mass, first = float(matrix[3, 3]), matrix[:3, 3]
    moments, axes = np.linalg.eigh(matrix[:3, :3] - np.outer(first, first) / mass)
    least = TOL.flattest * moments[-1] if moments[-1] > 0.0 else mass * gyration**2
    if moments[0] >= least:
        return matrix, False
    out = matrix.copy()
    out[:3, :3] = (axes * np.maximum(moments, least)) @ axes.T + np.outer(first, first) / mass
    return out, True


def _length(robot: RobotModel, joint: int) -> float:
    """Distance from a joint to the farthest of the next ones, else to the one before, else the median of the robot [m]."""
    steps = np.array([np.linalg.norm(p.translation) for p in list(robot.model.jointPlacements)[1:]])
    after = [float(steps[int(child) - 1]) for child in robot.model.children[joint + 1]]
    for length in (max(after, default=0.0), float(steps[joint]), float(np.median(steps))):
        if length > 1e-3:
            return length
    return TOL.usual_length
