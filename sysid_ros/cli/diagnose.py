"""``sysid diagnose``: what a robot's model gets wrong, why, and what the fix gains."""

from __future__ import annotations

import time
from pathlib import Path

import click
import numpy as np

from sysid_ros.cli import options as opt
from sysid_ros.cli.diagnose_legs import Found, check_of_legs, diagnosed, legs_of
from sysid_ros.cli.diagnose_output import check_results, show, write_files
from sysid_ros.cli.inputs import open_bag, provenance, read_config, require_same_robot, settings_from
from sysid_ros.cli.output import ManyValues, note, warn
from sysid_ros.cli.progress import progress_bar, stages
from sysid_ros.cli.recordings import TrunkTopics
from sysid_ros.diagnosis import Diagnosis, diagnose
from sysid_ros.diagnosis.reporting import with_ranking
from sysid_ros.diagnosis.result import RankedUrdf
from sysid_ros.diagnosis.whose.ranked_urdfs import rank_urdfs
from sysid_ros.exceptions import DataError, RobotModelError
from sysid_ros.input_gate.missing_joints import missing_joints
from sysid_ros.input_gate.raw_messages import read_messages
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.temperature import with_temperatures
from sysid_ros.simulation.simulators import SIMULATORS, installed
from sysid_ros.sources import temperatures, urdf_text
from sysid_ros.torque.model_file import ModelFile

BAD_INPUT = 2
Reading = tuple[str, Path | None]
"""Topic of the joint states in a bag, and the mapping of a table's columns."""


@click.command(cls=ManyValues, one_each=("--urdf",))
@opt.BAGS
@opt.path(
    "--urdf",
    "urdfs",
    multiple=True,
    metavar="URDF",
    help="The model to judge (nominal model); else /robot_description of the bag. Given again for others: the robot's is found.",
)
@opt.path("--out", "out_path", required=True, metavar="DIR", help="Folder to write the files to.")
@opt.path("--validate", multiple=True, metavar="BAG...", help="Bags to judge on, never fitted; of another motion, if possible.")
@opt.path("--model", "model_path", help="model.yaml of 'sysid identify' or of an earlier diagnosis: the known part.")
@click.option("--simulator", type=click.Choice(SIMULATORS), help="Of the gain in simulation.  [default: the first installed]")
@opt.READ_JOINTS
@opt.EFFORT_PRESET
@opt.CONFIG
@opt.TOPIC
@opt.COLUMNS
@opt.IMU_TOPIC
@opt.CONTACT_TOPIC
@opt.RERUN
@opt.JSON
@opt.FORCE
def command(
    bags: tuple[Path, ...],
    urdfs: tuple[Path, ...],
    out_path: Path,
    validate: tuple[Path, ...],
    model_path: Path | None,
    simulator: str | None,
    joint_names: tuple[str, ...],
    effort_preset: str,
    config_path: Path | None,
    topic: str,
    columns_path: Path | None,
    imu_topic: str,
    contact_topic: str,
    rerun_path: Path | None,
    json_path: Path | None,
    force: bool,
) -> int:
    """Find what the model of a robot gets wrong: the causes by name, with evidence, and a model extended by them.

    Give bags of a robot that moves all of its joints (15 to 30 s of positions and efforts, slow and fast) and its URDF; of
    one on legs with its IMU, swaying widely and quickly over its feet. Without --validate the last part of each bag is held
    out. It takes about as long as the recording, up to three times as long where much is wrong. Temperatures of joints
    (Temperature or DynamicJointState messages) are read where a bag has them.

    \b
    Writes to DIR:
      report.html       what is wrong in plain words, the causes, figures, numbers (opens without a network)
      diagnosis.json    the same for machines
      model.yaml        the extended model, for sysid replay, the nodes and the simulation
      extended.urdf     what a URDF can hold of it; extended.xml the same for MuJoCo, with rotors, gains and delays
      hybrid.json       where black boxes predict more than the model: the rest, for sysid_ros.blackbox.Hybrid
      predictions.npz   torques on the data that were not fitted: measured, nominal, extended, and hybrid where there is one

    \b
    Example:
      sysid diagnose run1/ --urdf arm.urdf --validate run2/ --out diagnosis/
      sysid diagnose sway/ --urdf quadruped.urdf --imu-topic /imu/data --out diagnosis/

    The verdict is "explained", "partly explained", "unexplained", "nothing wrong" or "refused": the recordings can't be judged,
    with the reason and the cure.

    Exit codes: 0 done; 2 bad input or usage, also where the verdict is "refused".
    """
    started = time.monotonic()
    check_results(out_path, json_path, rerun_path, force)
    installed(simulator)
    settings = settings_from(read_config(config_path), joint_names=joint_names, effort_preset=effort_preset)
    origin = provenance(bags, validate=validate, urdf=urdfs or "/robot_description of the first bag", model=model_path)
    if base := legs_of(bags[0], urdfs, topic, settings, columns_path):
        check_of_legs(urdfs, model_path, simulator)
        topics = TrunkTopics(imu_topic, contact_topic)
        robot, chosen, result = diagnosed(base, bags, validate, urdfs, settings, (topic, columns_path, topics), origin)
    else:
        given = bags, validate, urdfs, settings, (topic, columns_path)
        robot, chosen, result = _of_an_arm(*given, model_path, origin, simulator)
    write_files(result, robot, out_path, origin, json_path, chosen, rerun_path, base)
    show(result)
    note(f"Written to {out_path} in {time.monotonic() - started:.0f} s.")
    return BAD_INPUT if result.verdict == "refused" else 0


def _of_an_arm(
    bags: tuple[Path, ...],
    validate: tuple[Path, ...],
    urdfs: tuple[Path, ...],
    settings: OnlineSettings,
    read: Reading,
    model_path: Path | None,
    origin: dict[str, object],
    simulator: str | None,
) -> Found:
    """The likeliest robot of several URDFs, its URDF, and what is wrong with it; "refused" where that can't be judged."""
    robot: RobotModel | None = None
    known = ModelFile.read(model_path) if model_path else None
    chosen = urdfs[0] if urdfs else None
    try:
        robots, fitted, judged = _read_with_urdfs(bags, validate, urdfs, settings, read)
        ranked = _ranked(urdfs, robots, fitted)
        likeliest = max(ranked, key=lambda x: x.probability).urdf if ranked else next(iter(robots))
        robot, chosen = robots[likeliest], Path(likeliest) if urdfs else None
        return robot, chosen, with_ranking(_diagnosed(robot, fitted, judged, known, origin, simulator), ranked)
    except (DataError, RobotModelError) as error:
        return robot, chosen, Diagnosis("refused", robot.joint_names if robot else (), refusal=str(error))


def _diagnosed(
    robot: RobotModel,
    fitted: list[Recording],
    judged: list[Recording],
    known: ModelFile | None,
    origin: dict[str, object],
    simulator: str | None,
) -> Diagnosis:
    for sentence in known.notes(robot.urdf) if known else []:
        note(sentence)
    with stages() as tell:
        return diagnose(robot, fitted, judged, known, tell, origin, simulator)


def _read_with_urdfs(
    bags: tuple[Path, ...], validate: tuple[Path, ...], urdfs: tuple[Path, ...], settings: OnlineSettings, read: Reading
) -> tuple[dict[str, RobotModel], list[Recording], list[Recording]]:
    """The robots of the URDFs that have the joints of the bags, by the URDFs' names, and the recordings, as :func:`_read_all`.

    Raises:
        DataError, RobotModelError: as there, where it is so with each of the URDFs.
    """
    first, *others = urdfs or (None,)
    try:
        robot, fitted, judged = _read_all(bags, validate, first, settings, read)
    except RobotModelError as error:
        if not others:
            raise
        warn(f"{first}: {error}")
        return _read_with_urdfs(bags, validate, tuple(x for x in others if x is not None), settings, read)
    robots = {str(first): robot}
    for path in others:
        try:
            other = RobotModel.from_urdf(urdf_text(path), robot.joint_names, settings.gravity)
            require_same_robot(Path(str(path)), other, robot)
            robots[str(path)] = other
        except RobotModelError as error:
            warn(f"{path}: {error}")
    return robots, fitted, judged


def _ranked(urdfs: tuple[Path, ...], robots: dict[str, RobotModel], fitted: list[Recording]) -> list[RankedUrdf]:
    """How likely each of several URDFs is the robot's; none of it where one is given. One without the bags' joints is not."""
    if len(urdfs) < 2:
        return []
    note("weighing the URDFs against one another")
    known = {x.urdf: x for x in rank_urdfs(list(robots.values()), list(robots), fitted)}
    return [known.get(str(path), RankedUrdf(str(path), 0.0)) for path in urdfs]


def _read_all(
    bags: tuple[Path, ...], validate: tuple[Path, ...], urdf: Path | None, settings: OnlineSettings, read: Reading
) -> tuple[RobotModel, list[Recording], list[Recording]]:
    """The robot of the first bag, and the recordings to fit and to judge on.

    Raises:
        DataError: a bag holds nothing to judge. RobotModelError: the URDF or a bag is of another robot.
    """
    robot: RobotModel | None = None
    recordings = []
    for path in (*bags, *validate):
        source, own = open_bag(path, read[0], urdf, settings, read[1])
        if robot is None:
            robot = own
            if not settings.joint_names and (reason := missing_joints(own)):
                raise RobotModelError(f"bag '{path}': {reason}")
        require_same_robot(path, own, robot)
        with progress_bar(path.name, source.message_count) as advance:
            recording, sentences = read_messages(_name_of(path, (*bags, *validate)), source, robot, settings, advance)
        series, unread = temperatures(source)
        recording, unused = with_temperatures(recording, robot, series)
        for sentence in (*sentences, *unread, *unused):
            warn(sentence)
        if recording.temperature is not None:
            warm = np.flatnonzero(np.isfinite(recording.temperature).any(axis=0)).tolist()
            names = "all joints" if len(warm) == robot.n else ", ".join(robot.joint_names[j] for j in warm)
            note(f"{path}: it holds the temperature of {names}.")
        recordings.append(recording)
    assert robot is not None
    return robot, recordings[: len(bags)], recordings[len(bags) :]


def _name_of(bag: Path, every: tuple[Path, ...]) -> str:
    """A bag's own name, with its folder where others are called the same."""
    return bag.name if [b.resolve().name for b in every].count(bag.name) == 1 else str(bag)
