"""Reference bodies: the URDF's links as bodies that can exist, for a prior that measures distances from them."""

from __future__ import annotations

import numpy as np

from sysid_ros.identification.tolerances import TOL
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


def reference_bodies(robot: RobotModel, joints: np.ndarray[tuple[int], np.dtype[np.intp]]) -> tuple[FloatArray, tuple[str, ...]]:
    """Pseudo-inertias of the URDF's links, shape (k, 4, 4), each positive definite, and what had to be changed, in words.

    A link without mass becomes a round body with a tenth of the median mass of the others (1 kg where none has a mass). A link
    whose inertia no body can have keeps its mass and centre of mass; the second moments about it are raised to a
    ten-thousandth of their greatest.

    Args:
        robot: the model. joints: indices of the joints whose links are meant, shape (k,).
    """
    masses = robot.pi[::10]
    heavy = masses[masses > 0.0]
    spare = TOL.spare_mass * float(np.median(heavy)) if heavy.size else 1.0
    out, notes = [], []
    for joint in joints:
        theta = robot.pi[10 * int(joint) : 10 * int(joint) + 10]
        name = robot.body_names[int(joint)]
        gyration = TOL.gyration * _length(robot, int(joint))
        if not theta[0] > 0.0:
            body = inertial_parameters.from_com(spare, np.zeros(3), 2.0 * spare * gyration**2 * np.eye(3))
            notes.append(
                f"The URDF states a mass of {theta[0]:g} kg for link '{name}'; the prior takes a round body of {spare:.2g} kg."
            )
            out.append(inertial_parameters.pseudo_inertia(body))
            continue
        matrix, changed = _thickened(inertial_parameters.pseudo_inertia(theta), gyration)
        if changed:
            notes.append(
                f"The URDF's inertia of link '{name}' belongs to no body of positive density (or to one without thickness); "
                "the prior takes the nearest that has some, with the same mass and centre of mass."
            )
        out.append(matrix)
    return np.array(out).reshape(-1, 4, 4), tuple(notes)


def _thickened(matrix: FloatArray, gyration: float) -> tuple[FloatArray, bool]:
    """The pseudo-inertia with second moments about the centre of mass that are not too small, and whether they were."""
    mass, first = float(matrix[3, 3]), matrix[:3, 3]
    moments, axes = np.linalg.eigh(matrix[:3, :3] - np.outer(first, first) / mass)
    least = TOL.flattest * moments[-1] if moments[-1] > 0.0 else mass * gyration**2
    if moments[0] >= least:
        return matrix, False
    out = matrix.copy()
    out[:3, :3] = (axes * np.maximum(moments, least)) @ axes.T + np.outer(first, first) / mass
    return out, True


def _length(robot: RobotModel, joint: int) -> float:
    """Distance from a joint to the farthest of the next ones, else to the one before, else the median of the robot [m]."""
    steps = np.array([np.linalg.norm(p.translation) for p in list(robot.model.jointPlacements)[1:]])
    after = [float(steps[int(child) - 1]) for child in robot.model.children[joint + 1]]
    for length in (max(after, default=0.0), float(steps[joint]), float(np.median(steps))):
        if length > 1e-3:
            return length
    return TOL.usual_length
