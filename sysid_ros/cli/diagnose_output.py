"""What ``sysid diagnose`` writes and shows."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sysid_ros.cli.output import note, report, table, write_json
from sysid_ros.diagnosis import Diagnosis
from sysid_ros.exceptions import ModelFileError, RobotModelError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.mjcf_export import export_mjcf
from sysid_ros.torque.urdf_export import export_urdf


def progress_lines() -> Callable[[str], None]:
    """Tells on stderr what is being done, with the seconds since the start."""
    started = time.monotonic()
    return lambda sentence: note(f"{time.monotonic() - started:5.1f} s  {sentence}")


def write_files(result: Diagnosis, robot: RobotModel | None, folder: Path, provenance: dict[str, object]) -> None:
    """Write the report, the document for machines, the extended model and its predictions into a folder."""
    from sysid_ros.pages.diagnosis_page import diagnosis_page

    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "diagnosis.json", result.as_dict())
    (folder / "report.html").write_text(diagnosis_page(result, robot.name if robot else "", provenance))
    if result.model is not None:
        result.model.write(folder / "model.yaml")
    if (p := result.predictions) is not None:
        np.savez_compressed(
            folder / "predictions.npz",
            t=p.t,
            joint_names=np.array(p.joints),
            tau_measured=p.measured,
            tau_nominal=p.nominal,
            tau_extended=p.extended,
        )
    if result.urdf_model is not None and robot is not None:
        try:
            notes = export_urdf(robot, result.urdf_model, folder / "extended.urdf")
        except (ModelFileError, RobotModelError) as error:
            (folder / "extended.urdf").write_text(robot.urdf)
            notes = [f"extended.urdf is the URDF as it was given: {error} model.yaml has what was found."]
        try:
            notes += export_mjcf(robot, result.urdf_model, folder / "extended.xml")
        except ModelFileError as error:
            notes.append(f"There is no extended.xml: {error} model.yaml has what was found.")
        for sentence in notes:
            note(sentence)


def show(result: Diagnosis) -> None:
    """Print the verdict, the causes and the torque errors."""
    console = report()
    console.print(f"Verdict: {result.verdict.replace('_', ' ')}")
    if result.refusal:
        console.print(result.refusal)
        return
    for number, finding in enumerate(result.findings, start=1):
        console.print(f"{number}. {finding.sentence}")
        if finding.cannot_be_told_from:
            console.print(f"   These recordings can't tell it from {', '.join(finding.cannot_be_told_from)}.")
    for sentence in (result.unexplained, *result.record_next, *result.notes):
        if sentence:
            console.print(sentence)
    if (t := result.torque) is None:
        return
    title = "Torque error on held-out data below 8 Hz: rms in N m"
    out = table(title, "joint", "torque", "nominal model", "extended model", "noise floor")
    for j, name in enumerate(t.joints):
        part = 100.0 * t.after[j] / max(t.torque[j], 1e-12)
        after = f"{t.after[j]:.3g} ({part:.1f} %)"
        out.add_row(name, f"{t.torque[j]:.3g}", f"{t.before[j]:.3g}", after, f"{t.noise_floor[j]:.2g}")
    console.print(out)
