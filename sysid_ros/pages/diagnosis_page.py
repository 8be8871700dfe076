"""The report of a diagnosis: one HTML file that opens without a network."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from importlib import resources
from string import Template

import numpy as np

from sysid_ros.diagnosis.result import Diagnosis, Finding, Parameter
from sysid_ros.diagnosis.trajectories import HORIZON, Trajectories
from sysid_ros.pages.diagnosis_figures import residual_figure, simulation_figure, torque_figure

_VERDICTS = {
    "explained": "The causes below explain what the nominal model gets wrong.",
    "partly_explained": "The causes below explain a part of what the nominal model gets wrong; something else is left.",
    "unexplained": "The nominal model is wrong, and no cause that is known here explains it.",
    "nothing_wrong": "Nothing is wrong that these recordings could show: the model predicts the torques down to the noise.",
    "refused": "These recordings can't be judged.",
}


def diagnosis_page(result: Diagnosis, name: str, provenance: Mapping[str, object], driven: Trajectories | None = None) -> str:
    """HTML of the report: a paragraph in plain words, the causes, the figures, the numbers, where they come from.

    Args:
        driven: the simulation under the measured torques.
    """
    from plotly.offline import get_plotlyjs

    template = Template(resources.files("sysid_ros.pages").joinpath("identification.html").read_text(encoding="utf-8"))
    return template.substitute(
        title=f"Diagnosis of {escape(name or 'robot')}",
        where=f"{len(result.joints)} joints; {_judged_on(provenance)}.",
        lead=_lead(result),
        tiles=_tiles(result),
        sections="\n".join(_sections(result, provenance, driven)),
        plotly=get_plotlyjs() if result.predictions is not None else "",
    )


def _judged_on(provenance: Mapping[str, object]) -> str:
    bags, others = provenance.get("bags"), provenance.get("validate")
    fitted = ", ".join(map(str, bags)) if isinstance(bags, list) else "recordings"
    judged = (
        f"judged on {', '.join(map(str, others))}, never fitted"
        if others and isinstance(others, list)
        else ("judged on the last part of each, which was not fitted")
    )
    return escape(f"from {fitted}; {judged}")


def _lead(result: Diagnosis) -> str:
    if result.verdict == "refused":
        return f"{_VERDICTS['refused']} {escape(result.refusal or '')}"
    sentences = [_VERDICTS[result.verdict]]
    if result.findings and result.torque is not None:
        first = result.findings[0]
        then = [f.label for f in result.findings[1:4]]
        rest = f", then {escape(_listed(tuple(then)))}" if then else ""
        sentences.append(f"First comes <b>{escape(first.label)}</b> on {escape(_where(first, result))}{rest}.")
        t = result.torque
        floor = np.maximum(t.noise_floor, 1e-12)
        most, worst = int(np.argmax(t.before / floor)), int(np.argmax(t.after / floor))
        torque = max(float(t.torque[most]), 1e-12)
        sentences.append(
            f"On data that were not fitted the error of {escape(result.joints[most])}, the furthest above its noise, falls from "
            f"{_times(t.before[most] / floor[most])} to {_times(t.after[most] / floor[most])} the noise, "
            f"{100 * t.before[most] / torque:.2g} to {100 * t.after[most] / torque:.2g} % of its torque."
        )
        if result.unexplained_fraction >= 0.01:
            sentences.append(
                f"{100 * result.unexplained_fraction:.0f} % of the error's power above the noise is left, most on "
                f"{escape(result.joints[worst])}."
            )
    if result.unexplained:
        sentences.append(escape(result.unexplained))
    return " ".join(sentences)


def _tiles(result: Diagnosis) -> str:
    tiles = [(result.verdict.replace("_", " "), "verdict")]
    if result.torque is not None:
        weight = np.maximum(result.torque.noise_floor, 1e-12)
        before = float(np.sqrt(np.mean((result.torque.before / weight) ** 2)))
        after = float(np.sqrt(np.mean((result.torque.after / weight) ** 2)))
        tiles += [
            (str(len(result.findings)), "causes that earned their place"),
            (f"{before:.1f} → {after:.2f}", "error over noise floor, before and after"),
        ]
    if (s := result.simulation) is not None:
        tiles.append(
            (
                f"{_angle(s.position_rmse_before)} → {_angle(s.position_rmse_after)}",
                f"simulated position after {s.horizon_s:g} s under the measured torques",
            )
        )
    return "".join(f"<div class='tile'><b>{escape(value)}</b><span>{escape(what)}</span></div>" for value, what in tiles)


def _sections(result: Diagnosis, provenance: Mapping[str, object], driven: Trajectories | None) -> list[str]:
    out = []
    if result.findings:
        rows = "".join(_row(i, f) for i, f in enumerate(result.findings, start=1))
        head = (
            "<tr><th>cause</th><th class='left'>in one sentence</th><th>gain</th><th>ΔBIC</th>"
            "<th class='left'>can't be told from</th></tr>"
        )
        note = (
            "Gain: part of the nominal residual's power, over the noise of each joint, that comes back on data not fitted where "
            "this cause alone is left out. Causes that share what they explain do not add up to all that was removed."
        )
        out.append(_section("Causes, in order of gain", note, f"<div class='scroll'><table>{head}{rows}</table></div>"))
    if result.record_next:
        out.append(
            _section("What to record next", "", "<ul>" + "".join(f"<li>{escape(s)}</li>" for s in result.record_next) + "</ul>")
        )
    if (p := result.predictions) is not None:
        units = ["N m"] * len(p.joints)
        out.append(_section("Torque on held-out data", "Below 20 Hz; drag to zoom.", torque_figure(p, units)))
        if driven is not None:
            note = (
                f"{driven.simulator} from measured states under the measured torques, {HORIZON:g} s at a time; the ticks "
                "say when each window starts. The nominal model may leave the picture."
            )
            out.append(_section("The simulation driven as the robot was", note, simulation_figure(driven, p.joints)))
        note = (
            "What each model leaves, against what could explain it: a cause that is missing shows as a shape. To the right its "
            "amplitude density, with the noise floor dotted, and the part of its power that goes along with the "
            "joint's own velocity at each frequency (coherence)."
        )
        floor = result.torque.noise_floor if result.torque is not None else np.zeros(len(p.joints))
        out.append(_section("Residual", note, residual_figure(p, units, floor)))
    out += _numbers(result)
    facts = "".join(
        f"<tr><td>{escape(str(k))}</td><td><code>{escape(', '.join(v) if isinstance(v, list) else str(v))}</code></td></tr>"
        for k, v in provenance.items()
    )
    out.append(_section("Where this comes from", "", f"<table class='facts'>{facts}</table>"))
    return out


def _row(number: int, finding: Finding) -> str:
    return (
        f"<tr><td>{number}. {escape(finding.label)}</td>"
        f"<td class='words left'>{escape(finding.sentence)} It shows as {escape(finding.signature)}.</td>"
        f"<td>{_gain(finding.heldout_gain)}</td><td>{'—' if finding.delta_bic is None else format(finding.delta_bic, '.0f')}</td>"
        f"<td class='left'>{'<br>'.join(escape(o) for o in finding.cannot_be_told_from)}</td></tr>"
    )


def _angle(value: float) -> str:
    return f"{value:.2g} rad" if value >= 0.1 else f"{1e3 * value:.2g} mrad"


def _bar(share: float) -> str:
    return f"<span class='bar'><i style='width:{100 * min(max(share, 0.0), 1.0):.1f}%'></i></span> "


def _gain(share: float | None) -> str:
    return "—" if share is None else f"{_bar(share)}{100 * max(share, 0.0):.1f} %"


def _numbers(result: Diagnosis) -> list[str]:
    out = []
    if result.findings:
        rows = "".join(_parameter_row(f, p) for f in result.findings for p in f.parameters)
        head = "<tr><th>cause</th><th class='left'>joint</th><th class='left'>parameter</th><th>value</th><th>95 %</th></tr>"
        out.append(_section("Parameters", "", f"<div class='scroll'><table>{head}{rows}</table></div>"))
    if (t := result.torque) is not None:
        head = "<tr><th>joint</th><th>torque</th><th>nominal model</th><th>extended model</th><th>noise floor</th></tr>"
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{t.torque[j]:.3g}</td><td>{t.before[j]:.3g}</td>"
            f"<td>{t.after[j]:.3g} ({100 * t.after[j] / max(t.torque[j], 1e-12):.1f} %)</td><td>{t.noise_floor[j]:.2g}</td></tr>"
            for j, name in enumerate(t.joints)
        )
        note = "Root mean square on held-out data below 8 Hz, N m."
        out.append(_section("Torque error", note, f"<div class='scroll'><table>{head}{rows}</table></div>"))
    if (w := result.temperature) is not None:
        head = "<tr><th>joint</th><th>temperature</th><th>nominal model</th><th>extended model</th></tr>"
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{low:.1f} to {high:.1f} °C</td><td>{_correlation(before)}</td>"
            f"<td>{_correlation(after)}</td></tr>"
            for name, (low, high), before, after in zip(
                w["joints"], w["range"], w["friction_before"], w["friction_after"], strict=True
            )
        )
        note = (
            "Correlation of what each model leaves along the motion (residual times sign of the velocity, at equal speed) with "
            "the temperature of the joint, on held-out data; negative where friction falls as the joint warms up."
        )
        out.append(_section("Temperature", note, f"<div class='scroll'><table>{head}{rows}</table></div>"))
    return out


def _correlation(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _parameter_row(finding: Finding, p: Parameter) -> str:
    values = zip(p.value, p.low, p.high, strict=True) if isinstance(p.value, list) else [(p.value, p.low, p.high)]
    cells = [(_number(v), "—" if low is None else f"{_number(low)} to {_number(high)}") for v, low, high in values]
    unit = "" if p.unit == "1" else f" {escape(p.unit)}"
    return (
        f"<tr><td>{escape(finding.label)}</td><td class='left'>{escape(p.joint or '')}</td><td class='left'>{escape(p.name)}</td>"
        f"<td>{', '.join(c[0] for c in cells)}{unit}</td><td>{'<br>'.join(c[1] for c in cells)}</td></tr>"
    )


def _number(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float | int) else "—" if value is None else escape(str(value))


def _section(title: str, note: str, content: str) -> str:
    words = f"<p class='note'>{escape(note)}</p>" if note else ""
    return f"<section><h2>{escape(title)}</h2>{words}{content}</section>"


def _listed(names: tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _where(finding: Finding, result: Diagnosis) -> str:
    return "all joints" if len(finding.joints) == len(result.joints) > 2 else _listed(finding.joints)


def _times(ratio: float) -> str:
    return f"{ratio:.1f} times" if ratio < 10.0 else f"{ratio:.0f} times"
