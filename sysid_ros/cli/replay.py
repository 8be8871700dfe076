"""``sysid replay``: what the node would have said, from a bag."""

from __future__ import annotations

from pathlib import Path

import click

from sysid_ros.cli import options as opt
from sysid_ros.cli.inputs import open_bag, read_config, settings_from
from sysid_ros.cli.output import ManyValues, check_outputs, warn, write_json
from sysid_ros.cli.progress import progress_bar, said_if_slow
from sysid_ros.cli.replay_tables import show_replay
from sysid_ros.exceptions import BagError, DataError
from sysid_ros.input_gate import Gate, gate_for
from sysid_ros.online.carried import write_carried
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.replay import Replay, as_json, replay, write_series
from sysid_ros.online.warm_up import warm_up
from sysid_ros.pages import check_plot_paths
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import BagSource, FloatingBagSource, Source, TableSource
from sysid_ros.torque.model_file import ModelFile


@click.command(cls=ManyValues)
@click.argument("bag", type=opt.PATH)
@opt.path("--urdf", help="The robot; else /robot_description of the bag.")
@click.option("--frame", help="Link that the payload is expressed in; else the arm's flange.")
@opt.path("--model", "model_path", help="model.yaml of 'sysid identify': what is known of the arm itself.")
@opt.READ_JOINTS
@opt.EFFORT_PRESET
@opt.CONFIG
@opt.TOPIC
@opt.COLUMNS
@opt.IMU_TOPIC
@opt.CONTACT_TOPIC
@opt.JSON
@opt.path("--series", "series_path", help="Write every estimate as a row of CSV.")
@opt.path("--payloads", "payloads_path", help="Write what was carried, a row of CSV each.")
@opt.path("--plot", "plot_path", help="Draw the estimate over time: .png or .html.")
@opt.RERUN
@opt.FORCE
def command(
    bag: Path,
    urdf: Path | None,
    frame: str | None,
    model_path: Path | None,
    joint_names: tuple[str, ...],
    effort_preset: str,
    config_path: Path | None,
    topic: str,
    columns_path: Path | None,
    imu_topic: str,
    contact_topic: str,
    json_path: Path | None,
    series_path: Path | None,
    payloads_path: Path | None,
    plot_path: Path | None,
    rerun_path: Path | None,
    force: bool,
) -> None:
    """Estimate from BAG, exactly as the node does live, what was carried: one row for each thing.

    BAG is a rosbag2 folder, an .mcap or a .db3 file with sensor_msgs/JointState that holds effort; or a table of times, positions
    and efforts: .csv, .parquet, .npz.

    \b
    Example:
      sysid identify empty_run/ --urdf arm.urdf --out model.yaml
      sysid replay pick_and_drop.mcap --urdf arm.urdf --model model.yaml --json estimate.json --plot estimate.png
      sysid replay log.csv --urdf arm.urdf --columns columns.yaml
      sysid replay walk.mcap --urdf quadruped.urdf --imu-topic /imu/data --contact-topic /feet --json estimate.json

    Exit codes: 0 done; 2 bad input or usage, or nothing in BAG tells of a payload. Whether an estimate can be believed is its
    status.
    """
    check_outputs(force, json=json_path, series=series_path, payloads=payloads_path, plot=plot_path, rerun=rerun_path)
    check_plot_paths(plot_path, rerun_path)
    parameters = read_config(config_path)
    settings = settings_from(parameters, frame_id=frame, joint_names=joint_names, effort_preset=effort_preset)
    urdf = urdf or _path_in(parameters, "urdf_path")
    model_path = model_path or _path_in(parameters, "model_path")
    source, robot = open_bag(bag, topic, urdf, settings, columns_path)
    estimation = OnlineEstimation(robot, settings, ModelFile.read(model_path) if model_path else None)
    records = _records(bag, source, estimation, imu_topic, contact_topic)
    gate = gate_for(robot, estimation.base, settings)
    with said_if_slow("Loading compiled code; after an install it is compiled, which takes a minute, once"):
        warm_up(robot, settings)
    with progress_bar("replay", source.message_count) as advance:
        result = replay(records, gate, estimation, advance)
    if result.used == 0:
        worst = max(gate.counts, key=lambda reason: gate.counts[reason], default="joints_missing")
        raise BagError(f"bag '{bag}': no joint state of it can be used. {gate.last_texts.get(worst, '')}".rstrip())
    tells = any(e.status != "warming_up" for e in result.series)
    if tells:
        _write(result, bag.name, robot, urdf, json_path, series_path, payloads_path, (plot_path, rerun_path))
    for sentence in result.warnings:
        warn(sentence)
    show_replay(result, bag.name)
    if not tells:
        raise BagError(f"bag '{bag}' tells nothing of a payload: {_why_nothing(result, gate)}")


def _records(
    bag: Path, source: BagSource | TableSource, estimation: OnlineEstimation, imu_topic: str, contact_topic: str
) -> FloatingBagSource | Source:
    if estimation.base is None:
        return source
    if isinstance(source, TableSource):
        raise DataError(f"table '{bag}' holds no IMU, which a robot on legs needs. Give a bag.")
    return FloatingBagSource(source, imu_topic, contact_topic)


def _write(
    result: Replay,
    name: str,
    robot: RobotModel,
    urdf: Path | None,
    json_path: Path | None,
    series_path: Path | None,
    payloads_path: Path | None,
    plots: tuple[Path | None, ...],
) -> None:
    if json_path:
        write_json(json_path, as_json(result))
    if series_path:
        write_series(series_path, result.series)
    if payloads_path:
        write_carried(payloads_path, result.payloads)
    for path in plots:
        if path and result.series:
            from sysid_ros.pages import write_replay  # drawing libraries take a second to import

            write_replay(path, result, robot, f"Payload in {name}", urdf)


def _path_in(parameters: dict[str, object], name: str) -> Path | None:
    value = parameters.get(name)
    return Path(str(value)) if value else None


def _why_nothing(result: Replay, gate: Gate) -> str:
    if result.rejected and result.read > 2 * result.used:
        return gate.last_texts[max(result.rejected, key=lambda reason: result.rejected[reason])]
    if not result.series:
        return f"it ends after {result.duration:.2g} s, before there is an estimate. Record ten seconds of a moving robot."
    return f"it ends after {result.duration:.2g} s. {result.reason}"
