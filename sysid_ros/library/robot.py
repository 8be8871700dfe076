"""Robot: the model that data are compared with, from a URDF, an MJCF or by name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import urdf_text


class Robot:
    """A robot model.

    Args:
        source: path of a URDF or an MJCF, the text of a URDF, or the name of a robot of example-robot-data, such as "panda".
        joint_names: joints that move, others are locked at 0; all without it. gravity: in the base frame, shape (3,) [m/s^2].

    Attributes:
        urdf: text. path: of its file, None where it is a text. joint_names, gravity: as given.

    Raises:
        RobotModelError: there is no such robot, or it can't be used.
    """

    def __init__(self, source: str | Path, joint_names: Sequence[str] = (), gravity: Sequence[float] = (0.0, 0.0, -9.81)) -> None:
        text = str(source)
        self.path = None if text.lstrip().startswith("<") else _path_of(text)
        self.urdf = text if self.path is None else urdf_text(self.path)
        self.joint_names, self.gravity = tuple(joint_names), tuple(gravity)
        self.model: RobotModel = RobotModel.from_urdf(self.urdf, self.joint_names, self.gravity)

    def __repr__(self) -> str:
        model = self.model
        mass = float(model.pi.reshape(-1, 10)[:, 0].sum())
        notes = "".join(f"\n  {note}" for note in model.notes)
        return f"Robot {model.name}: {model.n} joints, {mass:.2f} kg that moves\n  {', '.join(model.joint_names)}{notes}"


def _path_of(text: str) -> Path:
    path = Path(text)
    if path.exists() or path.suffix:
        return path
    if (found := packaged(text)) is not None:
        return found
    raise RobotModelError(
        f"there is no file '{text}', and no robot of that name in example-robot-data. Give the path of a URDF or an MJCF; robots "
        "by name need: pip install example-robot-data."
    )
