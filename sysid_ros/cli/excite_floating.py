"""``sysid excite --base floating``: motions of a trunk over feet that stand, of robots on legs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from click.core import ParameterSource
from scipy.spatial.transform import Rotation

from sysid_ros.cli import options as opt
from sysid_ros.cli.excite_report import median
from sysid_ros.cli.output import check_outputs, note, report, table, write_json
from sysid_ros.cli.progress import progress_bar
from sysid_ros.exceptions import SettingsError
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.excite import steps
from sysid_ros.excitation.excite_trunk import TrunkExcitation, excite_trunk
from sysid_ros.excitation.motion_limits import KINDS, JointLimit
from sysid_ros.files import plain, write_text
from sysid_ros.floating.floating_base import FloatingBase, floating_base_of
from sysid_ros.floating.planted_feet import PlantedFeet
from sysid_ros.identification.free_effects import free_model_on_legs
from sysid_ros.identification.prior_weight import precision_on_legs
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.sources.joint_trajectory import JointTrajectory
from sysid_ros.sources.trunk_trajectory import TrunkTrajectory

_PERIOD = 4.0
"""Usual period of a trunk's motion [s]: 0.25 to 1.25 Hz with five harmonics, about the slowest that a leg can follow by its
controller and the fastest that shows inertia."""
_ACCELERATION = 20.0
"""Usual limit of legs' joints [rad/s^2]: a walking robot's have several times as much."""
_PARTS = ("x", "y", "z", "turn x", "turn y", "turn z")
_EQUATION = (
    "pose_j(t) = offset[j] + sum_l sine[l][j] sin((l+1) w t) + cosine[l][j] cos((l+1) w t), w = 2 pi / period: x, y, z [m] from "
    "where the trunk stands, then turns about its own axes x, y, z [rad], one after the other"
)
Write = Callable[[JointTrajectory, Path, Path | None], None]


def options(command: Any) -> Any:
    """The options of a robot on legs."""
    for option in reversed(
        (
            click.option("--robot", "robot_name", default="", metavar="NAME", help="Of example-robot-data, in place of --urdf."),
            click.option(
                "--base",
                type=click.Choice(["auto", "fixed", "floating"]),
                default="auto",
                show_default=True,
                help="floating: a robot on legs, whose trunk moves over feet that stand.",
            ),
            click.option("--contact-frames", multiple=True, metavar="LINK...", help="Its feet.  [default: the ends of its legs]"),
            opt.number(
                "--foot-friction", default=ExcitationSettings().foot_friction, help="Of the feet on the ground, that may be used."
            ),
            opt.path("--trunk", "trunk_path", help="The trunk's pose to write: trajectory_msgs/MultiDOFJointTrajectory in YAML."),
        )
    ):
        command = option(command)
    return command


def robot_path(urdf: Path | None, name: str) -> Path:
    """The URDF that was asked for, by its path or its name.

    Raises:
        SettingsError: neither or both were given, or there is no such robot.
    """
    if (urdf is None) == (not name):
        raise SettingsError("--urdf or --robot must be given, and not both.")
    path = urdf if urdf is not None else packaged(name)
    if path is None:
        raise SettingsError(
            f"--robot is {name}; it must be the name of a robot of example-robot-data (pip install example-robot-data)."
        )
    return path


def base_of(robot: RobotModel, online: OnlineSettings, base: str, frames: tuple[str, ...]) -> FloatingBase | None:
    """The robot on its floating base, where ``base``, or its URDF, says that it stands on legs; ``frames``: its feet.

    Raises:
        RobotModelError: the feet do not fit the robot.
    """
    base = online.base if base == "auto" else base
    return floating_base_of(robot, replace(online, base=base, contact_frames=frames or online.contact_frames))


@dataclass(frozen=True, slots=True)
class Files:
    """What to write: motion, bag, JSON, figures and the trunk's pose; whether what is there may be replaced."""

    out: Path
    bag: Path | None
    json: Path | None
    plots: tuple[Path | None, ...]
    trunk: Path | None
    force: bool


def run_floating(
    base: FloatingBase,
    settings: ExcitationSettings,
    given: Mapping[str, JointLimit],
    posture: FloatArray | None,
    files: Files,
    timing: tuple[float, float],
    write: Write,
) -> None:
    """Find the motion, write and show it.

    Args:
        timing: points a second [Hz], time to come to the start [s]. write: a message into a file, and a bag.

    Raises:
        SettingsError: a setting is not allowed. DataError: the robot can't stand. OutputError: a file is there already.
    """
    check_outputs(files.force, trunk=files.trunk)
    settings = _of_legs(settings)
    feet = PlantedFeet(base, posture)
    model = free_model_on_legs(base, sensors=False)
    with progress_bar("Searching", steps(settings)) as advance:
        result = excite_trunk(model, precision_on_legs(model, base), feet, settings, given, advance)
    for sentence in result.notes:
        note(sentence)
    t = result.trajectory.grid(1.0 / timing[0])
    write(JointTrajectory(base.legs.joint_names, t + timing[1], *result.joints(t)), files.out, files.bag)
    if files.trunk is not None:
        pose = result.trajectory.sample(t)[0]
        turns = Rotation.from_euler("XYZ", pose[:, 3:]).as_quat()
        text = TrunkTrajectory(base.trunk, t + timing[1], pose[:, :3], turns).yaml(
            f"Pose of {base.trunk} of {base.legs.name} in a motion of its legs, from where it stands."
        )
        write_text(files.trunk, text)
    if files.json is not None:
        write_json(files.json, _as_json(result, settings))
    for path in files.plots:
        if path is not None:
            from sysid_ros.pages.trunk_excitation_figure import write_trunk_excitation

            write_trunk_excitation(path, result, f"Exciting motion of {base.legs.name}")
    _show(result)
    note(f"Motion written to {files.out}{f' and {files.bag}' if files.bag else ''}. The robot must stand at its start.")


def _of_legs(settings: ExcitationSettings) -> ExcitationSettings:
    """The settings with what is usual of legs where nothing was asked for."""
    source = click.get_current_context().get_parameter_source
    if source("acceleration_limit") is not ParameterSource.COMMANDLINE:
        settings = replace(settings, acceleration_limit=_ACCELERATION)
    if source("starts") is not ParameterSource.COMMANDLINE:
        settings = replace(settings, starts=1)
    if settings.period == 0.0:
        settings = replace(settings, period=settings.duration / max(1, round(settings.duration / _PERIOD)))
    return settings


def _show(result: TrunkExcitation) -> None:
    names, robot = result.feet.base.contact_frames, result.feet.base.legs
    before = (median(result.random), result.random[0])
    title = f"Excitation of a robot on {len(names)} feet; before: {len(result.random)} random feasible motions"
    out = table(title, "criterion", "", "before,\nmedian", "before,\nbest D", "after", words=["criterion", ""])
    for criterion, meaning, name in (
        ("D", "log det of information and prior, more is better", "d"),
        ("A", "mean variance over that before, less is better", "a"),
    ):
        out.add_row(criterion, meaning, *(f"{getattr(c, name):.4g}" for c in (*before, result.criteria)))
    report().print(out)
    pose = result.trajectory.sample(result.trajectory.grid(0.01, one_period=True))
    trunk = table("Motion of the trunk", "", "from", "to", "velocity", "acceleration")
    for j, part in enumerate(_PARTS):
        q, v, a = (x[:, j] for x in pose)
        trunk.add_row(
            f"{part} [{'m' if j < 3 else 'rad'}]", *(f"{x:.3f}" for x in (q.min(), q.max(), np.abs(v).max(), np.abs(a).max()))
        )
    report().print(trunk)
    motion = table(
        "Joints, and the part of what is allowed that they use", "joint", "start\nrad", *(f"{kind}\n%" for kind in KINDS)
    )
    for i, name in enumerate(robot.joint_names):
        motion.add_row(name, f"{result.feet.posture[i]:.4f}", *(f"{100.0 * x:.1f}" for x in result.joint_use[:, i]))
    report().print(motion)
    feet = table("Feet, and the part of what is allowed that they use", "foot", "friction cone\n%", "stretched leg\n%")
    for i, name in enumerate(names):
        feet.add_row(name, *(f"{100.0 * x:.1f}" for x in result.feet_use[:, i]))
    report().print(feet)
    report().print(f"Start, for --start: {','.join(f'{x:.6f}' for x in result.feet.posture)}", soft_wrap=True)


def _as_json(result: TrunkExcitation, settings: ExcitationSettings) -> dict[str, Any]:
    trajectory, base = result.trajectory, result.feet.base
    offset, sine, cosine = trajectory.basis.series(trajectory.coefficients)
    criteria = {"after": result.criteria, "before_best": result.random[0], "before_median": median(result.random)}
    document: dict[str, Any] = plain(
        {
            "robot": base.legs.name,
            "trunk": base.trunk,
            "joints": base.legs.joint_names,
            "contact_frames": base.contact_frames,
            "settings": settings,
            "motion": {
                "duration": trajectory.duration,
                "period": trajectory.basis.period,
                "start": result.feet.posture,
                "equation": _EQUATION,
                "offset": offset,
                "sine": sine,
                "cosine": cosine,
            },
            "criteria": {
                name: {key: value for key, value in asdict(c).items() if key in ("d", "a")} for name, c in criteria.items()
            }
            | {"random_d": [c.d for c in result.random], "search_d": result.start_d},
            "use": dict(zip(KINDS, result.joint_use, strict=True))
            | dict(zip(("friction_cone", "stretched_leg"), result.feet_use, strict=True)),
            "notes": result.notes,
        }
    )
    return document
