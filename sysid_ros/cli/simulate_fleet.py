"""``sysid simulate fleet``: bags of many arms over months, or only the store that they would give."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import yaml

from sysid_ros.cli import options as opt
from sysid_ros.cli.output import check_outputs, report, table, write_json
from sysid_ros.cli.progress import progress_bar
from sysid_ros.exceptions import SettingsError
from sysid_ros.files import check_bag, whole_folder, write_text
from sysid_ros.fleet.store import Results, Store
from sysid_ros.sample import JointStateRecord
from sysid_ros.simulation.fleet.drawn_fleet import Fleet, FleetBag, draw_fleet
from sysid_ros.simulation.fleet.fleet_recording import record
from sysid_ros.simulation.fleet.fleet_scenario import CAUSES, FleetScenario
from sysid_ros.simulation.fleet.fleet_tables import drawn_rows
from sysid_ros.simulation.fleet.plain_arm import KINDS, plain_arm
from sysid_ros.sources import BagRecorder, urdf_text
from sysid_ros.sources.temperatures import TEMPERATURE

_TRUTH, _ROBOTS = "truth.yaml", "robots.yaml"


def _changes(ctx: click.Context, param: click.Parameter, value: tuple[str, ...]) -> dict[str, int]:
    """NAME=COUNT each, or one number for each kind of change."""
    out: dict[str, int] = {}
    for text in value:
        name, _, count = text.rpartition("=")
        if not count.isdigit() or (name and name not in CAUSES):
            raise click.BadParameter(f"{text!r} is not NAME=COUNT, such as wear=3; names are {', '.join(CAUSES)}.")
        out |= {name: int(count)} if name else dict.fromkeys(CAUSES, int(count))
    return out


@click.command()
@opt.path("--bag", "out", required=True, help="Folder to create: ROBOT/BAG each, robots.yaml, a URDF a kind, truth.yaml.")
@opt.number("--robots", default=40, help="How many.")
@opt.number("--weeks", default=50, help="How long.")
@opt.number("--bags-per-week", default=1, help="Of each robot.")
@opt.number("--duration", default=20.0, help="Of a bag. [s]")
@opt.number("--rate", default=250, help="Of its joint states. [Hz]")
@click.option(
    "--changes",
    multiple=True,
    callback=_changes,
    metavar="[NAME=]COUNT",
    help=f"Robots to which each kind of change happens: {', '.join(CAUSES)}. Repeatable.  [default: a tenth of the robots each]",
)
@opt.number("--seasons", default=8.0, help="Amplitude of the year's temperature. [K]")
@click.option("--temperature/--no-temperature", default=True, show_default=True, help="Bags hold the temperatures of the joints.")
@click.option("--urdf", "urdfs", type=opt.PATH, multiple=True, help="A kind of robot; repeatable.  [default: two plain arms]")
@click.option(
    "--store", is_flag=True, help="No bags, but the store that `sysid batch` would make of them, drawn from its errors."
)
@opt.SEED
@opt.STORAGE
@opt.JSON
@opt.FORCE
def command(
    out: Path, urdfs: tuple[Path, ...], store: bool, storage: str, json_path: Path | None, force: bool, **given: Any
) -> None:
    """Simulate a fleet of arms over months: gears wear, seasons pass, sensors drift, zeros slip in crashes, tools are swapped.

    No physics engine is needed: the arms follow their motions, and what that costs is told by inverse dynamics.

    \b
    Examples:
      sysid simulate fleet --bag fleet --robots 10 --weeks 26
      sysid simulate fleet --bag year --store --changes wear=4 --changes tool=2

    Exit codes: 0 done; 2 bad input or usage.
    """
    check_outputs(force, json=json_path)
    _check(out, force)
    began = time.perf_counter()
    fleet = draw_fleet(_scenario(given), _kinds(urdfs))
    with whole_folder(out, replace=force) as folder:
        folder.mkdir(parents=True)
        _write_known(folder, fleet)
        with progress_bar("Simulating", len(fleet.bags)) as advance:
            if store:
                _write_store(folder / "store", fleet)
                advance(len(fleet.bags))
            else:
                for bag in fleet.bags:
                    _write_bag(folder / fleet.robots[bag.robot].name / bag.name, fleet, bag, storage)
                    advance(1)
    elapsed = time.perf_counter() - began
    if json_path is not None:
        write_json(json_path, {"folder": str(out), "bags": len(fleet.bags), "seconds": elapsed, "truth": fleet.truth()})
    _show(out, fleet, elapsed)


def _scenario(given: Mapping[str, Any]) -> FleetScenario:
    changes = given["changes"] or dict.fromkeys(CAUSES, given["robots"] // 10)
    names = ("robots", "weeks", "bags_per_week", "duration", "rate", "seasons", "seed")
    return FleetScenario(changes=changes, temperature_known=given["temperature"], **{name: given[name] for name in names})


def _kinds(urdfs: tuple[Path, ...]) -> dict[str, str]:
    if len({path.stem for path in urdfs}) < len(urdfs):
        raise SettingsError("--urdf names two files alike; a kind of robot is called as its file. Rename one.")
    return {path.stem: urdf_text(path) for path in urdfs} or {k: plain_arm(k, *v) for k, v in KINDS.items()}


def _check(out: Path, force: bool) -> None:
    if force and (out / _TRUTH).exists():
        return  # a fleet of before, which is replaced
    check_bag(out, False, "--bag")


def _write_known(folder: Path, fleet: Fleet) -> None:
    for kind, text in fleet.urdfs.items():
        write_text(folder / f"{kind}.urdf", text)
    rules = [{"paths": [f"**/{r.name}/**"], "robot": r.name, "kind": r.kind, "urdf": f"{r.kind}.urdf"} for r in fleet.robots]
    write_text(folder / _ROBOTS, yaml.safe_dump({"robots": rules}, sort_keys=False))
    write_text(folder / _TRUTH, yaml.safe_dump(fleet.truth(), sort_keys=False))


def _write_store(path: Path, fleet: Fleet) -> None:
    Store(path, create=True).append([Results(rows.bag, rows.joints, rows.payloads) for rows in drawn_rows(fleet)])


def _write_bag(path: Path, fleet: Fleet, bag: FleetBag, storage: str) -> None:
    path.parent.mkdir(exist_ok=True)
    robot, held = fleet.robots[bag.robot], record(fleet, bag)
    names = robot.model.joint_names
    start = fleet.scenario.date(bag.day).timestamp()
    with BagRecorder(path, storage) as recorder:
        recorder.write_robot_description(fleet.urdfs[robot.kind], start)
        if fleet.scenario.temperature_known:
            _write_temperatures(recorder, names, bag, start)
        stamps = (start + held.t).tolist()
        recorder.write_joint_states(
            JointStateRecord(t, t, names, q, v, tau) for t, q, v, tau in zip(stamps, held.q, held.v, held.tau, strict=True)
        )


def _write_temperatures(recorder: BagRecorder, names: tuple[str, ...], bag: FleetBag, start: float) -> None:
    from sysid_ros.sources.joint_state_cdr import typestore

    kinds = typestore().types
    sec, nanosec = divmod(round(start * 1e9), 10**9)
    stamp = kinds["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    for name, value in zip(names, bag.temperature.tolist(), strict=True):
        header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=name)
        recorder.write("/temperatures", TEMPERATURE, kinds[TEMPERATURE](header=header, temperature=value, variance=0.0), start)


def _show(out: Path, fleet: Fleet, elapsed: float) -> None:
    title = f"Simulated {len(fleet.robots)} robots, {len(fleet.bags)} bags, in {out} ({elapsed:.0f} s)"
    shown = table(title, "robot", "what", "where", "since", "by", words=("what", "where"))
    for c in fleet.changes:
        since = f"{fleet.scenario.date(c.day):%Y-%m-%d}"
        shown.add_row(c.robot, c.cause.replace("_", " "), c.joint or "tip", since, f"{c.size:+.3g} {c.unit}")
    report().print(shown)
