"""``sysid control``: how well control laws follow a motion while the arm picks up what they do not know."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from sysid_ros.cli import options as opt
from sysid_ros.cli.output import ManyValues, check_outputs, note, report, table, write_json
from sysid_ros.cli.progress import progress_bar
from sysid_ros.cli.simulate_output import named_option  # says so where PyBullet is missing
from sysid_ros.control.control_settings import ControlSettings
from sysid_ros.control.tracking_run import TrackingRun
from sysid_ros.exceptions import SettingsError
from sysid_ros.files import plain
from sysid_ros.pages import check_plot_paths
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation import ArmScenario
from sysid_ros.simulation.tracking import TRACKED, track
from sysid_ros.torque.model_file import ModelFile

if TYPE_CHECKING:
    from sysid_ros.pages.tracking_figure import Followed

_SETTLED = 2.0
"""After a pick or a drop, for so long a law is still finding out [s]."""
_AT_REST = 1.0
JOINT_LAW = "deepc"
"""Data-enabled predictive control is of one joint, and has a table of its own."""

_SETTINGS = ("loop_delay", "bandwidth", "adaptation_time", "composite_time", "blend", "expected_mass", "expected_radius")


def _settings_options(command: Any) -> Any:
    """An option for each of the settings, with its own description as help."""
    for f in reversed([f for f in fields(ControlSettings) if f.name in _SETTINGS]):
        text = f"{f.metadata['description'].capitalize()}. [{f.metadata['unit']}]"
        default = 1e-3 if f.name == "loop_delay" else f.default
        option = "--" + f.name.replace("_", "-")
        command = click.option(option, f.name, type=float, default=default, show_default=True, help=text)(command)
    return command


@click.command(cls=ManyValues)
@click.option(
    "--law",
    "laws",
    multiple=True,
    type=click.Choice((*TRACKED, JOINT_LAW)),
    metavar="LAW...",
    help=f"Of {', '.join(TRACKED)}; or {JOINT_LAW}.  [default: all but {JOINT_LAW}]",
)
@opt.number("--payload-mass", default=3.0, help="Picked up by the arm. [kg]")
@opt.vector("--payload-com", default=(0.03, -0.02, 0.08), help="Centre of mass in the tip link's frame. [m]")
@opt.number("--pick", "pick_time", default=6.0, help="When it is picked up. [s]")
@opt.number("--drop", "drop_time", default=12.0, help="When it is dropped. [s]")
@opt.number("--duration", default=16.0, help="[s]")
@opt.SEED
@opt.number("--base-frequency", default=0.2, help="Of the motion, which has 5 harmonics. [Hz]")
@opt.each_joint("--viscous-friction", help="Of the arm, unknown but for --model. [N m s/rad]")
@opt.each_joint("--coulomb-friction", help="As above. [N m]")
@opt.each_joint("--rotor-inertia", help="As above. [kg m^2]")
@opt.path("--model", "model_path", help="model.yaml of 'sysid identify': what laws and estimator know of the arm.")
@_settings_options
@opt.JSON
@opt.path("--plot", "plot_path", help="Draw errors and masses over time: .png or .html.")
@opt.RERUN
@opt.FORCE
def command(
    laws: tuple[str, ...],
    model_path: Path | None,
    json_path: Path | None,
    plot_path: Path | None,
    rerun_path: Path | None,
    force: bool,
    **options: Any,
) -> None:
    """Compare control laws on a simulated arm that picks up a payload which none of them knows.

    \b
    computed_torque        the model of the empty arm: never learns
    certainty_equivalence  computed torque with the payload of the online estimator
    slotine_li             adaptive: learns from the tracking error
    composite              adaptive, and drawn towards the online estimator
    informed               computed torque that knows the truth at the pick, to compare with
    deepc                  data-enabled predictive control of one joint with friction, beside PD and computed torque: alone

    All see the same noise, obey the same effort limits, have the same gains, and run at 1 kHz in PyBullet; each effort acts
    --loop-delay after the state that it answers, less the period of 1 ms.

    \b
    Examples:
      sysid control --payload-mass 3 --plot tracking.png
      sysid simulate arm --bag empty --duration 60 --coulomb-friction 0.5 --viscous-friction 0.5
      sysid identify empty --out model.yaml
      sysid control --coulomb-friction 0.5 --viscous-friction 0.5 --model model.yaml

    Exit codes: 0 done; 2 bad input or usage.
    """
    check_outputs(force, json=json_path, plot=plot_path, rerun=rerun_path)
    check_plot_paths(plot_path, rerun_path)
    if JOINT_LAW in laws:
        _one_joint(laws, options, json_path, (plot_path, rerun_path, model_path))
        return
    try:
        settings = ControlSettings(**{name: options[name] for name in _SETTINGS})
        scenario = ArmScenario(**{name: value for name, value in options.items() if name not in _SETTINGS})
        if not np.isfinite(scenario.duration):
            raise SettingsError("duration is inf; the comparison must end. Give a number of seconds.")
        known = ModelFile.read(model_path) if model_path is not None else None
        chosen = tuple(dict.fromkeys(laws)) or TRACKED
        with progress_bar("Simulating", len(chosen) * round(scenario.duration * 1000)) as advance:
            runs = [track(law, scenario, settings, known, advance) for law in chosen]
    except SettingsError as error:
        raise named_option(error, options) from None
    for sentence in dict.fromkeys(sentence for run in runs for sentence in run.notes):
        note(sentence)
    if json_path is not None:
        write_json(json_path, {"scenario": _plain(scenario), "laws": [_summary(run, scenario) for run in runs]})
    for path in (plot_path, rerun_path):
        if path is not None:
            from sysid_ros.pages.tracking_figure import write_tracking

            write_tracking(path, runs, _followed(scenario), _answer(runs, scenario))
            note(f"Figure written to {path}.")
    _show(runs, scenario)


def _one_joint(
    laws: tuple[str, ...], options: dict[str, Any], json_path: Path | None, others: tuple[Path | None, Path | None, Path | None]
) -> None:
    """The joint with friction, followed by three laws.

    Raises:
        SettingsError: what belongs to the arm is given too.
    """
    from sysid_ros.simulation.friction_joint import follow

    if set(laws) != {JOINT_LAW} or any(others):
        raise SettingsError(
            f"--law {JOINT_LAW} is of one joint and goes alone: leave out other laws, --plot, --rerun and --model."
        )
    if not 1.0 <= options["duration"] <= 600.0:
        raise SettingsError(f"--duration is {options['duration']:g} s; with --law {JOINT_LAW} it must be from 1 to 600.")
    runs = follow(options["seed"], options["duration"])
    out = table(
        "One joint with friction that follows a sum of sines", "law", "error, rms\nmrad", "decides within\nms", words=["law"]
    )
    for run in runs:
        out.add_row(run.law, f"{1e3 * run.rms:.3g}", f"{1e3 * run.step:.2g}")
    report().print(out)
    note(
        "PD knows nothing of the joint, computed torque its inertia and gravity, deepc 8 s that were recorded with PD and noise."
    )
    if json_path is not None:
        laws_out = [{"law": run.law, "rms_rad": run.rms, "step_s": run.step} for run in runs]
        write_json(json_path, {"joint_with_friction": laws_out, "seed": options["seed"], "duration_s": options["duration"]})


def _followed(scenario: ArmScenario) -> Followed:
    """What the laws had to do, for the page."""
    from sysid_ros.pages.tracking_figure import Followed
    from sysid_ros.simulation.description import TIP_LINK, arm_description

    both = ((scenario.pick_time or 0.0, "pick"), (scenario.drop_time, "drop"))
    events = tuple((t, kind) for t, kind in both if t is not None and np.isfinite(t))
    body, robot = scenario.payload, RobotModel.from_urdf(arm_description())
    assert body is not None
    return Followed(robot, TIP_LINK, body.mass, body.com, body.inertia_com, events)


def _answer(runs: list[TrackingRun], scenario: ArmScenario) -> str:
    """The laws by how near they keep the tip to its path while the arm carries what it knows nothing of, in a sentence."""
    begin, end = _phases(scenario).get("carrying", (0.0, scenario.duration))
    errors = {run.law: 1e3 * run.tip_rms(begin, end) for run in runs if run.lost is None or run.lost >= end}
    told = [f"{_said(law)} {error:.2g} mm" for law, error in sorted(errors.items(), key=lambda item: item[1])]
    lost = [_said(run.law) for run in runs if run.law not in errors]
    gone = f" The motion is lost by {', '.join(lost)}." if lost else ""
    carried = f"While {scenario.payload_mass:g} kg are carried the tip strays from its path by (rms): "
    return f"{carried}{', '.join(told)}.{gone}" if told else f"Every law loses the motion.{gone}"


def _said(law: str) -> str:
    return law.replace("_", " ").replace("slotine li", "Slotine-Li")


def _phases(scenario: ArmScenario) -> dict[str, tuple[float, float]]:
    """Names and times of the phases [s]."""
    end, pick = scenario.duration, scenario.pick_time or 0.0
    drop = scenario.drop_time if scenario.drop_time is not None else end
    phases = {
        "empty": (min(_AT_REST, pick), pick),
        "just picked up": (pick, min(pick + _SETTLED, drop)),
        "carrying": (min(pick + _SETTLED, drop), drop),
        "dropped": (min(drop + _SETTLED, end), end),
    }
    return {name: (a, b) for name, (a, b) in phases.items() if b > a}


def _plain(scenario: ArmScenario) -> dict[str, Any]:
    run = ("seed", "duration", "payload_mass", "payload_com", "pick_time", "drop_time")
    arm = ("base_frequency", "viscous_friction", "coulomb_friction", "rotor_inertia")
    return {name: plain(getattr(scenario, name)) for name in (*run, *arm)}


def _summary(run: TrackingRun, scenario: ArmScenario) -> dict[str, Any]:
    phases = {}
    for name, (begin, end) in _phases(scenario).items():
        part = (run.t >= begin) & (run.t < end)
        if run.lost is None or run.lost >= end:
            joints = np.sqrt(np.mean(run.error[part] ** 2, axis=0))
            phases[name.replace(" ", "_")] = {"tip_rms_m": run.tip_rms(begin, end), "joint_rms": joints.tolist()}
    mass = _mass(run, scenario)
    result = {"law": run.law, "lost_at_s": run.lost, "steps_at_effort_limit": run.clipped, "mass_while_carrying": mass}
    return {**result, "phases": phases}


def _mass(run: TrackingRun, scenario: ArmScenario) -> float | None:
    """Mean mass believed in the phase 'carrying' [kg], None where there is no such phase."""
    begin, end = _phases(scenario).get("carrying", (0.0, 0.0))
    part = (run.t >= begin) & (run.t < end)
    return float(run.mass[part].mean()) if part.any() else None


def _show(runs: list[TrackingRun], scenario: ArmScenario) -> None:
    phases = _phases(scenario)
    name = f"Distance of the tip from its path, rms in mm; {scenario.payload_mass:g} kg are picked up"
    columns = [f"{phase}\n{begin:g} to {end:g} s" for phase, (begin, end) in phases.items()]
    out = table(name, "law", *columns, "believes in,\nkg", "", words=[""])
    for run in runs:
        cells = [
            f"{1e3 * run.tip_rms(*phase):.2f}" if run.lost is None or run.lost >= phase[1] else "-" for phase in phases.values()
        ]
        mass = _mass(run, scenario)
        remarks = [f"lost the motion at {run.lost:.2f} s"] if run.lost is not None else []
        remarks += [f"{run.clipped} steps at an effort limit"] if run.clipped else []
        out.add_row(run.law, *cells, "-" if mass is None else f"{mass:.2f}", ", ".join(remarks))
    report().print(out)
