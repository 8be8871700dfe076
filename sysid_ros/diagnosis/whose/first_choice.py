"""Faults of the channels of which one is likeliest, by a quick look: on a few rows, roughly."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from sysid_ros.diagnosis.channel_faults import (
    FAULT,
    OWN_FACTORS,
    Fault,
    effort_factors,
    fault_of_factors,
    faults_to_try,
)
from sysid_ros.diagnosis.whose.coarse_rows import CoarseRows
from sysid_ros.diagnosis.whose.robot_trial import Trial
from sysid_ros.robot.robot_model import RobotModel

COARSE, _TRIED = 3, 2
"""Each of so many rows for a first comparison, and how many hypotheses are compared on all of them."""


def channel_is_likelier(robot: RobotModel, rows: CoarseRows) -> bool:
    """Whether recordings are to be judged: on a few of their rows, roughly, a wrong sign or order of channels is likelier than
    none, or than another unit."""
    few, listed = Trial.of(robot, rows).every(COARSE), list(faults_to_try(robot.joint_names))
    units, others = ([x for x in listed if (x[0] == "unit") is unit] for unit in (True, False))
    best = [max((score for score, _ in _roughly(few, some)), default=-np.inf) for some in (units, others)]
    return bool(best[1] > max(few.roughly(), best[0]))


def first_choice(robot: RobotModel, trial: Trial, scaled: bool) -> list[Trial]:
    """The likeliest faults on a few rows, roughly compared; ``scaled``: another unit was undone, and is none of them."""
    few, listed = trial.every(COARSE), [x for x in faults_to_try(robot.joint_names) if not (scaled and x[0] == "unit")]
    chosen = [undone for _, undone in _roughly(few, listed)[:_TRIED]]
    if not scaled:
        # found by a search of its own, on all rows
        chosen.append(partial(_with_factors, candidates=len(listed) + 1))
    return [undone(trial) for undone in chosen]


def _roughly(few: Trial, listed: Sequence[tuple[str, Fault]]) -> list[tuple[float, Callable[[Trial], Trial]]]:
    """How likely each fault is, of those of its kind, and how it is undone, the likeliest first."""
    kinds = Counter(kind for kind, _ in listed)
    tried: list[tuple[float, Callable[[Trial], Trial]]] = []
    for kind, fault in listed:
        fault, prior = replace(fault, candidates=len(listed) + 1), float(np.log(FAULT / kinds[kind]))
        undone = partial(Trial.without, fault=fault, log_prior=prior)
        tried.append((undone(few).roughly(), undone))
    return sorted(tried, key=lambda x: -x[0])


def _with_factors(trial: Trial, candidates: int) -> Trial:
    """The same with a factor of its own on each effort undone."""
    factors = effort_factors(trial.kernels, trial.rows.tau)
    return trial.without(fault_of_factors(factors, candidates), float(np.log(OWN_FACTORS)) + factors.log_prior, factors)
