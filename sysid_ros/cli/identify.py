"""``sysid identify``: the arm's own dynamics from bags without a payload."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

import click
from rich import box
from rich.table import Table

from sysid_ros import __version__
from sysid_ros.cli.inputs import open_bag, read_config, settings_from
from sysid_ros.cli.output import ManyValues, note, progress_bar, report, warn, write_json
from sysid_ros.exceptions import RobotModelError
from sysid_ros.identification import BagRows, Identification, collect_rows, free_model, identify
from sysid_ros.identification.identify import TorqueError
from sysid_ros.input_gate import InputGate
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import Measurement
from sysid_ros.settings import OnlineSettings

_PATH = click.Path(path_type=Path)


@click.command(cls=ManyValues)
@click.argument("bags", type=_PATH, nargs=-1, required=True, metavar="BAG...")
@click.option("--urdf", type=_PATH, help="The robot; else /robot_description of the first bag.")
@click.option("--out", "out_path", type=_PATH, required=True, help="model.yaml to write.")
@click.option(
    "--validate", type=_PATH, multiple=True, metavar="BAG...", help="Bags to judge the model on; they are never fitted."
)
@click.option(
    "--config", "config_path", type=_PATH, help="Parameters of the node (effort_scale, joint_names, ...), a ROS 2 YAML file."
)
@click.option("--cutoff", type=click.FloatRange(0.5, 100.0), help="Cut-off of the low-pass on both sides. [Hz]")
@click.option("--topic", default="/joint_states", show_default=True)
@click.option("--json", "json_path", type=_PATH, help="Write the result for machines.")
def command(
    bags: tuple[Path, ...],
    urdf: Path | None,
    out_path: Path,
    validate: tuple[Path, ...],
    config_path: Path | None,
    cutoff: float | None,
    topic: str,
    json_path: Path | None,
) -> None:
    """Identify link inertials, friction, rotor inertia and torque offsets of an arm from BAGs in which it carries nothing.

    The result is what 'sysid replay --model' and the node take as known. Each bag is predicted by a model fitted to the others
    (halves, where there is one bag), and that error is shown.

    \b
    Example:
      sysid identify run1/ run2/ --urdf arm.urdf --validate run3/ --out model.yaml

    Exit codes: 0 done; 2 bad input or usage.
    """
    settings = settings_from(read_config(config_path))
    robots: list[RobotModel] = []
    rows = [_rows(path, urdf, topic, settings, cutoff or 0.0, robots) for path in bags]
    checks = [_rows(path, urdf, topic, settings, cutoff or 0.0, robots) for path in validate]
    provenance = {"bags": [str(b) for b in bags], "command": shlex.join(["sysid", *sys.argv[1:]]), "version": __version__}
    result = identify(free_model(robots[0]), rows, checks, provenance)
    result.model.write(out_path)
    if json_path:
        write_json(json_path, _as_json(result))
    _show(result, robots[0])
    note(f"Model written to {out_path}.")


def _rows(
    path: Path, urdf: Path | None, topic: str, settings: OnlineSettings, cutoff: float, robots: list[RobotModel]
) -> BagRows:
    source, robot = open_bag(path, topic, urdf, settings)
    if robots and robot.joint_names != robots[0].joint_names:
        raise RobotModelError(
            f"bag '{path}' has joints {', '.join(robot.joint_names)}, the first bag has {', '.join(robots[0].joint_names)}. "
            "Use bags of the same robot."
        )
    robots.append(robot)
    gate = InputGate(robot, settings)
    with progress_bar(path.name, source.message_count) as advance:
        accepted = (m for m in map(gate.accept, source) if isinstance(m, Measurement))
        rows = collect_rows(free_model(robot), accepted, str(path), cutoff, settings.max_gap, lambda: advance(1))
    for key, n in gate.counts.items():
        warn(f"{path.name}: {n} of {gate.received} messages rejected: {gate.last_texts[key]}")
    for sentence in gate.warnings:
        warn(f"{path.name}: {sentence}")
    return rows


def _show(result: Identification, robot: RobotModel) -> None:
    console = report()
    blocks = {b.effect: b for b in result.model.effects}
    table = Table(title="Joints, with 95 % intervals", title_justify="left", box=box.SIMPLE)
    table.add_column("joint", no_wrap=True)
    for column in ("viscous\nN m s/rad", "Coulomb\nN m", "rotor inertia\nkg m²", "offset\nN m"):
        table.add_column(column, justify="right", no_wrap=True)
    for i, name in enumerate(robot.joint_names):
        cells = []
        for effect in ("viscous_friction", "coulomb_friction", "rotor_inertia", "torque_offset"):
            block = blocks[effect]
            assert block.covariance is not None
            cells.append(f"{block.theta[i]:.3g} ± {1.96 * block.covariance[i, i] ** 0.5:.2g}")
        table.add_row(name, *cells)
    console.print(table)
    recordings = [(e, "held out") for e in result.errors] + [(e, "validation") for e in result.validation]
    errors = Table(
        title="Torque error where the model was not fitted: rms in N m, and as a part of the torque",
        title_justify="left",
        box=box.SIMPLE,
    )
    errors.add_column("joint", no_wrap=True)
    for error, kind in recordings:
        errors.add_column(f"{Path(error.name).name}\n{kind}", justify="right")
    for i, name in enumerate(robot.joint_names):
        errors.add_row(name, *(f"{e.residual[i]:.2g} ({100 * e.residual[i] / e.torque[i]:.1f} %)" for e, _ in recordings))
    console.print(errors)
    console.print(
        f"{result.base.rank} base parameters of {len(result.names)}, "
        f"condition number {result.base.condition_number:.0f} of the scaled columns",
        highlight=False,
    )


def _as_json(result: Identification) -> dict[str, Any]:
    def error(e: TorqueError) -> dict[str, Any]:
        return {
            "name": e.name,
            "residual_rms": e.residual.tolist(),
            "torque_rms": e.torque.tolist(),
            "relative": (e.residual / e.torque).tolist(),
            "nominal_residual_rms": e.nominal.tolist(),
        }

    std = result.covariance.diagonal() ** 0.5
    return {
        "joints": list(result.model.joints),
        "parameters": [
            {"name": n, "value": float(v), "std": float(s), "unit": u}
            for n, v, s, u in zip(result.names, result.theta, std, result.units, strict=True)
        ],
        "base_parameters": result.base.rank,
        "condition_number": result.base.condition_number,
        "torque_error": {"held_out": [error(e) for e in result.errors], "validation": [error(e) for e in result.validation]},
        "noise": {"torque_std": result.model.torque_std.tolist(), "correlation_time": result.model.correlation_time.tolist()},
    }
