"""``sysid frequency``: up to what frequency a model holds, and what it misses beyond."""

from __future__ import annotations

from pathlib import Path

import click

from sysid_ros.cli import options as opt
from sysid_ros.cli.frequency_tables import show
from sysid_ros.cli.inputs import provenance, read_config, settings_from
from sysid_ros.cli.output import ManyValues, note, progress_bar, require_folders, warn, write_json
from sysid_ros.cli.recordings import read_recordings, warn_of
from sysid_ros.frequency import check_frequency
from sysid_ros.pages import check_plot_path
from sysid_ros.torque.model_file import ModelFile


@click.command(cls=ManyValues)
@opt.BAGS
@opt.path("--urdf", help="The model to check; else /robot_description of the first bag.")
@opt.path("--model", "model_path", help="model.yaml of 'sysid identify' or 'sysid diagnose': the model to check.")
@opt.JOINT_NAMES
@click.option(
    "--top", type=click.FloatRange(1.0, 400.0), help="Upper end of the band. [Hz]  [default: a fifth of the rate, 40 at most]"
)
@opt.CONFIG
@opt.TOPIC
@opt.PLOT
@opt.JSON
def command(
    bags: tuple[Path, ...],
    urdf: Path | None,
    model_path: Path | None,
    joint_names: tuple[str, ...],
    top: float | None,
    config_path: Path | None,
    topic: str,
    plot_path: Path | None,
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
    if plot_path is not None:
        check_plot_path(plot_path)
    require_folders(json=json_path)
    settings = settings_from(read_config(config_path), joint_names=joint_names)
    file = ModelFile.read(model_path) if model_path else None
    robot, recordings, problems = read_recordings(bags, urdf, topic, settings)
    warn_of(problems)
    for sentence in file.notes(robot.urdf) if file else []:
        note(sentence)
    origin = provenance(bags, urdf=urdf or "/robot_description of the first bag", model=model_path)
    known = file.known_effects(robot) if file else []
    with progress_bar("joints", robot.n) as advance:
        result = check_frequency(robot, recordings, known, top or 0.0, settings.max_gap, advance, origin)
    for sentence in result.warnings:
        warn(sentence)
    if json_path:
        write_json(json_path, result.as_dict())
    show(result)
    if plot_path:
        from sysid_ros.pages.frequency_figure import write_frequency_plot

        model = f"{model_path.name}" if model_path else "the URDF"
        write_frequency_plot(plot_path, result, f"Measured torque over that of {model}: {', '.join(b.name for b in bags)}")
        note(f"Plot written to {plot_path}.")
