"""From recordings to the problem: smooth motions, the nominal model's torque, the rows that it leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.conditioning import as_measured, motions
from sysid_ros.diagnosis.fit import Problem
from sysid_ros.diagnosis.recording import Recording
from sysid_ros.effects import Motion
from sysid_ros.known_effect import KnownEffect
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque_model import TorqueModel

_TURNS = 0.004
"""Speed at which the dry friction that a URDF declares has turned [rad/s]."""
INEXACT = 0.02
"""What no URDF's masses are better than, as a part."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """Recordings ready for the search.

    Attributes:
        motions: without gaps. nominal: torque of the nominal model on their grids, shape (N, n) each.
        band: their rows in the frequency domain. problem: the rows to explain. names: recording of each motion.
    """

    motions: tuple[Motion, ...]
    nominal: tuple[FloatArray, ...]
    band: Band
    problem: Problem
    names: tuple[str, ...] = ()


def prepare(robot: RobotModel, recordings: Sequence[Recording], known: Sequence[KnownEffect]) -> Prepared:
    """Smooth motions of recordings and what the nominal model (URDF, or the known effects) leaves of their torque."""
    named = [(recording.name, motion) for recording in recordings for motion in motions(robot, recording)]
    found = [motion for _, motion in named]
    model = TorqueModel(robot, [], known)
    nominal = [_nominal(model, motion) for motion in found]
    prepared = assemble(robot, [m.with_torques(m.link_torque, t) for m, t in zip(found, nominal, strict=True)], nominal)
    return replace(prepared, names=tuple(name for name, _ in named))


def assemble(robot: RobotModel, found: Sequence[Motion], nominal: Sequence[FloatArray]) -> Prepared:
    """The problem of motions whose nominal torque is known."""
    band = Band(found)
    y = band.rows([m.tau - t for m, t in zip(found, nominal, strict=True)])
    regressor = band.rows([m.regressor for m in found])
    pi = robot.pi.reshape(-1, 10)
    links = np.stack([regressor[:, :, 10 * j : 10 * j + 10] @ pi[j] for j in range(robot.n)], axis=-1)
    return Prepared(tuple(found), tuple(nominal), band, Problem(band, y, links, np.full(robot.n, INEXACT)))


def _nominal(model: TorqueModel, motion: Motion) -> FloatArray:
    robot = model.robot
    if model.known:
        return np.stack([model.known_torque(sample) for sample in motion.samples()])
    # rows in which a joint hardly moves are not judged: elsewhere dry friction has turned
    dry = robot.friction * np.tanh(motion.v / _TURNS)
    return np.asarray(motion.link_torque + robot.damping * motion.v + as_measured(dry, motion.period))
