"""``sysid export``: an identified model for simulators."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click
from rich.table import Table

from sysid_ros.cli import options as opt
from sysid_ros.cli.output import ManyValues, check_outputs, note, report, table
from sysid_ros.exceptions import SettingsError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import urdf_text
from sysid_ros.torque.drake_export import export_drake
from sysid_ros.torque.exported import COLUMNS, UNITS, JointParameters, known_of
from sysid_ros.torque.joint_tables import export_isaac, export_table
from sysid_ros.torque.mjcf_export import export_mjcf
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.sdf_export import export_sdf
from sysid_ros.torque.urdf_export import export_urdf

WRITERS: dict[str, Callable[[RobotModel, ModelFile, Path], list[str]]] = {
    ".xml": export_mjcf,
    ".urdf": export_urdf,
    ".sdf": export_sdf,
    ".drake.urdf": export_drake,
    ".isaac.yaml": export_isaac,
    ".isaac.json": export_isaac,
    ".csv": export_table,
}
"""How the name of a file ends, and what writes it and gives back what it can't hold."""


@click.command(cls=ManyValues)
@click.argument("model_path", type=opt.PATH, metavar="MODEL")
@opt.path("--urdf", required=True, help="The robot that MODEL belongs to: URDF or MJCF.")
@opt.path(
    "--out",
    "outs",
    multiple=True,
    metavar="FILE...",
    help="To write: .xml, .urdf, .sdf, .drake.urdf, .isaac.yaml, .csv; see above.",
)
@opt.FORCE
def command(model_path: Path, urdf: Path, outs: tuple[Path, ...], force: bool) -> None:
    """Write MODEL, a model.yaml of 'sysid identify' or 'sysid diagnose', for a simulator, and show what each joint has.

    How a name ends says what is written. Each file holds what its format has a place for, and says what it can't hold.

    \b
    .xml          MuJoCo: links, armature, damping, frictionloss, gear, delay
    .urdf         PyBullet, Gazebo, pinocchio: links, damping, friction
    .sdf          Gazebo: links, damping, friction; no shapes
    .drake.urdf   Drake: links, rotor inertia (at a gear ratio of 1), damping
    .isaac.yaml   Isaac, or .isaac.json: armature, friction, damping of each joint
    .csv          one row a joint: armature, damping, friction, gain of the effort

    \b
    Example:
      sysid export model.yaml --urdf arm.urdf --out arm.xml arm.sdf arm.drake.urdf joints.isaac.yaml

    Exit codes: 0 done; 2 bad input or usage.
    """
    chosen = {path: _writer(path) for path in outs}
    check_outputs(force, out=outs)
    model = ModelFile.read(model_path)
    robot = RobotModel.from_urdf(urdf_text(urdf), model.joints)
    for sentence in (*robot.notes, *model.notes(robot.urdf)):
        note(sentence)
    report().print(_shown(robot, model))
    for path, write in chosen.items():
        for sentence in write(robot, model, path):
            note(sentence)
        note(f"Written to {path}.")


def _writer(path: Path) -> Callable[[RobotModel, ModelFile, Path], list[str]]:
    """Of the longest ending that a name has."""
    for ending in sorted(WRITERS, key=len, reverse=True):
        if path.name.endswith(ending):
            return WRITERS[ending]
    raise SettingsError(f"'{path}' ends in '{path.suffix}'; the suffix must be one of {', '.join(WRITERS)}.")


def _shown(robot: RobotModel, model: ModelFile) -> Table:
    out = table(f"Joints of {robot.name}", "joint", *(f"{name}\n{unit}" for name, unit in zip(COLUMNS, UNITS, strict=True)))
    rows = JointParameters.of(known_of(robot, model)).rows()
    for joint, row in zip(robot.joint_names, rows, strict=True):
        out.add_row(joint, *(f"{x:.4g}" for x in row))
    return out
