"""Links that are heavier or lighter than the URDF says by more than any URDF is inexact."""

from __future__ import annotations

import numpy as np
from scipy import stats

from sysid_ros.diagnosis.backward import without_nuisance
from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.held_out_gate import whitened_cost
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import LinkInertia
from sysid_ros.robot.robot_model import RobotModel

_SURE = 1e-4
"""Probability of masses that are so far from the URDF's, were they only as inexact as any URDF's."""

_STATED = 0.01
"""Part of a mass from which it is stated."""


def with_masses(robot: RobotModel, problem: Problem, fit: Fit, held: HeldOut) -> Fit:
    """The fit with those masses as terms that its nuisance parameters have taken in silence.

    ``sum_k (dm_k / m_k / 0.02)^2`` of exact models with inexact masses is chi-squared. Where it is too large, the mass that is
    farthest off becomes a term, and so on with the rest. The terms must make held-out rows likelier than a fit with the URDF's
    masses.
    """
    if not fit.inexact:
        return fit
    known = {t.joints[0] for t in fit.terms if t.effect.replaces_links}
    found: list[Term] = []
    wider = fit
    while rest := [k for k in range(robot.n) if k not in known]:
        off = wider.theta[-len(problem.prior) :] * np.sqrt(problem.prior)
        if float(np.sum(off[rest] ** 2)) < stats.chi2.isf(_SURE, len(rest)):
            break
        worst = max(rest, key=lambda k: abs(off[k]))
        known.add(worst)
        found.append(_mass(robot, problem, worst))
        wider = problem.fit([*fit.terms, *found], wider.noise, inexact=True)
    if not found:
        return fit
    wider = without_nuisance(problem, wider)
    held.add(found)
    nominal = problem.fit(list(fit.terms), fit.noise)
    return wider if whitened_cost(wider, held, wider) < whitened_cost(nominal, held, wider) else fit


def tolerated(robot: RobotModel, fit: Fit) -> tuple[str, ...]:
    """What was taken for the inexactness that every URDF has, in a sentence."""
    if not fit.inexact:
        return ()
    part = fit.theta[-robot.n :]
    stated = [f"{robot.body_names[k]} {100.0 * part[k]:+.1f} %" for k in np.argsort(-np.abs(part)) if abs(part[k]) > _STATED]
    if not stated:
        return ()
    return (f"Taken for what a URDF is inexact by, and no cause: the masses of {', '.join(stated)}. model.yaml has them.",)


def _mass(robot: RobotModel, problem: Problem, link: int) -> Term:
    effect = LinkInertia(robot, [robot.joint_names[link]])
    own = robot.pi[10 * link : 10 * link + 10]
    return Term(effect, (link,), None, problem.nuisance[:, :, [link]].copy(), own[:, None], "scale")
