"""``sysid identify``: the arm's own dynamics from bags without a payload."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from sysid_ros.cli import options as opt
from sysid_ros.cli.identify_tables import as_json, show
from sysid_ros.cli.inputs import provenance, read_config, settings_from
from sysid_ros.cli.output import ManyValues, check_outputs, note, write_json
from sysid_ros.cli.progress import progress_bar
from sysid_ros.cli.recordings import TrunkTopics, read_recordings, warn_of
from sysid_ros.exceptions import SysidError
from sysid_ros.floating.floating_base import FloatingBase, floating_base_of
from sysid_ros.identification import Choices, Identification, identify_recordings
from sysid_ros.identification.free_effects import frictions
from sysid_ros.identification.least_squares import METHODS
from sysid_ros.identification.rows import FORMS
from sysid_ros.pages import check_plot_paths
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.urdf_export import check_model_file, export_urdf


@click.command(cls=ManyValues)
@opt.BAGS
@opt.path("--urdf", help="The robot; else /robot_description of the first bag.")
@opt.path("--out", "out_path", required=True, help="model.yaml to write.")
@opt.path("--urdf-out", help="URDF to write, with the identified inertials and joint dynamics.")
@opt.path("--validate", multiple=True, metavar="BAG...", help="Bags to judge the model on; they are never fitted.")
@opt.READ_JOINTS
@opt.EFFORT_PRESET
@opt.CONFIG
@click.option("--cutoff", type=opt.Range(0.5, 100.0), help="Cut-off of the low-pass on both sides; else from the spectrum. [Hz]")
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
    help="Model of the dry friction; auto takes Coulomb's, and by the load, Stribeck's or one that builds up after a reversal on "
    "the joints where that predicts better.",
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
    type=opt.Range(0.0, min_open=True),
    help="How strongly the links are held to the URDF's; inf keeps them. Else chosen by the error on held-out data.",
)
@opt.path("--payload-bag", multiple=True, metavar="BAG...", help="Bags with a payload, found as the difference to BAGs.")
@click.option("--payload-frame", default="", metavar="LINK", help="Link that carries it; the flange by default.")
@click.option("--accept-doubts", is_flag=True, help="Go on where effort and URDF, or the bags among each other, don't fit.")
@opt.TOPIC
@opt.COLUMNS
@opt.IMU_TOPIC
@opt.CONTACT_TOPIC
@opt.path("--report", "report_path", metavar="HTML", help="Write a report for people, one file.")
@opt.RERUN
@opt.JSON
@opt.FORCE
@click.option("--verbose", is_flag=True, help="Show the base parameters, the noise and the repeatability too.")
def command(
    bags: tuple[Path, ...],
    urdf: Path | None,
    out_path: Path,
    urdf_out: Path | None,
    validate: tuple[Path, ...],
    joint_names: tuple[str, ...],
    effort_preset: str,
    config_path: Path | None,
    cutoff: float | None,
    payload_bag: tuple[Path, ...],
    topic: str,
    columns_path: Path | None,
    report_path: Path | None,
    rerun_path: Path | None,
    json_path: Path | None,
    force: bool,
    verbose: bool,
    **choices: Any,
) -> None:
    """Identify link inertials, friction, rotor inertia and torque offsets of an arm from BAGs in which it carries nothing.

    Of a robot on legs also what is not known of its IMU and feet; record two ways to move, such as swaying and a trot.

    The result is what 'sysid replay --model' and the node take as known. Each bag is predicted by a model fitted to the others
    (halves, where there is one bag), and that error is shown.

    \b
    Examples:
      sysid identify run1/ run2/ --urdf arm.urdf --validate run3/ --out model.yaml
      sysid identify run1/ run2/ --urdf arm.urdf --effect cogging --effect spring --out model.yaml
      sysid identify sway/ trot/ --urdf quadruped.urdf --imu-topic /imu/data --contact-topic /feet --out model.yaml

    Exit codes: 0 done; 2 bad input or usage.
    """
    from sysid_ros.diagnosis.whose.as_named import as_named

    check_outputs(force, out=out_path, urdf_out=urdf_out, report=report_path, json=json_path, rerun=rerun_path)
    check_plot_paths(None, rerun_path)
    settings = settings_from(read_config(config_path), joint_names=joint_names, effort_preset=effort_preset)
    topics = TrunkTopics(choices.pop("imu_topic"), choices.pop("contact_topic"))
    robot, read, problems = read_recordings((*bags, *validate, *payload_bag), urdf, topic, settings, columns_path, topics)
    base = floating_base_of(robot, settings)
    origin = provenance(bags)
    first, second = len(bags), len(bags) + len(validate)
    measured = settings.velocity_source == "message"
    try:
        with progress_bar("identifying", 2 * len(read) + 2) as advance:
            problems = [*problems, *as_named(robot, base, read[:first], settings.max_gap, choices["accept_doubts"])]
            advance(1)
            result = identify_recordings(
                robot, read[:first], read[first:second], origin, Choices(**choices), cutoff or 0.0, settings.max_gap, measured,
                problems, read[second:], lambda what: advance(1), base, math.hypot(*settings.gravity),
            )  # fmt: skip
    except SysidError:
        # what was wrong with the messages may be the reason
        warn_of(problems)
        raise
    described = base.robot if base else robot, urdf, base
    _write(described, result, origin, out_path, json_path, urdf_out, (report_path, rerun_path), verbose)


def _write(
    described: tuple[RobotModel, Path | None, FloatingBase | None],
    result: Identification,
    provenance: dict[str, Any],
    out_path: Path,
    json_path: Path | None,
    urdf_out: Path | None,
    pages: tuple[Path | None, Path | None],
    verbose: bool,
) -> None:
    """Warnings, the files that were asked for, and the tables."""
    robot, urdf, base = described
    warn_of(result.problems)
    for sentence in result.physical.notes if result.physical else ():
        note(sentence)
    result.model.write(out_path)
    check_model_file(robot, result.model, out_path)
    if json_path:
        write_json(json_path, as_json(result))
    for sentence in export_urdf(robot, result.model, urdf_out, base) if urdf_out else ():
        note(sentence)
    report_path, rerun_path = pages
    if report_path:
        from sysid_ros.pages.identification_page import write_report

        write_report(report_path, result, provenance, robot, urdf)
    if rerun_path:
        from sysid_ros.pages.identification_page import recording_of

        recording_of(rerun_path, result, robot, urdf)
    show(result, verbose=verbose)
    for what, path in (("Model", out_path), ("URDF", urdf_out), ("Report", report_path), ("Recording", rerun_path)):
        if path:
            note(f"{what} written to {path}.")
