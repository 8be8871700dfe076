"""``sysid identify``: the arm's own dynamics from bags without a payload."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from sysid_ros import __version__
from sysid_ros.cli.identify_tables import as_json, show
from sysid_ros.cli.inputs import read_config, settings_from
from sysid_ros.cli.output import ManyValues, command_line, note, progress_bar, warn, write_json
from sysid_ros.cli.recordings import read_recording
from sysid_ros.exceptions import SysidError
from sysid_ros.identification import Choices, Identification, identify_recordings
from sysid_ros.identification.free_effects import frictions
from sysid_ros.identification.least_squares import METHODS
from sysid_ros.identification.result import Problem
from sysid_ros.identification.rows import FORMS
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.urdf_export import check_model_file, export_urdf

_PATH = click.Path(path_type=Path)


@click.command(cls=ManyValues)
@click.argument("bags", type=_PATH, nargs=-1, required=True, metavar="BAG...")
@click.option("--urdf", type=_PATH, help="The robot; else /robot_description of the first bag.")
@click.option("--out", "out_path", type=_PATH, required=True, help="model.yaml to write.")
@click.option("--urdf-out", type=_PATH, help="URDF to write, with the identified inertials and joint dynamics.")
@click.option(
    "--validate", type=_PATH, multiple=True, metavar="BAG...", help="Bags to judge the model on; they are never fitted."
)
@click.option(
    "--config", "config_path", type=_PATH, help="Parameters of the node (effort_scale, joint_names, ...), a ROS 2 YAML file."
)
@click.option(
    "--cutoff", type=click.FloatRange(0.5, 100.0), help="Cut-off of the low-pass on both sides; else from the spectrum. [Hz]"
)
@click.option(
    "--form",
    type=click.Choice(FORMS),
    default=FORMS[0],
    show_default=True,
    help="Equation of motion with accelerations, or of the momentum, without.",
)
@click.option(
    "--method",
    type=click.Choice(METHODS),
    default="irls",
    show_default=True,
    help="Least squares: plain, weighted by the noise of each joint and bag once, until it converges, or with a bounded loss.",
)
@click.option(
    "--friction",
    type=click.Choice(("auto", *frictions())),
    default="auto",
    show_default=True,
    help="Model of the dry friction; auto lets it grow with the load on the joints where that predicts better.",
)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="ID",
    help="Another effect, such as cogging or spring: free on the joints, or for the whole arm, where it predicts held-out data "
    "better; its settings are searched. May be repeated.",
)
@click.option(
    "--physical/--no-physical",
    default=True,
    show_default=True,
    help="Only links that can exist, friction and rotors not negative.",
)
@click.option(
    "--prior-weight",
    type=click.FloatRange(0.0, min_open=True),
    help="How strongly the links are held to the URDF's; inf keeps them. Else chosen by the error on held-out data.",
)
@click.option(
    "--payload-bag", type=_PATH, multiple=True, metavar="BAG...", help="Bags with a payload, found as the difference to BAGs."
)
@click.option("--payload-frame", default="", metavar="LINK", help="Link that carries it; the last one by default.")
@click.option("--accept-doubts", is_flag=True, help="Go on where effort and URDF, or the bags among each other, don't fit.")
@click.option("--topic", default="/joint_states", show_default=True)
@click.option("--report", "report_path", type=_PATH, metavar="HTML", help="Write a report for people, one file.")
@click.option("--json", "json_path", type=_PATH, help="Write the result for machines.")
def command(
    bags: tuple[Path, ...],
    urdf: Path | None,
    out_path: Path,
    urdf_out: Path | None,
    validate: tuple[Path, ...],
    config_path: Path | None,
    cutoff: float | None,
    form: str,
    method: str,
    friction: str,
    effects: tuple[str, ...],
    physical: bool,
    prior_weight: float | None,
    payload_bag: tuple[Path, ...],
    payload_frame: str,
    accept_doubts: bool,
    topic: str,
    report_path: Path | None,
    json_path: Path | None,
) -> None:
    """Identify link inertials, friction, rotor inertia and torque offsets of an arm from BAGs in which it carries nothing.

    The result is what 'sysid replay --model' and the node take as known. Each bag is predicted by a model fitted to the others
    (halves, where there is one bag), and that error is shown.

    \b
    Examples:
      sysid identify run1/ run2/ --urdf arm.urdf --validate run3/ --out model.yaml
      sysid identify run1/ run2/ --urdf arm.urdf --effect cogging --effect spring --out model.yaml

    Exit codes: 0 done; 2 bad input or usage.
    """
    _require_folders(out_path, urdf_out, report_path, json_path)
    settings = settings_from(read_config(config_path))
    robots: list[RobotModel] = []
    problems: list[Problem] = []
    read = [read_recording(path, urdf, topic, settings, robots, problems) for path in (*bags, *validate, *payload_bag)]
    provenance = {"bags": [str(b) for b in bags], "command": command_line(), "version": __version__}
    first, second = len(bags), len(bags) + len(validate)
    try:
        with progress_bar("identifying", 2 * len(read) + 1) as advance:
            result = identify_recordings(
                robots[0],
                read[:first],
                read[first:second],
                provenance,
                Choices(method, form, friction, physical, prior_weight, accept_doubts, payload_frame, effects),
                cutoff or 0.0,
                settings.max_gap,
                settings.velocity_source == "message",
                problems,
                read[second:],
                lambda what: advance(1),
            )
    except SysidError:
        # what was wrong with the messages may be the reason
        _warn_of(problems)
        raise
    _write(robots[0], result, provenance, out_path, json_path, urdf_out, report_path)


def _require_folders(*paths: Path | None) -> None:
    for path in paths:
        if path is not None and not path.parent.is_dir():
            raise click.UsageError(f"'{path}' can't be written: the folder '{path.parent}' does not exist. Create it first.")


def _write(
    robot: RobotModel,
    result: Identification,
    provenance: dict[str, Any],
    out_path: Path,
    json_path: Path | None,
    urdf_out: Path | None,
    report_path: Path | None,
) -> None:
    """Warnings, the files that were asked for, and the tables."""
    _warn_of(result.problems)
    for sentence in result.physical.notes if result.physical else ():
        note(sentence)
    result.model.write(out_path)
    check_model_file(robot, result.model, out_path)
    if json_path:
        write_json(json_path, as_json(result))
    show(result)
    note(f"Model written to {out_path}.")
    if urdf_out:
        for sentence in export_urdf(robot, result.model, urdf_out):
            note(sentence)
        note(f"URDF written to {urdf_out}.")
    if report_path:
        from sysid_ros.pages.identification_page import write_report

        write_report(report_path, result, provenance)
        note(f"Report written to {report_path}.")


def _warn_of(problems: Sequence[Problem]) -> None:
    for problem in problems:
        warn(f"{Path(problem.bag).name}: {problem.text}" if problem.bag else problem.text)
