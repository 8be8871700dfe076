"""Tables of the identification's report, as HTML."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.identification.payload_difference import PayloadDifference
from sysid_ros.identification.result import (
    BaseGroup,
    Identification,
    JointNoise,
    Knob,
    Parameter,
    Repeatability,
    TorqueError,
    WhitenessTest,
)
from sysid_ros.pages.identification_figures import BLUE, GREEN, ORANGE
from sysid_ros.robot.inertial_parameters import NAMES

ERROR_KEY = (
    f'<span class="key"><i style="background:{ORANGE}"></i>URDF alone<i style="background:{GREEN}"></i>URDF with friction, '
    f'rotors and offsets<i style="background:{BLUE}"></i>identified</span>'
)
_SYMBOLS = {"b": "viscous", "Fc": "Coulomb", "Fs": "breakaway", "mu": "friction by load", "J": "rotor inertia"}
_CHIPS = {"bags": "good", "bags and prior": "fair", "prior": "poor"}


def number(value: float, digits: int = 3) -> str:
    """A number for people; a dash where there is none."""
    if not math.isfinite(value):
        return "∞" if value == math.inf else "–"
    return f"{value:.{digits}g}".replace("e-0", "e-").replace("e+0", "e")


def errors(joints: Sequence[str], units: Sequence[str], judged: Sequence[TorqueError]) -> str:
    """Torque error of three models, a joint a line, with bars in parts of the joint's torque."""
    fields = (("nominal", ORANGE), ("urdf_friction", GREEN), ("residual", BLUE))
    squares = {f: np.sqrt(np.mean([getattr(e, f) ** 2 for e in judged], axis=0)) for f in (*dict(fields), "torque")}
    torque = np.maximum(squares["torque"], 1e-12)
    longest = max(float(np.max(squares[f] / torque)) for f, _ in fields)
    rows = []
    for j, joint in enumerate(joints):
        bars = "".join(
            f'<div style="width:{100 * squares[f][j] / torque[j] / longest:.1f}%;background:{colour}"></div>'
            for f, colour in fields
        )
        cells = "".join(f"<td>{number(squares[f][j])} ({100 * squares[f][j] / torque[j]:.1f} %)</td>" for f, _ in fields)
        rows.append(
            f"<tr><td>{escape(joint)}</td><td>{number(squares['torque'][j])} {units[j]}</td>{cells}"
            f'<td class="bars">{bars}</td></tr>'
        )
    head = ("joint", "torque, rms", "URDF alone", "URDF, friction", "identified", "part of the torque")
    return f'<div class="scroll">{_table(head, rows)}</div>'


def joints_table(joints: Sequence[str], found: Sequence[Parameter]) -> str:
    """What each joint has beside its link, a joint a line and an effect a column; in brackets the bound."""
    by_place = {(p.joint, p.name.split("[")[0]): p for p in found}
    symbols = list(dict.fromkeys(symbol for _, symbol in by_place))
    units = {symbol: sorted({_unit(p.unit) for (_, s), p in by_place.items() if s == symbol}) for symbol in symbols}
    rows = []
    for joint in joints:
        cells = []
        for symbol in symbols:
            p = by_place.get((joint, symbol))
            unit = f" {_unit(p.unit)}" if p is not None and len(units[symbol]) > 1 else ""
            interval = "" if p is None else f"{number(p.value)} ± {number(1.96 * p.std, 2)} ({number(1.96 * p.crb, 2)}){unit}"
            cells.append(f"<td>{interval or '–'}</td>")
        rows.append(f"<tr><td>{escape(joint)}</td>{''.join(cells)}</tr>")
    heads = [_SYMBOLS.get(s, s) + (f" [{units[s][0]}]" if len(units[s]) == 1 else "") for s in symbols]
    return _table(("joint", *heads), rows)


def parameters(found: Sequence[Parameter]) -> str:
    """Parameters with intervals."""
    several = any(math.isfinite(p.between_bags) for p in found)
    rows = [
        f"<tr><td>{escape(p.name)}</td><td>{number(p.value)}</td><td>± {number(1.96 * p.std, 2)}</td>"
        f"<td>± {number(1.96 * p.crb, 2)}</td><td>{_unit(p.unit)}</td>{_between(p.between_bags, several)}"
        f"<td>{_share(p.from_data)}</td></tr>"
        for p in found
    ]
    between = ("std between bags",) if several else ()
    return _table(("parameter", "value", "95 %", "bound", "unit", *between, "from the bags"), rows)


def groups(found: Sequence[BaseGroup]) -> str:
    """Base parameters in words."""
    several = any(math.isfinite(g.between_bags) for g in found)
    rows = [
        f'<tr><td class="words">{escape(g.words)}</td><td>{number(g.value)}</td><td>± {number(1.96 * g.std, 2)}</td>'
        f"<td>± {number(1.96 * g.crb, 2)}</td><td>{_unit(g.unit)}</td>{_between(g.between_bags, several)}"
        f'<td><span class="chip {_CHIPS.get(g.determined_by, "")}">{escape(g.determined_by)}</span></td></tr>'
        for g in found
    ]
    between = ("std between bags",) if several else ()
    return _table(("sum", "value", "95 %", "bound", "unit", *between, "from"), rows)


def knobs(found: Sequence[Knob]) -> str:
    """Nonlinear settings; nothing where there are none."""
    if not found:
        return ""
    rows = [
        f"<tr><td>{escape(k.name)}</td><td>{escape(k.joint)}</td><td>{number(k.value)} {escape(k.unit)}</td>"
        f"<td>{'yes' if k.determined else 'no'}</td></tr>"
        for k in found
    ]
    return f"<h3>Settings searched for</h3>{_table(('setting', 'joint', 'value', 'determined by the bags'), rows)}"


def payload(found: PayloadDifference) -> str:
    """The ten parameters of a payload with their intervals, and what follows from them."""
    std = np.sqrt(np.diag(found.covariance))
    lines = [("mass", found.mass, found.mass_std, "kg")]
    lines += [(f"centre of mass, {a}", c, s, "m") for a, c, s in zip("xyz", found.com, found.com_std, strict=True)]
    origin = zip(NAMES[4:], found.theta[4:], std[4:], strict=True)
    lines += [(f"{name} about the frame's origin", value, s, "kg m²") for name, value, s in origin]
    rows = [
        f"<tr><td>{escape(name)}</td><td>{number(value, 4)}</td><td>± {number(1.96 * s, 2)}</td><td>{unit}</td>"
        f"<td>{_share(float(part))}</td></tr>"
        for (name, value, s, unit), part in zip(lines, found.from_data, strict=True)
    ]
    return _table((f"in the frame of {found.frame}", "value", "95 %", "unit", "from the bags"), rows)


def noise(found: Sequence[JointNoise], tests: Sequence[WhitenessTest]) -> str:
    """Noise and whiteness, a joint and a bag a line."""
    by_place = {(t.bag, t.joint): t for t in tests}
    rows = []
    for x in found:
        test = by_place.get((x.bag, x.joint))
        verdict = "–"
        if test is not None:
            colour, word = ("good", "white") if test.white else ("fair", "coloured")
            verdict = f'<span class="chip {colour}">{word}</span> p = {number(test.p_value, 2)}'
        rows.append(
            f"<tr><td>{escape(x.joint)}</td><td>{escape(Path(x.bag).name)}</td><td>{number(x.std)}</td>"
            f"<td>{number(x.correlation_time, 2)} s</td><td>{x.effective_rows:.0f} of {x.rows}</td><td>{verdict}</td></tr>"
        )
    return _table(("joint", "bag", "rms", "keeps its sign for", "rows worth", "Ljung-Box"), rows)


def repeatability(found: Sequence[Repeatability], bags: Sequence[str]) -> str:
    """Parameters as each bag alone gives them."""
    rows = [
        f"<tr><td>{escape(r.name)}</td>"
        + "".join(f"<td>{number(v)} ± {number(1.96 * s, 2)}</td>" for v, s in zip(r.values, r.stds, strict=True))
        + f"<td>{number(r.between, 2)}</td><td>{number(r.within, 2)}</td><td>{escape(r.unit)}</td></tr>"
        for r in found
    ]
    return _table(("parameter", *(Path(bag).name for bag in bags), "std between", "std within", "unit"), rows)


def facts(result: Identification, provenance: dict[str, Any]) -> str:
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
    rows = [f"<tr><td>{escape(name)}</td><td>{escape(text)}</td></tr>" for name, text in lines]
    if command := provenance.get("command"):
        rows.append(f"<tr><td>Command</td><td><code>{escape(str(command))}</code></td></tr>")
    if version := provenance.get("version"):
        rows.append(f"<tr><td>Version</td><td>sysid_ros {escape(str(version))}</td></tr>")
    return f'<table class="facts"><tbody>{"".join(rows)}</tbody></table>'


def _unit(unit: str) -> str:
    return escape(unit.replace("^2", "²"))


def _between(value: float, several: bool) -> str:
    return f"<td>{number(value, 2)}</td>" if several else ""


def _share(part: float) -> str:
    return f'<span class="bar"><i style="width:{100.0 * part:.0f}%"></i></span> {100.0 * part:.0f} %'


def _table(head: Sequence[str], rows: Sequence[str]) -> str:
    cells = "".join(f"<th>{escape(h)}</th>" for h in head)
    return f"<table><thead><tr>{cells}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
