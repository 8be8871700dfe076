"""``sysid frequency``: up to what frequency a model holds, and what it misses beyond."""

from __future__ import annotations

from pathlib import Path

import click

from sysid_ros import __version__
from sysid_ros.cli.frequency_tables import show
from sysid_ros.cli.inputs import read_config, settings_from
from sysid_ros.cli.output import ManyValues, command_line, note, progress_bar, warn, write_json
from sysid_ros.cli.recordings import read_recording
from sysid_ros.frequency import check_frequency
from sysid_ros.identification.result import Problem
from sysid_ros.pages import check_plot_path
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.model_file import ModelFile

_PATH = click.Path(path_type=Path)


@click.command(cls=ManyValues)
@click.argument("bags", type=_PATH, nargs=-1, required=True, metavar="BAG...")
@click.option("--urdf", type=_PATH, help="The model to check; else /robot_description of the first bag.")
@click.option("--model", "model_path", type=_PATH, help="model.yaml of 'sysid identify' or 'sysid diagnose': the model to check.")
@click.option("--joint-names", multiple=True, metavar="NAME...", help="Joints that move; others are locked at 0.  [default: all]")
@click.option(
    "--top", type=click.FloatRange(1.0, 400.0), help="Upper end of the band. [Hz]  [default: a fifth of the rate, 40 at most]"
)
@click.option(
    "--config", "config_path", type=_PATH, help="Parameters of the node (effort_scale, joint_names, ...), a ROS 2 YAML file."
)
@click.option("--topic", default="/joint_states", show_default=True)
@click.option("--plot", type=_PATH, help="Write a figure: .png, .svg, .pdf, or .html to look around in.")
@click.option("--json", "json_path", type=_PATH, help="Write the result for machines.")
def command(
    bags: tuple[Path, ...],
    urdf: Path | None,
    model_path: Path | None,
    joint_names: tuple[str, ...],
    top: float | None,
    config_path: Path | None,
    topic: str,
    plot: Path | None,
    json_path: Path | None,
) -> None:
    """Up to what frequency does a model hold, on which joint does it stop, and is what it misses a delay, a filter, a resonance?

    For every joint the response from the model's torque (along the measured motion) to the measured torque is estimated, with
    its 95 % region; 1 says that the model holds. Then the simplest cause that explains it is named with its parameters, and a
    state-space model of torque and velocity is searched for oscillations that rigid links do not have.

    Any motion will do, but only frequencies that it contains can be judged: the fast Fourier motion of 'sysid excite' tells up to
    some Hz, a chirp or multisine about a posture further. Several periods of one motion tell noise from distortion.

    \b
    Example:
      sysid frequency run1/ run2/ --urdf arm.urdf --model model.yaml --plot bode.png

    Exit codes: 0 done; 2 bad input or usage.
    """
    if plot is not None:
        check_plot_path(plot)
    if json_path is not None and not json_path.parent.is_dir():
        raise click.UsageError(
            f"'{json_path}' can't be written: the folder '{json_path.parent}' does not exist. Create it first."
        )
    settings = settings_from(read_config(config_path), joint_names=joint_names)
    file = ModelFile.read(model_path) if model_path else None
    robots: list[RobotModel] = []
    problems: list[Problem] = []
    recordings = [read_recording(path, urdf, topic, settings, robots, problems) for path in bags]
    robot = robots[0]
    for problem in problems:
        warn(f"{Path(problem.bag).name}: {problem.text}" if problem.bag else problem.text)
    for sentence in file.notes(robot.urdf) if file else []:
        note(sentence)
    provenance = _provenance(bags, urdf, model_path)
    known = file.known_effects(robot) if file else []
    with progress_bar("joints", robot.n) as advance:
        result = check_frequency(robot, recordings, known, top or 0.0, settings.max_gap, advance, provenance)
    for sentence in result.warnings:
        warn(sentence)
    if json_path:
        write_json(json_path, result.as_dict())
    show(result)
    if plot:
        from sysid_ros.pages.frequency_figure import write_frequency_plot

        model = f"{model_path.name}" if model_path else "the URDF"
        write_frequency_plot(plot, result, f"Measured torque over that of {model}: {', '.join(b.name for b in bags)}")
        note(f"Plot written to {plot}.")


def _provenance(bags: tuple[Path, ...], urdf: Path | None, model: Path | None) -> dict[str, object]:
    return {
        "bags": [str(b) for b in bags],
        "urdf": str(urdf) if urdf else "/robot_description of the first bag",
        **({"model": str(model)} if model else {}),
        "command": command_line(),
        "version": __version__,
    }
