"""``sysid excite``: the motion of an arm from which its parameters can be identified best."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from sysid_ros.cli import options as opt
from sysid_ros.cli.excite_floating import Files, base_of, robot_path, run_floating
from sysid_ros.cli.excite_floating import options as floating_options
from sysid_ros.cli.excite_multisine import MultisineWishes, run_multisine
from sysid_ros.cli.excite_multisine import options as multisine_options
from sysid_ros.cli.excite_report import as_json, show
from sysid_ros.cli.inputs import read_config, settings_from
from sysid_ros.cli.output import ManyValues, check_outputs, note, warn, write_json
from sysid_ros.cli.progress import progress_bar
from sysid_ros.exceptions import SettingsError
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.excite import Excitation, excite, steps
from sysid_ros.excitation.motion_limits import JointLimit, read_joint_limits
from sysid_ros.files import check_bag, whole_folder, write_text
from sysid_ros.identification import free_model
from sysid_ros.pages import check_plot_paths
from sysid_ros.robot.collision_model import CollisionModel
from sysid_ros.robot.mesh_files import MeshFiles
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.sources import urdf_text
from sysid_ros.sources.joint_trajectory import JointTrajectory

_EPILOG = """
Send the motion to the controller, with the arm standing at its start, which is shown, or with --approach T:

\b
  ros2 topic pub --once -w 1 --stdin /joint_trajectory_controller/joint_trajectory \\
    trajectory_msgs/msg/JointTrajectory < traj.yaml

Or as an action, which tells how it ends:

\b
  (echo trajectory:; sed 's/^/  /' traj.yaml) | ros2 action send_goal --stdin \\
    /joint_trajectory_controller/follow_joint_trajectory control_msgs/action/FollowJointTrajectory

Or from the bag, with 3 s for the controller to be found:

\b
  ros2 bag play OUT --delay 3

--stdin is there from ROS 2 Jazzy on; before, take the bag. Make the first run with --velocity-scale 0.2 and a hand on the stop.

Exit codes: 0 done; 2 bad input or usage, or no feasible motion.
"""


def _setting(name: str, text: str) -> opt.Decorator:
    return opt.number("--" + name.replace("_", "-"), default=getattr(ExcitationSettings(), name), help=text)


@click.command(cls=ManyValues, epilog=_EPILOG)
@opt.path("--urdf", help="The robot.")
@opt.path("--out", "out_path", required=True, help="trajectory_msgs/JointTrajectory in YAML, to write.")
@opt.path("--bag", help="Folder to create: a bag with the same message.")
@opt.PLOT
@opt.RERUN
@opt.JSON
@_setting("duration", "Of the motion. [s]")
@click.option("--period", type=float, help="The duration is a whole number of periods. [s]  [default: about 10]")
@_setting("harmonics", "Of the Fourier series; the fastest is HARMONICS / PERIOD.")
@_setting("starts", "Local searches, from the best of the random motions.")
@_setting("seed", "Of all that is random: the same seed gives the same motion.")
@_setting("comparison", "Random feasible motions, to compare with and to start from.")
@opt.number("--rate", default=100.0, help="Points a second. [Hz]")
@_setting("position_scale", "Part of each joint's range, about its middle, that may be used.")
@_setting("velocity_scale", "Part of the velocity limits that may be used.")
@_setting("effort_scale", "Part of the effort limits that the nominal torque may use.")
@_setting("acceleration_limit", "Of revolute joints: a URDF states none. [rad/s^2]")
@_setting("slide_acceleration_limit", "Of prismatic joints. [m/s^2]")
@opt.path("--limits", "limits_path", help="joint_limits.yaml as of MoveIt; replaces the URDF's.")
@opt.JOINT_NAMES
@click.option(
    "--start", callback=opt.numbers, metavar="Q,Q,...", help="Where it starts and ends. [rad or m]  [default: anywhere]"
)
@opt.number(
    "--approach",
    default=0.0,
    help="Time for the controller to come to the start from where the arm stands, on a way that is not checked. [s]",
)
@click.option("--floor", type=float, metavar="Z", help="Height of the floor in the base frame. [m]  [default: no floor]")
@_setting("clearance", "Least distance of two links, and of a link from the floor. [m]")
@opt.path("--package-path", multiple=True, metavar="DIR...", help="Folders of packages that package:// names.")
@click.option("--ignore-pair", multiple=True, metavar="LINK,LINK...", help="Pairs of links that are not compared.")
@click.option("--no-collisions", is_flag=True, help="Check no collisions.")
@click.option("--controller", default="joint_trajectory_controller", show_default=True, help="Whose topic the bag has.")
@multisine_options
@floating_options
@opt.STORAGE
@opt.CONFIG
@opt.FORCE
def command(
    urdf: Path | None,
    robot_name: str,
    trunk_path: Path | None,
    out_path: Path,
    bag: Path | None,
    plot_path: Path | None,
    rerun_path: Path | None,
    json_path: Path | None,
    period: float | None,
    rate: float,
    limits_path: Path | None,
    joint_names: tuple[str, ...],
    start: tuple[float, ...] | None,
    approach: float,
    package_path: tuple[Path, ...],
    ignore_pair: tuple[str, ...],
    no_collisions: bool,
    controller: str,
    storage: str,
    config_path: Path | None,
    force: bool,
    **options: Any,
) -> None:
    """Find the motion from which the parameters of an arm, or of a robot on legs, can be identified best.

    A Fourier series that starts and ends at rest, with the largest determinant of the information about the base parameters of
    links, friction, rotors and offsets (D-optimal). Limits of position, velocity, acceleration and nominal torque are kept, and
    the links do not come near each other or a floor: checked every millisecond.

    Of a robot on legs it is the trunk that moves, over feet that stay: within the joints' limits and the friction cones of the
    feet, for trunk, links of the legs, friction, rotors and offsets. Collisions are not checked.

    \b
    Example:
      sysid excite --urdf arm.urdf --floor 0 --out traj.yaml --bag traj_bag --plot traj.png
      sysid excite --robot go2 --base floating --duration 20 --out sway.yaml --trunk trunk.yaml --plot sway.png
      sysid excite --urdf arm.urdf --multisine --band 0.3,15 --move joint_2 --out multisine.yaml
    """
    path, wishes = robot_path(urdf, robot_name), MultisineWishes.taken(options, period or 0.0)
    asked = options.pop("base"), options.pop("contact_frames")
    settings = _settings({"period": period or 0.0, **options})
    _check(out_path, bag, (plot_path, rerun_path), json_path, force, wishes is not None, (rate, approach))
    online = settings_from(read_config(config_path))
    robot = RobotModel.from_urdf(urdf_text(path), joint_names or online.joint_names, online.gravity)
    base = base_of(robot, online, *asked) if wishes is None else None
    for sentence in robot.notes:
        note(sentence)
    given = _limits_of(robot, limits_path) if limits_path is not None else {}
    write = partial(_write_message, robot, f"/{controller.strip('/')}/joint_trajectory", storage)
    outputs = Files(out_path, bag, json_path, (plot_path, rerun_path), trunk_path, force)
    if base is not None:
        run_floating(base, settings, given, _posture(robot, start), outputs, (rate, approach), write)
        return
    collision = _collision(robot, path, settings, package_path, ignore_pair, no_collisions)
    if wishes is not None:
        files = (out_path, bag, json_path, force)
        run_multisine(robot, settings, wishes, given, collision, _posture(robot, start), files, (rate, approach), write)
        return
    _run_arm(robot, path, settings, given, collision, (_posture(robot, start), no_collisions), outputs, (rate, approach), write)


def _collision(
    robot: RobotModel, path: Path, settings: ExcitationSettings, folders: tuple[Path, ...], ignored: tuple[str, ...], none: bool
) -> CollisionModel | None:
    if none:
        return None
    pairs = [_pair(text) for text in ignored]
    return CollisionModel(robot, MeshFiles(path.parent, folders), settings.clearance, settings.floor, pairs)


def _run_arm(
    robot: RobotModel,
    path: Path,
    settings: ExcitationSettings,
    given: dict[str, JointLimit],
    collision: CollisionModel | None,
    wanted: tuple[FloatArray | None, bool],
    files: Files,
    timing: tuple[float, float],
    write: Callable[[JointTrajectory, Path, Path | None], None],
) -> None:
    """Find, write and show the motion of an arm; ``wanted``: its start, and that collisions are not checked."""
    with progress_bar("Searching", steps(settings)) as advance:
        result = excite(free_model(robot), settings, given, collision, wanted[0], advance)
    _tell(result, settings.floor is not None, wanted[1])
    t = result.trajectory.grid(1.0 / timing[0])
    write(JointTrajectory(robot.joint_names, t + timing[1], *result.trajectory.sample(t)), files.out, files.bag)
    if files.json is not None:
        write_json(files.json, as_json(result, settings))
    _draw(files.plots, result, path)
    show(result)
    note(f"Motion written to {files.out}{f' and {files.bag}' if files.bag else ''}. How to send it: sysid excite --help")


def _tell(result: Excitation, floor: bool, no_collisions: bool) -> None:
    """What was assumed, what may not be good enough, and what was not checked."""
    for sentence in result.notes:
        note(sentence)
    for sentence in result.warnings:
        warn(sentence)
    if not floor or no_collisions:
        note("Collisions are not checked." if no_collisions else "No floor is checked; say where it is with --floor Z.")


def _draw(paths: tuple[Path | None, ...], result: Excitation, urdf: Path) -> None:
    for path in paths:
        if path is not None:
            from sysid_ros.pages.excitation_figure import write_excitation

            write_excitation(path, result, f"Exciting motion of {result.limits.robot.name}", urdf)


def _limits_of(robot: RobotModel, path: Path) -> dict[str, JointLimit]:
    """The limits in a file of the joints that move."""
    given = read_joint_limits(path)
    if others := sorted(set(given) - set(robot.joint_names)):
        note(f"Joints in {path} that do not move here: {', '.join(others)}.")
    return {name: limit for name, limit in given.items() if name in robot.joint_names}


def _settings(options: dict[str, Any]) -> ExcitationSettings:
    """Messages about a setting name its option."""
    try:
        return ExcitationSettings(**options)
    except SettingsError as error:
        field, _, rest = str(error).partition(" ")
        raise SettingsError(f"--{field.replace('_', '-')} {rest}") from None


def _check(
    out: Path,
    bag: Path | None,
    plots: tuple[Path | None, Path | None],
    json_path: Path | None,
    force: bool,
    multisine: bool,
    timing: tuple[float, float],
) -> None:
    """What can be wrong is said before the search, not after it."""
    _check_times(*timing)
    if multisine:
        if any(plots):
            raise SettingsError("--multisine draws no figure; leave out --plot and --rerun.")
        check_outputs(force, json=json_path)
        return
    check_outputs(force, out=out, json=json_path, plot=plots[0], rerun=plots[1])
    check_plot_paths(*plots)
    if bag is not None:
        check_bag(bag, force, "--bag")


def _check_times(rate: float, approach: float) -> None:
    if not 1.0 <= rate <= 1000.0:
        raise SettingsError(f"--rate is {rate:g} Hz; it must be from 1 to 1000.")
    if not 0.0 <= approach < np.inf:
        raise SettingsError(f"--approach is {approach:g} s; it must be 0 or more.")


def _pair(text: str) -> tuple[str, str]:
    links = [name.strip() for name in text.split(",")]
    if len(links) != 2 or not all(links):
        raise SettingsError(f"--ignore-pair is '{text}'; it must be two links with a comma between them, such as link_5,link_7.")
    return links[0], links[1]


def _posture(robot: RobotModel, start: tuple[float, ...] | None) -> FloatArray | None:
    if start is None:
        return None
    if len(start) != robot.n or not np.all(np.isfinite(start)):
        raise SettingsError(
            f"--start has {len(start)} values; it must have {robot.n} finite ones, for {', '.join(robot.joint_names)} in this "
            "order."
        )
    return np.array(start)


def _write_message(robot: RobotModel, topic: str, storage: str, message: JointTrajectory, out: Path, bag: Path | None) -> None:
    if bag is not None:
        with whole_folder(bag, replace=True) as folder:
            message.write_bag(folder, topic, robot.urdf, storage)
    write_text(out, message.yaml(f"Exciting motion of {robot.name} for {topic}: sysid excite --help says how to send it."))
