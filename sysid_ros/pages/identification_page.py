"""The report of an identification: one HTML file that opens without a network."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from sysid_ros.identification.result import Identification, TorqueError
from sysid_ros.pages import identification_figures
from sysid_ros.pages import identification_tables as tables
from sysid_ros.pages.identification_tables import number

_MOST_RECORDINGS = 4
"""Recordings whose torques are drawn one by one."""


def write_report(path: Path, result: Identification, provenance: dict[str, Any]) -> None:
    """Write the report of an identification.

    It holds the torque measured and predicted where nothing was fitted, the residual against position, velocity, time and
    frequency, the parameters with their intervals, what is lumped with what, the noise, and what to record next. Everything
    that it shows is inside the file.

    Args:
        path: the HTML file; one that is there is replaced. result: what was found.
        provenance: bags, command and version.
    """
    path.write_text(report_page(result, provenance), encoding="utf-8")


def report_page(result: Identification, provenance: dict[str, Any]) -> str:
    """HTML of the report."""
    from plotly.offline import get_plotlyjs

    template = Template(resources.files(__package__).joinpath("identification.html").read_text(encoding="utf-8"))
    judged = result.validation or result.errors
    name = result.model.robot_name or "robot"
    values = {
        "title": f"Identification of {escape(name)}",
        "where": f"{len(result.joint_names)} joints, from {_bag_names(result.bags)}; {_judged_on(result)}.",
        "lead": _lead(result, judged),
        "tiles": _tiles(result, judged),
        "sections": "\n".join(_sections(result, judged, provenance)),
        "plotly": get_plotlyjs(),
    }
    return template.substitute(values)


def _bag_names(bags: Sequence[str]) -> str:
    names = [escape(Path(bag).name) for bag in bags]
    return names[0] if len(names) == 1 else f"{len(names)} bags ({', '.join(names)})"


def _judged_on(result: Identification) -> str:
    if result.validation:
        return f"judged on {_bag_names(result.validation_bags)}, never fitted"
    return "judged on recordings held out in turn" if len(result.bags) > 1 else "judged on the halves held out in turn"


def _mean(errors: Sequence[TorqueError], field: str) -> np.ndarray[Any, Any]:
    """Root mean square over the recordings, shape (n,)."""
    return np.asarray(np.sqrt(np.mean([getattr(e, field) ** 2 for e in errors], axis=0)))


def _lead(result: Identification, judged: Sequence[TorqueError]) -> str:
    torque = np.maximum(_mean(judged, "torque"), 1e-12)
    found, urdf = _mean(judged, "residual") / torque, _mean(judged, "nominal") / torque
    worst = result.joint_names[int(np.argmax(found))]
    determined = sum(g.determined_by == "bags" for g in result.groups)
    sentences = [
        f"Where nothing was fitted, the model leaves <b>{_range(found)}</b> of the joints' torque unexplained; the URDF alone "
        f"leaves {_range(urdf)}. The largest part is left on {escape(worst)}.",
        f"Of {result.base.rank} combinations of parameters that this robot's motion can show, these bags determine "
        f"{determined} by themselves; for the others the URDF speaks with them.",
    ]
    if result.physical is not None:
        sentences.append("Every link is a body that can exist, and friction and rotors are not negative.")
    coloured = sum(not w.white for w in result.whiteness)
    if coloured:
        sentences.append(
            f"The residual keeps its sign for a while in {coloured} of {len(result.whiteness)} cases: the model lacks something "
            "there. The intervals take that into account."
        )
    return " ".join(sentences)


def _range(parts: np.ndarray[Any, Any]) -> str:
    low, high = 100.0 * float(parts.min()), 100.0 * float(parts.max())
    texts = [f"{x:.2g}" if x < 99.5 else f"{x:.0f}" for x in (low, high)]
    return f"{texts[0]} %" if texts[0] == texts[1] else f"{texts[0]} to {texts[1]} %"


def _tiles(result: Identification, judged: Sequence[TorqueError]) -> str:
    torque = np.maximum(_mean(judged, "torque"), 1e-12)
    median = 100.0 * float(np.median(_mean(judged, "residual") / torque))
    nominal = 100.0 * float(np.median(_mean(judged, "nominal") / torque))
    effective = sum(x.effective_rows for x in result.noise)
    tiles = [
        (f"{median:.2g} %", f"of the torque left unexplained, median over the joints; the URDF alone: {nominal:.2g} %"),
        (
            f"{sum(g.determined_by == 'bags' for g in result.groups)} of {result.base.rank}",
            "base parameters determined by the bags",
        ),
        (number(result.bags_condition_number), "condition number of these bags; under 100 is good"),
        (f"{effective:.0f}", f"independent rows of {sum(x.rows for x in result.noise)}, by the colour of the residual"),
        (f"{result.cutoff.hz:.3g} Hz", "low-pass on both sides of the equation"),
    ]
    return "".join(f'<div class="tile"><b>{head}</b><span>{escape(text)}</span></div>' for head, text in tiles)


def _sections(result: Identification, judged: Sequence[TorqueError], provenance: dict[str, Any]) -> list[str]:
    joints = result.joint_names
    units = [next((p.unit for p in result.parameters if p.effect == "torque_offset" and p.joint == j), "N m") for j in joints]
    prismatic = [unit == "N" for unit in units]
    out = []
    if result.record_next or result.problems:
        out.append(_section("What to record next", "", _list(result.record_next) + _problems(result)))
    if result.payload is not None:
        said = "The difference between the loaded and the empty runs, as a body that can exist."
        if not result.payload.consistent:
            said = "No body explains the difference between the loaded and the empty runs; this is the nearest."
        out.append(_section("Payload", said, f"<div class='scroll'>{tables.payload(result.payload)}</div>"))
    out.append(
        _section(
            "Torque error where nothing was fitted",
            f"Root mean square over {_judged_on(result).removeprefix('judged on ')}. {tables.ERROR_KEY}",
            tables.errors(joints, units, judged),
            plain_note=False,
        )
    )
    drawn = result.series[:_MOST_RECORDINGS]
    for series in drawn:
        out.append(
            _section(
                f"Torque measured and predicted: {Path(series.name).name}",
                f"{series.kind}, after the low-pass. Drag to enlarge, double-click to go back, click on a name to hide it.",
                identification_figures.torque_figure(series, joints, units, 1.0 / len(drawn)),
            )
        )
    if result.series:
        out.append(
            _section(
                "What is left: the residual",
                "Measured minus predicted, of all recordings above. Black: the mean over classes; grey points: the joint hardly "
                "moves, so its dry friction is not determined. Far right: spectrum of the residual (blue) and of the torque "
                "(grey), per root hertz. A slope over the velocity means friction of another shape, one over the position a "
                "spring or a wrong mass, one over time warming up.",
                identification_figures.residual_figure(result.series, joints, units, prismatic, result.cutoff.hz),
            )
        )
    standard = "".join(
        f"<details><summary>All {len(result.parameters)} standard parameters</summary>"
        "<p class='note'>Motion does not tell all of them one by one; where little comes from the bags, the prior decides. "
        "'bound' is the least any estimator could reach if the residuals were white.</p>"
        f"<div class='scroll'>{tables.parameters(result.parameters)}</div></details>"
    )
    own = [p for p in result.parameters if p.effect != "link_inertia"]
    out.append(
        _section(
            "Joints",
            "With 95 % intervals, which take the colour of the residuals into account; in brackets what the Cramér-Rao bound "
            "would allow, were the residuals white.",
            f"<div class='scroll'>{tables.joints_table(joints, own)}</div>{tables.knobs(result.knobs)}{standard}",
        )
    )
    out.append(
        _section(
            "Base parameters: what is lumped with what",
            "Only these sums show in the torque. Each line is one number that the motion can tell.",
            f"<div class='scroll'>{tables.groups(result.groups)}</div>",
        )
    )
    out.append(
        _section(
            "Noise",
            "The residual where it was fitted, how long it keeps its sign, what it leaves the rows worth, could it be white.",
            f"<div class='scroll'>{tables.noise(result.noise, result.whiteness)}</div>",
        )
    )
    if result.repeatability:
        out.append(
            _section(
                "Repeatability",
                "Parameters as each bag alone gives them. Much more spread between bags than within: the robot changed.",
                f"<div class='scroll'>{tables.repeatability(result.repeatability, result.bags)}</div>",
            )
        )
    out.append(_section("How it was made", "", tables.facts(result, provenance)))
    return out


def _section(title: str, note: str, content: str, plain_note: bool = True) -> str:
    text = (escape(note) if plain_note else note) if note else ""
    return f"<section><h2>{escape(title)}</h2>{f'<p class=note>{text}</p>' if text else ''}{content}</section>"


def _list(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(s)}</li>' for s in sentences)}</ul>" if sentences else ""


def _problems(result: Identification) -> str:
    if not result.problems:
        return ""
    found = [f"{Path(p.bag).name}: {p.text}" if p.bag else p.text for p in result.problems]
    return f"<h3>Found in the bags</h3>{_list(found)}"
