"""``sysid frequency``: up to what frequency a model holds, and what it misses beyond."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sysid_ros.cli import options as opt
from sysid_ros.cli.inputs import provenance, read_config, settings_from
from sysid_ros.cli.output import ManyValues, check_outputs, note, report, table, warn, write_json
from sysid_ros.cli.progress import progress_bar
from sysid_ros.cli.recordings import read_recordings, warn_of
from sysid_ros.frequency_domain import FrequencyCheck, JointCheck, check_frequency
from sysid_ros.frequency_domain.causes import Cause
from sysid_ros.frequency_domain.modes import HIGHEST, StablePair
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.pages import check_plot_paths
from sysid_ros.torque.model_file import ModelFile


@click.command(cls=ManyValues)
@opt.BAGS
@opt.path("--urdf", help="The model to check; else /robot_description of the first bag.")
@opt.path("--model", "model_path", help="model.yaml of 'sysid identify' or 'sysid diagnose': the model to check.")
@opt.READ_JOINTS
@opt.EFFORT_PRESET
@click.option("--top", type=opt.Range(1.0, 400.0), help="Upper end of the band. [Hz]  [default: a fifth of the rate, 40 at most]")
@click.option(
    "--order",
    type=click.IntRange(0, HIGHEST),
    help="Of the state-space models, of what the rigid model lacks.  [default: the one that predicts held-out parts best]",
)
@click.option("--stabilisation", is_flag=True, help="Show the pairs of models of every order, and which stay as it grows.")
@opt.CONFIG
@opt.TOPIC
@opt.COLUMNS
@opt.PLOT
@opt.RERUN
@opt.JSON
@opt.FORCE
def command(
    bags: tuple[Path, ...],
    urdf: Path | None,
    model_path: Path | None,
    joint_names: tuple[str, ...],
    effort_preset: str,
    top: float | None,
    order: int | None,
    stabilisation: bool,
    config_path: Path | None,
    topic: str,
    columns_path: Path | None,
    plot_path: Path | None,
    rerun_path: Path | None,
    json_path: Path | None,
    force: bool,
) -> None:
    """Up to what frequency does a model hold, on which joint does it stop, and is what it misses a delay, a filter, a resonance?

    For every joint the response from the model's torque (along the measured motion) to the measured torque is estimated, with
    its 95 % region; 1 says that the model holds. Then the simplest cause that explains it is named with its parameters, and a
    state-space model of torque and velocity is searched for oscillations that rigid links do not have.

    Any motion will do, but only frequencies that it contains can be judged: the fast Fourier motion of 'sysid excite' tells up to
    some Hz, a chirp or multisine about a posture further. Several periods of one motion tell noise from distortion.

    \b
    Example:
      sysid frequency run1/ run2/ --urdf arm.urdf --model model.yaml --plot bode.png

    Exit codes: 0 done; 2 bad input or usage.
    """
    check_outputs(force, json=json_path, plot=plot_path, rerun=rerun_path)
    check_plot_paths(plot_path, rerun_path)
    settings = settings_from(read_config(config_path), joint_names=joint_names, effort_preset=effort_preset)
    file = ModelFile.read(model_path) if model_path else None
    robot, recordings, problems = read_recordings(bags, urdf, topic, settings, columns_path)
    warn_of(problems)
    for sentence in file.notes(robot.urdf) if file else []:
        note(sentence)
    origin = provenance(bags, urdf=urdf or "/robot_description of the first bag", model=model_path)
    known = file.known_effects(robot) if file else []
    with progress_bar("joints", robot.n) as advance:
        result = check_frequency(robot, recordings, known, top or 0.0, settings.max_gap, advance, origin, order)
    for sentence in result.warnings:
        warn(sentence)
    if json_path:
        write_json(json_path, result.as_dict())
    title = f"Measured torque over that of {model_path.name if model_path else 'the URDF'}: {', '.join(b.name for b in bags)}"
    for what, path in (("Plot", plot_path), ("Recording", rerun_path)):
        if path:
            from sysid_ros.pages.frequency_figure import write_frequency_plot

            write_frequency_plot(path, result, title, robot, urdf)
            note(f"{what} written to {path}.")
    show(result)
    if stabilisation:
        _show_stabilisation(report(), result)


def show(result: FrequencyCheck, console: Console | None = None) -> None:
    """Print the table and the findings."""
    console = console or report()
    _show_joints(console, result)
    console.print("[bold]Findings[/bold]")
    for sentence in (*result.sentences, *(s for check in result.joints for s in check.sentences)):
        console.print(f"- {escape(sentence)}")
    _show_modes(console, result)
    console.print("[bold]Assumed[/bold]")
    for sentence in result.assumptions:
        console.print(f"- {escape(sentence)}")


def _show_joints(console: Console, result: FrequencyCheck) -> None:
    title = f"Measured torque over the model's, up to {result.top_hz:.3g} Hz (95 %, within 10 %)"
    headings = ("holds\nHz", "fails\nfrom Hz", "judged\nto Hz", "used\ns", "periods", "noise at 1 Hz\nN m/√Hz", "missed")
    out = table(title, "joint", *headings, words=["missed"])
    for check in result.joints:
        out.add_row(check.joint, *_row(check))
    console.print(out)


def _row(check: JointCheck) -> tuple[str, ...]:
    if check.torque is None:
        return ("", "", "", "", "", "", "not checked")
    r, v = check.torque, check.torque.verdict
    holds = "–" if v.holds_to is None else f"{v.holds_from:.2g} to {v.holds_to:.3g}"
    fails = "–" if v.fails_from is None else f"{v.fails_from:.3g}"
    judged = "–" if v.told_to is None else f"{v.told_to:.3g}"
    near = min(range(len(r.windows)), key=lambda i: abs(r.windows[i].f - 1.0), default=None)
    noise = "" if near is None else f"{r.density[near]:.2g}"
    periods = ", ".join(f"{n} x {p:.3g} s" for p, n in r.periods) or "–"
    missed = _missed(r.cause) if check.friction is None else f"dry friction, {check.friction.coulomb:.2g} N m"
    return holds, fails, judged, f"{r.seconds:.0f}", periods, noise, missed


def _missed(cause: Cause | None) -> str:
    if cause is None:
        return "not identified"
    if cause.name == "nothing" or cause.effect < TOLERANCES.negligible:
        return "nothing"
    if cause.share < TOLERANCES.mostly_smooth:
        return "not identifiable (dry friction)"
    if not cause.explains:
        return "not explained"
    words = []
    for p in cause.parameters:
        if p.name == "zero_ratio" or (p.name == "gain" and cause.name != "gain"):
            continue
        scale, unit = (1e3, "ms") if p.name == "delay" else (1.0, p.unit)
        words.append(f"{p.value * scale:.3g} {unit}".strip() if p.name != "damping" else f"damping {p.value:.2g}")
    return f"{cause.name.replace('_', ' ').replace('+', ' + ')} {', '.join(words)}"


def _show_modes(console: Console, result: FrequencyCheck) -> None:
    made = [c for c in result.joints if c.modes is not None]
    if made:
        headings = ("band\nHz", "order", "rigid poles\n1/s", "pair", "frequency\nHz", "damping", "found\nagain", "")
        out = table("State-space check: torque to velocity", "joint", *headings)
        for check in made:
            _add_modes(out, check)
        console.print(out)
    for check in result.joints:
        if check.modes is None and check.torque is not None:
            console.print(f"No state-space check of {escape(check.joint)}: {escape(check.why_no_modes)}")


def _show_stabilisation(console: Console, result: FrequencyCheck) -> None:
    """Pairs by order, one column each order; what stays is marked."""
    headings = ("pair", "frequency\nHz", "damping", "orders that have it", "of which it stays in")
    out = table("Stabilisation: pairs of models of order 1 to 12", "joint", *headings)
    for check in result.joints:
        found = check.modes.stabilisation if check.modes is not None else ()
        groups: list[list[StablePair]] = []
        for pair in found:
            near = [
                g for g in groups if g[-1].kind == pair.kind and abs(g[-1].frequency - pair.frequency) < 0.05 * pair.frequency
            ]
            if near:
                near[0].append(pair)
            else:
                groups.append([pair])
        for group in sorted(groups, key=lambda g: g[-1].frequency):
            last, stays = group[-1], [str(p.order) for p in group if p.stays]
            orders = ", ".join(str(p.order) for p in group)
            out.add_row(check.joint, f"{last.kind}s", f"{last.frequency:.3g}", f"{last.damping:.2g}", orders, ", ".join(stays))
    console.print(out)


def _add_modes(out: Table, check: JointCheck) -> None:
    m = check.modes
    assert m is not None
    rigid = ", ".join(f"{x.real:.2g}" if abs(x.imag) < 1e-9 else f"{x.real:.2g} {x.imag:+.2g}i" for x in m.rigid)
    first = (check.joint, f"{m.band[0]:.2g} to {m.band[1]:.2g}", str(m.order), rigid)
    if not m.modes:
        out.add_row(*first, "none", "", "", "", "")
    for i, x in enumerate(m.modes):
        out.add_row(
            *(first if i == 0 else ("",) * 4),
            f"{x.kind}s",
            f"{x.frequency:.3g} ± {1.96 * x.frequency_std:.2g}",
            f"{x.damping:.2g} ± {1.96 * x.damping_std:.1g}",
            f"{100.0 * x.found_again:.0f} %",
            "unmodelled" if x.unmodelled else "not sure",
        )
