"""What a URDF can hold of an extended model: links, what they carry, friction; as bodies that can exist."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sysid_ros.diagnosis.extended_model import has_links, urdf_dynamics
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.effects import LinkInertia
from sysid_ros.exceptions import DataError
from sysid_ros.identification.physical_consistency import PhysicalProblem
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.model_file import EffectBlock, ModelFile
from sysid_ros.torque.torque_model import TorqueModel

_ROWS = 1500
_PRIOR = 1.0
"""Weight of the URDF's own links in directions that no motion shows: about as if each were known to a part of 1."""


def urdf_part(robot: RobotModel, model: ModelFile, train: Prepared) -> tuple[ModelFile, tuple[str, ...]]:
    """The model with payload and links in one, physical set of link inertials, and what had to be changed, in words.

    Where links with their errors are bodies that can't exist, the nearest that can are taken: nearest in the torque along the
    recordings, ``min sum |W (Y pi - Y pi_found)|^2``, over links with positive definite pseudo-inertias (Traversaro et al. 2016;
    Wensing, Kim, Slotine 2018), with the URDF's own where the motion shows nothing.
    """
    known = list(zip(model.effects, model.known_effects(robot), strict=True))
    parts = [(b, k.effect.as_links(k.theta)) for b, k in known if k.effect.replaces_links or k.effect.as_links(k.theta).any()]
    if not parts:
        return model, ()
    blocks = [b for b in model.effects if not any(b is other for other, _ in parts)]
    links = robot.pi + sum((part for _, part in parts), np.zeros((robot.n, 10))).ravel()
    notes: list[str] = []
    bad = [
        name
        for name, body in zip(robot.body_names, links.reshape(-1, 10), strict=True)
        if not inertial_parameters.is_physical(body)
    ]
    if bad:
        found = _nearest(robot, model, train, links)
        if found is None:
            links = robot.pi.copy()
            notes.append(f"extended.urdf has the URDF's own links: those found for {', '.join(bad)} are near no body.")
        else:
            links, lost = found
            notes.append(
                f"The inertials found for {', '.join(bad)} belong to no body that can exist; extended.urdf has the nearest that "
                f"can, which changes the torque along the recordings by {lost}. model.yaml has what was found."
            )
    if len(bad) > 1:
        notes.append(
            f"{len(bad)} links that no body can be are what another robot's URDF leads to as well: check that --urdf is that of "
            "the robot that was recorded."
        )
    for block, k in known:
        if not k.effect.replaces_links and any(block is other for other, _ in parts):
            carriers = np.flatnonzero(k.effect.as_links(k.theta).any(axis=1))
            names = ", ".join(robot.body_names[j] for j in carriers)
            notes.append(f"The {k.effect.label} is part of link {names} in extended.urdf.")
    effect = LinkInertia(robot)
    own = EffectBlock(effect.id, effect.joint_names, {}, links, effect.parameter_names, effect.units, None)
    if not has_links(model.effects):
        blocks += urdf_dynamics(robot)
    return replace(model, effects=(own, *blocks), uncertainty=None), tuple(notes)


def _nearest(robot: RobotModel, model: ModelFile, train: Prepared, links: FloatArray) -> tuple[FloatArray, str] | None:
    """Physical links nearest to ``links`` in torque, and how much torque that changes, in words; None where there are none."""
    Y = np.concatenate([m.regressor[:: max(1, len(m.t) * len(train.motions) // _ROWS)] for m in train.motions])
    weight = 1.0 / np.maximum(model.torque_std, 1e-9)
    rows = (Y * weight[:, None]).reshape(-1, Y.shape[2])
    information = rows.T @ rows
    try:
        problem = PhysicalProblem(TorqueModel(robot, [LinkInertia(robot)]), information, information @ links)
        theta = problem.solve(_PRIOR).theta
    except DataError:
        return None
    lost = np.sqrt(np.mean((Y @ (theta - links)) ** 2, axis=0))
    worst = int(np.argmax(lost / np.maximum(model.torque_std, 1e-9)))
    return theta, f"{lost[worst]:.2g} N m (rms) at {robot.joint_names[worst]} at most"
