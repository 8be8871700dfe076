"""excite: the motion of an arm from which its parameters can be identified best."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from sysid_ros.excitation.arm_rows import ArmRows
from sysid_ros.excitation.criteria import Criteria, ExcitationCriteria
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.feasibility import Feasibility, Use
from sysid_ros.excitation.fourier_trajectory import FourierBasis, FourierTrajectory
from sysid_ros.excitation.motion_limits import JointLimit, MotionLimits
from sysid_ros.excitation.optimiser import F, MotionConstraints
from sysid_ros.excitation.search import STAGES, ExcitationSearch
from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.robot.collision_model import CollisionModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel

_POSTURES_EACH = 5


@dataclass(frozen=True, slots=True)
class Excitation:
    """The motion that was found, and what is known of it.

    Attributes:
        trajectory: the motion.
        criteria: its criteria. random: those of random feasible motions, the best D first. random_motions: these motions.
        use: what it uses of its limits at 1 ms.
        limits: these limits. pairs: of links, in the order of ``use.room``. clearance: what each must keep, shape (P,) [m].
        parameters: names of the independent base parameters. weight: of each joint's rows, shape (n,).
        start_d: D that each local search ended with.
        notes: what was assumed or left out, a sentence each. warnings: why the motion may not be good enough.
    """

    trajectory: FourierTrajectory
    criteria: Criteria
    random: tuple[Criteria, ...]
    random_motions: tuple[FourierTrajectory, ...]
    use: Use
    limits: MotionLimits
    pairs: tuple[tuple[str, str], ...]
    clearance: FloatArray
    parameters: tuple[str, ...]
    weight: FloatArray
    start_d: tuple[float, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


def steps(settings: ExcitationSettings) -> int:
    """How often :func:`excite` calls ``progress`` at most."""
    return settings.comparison + settings.starts * sum(stage.iterations for stage in STAGES)


def excite(
    model: TorqueModel,
    settings: ExcitationSettings | None = None,
    given: Mapping[str, JointLimit] | None = None,
    collision: CollisionModel | None = None,
    start: FloatArray | None = None,
    progress: Callable[[int], None] = lambda count: None,
) -> Excitation:
    """The feasible Fourier motion with the largest D, of several local searches from the best of random feasible motions.

    Args:
        model: whose free effects are to be identified, see :func:`sysid_ros.identification.free_model`.
        settings: what the motion is to be. given: limits of joints that replace the URDF's.
        collision: shapes to keep apart; None: they are not checked.
        start: where the motion starts and ends, shape (n,) [rad or m]; None: anywhere.
        progress: called with the number of steps done, :func:`steps` in all.

    Raises:
        SettingsError: a setting or limit is not allowed.
        DataError: no motion is feasible.
    """
    settings = settings or ExcitationSettings()
    limits = MotionLimits(model.robot, settings, given)
    basis = FourierBasis(settings.duration, settings.base_period, settings.harmonics, anchored=start is not None)
    feasibility = Feasibility(limits, collision)
    if start is not None:
        feasibility.require_posture(start)
    information = ExcitationCriteria(ArmRows(model, limits))
    search = ExcitationSearch(information, feasibility, basis, MotionConstraints)
    tries = (settings.comparison, _POSTURES_EACH)
    if start is None:
        postures = feasibility.postures(np.random.default_rng(settings.seed), tries[0] * tries[1]).reshape(*tries, -1)
    else:
        postures = np.tile(start, (*tries, 1))
    found = searched(search, settings, postures, progress)
    return Excitation(
        trajectory=found.best,
        criteria=found.criteria,
        random=tuple(c for c, _ in found.random),
        random_motions=tuple(motion for _, motion in found.random),
        use=feasibility.use(found.best),
        limits=limits,
        pairs=feasibility.collision.pairs if feasibility.collision else (),
        clearance=feasibility.collision.clearance if feasibility.collision else np.zeros(0),
        parameters=information.names,
        weight=information.weight,
        start_d=found.start_d,
        notes=(*limits.notes, *(collision.notes if collision else ())),
        warnings=tuple(doubts(found.criteria)),
    )


@dataclass(frozen=True, slots=True)
class Searched:
    """The best motion of a search, its criteria, those of the random motions, the best first, and D of each start."""

    best: FourierTrajectory
    criteria: Criteria
    random: tuple[tuple[Criteria, FourierTrajectory], ...]
    start_d: tuple[float, ...]


def searched(
    search: ExcitationSearch[F], settings: ExcitationSettings, postures: FloatArray, progress: Callable[[int], None]
) -> Searched:
    """Random motions about some of the postures, shape (comparison, tries, n), and the best ones improved."""
    generator = np.random.default_rng(settings.seed)
    motions: list[tuple[Criteria, FourierTrajectory]] = []
    for some in postures:
        motion = search.random(generator, some)
        motions.append((search.criteria(motion), motion))
        progress(1)
    motions.sort(key=lambda m: -m[0].d)
    best_criteria, best = motions[0]
    found = []
    for _, begin in motions[: settings.starts]:
        left = sum(stage.iterations for stage in search.stages)

        def step() -> None:
            nonlocal left
            left -= 1
            progress(1)

        motion = search.improve(begin, step)
        progress(left)
        criteria = search.criteria(motion)
        found.append(criteria.d)
        if criteria.d > best_criteria.d:
            best, best_criteria = motion, criteria
    return Searched(best, best_criteria, tuple(motions), tuple(found))


def doubts(criteria: Criteria) -> list[str]:
    """Why a motion may not be good enough, a sentence each."""
    if criteria.condition_number <= TOLERANCES.conditioned:
        return []
    return [
        f"The condition number is {criteria.condition_number:.0f}; under {TOLERANCES.conditioned:.0f} is wanted. Allow a longer "
        "period, more harmonics, or more of the joints' limits."
    ]
