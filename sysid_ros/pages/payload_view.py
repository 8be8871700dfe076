"""The robot of a replay: its recorded motion, and what it carried, from the pick to the drop."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sysid_ros.online.carried import Carried
from sysid_ros.online.replay import Replay
from sysid_ros.pages.robot_view import Ellipsoid, Track, View, ellipsoid, view
from sysid_ros.robot.appearance import in_joint
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.rotation import turned_by
from sysid_ros.sample import FloatArray
from sysid_ros.signals.postures import Postures

_MOMENTS = [4, 6, 9]
_CAPTION = (
    "The recorded motion. What was carried is drawn as the homogeneous ellipsoid of the mass and inertia that were found, as a "
    "ball of water of that mass where the motion does not determine the inertia; the outline is wider by the 95 % interval of "
    "the centre of mass."
)


def payload_view(robot: RobotModel | None, urdf: Path | None, result: Replay) -> View | None:
    """The view; None where there is no robot or no motion. Its clock begins at the first estimate, as the figure's does.

    Args:
        urdf: the robot's file, beside which meshes are looked for.
    """
    if robot is None or result.postures is None or not result.series:
        return None
    start, p = result.series[0].t, result.postures
    track = Track("", p.t - start, p.q, trunk_orientation(robot, p))
    bodies = tuple(_body(robot, one, start) for one in result.payloads)
    nothing = "" if bodies else " Nothing that it carried was found."
    trunk = " The trunk turns as the IMU says; where it stands is not known." if track.orientation is not None else ""
    return view(robot, urdf, [track], (_CAPTION if bodies else "The recorded motion.") + nothing + trunk, ellipsoids=bodies)


def trunk_orientation(robot: RobotModel, p: Postures) -> FloatArray | None:
    """Orientation of the base in the world, x, y, z, w, shape (N, 4), from that of the IMU's link; None where it is not known, or
    the link is not fixed to the base."""
    if p.orientation is None or (p.imu_frame and p.imu_frame not in robot.frame_names):
        return None
    rotation: FloatArray = np.eye(3)
    if p.imu_frame:
        joint, rotation, _ = in_joint(robot, p.imu_frame)
        if joint >= 0:
            return None
    return turned_by(p.orientation, rotation.T)


def _body(robot: RobotModel, one: Carried, start: float) -> Ellipsoid:
    e = one.estimate
    inertia = e.inertia_com if bool(np.all(e.observable[_MOMENTS])) else None
    span = (one.t0 - start, one.t1 - start)
    label = f"{e.mass:.2f} ± {1.96 * e.mass_std:.2f} kg"
    return ellipsoid(robot, e.frame, e.mass, e.com, label, inertia, e.com_std, span)
