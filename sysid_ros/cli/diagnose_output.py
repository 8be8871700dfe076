"""What ``sysid diagnose`` writes and shows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sysid_ros.cli.output import check_outputs, note, report, table, write_json
from sysid_ros.diagnosis import Diagnosis
from sysid_ros.diagnosis.result import Predictions, TorqueRmse
from sysid_ros.effects.wording import first_sentence, listed, percent
from sysid_ros.exceptions import ModelFileError, RobotModelError
from sysid_ros.files import check_folder, whole_files, write_text
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.pages import check_plot_paths
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.mjcf_export import export_mjcf
from sysid_ros.torque.urdf_export import export_urdf

FILES = ("report.html", "diagnosis.json", "model.yaml", "hybrid.json", "extended.urdf", "extended.xml", "predictions.npz")
"""What the folder of a diagnosis holds."""
_WIDTH = 100
_SEEN = 5e-4
"""Part of the error from which it is shown, in tenths of a per cent."""


def check_results(folder: Path, json_path: Path | None, rerun_path: Path | None, force: bool) -> None:
    """Check, before the work, that the files can be written, and that none of before is overwritten.

    Raises:
        OutputError: one can't be written or is there already. SettingsError: Rerun is not installed.
    """
    check_folder(folder, FILES, force, "--out")
    check_outputs(force, json=json_path, rerun=rerun_path)
    check_plot_paths(None, rerun_path)


def write_files(
    result: Diagnosis,
    robot: RobotModel | None,
    folder: Path,
    provenance: dict[str, object],
    json_path: Path | None = None,
    urdf: Path | None = None,
    rerun_path: Path | None = None,
    base: FloatingBase | None = None,
) -> None:
    """Write the report, the document for machines, the extended model and its predictions into a folder, all or none of them;
    the document also where else it is asked for, and the recording of Rerun.

    Args:
        urdf: the robot's file, beside which meshes are looked for. base: of a robot on legs.

    Raises:
        OutputError: they can't be written.
    """
    from sysid_ros.pages.diagnosis_page import diagnosis_page, recording_of

    with whole_files(folder, FILES) as room:
        write_json(room / "diagnosis.json", result.as_dict())
        write_text(room / "report.html", diagnosis_page(result, robot.name if robot else "", provenance, robot, urdf))
        if result.model is not None:
            result.model.write(room / "model.yaml")
        if (p := result.predictions) is not None:
            np.savez_compressed(room / "predictions.npz", **_arrays(p))
        if result.hybrid is not None:
            write_json(room / "hybrid.json", result.hybrid.as_dict())
        if robot is not None:
            for sentence in _write_robots(result, robot, room, base):
                note(sentence)
    if json_path:
        write_json(json_path, result.as_dict())
    if rerun_path and result.predictions is not None:
        recording_of(rerun_path, result, robot, urdf)
        note(f"Recording written to {rerun_path}.")


def _arrays(p: Predictions) -> dict[str, Any]:
    """What predictions.npz holds."""
    hybrid = {} if p.hybrid is None else {"tau_hybrid": p.hybrid}
    names = {"joint_names": np.array(p.joints)}
    return {"t": p.t, **names, "tau_measured": p.measured, "tau_nominal": p.nominal, "tau_extended": p.extended, **hybrid}


def _write_robots(result: Diagnosis, robot: RobotModel, room: Path, base: FloatingBase | None) -> list[str]:
    """The extended robot as URDF and MJCF; what they can't hold, in words."""
    if result.urdf_model is None:
        return []
    try:
        notes = export_urdf(robot, result.urdf_model, room / "extended.urdf", base)
    except (ModelFileError, RobotModelError) as error:
        write_text(room / "extended.urdf", base.legs.urdf if base else robot.urdf)
        notes = [f"extended.urdf is the URDF as it was given: {error} model.yaml has what was found."]
    if base is not None:
        return [*notes, "There is no extended.xml: MJCF is written of arms. extended.urdf has what a description can hold."]
    try:
        notes += export_mjcf(robot, result.urdf_model, room / "extended.xml")
    except ModelFileError as error:
        notes.append(f"There is no extended.xml: {error} model.yaml has what was found.")
    return notes


def show(result: Diagnosis, console: Console | None = None) -> None:
    """Print the answer, faults of the data, the causes with their shares, and the torque errors."""
    console = console or report(_WIDTH)
    console.print(escape(f"{result.headline} {result.refinements}".rstrip()))
    if result.refusal:
        console.print(escape(first_sentence(result.refusal)[1]))
        for sentence in result.notes:
            console.print(escape(f"- {sentence}"))
        return
    console.print(f"Verdict: {result.verdict.replace('_', ' ')}.{f' {escape(result.unexplained)}' if result.unexplained else ''}")
    for finding in result.data_faults:
        console.print(escape(f"\nFault of the data: {finding.sentence}"))
    if result.causes:
        console.print(_causes(result))
    if result.torque is not None:
        console.print(_errors(result.torque, result.units))
    if result.ceiling is not None:
        console.print(escape(result.ceiling.sentence))
    for sentence in (*result.record_next, *result.notes):
        console.print(escape(f"- {sentence}"))


def _causes(result: Diagnosis) -> Table:
    """The causes, and what else the error on held-out data is made of."""
    likely = any(f.probability is not None for f in result.causes)
    title = "What makes the torque error on data that were not fitted (squared, each joint over its noise)"
    out = table(title, "share", *(["sure"] if likely else []), "cause", words=("cause",))
    for f in result.causes:
        also = f" (or: {listed(f.look_alikes)}; these recordings can't tell)" if f.look_alikes else ""
        sure = [] if not likely else ["-" if f.probability is None else f"{100 * f.probability:.0f} %"]
        out.add_row(percent(f.heldout_gain), *sure, escape(f"{f.words}{also}{f' {f.remark}' if f.remark else ''}"))
    for part, words in result.rest.in_words() if result.rest is not None else ():
        if abs(part) < _SEEN:
            continue
        out.add_row(percent(part), *([""] if likely else []), words, style="dim")
    return out


def _errors(t: TorqueRmse, units: Sequence[str]) -> Table:
    """What each joint, or each row of a robot on legs, is off by; ``units`` of them, empty for N m."""
    what = "Error of the force and the moment on the robot" if units else "Torque error"
    title = f"{what} on data that were not fitted, below 8 Hz: rms{'' if units else ' in N m'}"
    out = table(title, "" if units else "joint", "torque", "error before", "error after", "of torque", "noise")
    for j, name in enumerate(t.joints):
        part = f"{100.0 * t.after[j] / max(t.torque[j], 1e-12):.1f} %"
        numbers = f"{t.torque[j]:.3g}", f"{t.before[j]:.3g}", f"{t.after[j]:.3g}", part, f"{t.noise_floor[j]:.2g}"
        out.add_row(f"{name} ({units[j]})" if units else name, *numbers)
    return out
