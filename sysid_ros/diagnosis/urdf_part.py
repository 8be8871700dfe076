"""What a URDF can hold of an extended model: links, what they carry, friction; as bodies that can exist."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sysid_ros.diagnosis.extended_model import urdf_dynamics
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.effects import LinkInertia, Payload
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
    links, changed = _links(robot, model)
    blocks = [b for b in model.effects if b.effect not in ("link_inertia", "payload")]
    if not changed:
        return model, ()
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
    if any(b.effect == "payload" for b in model.effects):
        notes.append(f"The payload is part of link {_carrier(robot, model)} in extended.urdf.")
    effect = LinkInertia(robot)
    own = EffectBlock(effect.id, effect.joint_names, {}, links, effect.parameter_names, effect.units, None)
    if not any(b.effect == "link_inertia" for b in model.effects):
        blocks += urdf_dynamics(robot)
    return replace(model, effects=(own, *blocks), uncertainty=None), tuple(notes)


def _links(robot: RobotModel, model: ModelFile) -> tuple[FloatArray, bool]:
    """Inertials of all links with what they carry, shape (10 n,), and whether they are not the URDF's."""
    links, changed = robot.pi.copy(), False
    for known in model.known_effects(robot):
        if isinstance(known.effect, LinkInertia):
            changed = True
            links.reshape(-1, 10)[known.effect.joints] += (known.theta - known.effect.nominal).reshape(-1, 10)
    for known in model.known_effects(robot):
        if type(known.effect) is Payload:
            changed = True
            frame = robot.model.frames[known.effect.frame_index]
            j = frame.parentJoint - 1
            placed = inertial_parameters.move(
                known.theta, np.array(frame.placement.rotation), np.array(frame.placement.translation)
            )
            links[10 * j : 10 * j + 10] += placed
    return links, changed


def _carrier(robot: RobotModel, model: ModelFile) -> str:
    settings = next(b.settings for b in model.effects if b.effect == "payload")
    frame = robot.model.frames[robot.frame_id(settings.get("frame") or robot.default_frame)]
    return str(robot.body_names[frame.parentJoint - 1])


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
