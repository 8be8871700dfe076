"""What ``sysid identify`` shows: tables for people, JSON for machines."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape

from sysid_ros.cli.output import report, table
from sysid_ros.effects import Effect, named
from sysid_ros.files import plain
from sysid_ros.identification import Identification
from sysid_ros.identification.free_effects import frictions, own_knobs
from sysid_ros.identification.result import Parameter, TorqueError
from sysid_ros.pages.identification_page import summary
from sysid_ros.pages.residual_curves import residual_curves


def show(result: Identification, console: Console | None = None, verbose: bool = False) -> None:
    """Print the answer and what it was found with; ``verbose``: with the base parameters and the noise."""
    console = console or report()
    for sentence in summary(result):
        console.print(escape(sentence))
    console.print(f"Dry friction: {escape(_friction(result))}.")
    _show_payload(console, result)
    _show_joints(console, result, verbose)
    _show_errors(console, result)
    if result.ceiling is not None:
        console.print(escape(result.ceiling.sentence))
    if verbose:
        console.print(
            f"Low-pass at {result.cutoff.hz:.3g} Hz on both sides: {escape(result.cutoff.reason)}.\n"
            f"Links held to the URDF's with weight {result.prior.weight:g}: {result.prior.reason}."
        )
        _show_groups(console, result)
        _show_noise(console, result)
        _show_repeatability(console, result)
    if result.record_next:
        console.print("[bold]What to record next[/bold]")
        for sentence in result.record_next:
            console.print(f"- {escape(sentence)}")


def _friction(result: Identification) -> str:
    """Which friction each joint got, in words."""
    forms = frictions().values()
    by_effect: dict[str, list[str]] = {}
    for p in result.parameters:
        by_effect.setdefault(p.effect, []).append(p.joint)
    joints = {form: list(dict.fromkeys(by_effect.get(form.id, ()))) for form in forms}
    usual, *others = forms
    chosen = result.friction == "auto" or bool(own_knobs(frictions()[result.friction]))
    found = [f"{form.label} at {', '.join(joints[form])}" for form in others if joints[form]]
    if joints[usual]:
        found.append(f"{usual.label} at the other joints" if found else f"{usual.label} at all joints")
    return f"{', '.join(found)}{' (chosen by what was not fitted)' if chosen else ''}"


def _show_joints(console: Console, result: Identification, bound: bool) -> None:
    by_place = {(p.name.split("[")[0], p.joint): p for p in result.parameters}
    beside = [p for p in result.parameters if not _effect(p).replaces_links]
    of_joints = [p for p in beside if p.joint in result.joint_names]
    symbols = {p.name.split("[")[0]: p for p in of_joints}
    out = table(
        "Joints, with 95 % intervals" + (" (in brackets: by the Cramér-Rao bound, for white residuals)" if bound else ""),
        "joint",
        *(f"{symbol}\n{p.unit}" for symbol, p in symbols.items()),
    )
    for joint in result.joint_names:
        out.add_row(joint, *(_interval(by_place.get((symbol, joint)), bound) for symbol in symbols))
    console.print(out)
    labels = {symbol: _effect(p).label for symbol, p in symbols.items()}
    console.print("; ".join(f"{escape(symbol)}: {label}" for symbol, label in labels.items()) + ".")
    for p in beside:
        if p.joint not in result.joint_names:
            line = f"{_effect(p).label}, {p.name}: {p.value:.3g} ± {1.96 * p.std:.2g} {p.unit}"
            console.print(escape(line))
    for knob in result.knobs:
        doubt = "" if knob.determined else " (these bags do not determine it)"
        console.print(f"{knob.name} of {knob.joint or 'the arm'}: {knob.value:.3g} {knob.unit}{doubt}")


def _effect(p: Parameter) -> type[Effect]:
    found = named(p.effect)
    assert found is not None
    return found


def _interval(p: Parameter | None, bound: bool) -> str:
    if p is None:
        return ""
    return f"{p.value:.3g} ± {1.96 * p.std:.2g}" + (f"\n(± {1.96 * p.crb:.2g})" if bound else "")


def _show_groups(console: Console, result: Identification) -> None:
    out = table("Base parameters: what is lumped with what", "sum", "value", "std", "bound", "unit", "from", words=["sum"])
    for g in result.groups:
        out.add_row(escape(g.words), f"{g.value:.3g}", f"{g.std:.2g}", f"{g.crb:.2g}", g.unit, g.determined_by)
    console.print(out)
    determined = sum(g.determined_by == "bags" for g in result.groups)
    console.print(
        f"{result.base.rank} base parameters of {len(result.names)}; these bags determine {determined} of them, with condition "
        f"number {result.bags_condition_number:.0f} of the scaled columns. 'bound' is the Cramér-Rao bound, were the residuals "
        "white.",
    )
    if result.base.rounded:
        console.print(
            f"{result.base.rounded} more would show by a few millionths, because the URDF rounds its numbers (such as 1.5708 for "
            "a right angle); they are left out.",
        )


def _show_errors(console: Console, result: Identification) -> None:
    recordings = [(e, "held out") for e in result.errors] + [(e, "validation") for e in result.validation]
    title = "Torque error where the model was not fitted: rms in N m, as a part of the torque, and of the URDF with friction"
    out = table(title, "joint", *(f"{Path(e.name).name}\n{kind}" for e, kind in recordings))
    for i, name in enumerate(result.joint_names):
        out.add_row(
            name,
            *(_error_cell(e, i) for e, _ in recordings),
        )
    console.print(out)


def _error_cell(e: TorqueError, i: int) -> str:
    torque = float(e.torque[i])
    if not torque > 0.0:  # none of its rows can be used, as of a leg that always stands
        return ""
    return f"{e.residual[i]:.2g} ({100 * e.residual[i] / torque:.1f} %; {100 * e.urdf_friction[i] / torque:.1f} %)"


def _show_noise(console: Console, result: Identification) -> None:
    white = {(w.bag, w.joint): w for w in result.whiteness}
    title = "Residual where it was fitted: rms in N m, time for which it keeps its sign, rows that it counts as"
    out = table(title, "joint", "bag", "rms", "time", "effective / rows", "Ljung-Box", words=["bag"])
    for n in result.noise:
        w = white.get((n.bag, n.joint))
        test = (
            "" if w is None else f"{'white' if w.white else 'coloured'} (p = {w.p_value:.2g}, Q = {w.statistic:.3g} of {w.lags})"
        )
        effective = f"{n.effective_rows:.0f} / {n.rows}"
        out.add_row(n.joint, Path(n.bag).name, f"{n.std:.2g}", f"{n.correlation_time:.2g} s", effective, test)
    console.print(out)


def _show_repeatability(console: Console, result: Identification) -> None:
    friction = [r for r in result.repeatability if r.friction]
    if not friction:
        return
    names = [Path(bag).name for bag in result.bags]
    out = table("Friction as each bag alone gives it", "parameter", *names, "between", "within")
    for r in friction:
        cells = ("" if math.isnan(x) else f"{x:.3g}" for x in r.values)
        out.add_row(escape(r.name), *cells, f"{r.between:.2g}", f"{r.within:.2g}")
    console.print(out)


def _show_payload(console: Console, result: Identification) -> None:
    p = result.payload
    if p is None:
        return
    com = ", ".join(f"{1e3 * c:.1f} ± {1.96e3 * s:.1f}" for c, s in zip(p.com, p.com_std, strict=True))
    console.print(
        f"Payload at {p.frame}: mass {p.mass:.3f} ± {1.96 * p.mass_std:.2g} kg, centre of mass ({com}) mm, with 95 % intervals"
        + ("." if p.consistent else ". The two runs differ by more than a payload: no body explains the difference."),
    )


def as_json(result: Identification) -> dict[str, Any]:
    """The result in plain types; what is not known is null."""
    alike = ("bags", "validation_bags", "method", "form", "friction", "cutoff", "prior", "knobs", "parameters", "repeatability")
    physical, model = result.physical, result.model
    document = {name: getattr(result, name) for name in (*alike, "payload", "problems", "record_next")} | {
        "joints": result.joint_names,
        "physical": physical and {name: getattr(physical, name) for name in ("divergence", "at_bound", "loss", "notes")},
        "base_parameters": result.base.rank,
        "base_parameters_by_rounding": result.base.rounded,
        "base_groups": result.groups,
        "condition_number": result.bags_condition_number,
        "torque_error": {
            "held_out": [_error(e) for e in result.errors],
            "validation": [_error(e) for e in result.validation],
        },
        "residuals": residual_curves(result.series, result.joint_names),
        "noise": {"torque_std": model.torque_std, "correlation_time": model.correlation_time, "bags": result.noise},
        "whiteness": [{**plain(w), "white": w.white} for w in result.whiteness],
    }
    if result.ceiling is not None:
        document["ceiling"] = result.ceiling.as_dict()
    cleaned: dict[str, Any] = plain(document)
    return cleaned


def _error(e: TorqueError) -> dict[str, Any]:
    return {
        "name": e.name,
        "residual_rms": e.residual,
        "torque_rms": e.torque,
        "relative": e.relative,
        "relative_moving": e.residual_moving / np.maximum(e.torque_moving, 1e-12),
        "nominal_residual_rms": e.nominal,
        "urdf_friction_residual_rms": e.urdf_friction,
    }
