"""excite_trunk: the motion of a trunk over feet that stand from which a robot on legs can be identified best."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.excitation.criteria import Criteria, ExcitationCriteria
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.excite import searched
from sysid_ros.excitation.feasibility import Use
from sysid_ros.excitation.fourier_trajectory import FourierBasis, FourierTrajectory
from sysid_ros.excitation.motion_limits import KINDS, JointLimit, MotionLimits
from sysid_ros.excitation.optimiser import Stage
from sysid_ros.excitation.search import ExcitationSearch
from sysid_ros.excitation.trunk_dynamics import TrunkDynamics
from sysid_ros.excitation.trunk_limits import TrunkConstraints, TrunkFeasibility, TrunkLimits
from sysid_ros.excitation.trunk_rows import TrunkRows
from sysid_ros.floating.planted_feet import PlantedFeet
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.torque.torque_model import TorqueModel

_STAGES = (Stage(60.0, 30, False), Stage(300.0, 15, True))
"""Shorter than for arms, whose constraints cost less: each iteration is half a second."""
_DIFFERENCE = 1e-3
"""Over which joint velocities and accelerations are taken from positions [s]."""


@dataclass(frozen=True, slots=True)
class TrunkExcitation:
    """The motion that was found, and what is known of it.

    Attributes:
        trajectory: of the trunk's pose, six columns, see :class:`.PlantedFeet`. feet: the robot and where it stands.
        criteria: of the motion, of which d and a are told. random: those of random feasible motions, the best D first.
        limits: of joints and feet. use: what the motion uses of them. start_d: D that each local search ended with.
        notes: what was assumed, a sentence each.
    """

    trajectory: FourierTrajectory
    feet: PlantedFeet
    criteria: Criteria
    random: tuple[Criteria, ...]
    limits: TrunkLimits
    use: Use
    start_d: tuple[float, ...]
    notes: tuple[str, ...]

    def joints(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Positions, velocities and accelerations of the legs' joints at times t [s], shape (len(t), n - 6) each."""
        h = _DIFFERENCE
        before, now, after = (self.feet.joints(self.trajectory.sample(t + shift)[0])[0] for shift in (-h, 0.0, h))
        return now, (after - before) / (2.0 * h), (after - 2.0 * now + before) / h**2

    @property
    def joint_use(self) -> FloatArray:
        """Largest part of each limit of the joints, shape (4, n - 6), in the order of :data:`.motion_limits.KINDS`."""
        return self.use.limits[: len(KINDS) * self.feet.base.legs.n].reshape(len(KINDS), -1)

    @property
    def feet_use(self) -> FloatArray:
        """Largest part of the friction cone of each foot, and of the stretching of its leg, shape (2, k)."""
        return self.use.limits[-2 * len(self.feet.legs) :].reshape(2, -1)


def excite_trunk(
    model: TorqueModel,
    precision: FloatArray,
    feet: PlantedFeet,
    settings: ExcitationSettings,
    given: Mapping[str, JointLimit] | None = None,
    progress: Callable[[int], None] = lambda count: None,
) -> TrunkExcitation:
    """The feasible Fourier motion of the trunk with the largest D; see :func:`.excite.excite`, which searches alike.

    Args:
        model: whose free effects are to be identified, see :func:`sysid_ros.identification.free_effects.free_model_on_legs`.
        precision: of what is known of them, shape (p, p). feet: the robot and where it stands.
        settings: what the motion is to be. given: limits of joints that replace the URDF's.
        progress: called with the number of steps done, :func:`.excite.steps` in all.

    Raises:
        SettingsError: a setting or limit is not allowed.
        DataError: the robot can't stand in its posture.
    """
    joints = MotionLimits(feet.base.legs, settings, given)
    limits = TrunkLimits(TrunkDynamics(feet), joints, settings)
    _require_standing(limits)
    basis = FourierBasis(settings.duration, settings.base_period, settings.harmonics, anchored=True)
    feasibility = TrunkFeasibility(limits)
    information = ExcitationCriteria(TrunkRows(model, limits, precision, settings.duration))
    search = ExcitationSearch(information, feasibility, basis, TrunkConstraints, _STAGES)
    found = searched(search, settings, np.zeros((settings.comparison, 1, FREE)), progress)
    return TrunkExcitation(
        trajectory=found.best,
        feet=feet,
        criteria=found.criteria,
        random=tuple(c for c, _ in found.random),
        limits=limits,
        use=feasibility.use(found.best),
        start_d=found.start_d,
        notes=(*feet.base.notes, *joints.notes),
    )


def _require_standing(limits: TrunkLimits) -> None:
    still = np.zeros((1, FREE))
    use = limits.most(still, still, still)
    worst = int(np.argmax(use))
    if use[worst] > 1.0:
        raise DataError(
            f"the robot can't stand at the start: {100.0 * use[worst]:.0f} % of what is allowed is used of the "
            f"{limits.names[worst]}. Choose another start, or allow more of the limits."
        )
