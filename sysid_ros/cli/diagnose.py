"""``sysid diagnose``: what a robot's model gets wrong, why, and what the fix buys."""

from __future__ import annotations

import time
from pathlib import Path

import click
import numpy as np
from rich import box
from rich.table import Table

from sysid_ros import __version__
from sysid_ros.cli.inputs import open_bag, read_config, settings_from
from sysid_ros.cli.output import ManyValues, command_line, note, progress_bar, report, warn, write_json
from sysid_ros.diagnosis import Diagnosis, Recording, diagnose
from sysid_ros.exceptions import RobotModelError, SysidError
from sysid_ros.identification.urdf_export import export_urdf
from sysid_ros.input_gate import InputGate
from sysid_ros.model_file import ModelFile
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import Measurement
from sysid_ros.settings import OnlineSettings

_PATH = click.Path(path_type=Path)
ANSWER_NO = 1


@click.command(cls=ManyValues)
@click.argument("bags", type=_PATH, nargs=-1, required=True, metavar="BAG...")
@click.option("--urdf", type=_PATH, help="The nominal model; else /robot_description of the first bag.")
@click.option("--out", "out_path", type=_PATH, required=True, metavar="DIR", help="Folder to write the files to.")
@click.option(
    "--validate",
    type=_PATH,
    multiple=True,
    metavar="BAG...",
    help="Bags to judge on, never fitted; of another motion, if possible.",
)
@click.option(
    "--model", "model_path", type=_PATH, help="model.yaml of 'sysid identify' or of an earlier diagnosis: the known part."
)
@click.option(
    "--config", "config_path", type=_PATH, help="Parameters of the node (effort_scale, joint_names, ...), a ROS 2 YAML file."
)
@click.option("--topic", default="/joint_states", show_default=True)
@click.option("--json", "json_path", type=_PATH, help="Write the result for machines here too.")
def command(
    bags: tuple[Path, ...],
    urdf: Path | None,
    out_path: Path,
    validate: tuple[Path, ...],
    model_path: Path | None,
    config_path: Path | None,
    topic: str,
    json_path: Path | None,
) -> int:
    """Find what the model of a robot gets wrong: the causes by name, with evidence, and a model extended by them.

    Writes DIR/report.html, diagnosis.json, model.yaml, extended.urdf and predictions.npz. Without --validate the last part
    of each bag is held out.

    \b
    Example:
      sysid diagnose run1/ --urdf arm.urdf --validate run2/ --out diagnosis/

    Exit codes: 0 done; 1 the recordings can't be judged (the verdict is "refused"); 2 bad input or usage.
    """
    started = time.monotonic()
    settings = settings_from(read_config(config_path))
    robots: list[RobotModel] = []
    fitted = [_read(path, urdf, topic, settings, robots) for path in bags]
    judged = [_read(path, urdf, topic, settings, robots) for path in validate]
    known = ModelFile.read(model_path) if model_path else None
    for sentence in known.notes(robots[0].urdf) if known else []:
        note(sentence)
    provenance: dict[str, object] = {
        "bags": [str(b) for b in bags],
        "validate": [str(b) for b in validate],
        "command": command_line(),
        "version": __version__,
    }
    result = diagnose(robots[0], fitted, judged, known, lambda sentence: note(f"  {sentence}"), provenance)
    _write(result, robots[0], out_path, provenance)
    if json_path:
        write_json(json_path, result.as_dict())
    _show(result)
    note(f"Written to {out_path} in {time.monotonic() - started:.0f} s.")
    return ANSWER_NO if result.verdict == "refused" else 0


def _read(path: Path, urdf: Path | None, topic: str, settings: OnlineSettings, robots: list[RobotModel]) -> Recording:
    source, robot = open_bag(path, topic, urdf, settings)
    if robots and robot.joint_names != robots[0].joint_names:
        raise RobotModelError(
            f"bag '{path}' has joints {', '.join(robot.joint_names)}, the first bag has {', '.join(robots[0].joint_names)}. "
            "Use bags of the same robot."
        )
    robots.append(robot)
    gate = InputGate(robot, settings)
    measurements = []
    with progress_bar(path.name, source.message_count) as advance:
        for record in source:
            advance(1)
            accepted = gate.accept(record)
            if isinstance(accepted, Measurement):
                measurements.append(accepted)
    for key, n in gate.counts.items():
        warn(f"{path.name}: {n} of {gate.received} messages rejected: {gate.last_texts[key]}")
    for sentence in gate.warnings:
        warn(f"{path.name}: {sentence}")
    return Recording.from_measurements(str(path), measurements)


def _write(result: Diagnosis, robot: RobotModel, folder: Path, provenance: dict[str, object]) -> None:
    from sysid_ros.plots.diagnosis_page import diagnosis_page

    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "diagnosis.json", result.as_dict())
    (folder / "report.html").write_text(diagnosis_page(result, robot.name, provenance))
    if result.model is not None:
        result.model.write(folder / "model.yaml")
        try:
            for sentence in export_urdf(robot, result.model, folder / "extended.urdf"):
                note(sentence)
        except SysidError as error:
            (folder / "extended.urdf").write_text(robot.urdf)
            warn(f"extended.urdf is the URDF as it was given: {error}")
    if (p := result.predictions) is not None:
        np.savez_compressed(
            folder / "predictions.npz",
            t=p.t,
            joint_names=np.array(p.joints),
            tau_measured=p.measured,
            tau_nominal=p.nominal,
            tau_extended=p.extended,
        )


def _show(result: Diagnosis) -> None:
    console = report()
    console.print(f"Verdict: {result.verdict.replace('_', ' ')}", highlight=False)
    if result.refusal:
        console.print(result.refusal, highlight=False)
        return
    for number, finding in enumerate(result.findings, start=1):
        console.print(f"{number}. {finding.sentence}", highlight=False)
        if finding.cannot_be_told_from:
            console.print(f"   These recordings can't tell it from {', '.join(finding.cannot_be_told_from)}.", highlight=False)
    for sentence in (result.unexplained, *result.record_next, *result.notes):
        if sentence:
            console.print(sentence, highlight=False)
    if (t := result.torque) is None:
        return
    table = Table(title="Torque error on held-out data below 8 Hz: rms in N m", title_justify="left", box=box.SIMPLE)
    for column in ("joint", "torque", "nominal model", "extended model", "noise floor"):
        table.add_column(column, justify="left" if column == "joint" else "right", no_wrap=True)
    for j, name in enumerate(t.joints):
        part = 100.0 * t.after[j] / max(t.torque[j], 1e-12)
        table.add_row(
            name, f"{t.torque[j]:.3g}", f"{t.before[j]:.3g}", f"{t.after[j]:.3g} ({part:.1f} %)", f"{t.noise_floor[j]:.2g}"
        )
    console.print(table)
