"""PayloadEstimate and PayloadEvent: what the online estimation says of the payload, as values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray

STATUSES = ("ok", "warming_up", "not_excited", "not_physical", "stale", "no_payload", "inconsistent")


@dataclass(frozen=True, slots=True)
class PayloadEvent:
    """A change of the payload, found from the innovations.

    Attributes:
        t: when it happened, corrected for the delay of the filters [s].
        kind: 'pick', 'drop', 'change', or 'external_force' where no body explains it.
        mass_before, mass_after: [kg].
    """

    t: float
    kind: str
    mass_before: float
    mass_after: float


class Body(NamedTuple):
    """What is carried, in the words of a mechanic.

    Attributes:
        mass: [kg]. com: in the frame, shape (3,) [m]; NaN where the mass is zero.
        inertia_com: about the centre of mass, axes parallel to the frame, shape (3, 3) [kg m^2].
        com_covariance: by the delta method, shape (3, 3) [m^2]; infinite variance where the mass is zero.
    """

    mass: float
    com: FloatArray
    inertia_com: FloatArray
    com_covariance: FloatArray


@dataclass(frozen=True)
class PayloadEstimate:
    """The payload and how well it is known.

    Attributes:
        t: stamp of the last sample used [s].
        frame: frame of com and inertia.
        theta: ten parameters about the frame's origin, pinocchio's order, shape (10,): the physical body nearest to the estimate.
        covariance: of theta, shape (10, 10).
        status: one of :data:`STATUSES`. reason: the same in a sentence.
        observable: shape (10,), bool: determined by this motion and not by the prior.
        residual: measured minus predicted torque after the low-pass, shape (n,) [N m].
        payload_effort: joint torques that the payload costs now, shape (n,) [N m].
    """

    t: float
    frame: str
    theta: FloatArray
    covariance: FloatArray
    status: str
    reason: str
    observable: np.ndarray[tuple[int], np.dtype[np.bool_]]
    residual: FloatArray
    payload_effort: FloatArray

    @classmethod
    def unknown(cls, frame: str, prior_std: FloatArray, n: int) -> PayloadEstimate:
        """Nothing but a prior of the standard deviation (10,), on a robot of n joints."""
        return cls(
            t=0.0,
            frame=frame,
            theta=np.zeros(10),
            covariance=np.diag(prior_std**2),
            status="warming_up",
            reason="There is no estimate yet.",
            observable=np.zeros(10, dtype=bool),
            residual=np.zeros(n),
            payload_effort=np.zeros(n),
        )

    @cached_property
    def body(self) -> Body:
        """The parameters as a body, computed once."""
        mass, com, inertia = inertial_parameters.to_com(self.theta)
        if mass == 0.0:
            return Body(mass, com, inertia, np.diag(np.full(3, np.inf)))
        jacobian = inertial_parameters.com_jacobian(self.theta)
        return Body(mass, com, inertia, jacobian @ self.covariance @ jacobian.T)

    @cached_property
    def is_empty(self) -> bool:
        """True where the estimate says that nothing is carried: no payload, or a mass that no body has."""
        return self.status == "no_payload" or not self.theta[0] > 0.0

    @property
    def mass(self) -> float:
        """[kg]"""
        return float(self.theta[0])

    @property
    def com(self) -> FloatArray:
        """As of :class:`Body`."""
        return self.body.com

    @property
    def inertia_com(self) -> FloatArray:
        """As of :class:`Body`."""
        return self.body.inertia_com

    @property
    def std(self) -> FloatArray:
        """Standard deviation of theta, shape (10,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def mass_std(self) -> float:
        """[kg]"""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def com_std(self) -> FloatArray:
        """Standard deviation of the centre of mass, shape (3,) [m]."""
        return np.sqrt(np.diag(self.body.com_covariance))
