"""ContactProjection: the one step that a floating base adds, rows free of the forces on the feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.floating import contact_kernels as kernels
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.sample import FREE, FloatArray, Sample

_G = 9.81
_SHIFT = 1e-3
"""Difference of radii over which a derivative is taken [m]."""


@dataclass(slots=True)
class Stance:
    """What the feet do at one sample.

    Attributes:
        stands: shape (k,), bool: from the contact messages, else inferred.
        loaded: shape (k,), bool: inferred from the torques of the legs.
        forces: of the ground on the feet in the trunk's axes, without those of an unknown load on the legs, shape (k, 3) [N].
        normal: of the ground in the trunk's axes, shape (3,). trusted: the feet carry the robot and the rows may be used.
        slips: feet that stand move against each other. stretched: a leg that may stand is; the force along it is in no torque.
        reported: ``stands`` is from a message.
    """

    stands: NDArray[np.bool_]
    loaded: NDArray[np.bool_]
    forces: FloatArray
    normal: FloatArray
    trusted: bool
    slips: bool
    stretched: bool
    reported: bool


class ContactProjection:
    """Multiplies the rows of a floating base by a basis of the null space of the contact Jacobian of *all* feet.

    With J_b (3k, 6) and J_l (3k, n - 6) the parts of the contact Jacobian for trunk and legs, ``N' = [1, A]`` with
    ``A = -J_b' (J_l J_l')^-1 J_l`` fulfils ``N' J' = 0``, so of ``rnea = [0; tau] + J' f`` six rows are left, the balance of
    force and moment on the whole robot with the forces on the feet read from the torques of the legs::

        N' rnea(q, v, a) = A tau

    A foot in the air has no force, so to eliminate it as well costs nothing but the noise of its leg, and nothing needs to
    switch when feet land or lift: the basis is a smooth function of q, and the rows may pass a filter across a step, an impact
    or a slip. A wrong contact flag does no harm. (A basis for the feet reported to stand would jump at each step, and leaves
    the force of a foot in the equation that lands before its flag does.)

    The force acts where the foot touches: for a sphere of radius r at ``centre - r n``, with the normal n that is perpendicular
    to the lines between feet that stand, followed with the gyro in between.

    The noise of each leg's torques is in all six rows. Where it is known (:meth:`weigh`), they are multiplied by the inverse of L
    too, ``L D L' = A diag(var tau) A' + diag(var rows)``: a row is then what the ones before it do not tell, and the noise of the
    rows is not correlated.

    References: Aghili 2005 (projection by null space); Mistry, Schaal, Yamane 2009 (floating bases, section III).

    Args:
        base: the robot. farther: by how much farther below its frame each foot touches the ground than the robot says, shape (k,)
            [m]; None: as it says.
    """

    def __init__(self, base: FloatingBase, farther: FloatArray | None = None) -> None:
        self.base = base
        k, n = len(base.contact_frames), base.robot.n
        self._radius = base.foot_radius if farther is None else base.foot_radius + farther
        self.matrix: FloatArray = np.zeros((FREE, n - FREE))
        self._feet: tuple[FloatArray, FloatArray] = np.zeros((k, 3)), np.zeros((6, n))
        self._shifted = np.zeros((k, 3, n)), np.zeros((FREE, n - FREE)), np.zeros((k, 3))
        self.points = np.zeros((k, 3, n))
        self.loads = np.zeros(k)
        self._nobody = np.zeros(0)
        nothing = np.zeros(k, dtype=np.bool_)
        self._stance = Stance(nothing.copy(), nothing.copy(), np.zeros((k, 3)), np.zeros(3), False, False, False, False)
        self._weight = base.mass * _G
        self._noise: tuple[FloatArray, FloatArray] | None = None
        self._factor, self._variance = np.eye(FREE), np.ones(FREE)
        self._legs = base.contacts.carriers[:, FREE:].astype(float)
        self._t = -np.inf

    @property
    def _carrying(self) -> FloatArray:
        """1.0 for joints of legs that are loaded, shape (n - 6,)."""
        return np.asarray(self._legs[self._stance.loaded].max(axis=0, initial=0.0))

    def weigh(self, joint_variance: FloatArray, row_variance: FloatArray) -> None:
        """Make rows whose noise is not correlated from now on.

        Args:
            joint_variance: noise of the legs' torques, shape (n - 6,). row_variance: what the six rows have beside, shape (6,).
        """
        self._noise = joint_variance, row_variance

    def update(self, sample: Sample, rest: FloatArray, reported: FloatArray | None) -> Stance:
        """Make the basis for a sample; the arrays of what comes back are overwritten by the next one.

        Args:
            sample: of all n joints. rest: measured torque minus what is known, shape (n,). reported: contacts, (k,), or None.
        """
        stance = self._stance
        origins, motions = self._feet = self.base.contacts.origins(sample.q)
        fresh = not 0.0 < sample.t - self._t < 0.5
        dt = 0.0 if fresh else sample.t - self._t
        self._t = sample.t
        trusted, slips, stretched = kernels.follow(
            origins, motions, self.base.contacts.carriers, self._radius, sample.v, sample.a, rest,
            self._nobody if reported is None else reported, dt, fresh, self._weight,
            self.points, self.matrix, stance.forces, stance.normal, stance.loaded, stance.stands, self.loads,
        )  # fmt: skip
        if self._noise is not None:
            kernels.decorrelate(self.matrix, *self._noise, self._factor, self._variance)
        stance.trusted, stance.slips, stance.stretched, stance.reported = trusted, slips, stretched, reported is not None
        return stance

    def variance_at(self, sample: Sample, joint_variance: FloatArray, row_variance: FloatArray) -> FloatArray:
        """D for a sample with the vertical as normal of the ground, shape (6,): the noise of the rows."""
        origins, motions = self.base.contacts.origins(sample.q)
        points, matrix = np.zeros_like(self.points), np.zeros_like(self.matrix)
        normal = sample.a[:3] / max(float(np.linalg.norm(sample.a[:3])), 1e-9)
        kernels.touching(origins, motions, self.base.contacts.carriers, self._radius, normal, points)
        kernels.project(points, sample.tau, kernels.DAMPING, matrix, np.zeros_like(self._stance.forces))
        variance = np.zeros(FREE)
        kernels.decorrelate(matrix, joint_variance, row_variance, np.zeros((FREE, FREE)), variance)
        return variance

    def leg_torque(self, wrench: FloatArray) -> FloatArray:
        """The smallest torques of the loaded legs that hold a wrench (6,) on the trunk, shape (n - 6,) [N m]: what a payload
        costs; what is missing in a residual."""
        columns = self.matrix * self._carrying
        gram = columns @ columns.T
        # one pair of feet can't hold a moment about the line between them, and with no leg loaded nothing can be held
        regular = 1e-6 * float(np.trace(gram)) + 1e-12
        return np.asarray(columns.T @ np.linalg.solve(gram + regular * np.eye(FREE), wrench))

    def apply(self, rows: FloatArray, out: FloatArray) -> None:
        """``L^-1 N' rows`` for rows of shape (n, c), into ``out`` of shape (6, c)."""
        self.multiply(rows, out)
        self.whiten(out)

    def multiply(self, rows: FloatArray, out: FloatArray) -> None:
        """``N' rows`` for rows of shape (n, c), into ``out`` of shape (6, c)."""
        kernels.multiply(self.matrix, rows, out)

    def whiten(self, rows: FloatArray) -> None:
        """``L^-1 rows`` of shape (6, c), in place."""
        if self._noise is not None:
            kernels.solve_unit_lower(self._factor, rows)

    def by_radius(self, rest: FloatArray, foot: int | None = None) -> FloatArray:
        """Derivative of ``N' rest`` by the radius of all feet, or of one, shape (6,) [N/m], [N], at the sample of the last
        update; ``rest``: torque of the legs that is left for the contact forces, shape (n,)."""
        points, matrix, forces = self._shifted
        radius = self._radius.copy()
        radius[slice(None) if foot is None else foot] += _SHIFT
        kernels.touching(*self._feet, self.base.contacts.carriers, radius, self._stance.normal, points)
        kernels.project(points, rest, kernels.DAMPING, matrix, forces)
        return np.asarray((matrix - self.matrix) @ rest[FREE:] / _SHIFT)

    def wrench(self, rows: FloatArray) -> FloatArray:
        """Force and moment on the trunk from the six rows, shape (6,): the inverse of the last step of :meth:`apply`."""
        return np.asarray(self._factor @ rows)
