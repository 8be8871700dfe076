"""``sysid excite --multisine``: motions from which frequency responses are measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from sysid_ros.cli.output import check_outputs, note, report, table, warn, write_json
from sysid_ros.exceptions import SettingsError
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.feasibility import Feasibility
from sysid_ros.excitation.motion_limits import JointLimit, MotionLimits
from sysid_ros.excitation.multisine import Multisine, crest_factor, multisines
from sysid_ros.files import check_bag, plain
from sysid_ros.robot.collision_model import CollisionModel
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.sources.joint_trajectory import JointTrajectory

_PERIOD = 10.0
"""Usual period [s]: lines 0.2 Hz apart."""
Write = Callable[[JointTrajectory, Path, Path | None], None]


def options(command: Any) -> Any:
    """The options of a multisine."""
    for option in reversed(
        (
            click.option(
                "--multisine",
                is_flag=True,
                help="Write multisines of odd harmonics for 'sysid frequency' instead, one file and one run for each joint that "
                "moves: orthogonal, with Schroeder's phases, after --period and --duration.",
            ),
            click.option("--band", default="0.3,10", show_default=True, metavar="LOW,HIGH", help="Of the multisine. [Hz]"),
            click.option("--move", multiple=True, metavar="JOINT...", help="Joints that a multisine moves.  [default: all]"),
        )
    ):
        command = option(command)
    return command


@dataclass(frozen=True)
class MultisineWishes:
    """What was asked for: band "LOW,HIGH" [Hz], joints by name, period [s] (0: the usual one), duration of all periods [s]."""

    band: str
    move: tuple[str, ...]
    period: float
    duration: float

    @classmethod
    def taken(cls, options: dict[str, Any], period: float) -> MultisineWishes | None:
        """Out of the options of the command, which are then those of the other motions; None where no multisine is asked for."""
        asked, band, move = (options.pop(name) for name in ("multisine", "band", "move"))
        return cls(band, move, period, options["duration"]) if asked else None

    def numbers(self, robot: RobotModel) -> tuple[tuple[float, float], list[int], float, int]:
        """Band, indices of joints, period and number of periods.

        Raises:
            SettingsError: one of them can't be.
        """
        try:
            low, high = (float(x) for x in self.band.split(","))
        except ValueError:
            raise SettingsError(
                f"--band is '{self.band}'; it must be two frequencies in Hz with a comma, such as 0.3,10."
            ) from None
        if not 0.0 < low < high <= 100.0:
            raise SettingsError(f"--band is {self.band}; it must be two rising frequencies above 0, at most 100 Hz.")
        if unknown := [name for name in self.move if name not in robot.joint_names]:
            raise SettingsError(f"--move names {', '.join(unknown)}; the joints are {', '.join(robot.joint_names)}.")
        period = self.period or _PERIOD
        return (low, high), [robot.joint_names.index(name) for name in self.move], period, max(1, round(self.duration / period))


def run_multisine(
    robot: RobotModel,
    settings: ExcitationSettings,
    wishes: MultisineWishes,
    given: Mapping[str, JointLimit],
    collision: CollisionModel | None,
    posture: FloatArray | None,
    out: tuple[Path, Path | None, Path | None, bool],
    timing: tuple[float, float],
    write: Write,
) -> None:
    """Find the motions, write and show them.

    Args:
        out: trajectory file, bag and JSON to write; whether what is there may be replaced. timing: points a second [Hz], time to
            come to the start [s]. write: a message into a file, and a bag.

    Raises:
        SettingsError: nothing feasible. OutputError: a file is there already.
    """
    band, joints, period, periods = wishes.numbers(robot)
    path, bag, json_path, force = out
    count = len(joints) or robot.n
    files = [(_numbered(path, k, count), None if bag is None else _numbered(bag, k, count)) for k in range(count)]
    for file, folder in files:
        check_outputs(force, out=file)
        if folder is not None:
            check_bag(folder, force, "--bag")
    if band[1] > 0.25 * timing[0]:
        warn(
            f"{timing[0]:g} points a second are few for {band[1]:g} Hz; give --rate {10 * band[1]:g} if the controller takes it."
        )
    limits = MotionLimits(robot, settings, given)
    found = multisines(limits, Feasibility(limits, collision), band, period, periods, joints, posture)
    for sentence in limits.notes:
        note(sentence)
    for motion, (file, folder) in zip(found, files, strict=True):
        t = np.linspace(0.0, motion.duration, round(motion.duration * timing[0]) + 1)
        write(JointTrajectory(robot.joint_names, t + timing[1], *motion.sample(t)), file, folder)
    if json_path is not None:
        write_json(json_path, _document(found, robot, [str(f) for f, _ in files]))
    _show(found, robot, joints or list(range(robot.n)))
    note(f"{count} motion{'s' if count > 1 else ''} of {found[0].duration:g} s written: {', '.join(str(f) for f, _ in files)}.")


def _numbered(path: Path, k: int, count: int) -> Path:
    return path if count == 1 else path.with_name(f"{path.stem}_{k + 1}{path.suffix}")


def _document(found: Sequence[Multisine], robot: RobotModel, files: list[str]) -> dict[str, Any]:
    first = found[0]
    document: dict[str, Any] = {
        "joints": robot.joint_names,
        "files": files,
        "period_s": first.period,
        "periods": first.periods,
        "ramp_s": first.ramp,
        "frequencies_hz": first.frequencies,
        "amplitudes": [m.amplitude for m in found],
        "phases": [m.phase for m in found],
    }
    cleaned: dict[str, Any] = plain(document)
    return cleaned


def _show(found: Sequence[Multisine], robot: RobotModel, joints: Sequence[int]) -> None:
    f = found[0].frequencies
    periods = f"{found[0].periods} periods of {found[0].period:g} s"
    title = f"Multisine of {len(f)} odd harmonics from {f[0]:.3g} to {f[-1]:.3g} Hz, {periods}"
    out = table(title, "joint", "excursion", "velocity, rms", "crest factor")
    at = found[0].ramp + np.arange(0.0, found[0].period, 1e-3)
    q, v, _ = found[0].sample(at)
    for j in joints:
        away = q[:, j] - found[0].centre[j]
        rms = float(np.sqrt(np.mean(v[:, j] ** 2)))
        out.add_row(robot.joint_names[j], f"{np.max(np.abs(away)):.3g}", f"{rms:.3g}", f"{crest_factor(v[:, j]):.2f}")
    report().print(out)
