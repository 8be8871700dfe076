"""``sysid replay``: what the node would have said, from a bag."""

from __future__ import annotations

from pathlib import Path

import click
from rich.table import Table

from sysid_ros.cli import options as opt
from sysid_ros.cli.inputs import open_bag, read_config, settings_from
from sysid_ros.cli.output import progress_bar, report, warn, write_json
from sysid_ros.exceptions import BagError
from sysid_ros.input_gate import gate_for
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.replay import Replay, as_json, replay, write_series
from sysid_ros.sources import FloatingBagSource
from sysid_ros.torque.model_file import ModelFile


@click.command()
@click.argument("bag", type=opt.PATH)
@opt.path("--urdf", help="The robot; else /robot_description of the bag.")
@click.option("--frame", help="Link that the payload is expressed in; else the one that the last joint moves.")
@opt.path("--model", "model_path", help="model.yaml of 'sysid identify': what is known of the arm itself.")
@opt.CONFIG
@opt.TOPIC
@click.option("--imu-topic", default="", help="sensor_msgs/Imu of a legged robot; else /imu, or the only one in the bag.")
@click.option("--contact-topic", default="", help="Which feet stand; else /contacts, if it is in the bag.")
@opt.JSON
@opt.path("--series", "series_path", help="Write every estimate as a row of CSV.")
@opt.path("--plot", "plot_path", help="Draw the estimate over time: .png or .html.")
def command(
    bag: Path,
    urdf: Path | None,
    frame: str | None,
    model_path: Path | None,
    config_path: Path | None,
    topic: str,
    imu_topic: str,
    contact_topic: str,
    json_path: Path | None,
    series_path: Path | None,
    plot_path: Path | None,
) -> None:
    """Estimate the payload from BAG exactly as the node does live.

    BAG is a rosbag2 folder, an .mcap or a .db3 file with sensor_msgs/JointState that holds effort.

    \b
    Example:
      sysid identify empty_run/ --urdf arm.urdf --out model.yaml
      sysid replay pick_and_drop.mcap --urdf arm.urdf --model model.yaml --json estimate.json --plot estimate.png
      sysid replay walk.mcap --urdf quadruped.urdf --imu-topic /imu/data --contact-topic /feet --json estimate.json

    Exit codes: 0 done; 2 bad input or usage. Whether the estimate can be believed is its status.
    """
    parameters = read_config(config_path)
    settings = settings_from(parameters, frame_id=frame)
    urdf = urdf or _path_in(parameters, "urdf_path")
    model_path = model_path or _path_in(parameters, "model_path")
    source, robot = open_bag(bag, topic, urdf, settings)
    estimation = OnlineEstimation(robot, settings, ModelFile.read(model_path) if model_path else None)
    records = FloatingBagSource(source, imu_topic, contact_topic) if estimation.base else source
    gate = gate_for(robot, estimation.base, settings)
    with progress_bar("replay", source.message_count) as advance:
        result = replay(records, gate, estimation, advance)
    if estimation.base and result.used == 0:
        worst = max(gate.counts, key=lambda reason: gate.counts[reason], default="")
        raise BagError(f"bag '{bag}': no joint state of it can be used. {gate.last_texts.get(worst, '')}")
    if json_path:
        write_json(json_path, as_json(result))
    if series_path:
        write_series(series_path, result.series)
    if plot_path:
        from sysid_ros.pages import write_payload_plot  # drawing libraries take a second to import

        write_payload_plot(plot_path, result.series, result.events, robot.joint_names, f"Payload in {bag.name}")
    for sentence in result.warnings:
        warn(sentence)
    _show(result, bag)


def _path_in(parameters: dict[str, object], name: str) -> Path | None:
    value = parameters.get(name)
    return Path(str(value)) if value else None


def _show(result: Replay, bag: Path) -> None:
    final = result.final
    table = Table(title=f"Payload in {bag.name}, frame {final.frame}", title_justify="left", show_header=True)
    table.add_column("")
    table.add_column("estimate", justify="right")
    table.add_column("95 %", justify="right")
    table.add_column("unit")
    table.add_row("mass", f"{final.mass:.3f}", f"± {1.96 * final.mass_std:.3f}", "kg")
    known = abs(final.mass) > 1.96 * final.mass_std
    for axis, com, std in zip("xyz", final.com, final.com_std, strict=True):
        table.add_row(f"com {axis}", f"{1e3 * com:.1f}" if known else "-", f"± {1.96e3 * std:.1f}" if known else "-", "mm")
    for name, i, (a, b) in (("Ixx", 4, (0, 0)), ("Iyy", 6, (1, 1)), ("Izz", 9, (2, 2))):
        text = f"{final.inertia_com[a, b]:.4f}" if known and final.observable[i] else "-"
        table.add_row(f"{name} at com", text, "", "kg m²")
    table.add_row("status", result.status, "", "")
    console = report()
    console.print(table)
    if result.reason:
        console.print(result.reason)
    for e in result.events:
        console.print(f"{e.kind} at {e.t - result.start:.2f} s: {e.mass_before:.3f} -> {e.mass_after:.3f} kg")
    console.print(
        f"{result.used} of {result.read} samples used, {result.duration:.1f} s in {result.seconds:.2f} s "
        f"({result.duration / result.seconds:.0f} times real time)",
    )
