"""The report of an identification: one HTML file that opens without a network."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.effects import Effect, named
from sysid_ros.files import write_text
from sysid_ros.identification.payload_difference import PayloadDifference
from sysid_ros.identification.result import Identification, Parameter, TorqueError
from sysid_ros.pages import palette
from sysid_ros.pages.ceiling_view import ceiling_view
from sysid_ros.pages.figure import Figure
from sysid_ros.pages.identification_figures import residual_figure, torque_figure
from sysid_ros.pages.page import number, page
from sysid_ros.pages.robot_view import Track, View, percentages, view
from sysid_ros.robot.inertial_parameters import NAMES
from sysid_ros.robot.robot_model import RobotModel

_MOST_RECORDINGS = 4
"""Recordings whose torques are drawn one by one."""
_SYMBOLS = {"b": "viscous", "Fc": "Coulomb", "Fs": "breakaway", "mu": "friction by load", "J": "rotor inertia"}
_MODELS = {
    "nominal": ("URDF alone", palette.ORANGE),
    "urdf_friction": ("URDF with friction, rotors and offsets", palette.GREEN),
    "residual": ("identified", palette.BLUE),
}
_SHORT = {"nominal": "URDF alone", "urdf_friction": "with friction", "residual": "identified"}


def write_report(
    path: Path, result: Identification, provenance: dict[str, Any], robot: RobotModel | None = None, urdf: Path | None = None
) -> None:
    """Write the report of an identification.

    It holds the torque measured and predicted where nothing was fitted, the residual against position, velocity, time and
    frequency, the parameters with their intervals, what is lumped with what, the noise, and what to record next. Everything
    that it shows is inside the file.

    Args:
        path: the HTML file; one that is there is replaced. result: what was found.
        provenance: bags, command and version. robot: to be shown. urdf: its file, beside which meshes are looked for.
    """
    write_text(path, report_page(result, provenance, robot, urdf))


def report_page(
    result: Identification, provenance: dict[str, Any], robot: RobotModel | None = None, urdf: Path | None = None
) -> str:
    """HTML of the report."""
    judged = result.validation or result.errors
    joints = result.joint_names
    units = _torque_units(result)
    drawn = result.series[:_MOST_RECORDINGS]
    return page(
        "identification.html",
        title=f"Identification of {result.model.robot_name or 'robot'}",
        where=f"{len(joints)} joint{'s' * (len(joints) != 1)}, from {_bag_names(result.bags)}; {_judged_on(result)}.",
        result=result,
        judged_on=_judged_on(result).removeprefix("judged on "),
        summary=_summary(result, judged),
        view=_view(robot, urdf, result, judged),
        tiles=_tiles(result, judged),
        models=_MODELS.values(),
        errors=_errors(joints, units, judged),
        torques=[(s, torque_figure(s, joints, units, 1.0 / len(drawn), i == 0)) for i, s in enumerate(drawn)],
        residual=_left(result),
        joints=_joints(joints, [p for p in result.parameters if not _kind(p).replaces_links]),
        several=any(math.isfinite(p.between_bags) for p in result.parameters),
        ceiling=ceiling_view(result.ceiling),
        payload=_payload(result.payload) if result.payload is not None else [],
        whiteness={(t.bag, t.joint): t for t in result.whiteness},
        facts=_facts(result, provenance),
        command=provenance.get("command"),
        version=provenance.get("version"),
    )


def _kind(parameter: Parameter) -> type[Effect]:
    found = named(parameter.effect)
    assert found is not None
    return found


def recording_of(path: Path, result: Identification, robot: RobotModel, urdf: Path | None = None) -> None:
    """Write the robot and the torques of the first recording over time, and what is left of all, for the viewer of Rerun.

    Args:
        path: the .rrd file. robot, urdf: as of :func:`write_report`.

    Raises:
        SettingsError: Rerun is not installed. OutputError: it can't be written.
    """
    from sysid_ros.pages.rerun_renderer import write_recording

    figures = [torque_figure(s, result.joint_names, _torque_units(result), 1.0, True) for s in result.series[:1]]
    figures = [replace(figure, title=f"Torque in {Path(result.series[0].name).name}") for figure in figures]
    if (left := _left(result)) is not None:
        figures.append(replace(left, title="What is left"))
    write_recording(path, figures, _view(robot, urdf, result, result.validation or result.errors))


def _torque_units(result: Identification) -> list[str]:
    """Of the effort of each joint."""
    found = {p.joint: p.unit for p in reversed(result.parameters) if p.unit in ("N", "N m")}
    return [found.get(joint, "N m") for joint in result.joint_names]


def _left(result: Identification) -> Figure | None:
    units = _torque_units(result)
    slides = [unit == "N" for unit in units]
    return residual_figure(result.series, result.joint_names, units, slides, result.cutoff.hz) if result.series else None


def _view(robot: RobotModel | None, urdf: Path | None, result: Identification, judged: Sequence[TorqueError]) -> View | None:
    """The robot in the first recording that is drawn, each joint in the colour of what is left of its torque."""
    if robot is None or not result.series:
        return None
    first, torque = result.series[0], np.maximum(_mean(judged, "torque"), 1e-12)
    parts = {name: _mean(judged, field) / torque for field, (name, _) in _MODELS.items()}
    most = float(max(part.max() for part in parts.values()))
    shown = ("residual", "urdf_friction", "nominal")
    colourings = tuple(percentages(_SHORT[field], parts[_MODELS[field][0]], most) for field in shown)
    caption = (
        f"The motion of {Path(first.name).name}, {first.kind}. Each joint has the colour of the part of its torque (rms) that a "
        "model leaves where nothing was fitted."
    )
    return view(robot, urdf, [Track("", first.t - first.t[0], first.q)], caption, colourings=colourings)


def _bag_names(bags: Sequence[str]) -> str:
    names = [Path(bag).name for bag in bags]
    return names[0] if len(names) == 1 else f"{len(names)} bags ({', '.join(names)})"


def _judged_on(result: Identification) -> str:
    if result.validation:
        return f"judged on {_bag_names(result.validation_bags)}, never fitted"
    return "judged on recordings held out in turn" if len(result.bags) > 1 else "judged on the halves held out in turn"


def _mean(errors: Sequence[TorqueError], field: str) -> np.ndarray[Any, Any]:
    """Root mean square over the recordings, shape (n,)."""
    return np.asarray(np.sqrt(np.mean([getattr(e, field) ** 2 for e in errors], axis=0)))


def _part(errors: Sequence[TorqueError], field: str) -> np.ndarray[Any, Any]:
    """An error as a part of the torque, shape (n,); NaN of joints none of whose rows can be used: of a leg that always stands."""
    torque = _mean(errors, "torque")
    return np.asarray(np.where(torque > 0.0, _mean(errors, field) / np.maximum(torque, 1e-12), np.nan))


def _summary(result: Identification, judged: Sequence[TorqueError]) -> dict[str, Any]:
    """What the first paragraph tells."""
    found = _part(judged, "residual")
    return {
        "found": _range(found[np.isfinite(found)]),
        "urdf": _range(_part(judged, "nominal")[np.isfinite(found)]),
        "worst": result.joint_names[int(np.nanargmax(found))],
        "determined": sum(g.determined_by == "bags" for g in result.groups),
        "coloured": sum(not w.white for w in result.whiteness),
    }


def summary(result: Identification) -> list[str]:
    """What the report's head says, in sentences for a terminal."""
    judged = result.validation or result.errors
    told = _summary(result, judged)
    sure = f"{told['determined']} of {result.base.rank} base parameters are determined by the recordings"
    return [
        f"{told['found']} of a joint's torque is left unexplained, {_judged_on(result)} (the URDF alone: {told['urdf']}); the "
        f"most at {told['worst']}.",
        f"{sure}.",
    ]


def _range(parts: np.ndarray[Any, Any]) -> str:
    low, high = 100.0 * float(parts.min()), 100.0 * float(parts.max())
    texts = [f"{x:.2g}" if x < 99.5 else f"{x:.0f}" for x in (low, high)]
    return f"{texts[0]} %" if texts[0] == texts[1] else f"{texts[0]} to {texts[1]} %"


def _tiles(result: Identification, judged: Sequence[TorqueError]) -> list[tuple[str, str]]:
    median, nominal = (100.0 * float(np.nanmedian(_part(judged, field))) for field in ("residual", "nominal"))
    determined = sum(g.determined_by == "bags" for g in result.groups)
    effective, rows = sum(x.effective_rows for x in result.noise), sum(x.rows for x in result.noise)
    return [
        (f"{median:.2g} %", f"of the torque left unexplained, median over the joints; the URDF alone: {nominal:.2g} %"),
        (f"{determined} of {result.base.rank}", "base parameters determined by the bags"),
        (number(result.bags_condition_number), "condition number of these bags; under 100 is good"),
        (f"{effective:.0f}", f"independent rows of {rows}, by the colour of the residual"),
        (f"{result.cutoff.hz:.3g} Hz", "low-pass on both sides of the equation"),
    ]


def _errors(joints: Sequence[str], units: Sequence[str], judged: Sequence[TorqueError]) -> list[dict[str, Any]]:
    """Torque error of three models, a joint a line: value, part of the joint's torque, width of its bar, colour."""
    squares = {field: _mean(judged, field) for field in (*_MODELS, "torque")}
    torque = np.maximum(squares["torque"], 1e-12)
    longest = max(float(np.max(squares[field] / torque)) for field in _MODELS)
    return [
        {
            "joint": joint,
            "torque": f"{number(squares['torque'][j])} {units[j]}",
            "models": [
                (squares[field][j], squares[field][j] / torque[j], squares[field][j] / torque[j] / longest, colour)
                for field, (_, colour) in _MODELS.items()
            ],
        }
        for j, joint in enumerate(joints)
    ]


def _joints(joints: Sequence[str], found: Sequence[Parameter]) -> tuple[list[str], list[list[str]]]:
    """Head and rows of what each joint has beside its link, a joint a line and a parameter a column; in brackets the bound."""
    by_place = {(p.joint, p.name.split("[")[0]): p for p in found}
    symbols = list(dict.fromkeys(symbol for _, symbol in by_place))
    units = {symbol: sorted({_unit(p.unit) for (_, s), p in by_place.items() if s == symbol}) for symbol in symbols}
    rows = []
    for joint in joints:
        row = [joint]
        for symbol in symbols:
            p = by_place.get((joint, symbol))
            unit = f" {_unit(p.unit)}" if p is not None and len(units[symbol]) > 1 else ""
            row.append("–" if p is None else f"{number(p.value)} ± {number(1.96 * p.std, 2)} ({number(1.96 * p.crb, 2)}){unit}")
        rows.append(row)
    heads = [_SYMBOLS.get(s, s) + (f" [{units[s][0]}]" if len(units[s]) == 1 else "") for s in symbols]
    return ["joint", *heads], rows


def _unit(unit: str) -> str:
    return unit.replace("^2", "²")


def _payload(found: PayloadDifference) -> list[tuple[str, float, float, str, float]]:
    """Name, value, standard deviation, unit and share of the bags of the ten parameters of a payload."""
    std = np.sqrt(np.diag(found.covariance))
    lines = [("mass", found.mass, found.mass_std, "kg")]
    lines += [(f"centre of mass, {a}", c, s, "m") for a, c, s in zip("xyz", found.com, found.com_std, strict=True)]
    origin = zip(NAMES[4:], found.theta[4:], std[4:], strict=True)
    lines += [(f"{name} about the frame's origin", value, s, "kg m²") for name, value, s in origin]
    return [(*line, float(part)) for line, part in zip(lines, found.from_data, strict=True)]


def _facts(result: Identification, provenance: dict[str, Any]) -> list[tuple[str, str]]:
    """How the result came about, a fact a line."""
    lines = [
        ("Robot", f"{result.model.robot_name}, URDF with SHA-256 {result.model.urdf_sha256[:16]}…"),
        ("Method", f"{result.method}, {result.form} form, {result.friction} friction"),
        ("Low-pass", f"{result.cutoff.hz:.3g} Hz: {result.cutoff.reason}"),
        ("Prior", f"weight {number(result.prior.weight)}: {result.prior.reason}"),
    ]
    if result.physical is not None:
        bound = ", ".join(result.physical.at_bound)
        lines.append(("Physical links", "yes" + (f"; held at 0: {bound}" if bound else "")))
        lines += [("", note) for note in result.physical.notes]
    else:
        lines.append(("Physical links", "not asked for"))
    lines.append(("Bags", ", ".join(str(bag) for bag in provenance.get("bags", result.bags))))
    if result.validation_bags:
        lines.append(("Validation", ", ".join(result.validation_bags)))
    return lines
