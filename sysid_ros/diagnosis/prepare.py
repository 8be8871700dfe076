"""From recordings to the problem: smooth motions, the nominal model's torque, the rows that it leaves; and torques with a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.effects import Acts, Depends, Motion
from sysid_ros.robot.inertial_parameters import by_centre
from sysid_ros.robot.link_inexactness import by_moments, principal_directions
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import as_measured, motions
from sysid_ros.signals.driver_filter import ORDERS, driver_filter
from sysid_ros.signals.recording import Recording
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel

_TURNS = np.geomspace(0.004, 0.15, 18)
"""Speeds at which the dry friction that a URDF declares may have turned [rad/s]: a URDF does not say, and gears and simulators
differ."""
_LATE = (0.001, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12)
"""How late efforts may be, as a delay or by a low-pass [s]."""
_NARROWED = 12
"""Steps in which that is narrowed."""
_SETTLES = 0.5
"""A low-pass has forgotten how it began after so long [s]."""
INEXACT = 0.02
"""What no URDF's masses are better than, as a part."""
MOMENTS = 5.0
"""Parts of a moment of inertia about the centre of mass for each part of a mass: a URDF's are those of a body without motors and
cables, or of a solid one."""
ARM = 0.1
"""Length of which that part is what no URDF's centres of mass are better than [m]."""
_MASSES, _PLACES = (0.3, 1.0, 2.0, 4.0), (0.05, 0.3, 1.0, 2.0, 4.0)
SCALES = ((0.0, 0.0), *product(_MASSES, _PLACES))
"""How inexact masses and centres of mass of all links may be, in units of the usual inexactness; first links that are exact.

Either may be so without the other, each size twice the last where robots differ: a link that is 7 mm off is one of links that are
3 mm off, and a cause beside links that are 2 mm off. With one size for both, masses that were all 2 % off were told as one link
that was 5 % off: three coordinates a link that are exact cost a prediction more than one wrong link does."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """Recordings ready for the search.

    Attributes:
        motions: without gaps. nominal: torque of the nominal model on their grids, shape (N, n) each.
        band: their rows in the frequency domain. problem: the rows to explain. names: recording of each motion.
        turns: speed at which the dry friction that the URDF declares turns, of each joint, shape (n,) [rad/s].
    """

    motions: tuple[Motion, ...]
    nominal: tuple[FloatArray, ...]
    band: Band
    problem: Problem
    names: tuple[str, ...] = ()
    turns: FloatArray | None = None

    def less(self, torques: Sequence[FloatArray]) -> Prepared:
        """The same with so much less of the measured torque, shape (N, n) a motion."""
        found = [m.less(x) for m, x in zip(self.motions, torques, strict=True)]
        made = assemble(found[0].robot, found, self.nominal, self.band.silent, self.problem.gains)
        return replace(made, names=self.names, turns=self.turns)


def prepare(
    robot: RobotModel,
    recordings: Sequence[Recording],
    known: Sequence[KnownEffect],
    turns: FloatArray | None = None,
    silent: Sequence[int] = (),
    gains: Sequence[int] = (),
) -> Prepared:
    """Smooth motions of recordings and what the nominal model (URDF, or the known effects) leaves of their torque.

    Args:
        turns: as :class:`Prepared` has it, where it was found before. silent: joints whose efforts hold nothing of their torque.
        gains: those whose efforts may be in a unit of their own.
    """
    named = [(recording.name, motion) for recording in recordings for motion in motions(robot, recording)]
    found = [motion for _, motion in named]
    turns = _turns(robot, found) if turns is None else turns
    model = TorqueModel(robot, [], known, turns=turns)
    nominal = [_nominal(model, motion) for motion in found]
    moved = [m.with_torques(m.link_torque, t) for m, t in zip(found, nominal, strict=True)]
    prepared = assemble(robot, moved, nominal, silent, gains)
    return replace(prepared, names=tuple(name for name, _ in named), turns=turns)


def assemble(
    robot: RobotModel,
    found: Sequence[Motion],
    nominal: Sequence[FloatArray],
    silent: Sequence[int] = (),
    gains: Sequence[int] = (),
) -> Prepared:
    """The problem of motions whose nominal torque is known; ``silent`` and ``gains`` as in :func:`prepare`."""
    band = Band(found, silent=silent)
    y = band.rows([m.tau - t for m, t in zip(found, nominal, strict=True)])
    links = inexact_links(robot)
    columns = band.rows([m.regressor @ links.basis for m in found])
    return Prepared(tuple(found), tuple(nominal), band, Problem(band, y, columns, *links[1:], links.basis, gains, nominal))


class InexactLinks(NamedTuple):
    """What no model's links get exactly right.

    Attributes:
        basis: change of the links' inertials by each parameter, shape (10 n, c). std: of the parameters, shape (c,).
        scaled_by: which of the two sizes of :data:`SCALES` each of them follows, 1 (masses) or 2 (places), shape (c,).
    """

    basis: FloatArray
    std: FloatArray
    scaled_by: NDArray[np.intp]


def inexact_links(robot: RobotModel, floats: bool = False) -> InexactLinks:
    """All ten inertials of each link by a factor, the centre of mass of each by three lengths in units of :data:`ARM`, and the
    principal moments of inertia about it, in the directions that make torque.

    Args:
        floats: on a floating base; the moments of its many small links make no torque to speak of, and are left out.
    """
    n = robot.n
    basis, moments = np.zeros((10 * n, 4 * n)), np.zeros((10 * n, 3 * n))
    for j in range(n):
        own = slice(10 * j, 10 * j + 10)
        basis[own, j] = robot.pi[own]
        basis[own, n + 3 * j : n + 3 * j + 3] = ARM * by_centre(robot.pi[own])
        moments[own, 3 * j : 3 * j + 3] = MOMENTS * by_moments(robot.pi[own])
    moments = moments @ principal_directions(robot, moments) if not floats else moments[:, :0]
    scaled_by = np.repeat([1, 2, 1], [n, 3 * n, moments.shape[1]])
    return InexactLinks(np.concatenate([basis, moments], axis=1), np.full(len(scaled_by), INEXACT), scaled_by)


def _nominal(model: TorqueModel, motion: Motion) -> FloatArray:
    torque = model.torques_along(motion)
    # where nothing is known but the URDF its friction may turn within less than the low-pass of the torques lets through
    return torque.total if model.known else torque.total - torque.jumps + as_measured(torque.jumps, motion.period)


def _turns(robot: RobotModel, found: Sequence[Motion]) -> FloatArray:
    """The speeds with which declared friction leaves the least of each joint's torque, whatever its level, shape (n,).

    Efforts may be late, all of them alike: a sign that is published late looks like one that turns slowly.
    """
    rubs = [int(j) for j in np.flatnonzero(robot.friction > 0.0)]
    out = np.full(robot.n, _TURNS[0])
    if not rubs:
        return out
    dry = {j: [[as_measured(smoothed_sign(m.v[:, [j]], x), m.period)[:, 0] for m in found] for x in _TURNS] for j in rubs}

    def left(late: float, order: int) -> FloatArray:
        return np.array([_left(found, j, dry[j], late, order) for j in rubs])

    def cost(late: float, order: int) -> float:
        return float(np.sum(np.log(np.min(left(late, order), axis=1))))

    ways = [(0.0, 0)]
    for order in (0, *ORDERS):
        near = int(np.argmin([cost(x, order) for x in _LATE]))
        bounds = _LATE[max(near - 1, 0)], _LATE[min(near + 1, len(_LATE) - 1)]
        best = optimize.minimize_scalar(cost, bounds=bounds, args=(order,), method="bounded", options={"maxiter": _NARROWED})
        ways.append((float(best.x), order))
    out[rubs] = _TURNS[np.argmin(left(*min(ways, key=lambda way: cost(*way))), axis=1)]
    return out


def _left(found: Sequence[Motion], joint: int, dry: Sequence[Sequence[FloatArray]], late: float, order: int) -> FloatArray:
    """What each of several forms of dry friction leaves of a joint's torque, beside viscous friction and an offset, where efforts
    are late by a time (order 0), or behind a low-pass with that lag: a mean square, shape (forms,)."""

    def published(motion: Motion, values: FloatArray) -> FloatArray:
        if order:
            return driver_filter(values, motion.period / late, order)
        return np.asarray(np.interp(motion.t - late, motion.t, values)) if late else values

    def settled(each: Sequence[FloatArray]) -> FloatArray:
        return np.concatenate([x[min(round(_SETTLES / m.period), len(x) // 2) :] for m, x in zip(found, each, strict=True)])

    def whole(values: Sequence[FloatArray]) -> FloatArray:
        return settled([published(m, x) for m, x in zip(found, values, strict=True)])

    rest = settled([m.tau[:, joint] for m in found]) - whole([m.link_torque[:, joint] for m in found])
    speed = whole([m.v[:, joint] for m in found])
    others = np.column_stack([speed, np.ones(len(speed))])
    basis = np.linalg.qr(others)[0]
    rest = rest - basis @ (basis.T @ rest)
    out = []
    for form in dry:
        x = whole(form)
        x = x - basis @ (basis.T @ x)
        out.append(float(rest @ rest - (x @ rest) ** 2 / max(float(x @ x), 1e-300)) / len(rest))
    return np.maximum(out, 1e-300)


def torques(
    library: Library, fit: Fit, links: Sequence[FloatArray], nominal: Sequence[FloatArray]
) -> tuple[list[FloatArray], list[FloatArray], list[FloatArray], list[FloatArray], list[FloatArray]]:
    """Torque on the link side and on the motor side of the joints with the effects of a fit, what effects of single joints have
    in the latter, the latter with what was measured where a joint stands, and what the sensor adds, shape (N, n) a motion. Links
    as inexact as the fit has them are a part of both sides.

    Where a joint stands dry friction holds any torque, which its sensor alone tells.
    """
    link, drive, free = ([x.copy() for x in links], [x.copy() for x in nominal], [np.zeros_like(x) for x in nominal])
    given, added = [motion.tau.copy() for motion in library.motions], [np.zeros_like(x) for x in nominal]
    for term in fit.terms:
        theta = term.theta_of_effect(fit.theta_of(term))
        for i, motion in enumerate(library.motions):
            torque = term.effect.torque_along(motion, theta)
            if term.effect.acts is Acts.MEASUREMENT:
                given[i] -= torque
                added[i] += torque if Depends.SENSOR not in term.effect.depends_on else 0.0
                continue
            drive[i] += torque
            if term.row is not None:
                free[i] += torque
            if term.effect.acts is Acts.LINK:
                link[i] += torque
    for i, motion in enumerate(library.motions if fit.inexact else ()):
        torque = motion.regressor @ fit.links_off
        link[i] += torque
        drive[i] += torque
    held = [np.where(moving, x, tau) for moving, x, tau in zip(library.band.moving, drive, given, strict=True)]
    return link, drive, free, held, added


def before_gains(fit: Fit) -> Fit:
    """A fit whose gains are of the links' torque alone, with what single joints have beside it as it is before those gains."""
    theta = fit.theta.copy()
    for gain in (t for t in fit.terms if t.effect.of_own_torque):
        factor = 1.0 + float(fit.theta_of(gain)[0])
        for term, where in zip(fit.terms, fit.slices, strict=True):
            if term.row == gain.row and term.effect.acts is not Acts.MEASUREMENT:
                theta[where] /= factor
    return replace(fit, theta=theta)


def links_changed(fit: Fit) -> FloatArray:
    """What a fit adds to the links' inertials all the time, payload included, shape (10 n,)."""
    change = fit.links_off.copy()
    for term in fit.terms:
        theta = term.theta_of_effect(fit.theta_of(term))
        # a term of links is a change of them already
        nothing = term.effect.as_links(np.zeros(term.effect.p))
        change += (term.effect.as_links(theta) - nothing).ravel()
    return change


def scales_beside(scale: int) -> list[int]:
    """Those of :data:`SCALES` that are a step from one."""
    masses, places = SCALES[scale]

    def near(sizes: tuple[float, ...], a: float, b: float) -> bool:
        order = (0.0, *sizes)
        return abs(order.index(a) - order.index(b)) <= 1

    return [k for k, x in enumerate(SCALES) if k != scale and near(_MASSES, x[0], masses) and near(_PLACES, x[1], places)]
