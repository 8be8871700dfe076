"""Friction with a nonlinear knob, by variable projection: the knob is searched for, all that is linear follows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sysid_ros.effects import (
    CoulombFriction,
    Effect,
    LinkInertia,
    LoadDependentFriction,
    RotorInertia,
    StribeckFriction,
    TorqueOffset,
    ViscousFriction,
)
from sysid_ros.identification.friction_choice import joints_that_need
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import fit
from sysid_ros.identification.normal_equations import NormalEquations
from sysid_ros.identification.result import Knob
from sysid_ros.identification.rows import BagRows
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel

if TYPE_CHECKING:
    from sysid_ros.identification.identify import Choices

FRICTIONS = ("auto", "coulomb", "stribeck", "load_dependent")

_COARSE, _FINE = 6, 5
_SWEEPS = 4
_EVIDENCE = 3.84
"""Of chi-squared with one degree of freedom at 95 %: how much worse all other values must be for the data to tell the knob."""

Indices = NDArray[np.intp]


def search_friction(
    robot: RobotModel,
    choices: Choices,
    rows: Callable[[TorqueModel], Sequence[BagRows]],
    progress: Callable[[str], None],
) -> tuple[list[Effect], list[Knob]]:
    """Effects for the dry friction in place of Coulomb's, and what was searched for; both empty for plain Coulomb friction.

    With "auto" a joint's friction grows with its load where that predicts what was not fitted better than Coulomb's friction
    does, see :func:`~sysid_ros.identification.friction_choice.joints_that_need`; with "load_dependent", on every joint. The load
    is the URDF's torque, as in the effect.

    With "stribeck" the Stribeck velocity of each joint minimises the weighted sum of squares that is left when all linear
    parameters are solved for (variable projection: Golub, Pereyra 1973). A joint's velocity touches that joint's rows only, so
    the joints are searched in turn until none changes, first on a coarse grid over the effect's range, then on a fine one around
    the best. Joints on which it predicts no better keep Coulomb's friction.

    Args:
        rows: rows of the recordings for a model.
    """
    if choices.friction == "coulomb":
        return [], []
    if choices.friction == "load_dependent":
        return [LoadDependentFriction(robot)], []
    if choices.friction == "auto":
        progress("choosing the friction of each joint")
        model = _with_links(robot, [LoadDependentFriction(robot)])
        needed = joints_that_need(
            model, rows(model), [_index(model, "mu", name) for name in robot.joint_names], (), choices.method
        )
        return _mixed(robot, [LoadDependentFriction(robot, [robot.joint_names[j] for j in needed])] if needed else []), []
    knob = next(k for k in StribeckFriction.knobs if k.name == "vs")
    grids = [np.geomspace(knob.low, knob.high, _COARSE)] * robot.n
    progress("searching the Stribeck velocities")
    best, _ = _search(robot, grids, rows)
    ratio = (knob.high / knob.low) ** (1.0 / (_COARSE - 1))
    grids = [np.clip(np.geomspace(x / ratio, x * ratio, _FINE), knob.low, knob.high) for x in best]
    best, told = _search(robot, grids, rows)
    curves = [StribeckFriction(robot, (name,), vs=float(x)) for name, x in zip(robot.joint_names, best, strict=True)]
    # beside Coulomb's friction, what is above it at low speed is the second of the two curves alone
    model = _with_links(robot, [CoulombFriction(robot), *curves])
    starts = [where.start for effect, where in zip(model.free, model.slices, strict=True) if effect in curves]
    needed = joints_that_need(model, rows(model), [k + 1 for k in starts], starts, choices.method)
    units = np.where(robot.is_prismatic, "m/s", "rad/s")
    knobs = [Knob("vs", robot.joint_names[j], float(best[j]), str(units[j]), bool(told[j])) for j in needed]
    return _mixed(robot, [curves[j] for j in needed]), knobs


def _with_links(robot: RobotModel, dry: Sequence[Effect]) -> TorqueModel:
    return TorqueModel(robot, [LinkInertia(robot), ViscousFriction(robot), *dry, RotorInertia(robot), TorqueOffset(robot)])


def _index(model: TorqueModel, symbol: str, joint: str) -> int:
    return model.parameter_names.index(f"{symbol}[{joint}]")


def _mixed(robot: RobotModel, chosen: Sequence[Effect]) -> list[Effect]:
    """The effects chosen for some joints, and Coulomb's friction on the others; none where none was chosen."""
    if not chosen:
        return []
    taken = {name for effect in chosen for name in effect.joint_names}
    others = [name for name in robot.joint_names if name not in taken]
    return [*([CoulombFriction(robot, others)] if others else []), *chosen]


def _search(
    robot: RobotModel, grids: Sequence[FloatArray], rows: Callable[[TorqueModel], Sequence[BagRows]]
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The best value of each joint, and whether the ends of its grid are significantly worse."""
    names = robot.joint_names
    candidates = [[StribeckFriction(robot, (name,), vs=float(x)) for x in grid] for name, grid in zip(names, grids, strict=True)]
    others: list[Effect] = [LinkInertia(robot), ViscousFriction(robot), RotorInertia(robot), TorqueOffset(robot)]
    model = TorqueModel(robot, [*others, *(e for of_joint in candidates for e in of_joint)])
    bags = rows(model)
    fixed = np.arange(model.slices[len(others) - 1].stop)
    starts = iter(model.slices[len(others) :])
    where: list[list[Indices]] = [[np.arange((s := next(starts)).start, s.stop) for _ in of_joint] for of_joint in candidates]
    chosen = np.array([len(grid) // 2 for grid in grids])

    def columns(choice: Sequence[int]) -> Indices:
        return np.concatenate([fixed, *(where[j][k] for j, k in enumerate(choice))])

    prior = Prior.of(model)
    first = columns(chosen.tolist())
    small = [replace(bag, Y=bag.Y[:, :, first]) for bag in bags]
    weight = fit(small, prior.mean[first], prior.std[first]).weight
    equations = NormalEquations.of(bags)
    information, side = equations.information(weight), equations.right_side(weight)
    constant = float(np.sum(weight * equations.power))
    precision = prior.precision()

    def cost(choice: Sequence[int]) -> float:
        c = columns(choice)
        A = information[np.ix_(c, c)] + np.diag(precision[c])
        b = side[c] + precision[c] * prior.mean[c]
        return constant + float(precision[c] @ prior.mean[c] ** 2 - b @ np.linalg.solve(A, b))

    costs = [np.zeros(len(grid)) for grid in grids]
    for _ in range(_SWEEPS):
        before = chosen.copy()
        for j, grid in enumerate(grids):
            for k in range(len(grid)):
                trial = chosen.copy()
                trial[j] = k
                costs[j][k] = cost(trial.tolist())
            chosen[j] = int(np.argmin(costs[j]))
        if np.array_equal(before, chosen):
            break
    best = np.array([grid[k] for grid, k in zip(grids, chosen, strict=True)])
    told = np.array([min(c[0], c[-1]) - c.min() > _EVIDENCE for c in costs])
    return best, told
