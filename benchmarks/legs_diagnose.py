"""What ``sysid diagnose`` names of robots on legs: one hidden cause of sixteen kinds, two of them, or none.

Each seed is a robot in MuJoCo whose links' masses are off by 2 %, with encoders that have steps and an IMU with a rate of its own
and noise; it sways widely over its feet for some seconds. Every cause is then hidden in that one recording, or in what the
description says of the robot: torques that rubbing, rotors, wrong gains, offsets and delays add, an IMU that is turned, sits
elsewhere, is late or shows a bias, feet, links and a trunk that are described wrongly, and a body on the trunk that is not
described, and channels of legs under each other's names or of the other sign. The motion is the same for each, so that causes are
compared and not motions.

The peer in the same run, on the same rows: of all candidates the one that gains the most alone (BIC), as one would name a cause
without sets, priors and held-out data; it never says that nothing is wrong where one gains anything.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import click
import numpy as np
from legs_identify import START, recorded
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.diagnosis.claims import Judged
from sysid_ros.diagnosis.legs.leg_rows import LegLibrary
from sysid_ros.diagnosis.legs.on_legs import judged_on_legs
from sysid_ros.diagnosis.reporting import report
from sysid_ros.diagnosis.scoring import Scorer
from sysid_ros.diagnosis.term import Term
from sysid_ros.exceptions import SettingsError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.simulation.legged_record import LeggedRecord, simulate_legged
from sysid_ros.simulation.legged_scenario import LeggedScenario
from sysid_ros.simulation.quadruped_record import QuadrupedRecord, simulate_quadruped
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario


@dataclass(frozen=True, slots=True)
class Robot:
    """What is recorded of a robot and said of it: recording, description, and its exact velocities and accelerations, (N, n)."""

    recording: Recording
    urdf: str
    v: FloatArray
    a: FloatArray

    def with_torque(self, tau: FloatArray) -> Robot:
        """With other torques (N, n)."""
        return replace(self, recording=replace(self.recording, tau=tau))

    def with_imu(self, omega: FloatArray, force: FloatArray) -> Robot:
        """With another IMU."""
        assert self.recording.trunk is not None
        return replace(self, recording=replace(self.recording, trunk=replace(self.recording.trunk, omega=omega, force=force)))

    def with_link(self, name: str, change: Callable[[FloatArray], FloatArray]) -> Robot:
        """With a link that is described by other parameters, shape (10,)."""
        root = ElementTree.fromstring(self.urdf)
        inertial = root.find(f"link[@name='{name}']/inertial")
        assert inertial is not None
        mass, origin, inertia = inertial.find("mass"), inertial.find("origin"), inertial.find("inertia")
        assert mass is not None
        assert origin is not None
        assert inertia is not None
        com = np.array([float(x) for x in origin.get("xyz", "0 0 0").split()])
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        xx, xy, xz, yy, yz, zz = (float(inertia.get(key, "0")) for key in keys)
        about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        own = inertial_parameters.from_com(float(mass.get("value", "0")), com, about_com)
        m, c, moments = inertial_parameters.to_com(change(own))
        mass.set("value", repr(float(m)))
        origin.set("xyz", " ".join(repr(float(x)) for x in c))
        for key, (i, k) in zip(keys, ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)), strict=True):
            inertia.set(key, repr(float(moments[i, k])))
        return replace(self, urdf=ElementTree.tostring(root, encoding="unicode"))


Hide = Callable[[Robot, np.random.Generator], tuple[Robot, tuple[str, str]]]
"""Hides a cause; with it the effect that names it, and the joint or link that it is on, empty for the whole robot."""


def _signed(rng: np.random.Generator, low: float, high: float, size: int | None = None) -> FloatArray:
    return np.asarray(rng.uniform(low, high, size) * rng.choice([-1.0, 1.0], size))


def _late(t: FloatArray, x: FloatArray, by: float) -> FloatArray:
    return np.stack([np.interp(t - by, t, column) for column in x.T], axis=1)


def _base(robot: Robot) -> FloatingBase:
    return FloatingBase(RobotModel.from_urdf(robot.urdf))


def _joint(robot: Robot, rng: np.random.Generator) -> tuple[int, str]:
    names = _base(robot).legs.joint_names
    j = int(rng.integers(len(names)))
    return j, names[j]


def dry(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    level = rng.uniform(0.3, 0.8) * rng.uniform(0.7, 1.3, robot.v.shape[1])
    return robot.with_torque(robot.recording.tau + level * smoothed_sign(robot.v, 0.01)), ("coulomb_friction", "")


def viscous(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    level = rng.uniform(0.1, 0.4) * rng.uniform(0.7, 1.3, robot.v.shape[1])
    return robot.with_torque(robot.recording.tau + level * robot.v), ("viscous_friction", "")


def rotors(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    level = rng.uniform(0.02, 0.05) * rng.uniform(0.7, 1.3, robot.v.shape[1])
    return robot.with_torque(robot.recording.tau + level * robot.a), ("rotor_inertia", "")


def gain(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    j, name = _joint(robot, rng)
    tau = robot.recording.tau.copy()
    tau[:, j] *= 1.0 + float(_signed(rng, 0.15, 0.3))
    return robot.with_torque(tau), ("torque_scale", name)


def offset(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    j, name = _joint(robot, rng)
    tau = robot.recording.tau.copy()
    tau[:, j] += float(_signed(rng, 0.4, 1.0))
    return robot.with_torque(tau), ("torque_offset", name)


def late_torque(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    r = robot.recording
    return robot.with_torque(_late(r.t, r.tau, rng.uniform(0.01, 0.025))), ("time_delay", "")


def tilt(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    trunk = robot.recording.trunk
    assert trunk is not None
    turned = TrunkSetup(tilt=_signed(rng, 0.015, 0.06, 3)).rotation
    return robot.with_imu(trunk.omega @ turned, trunk.force @ turned), ("imu_tilt", "")


def lever(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    trunk = robot.recording.trunk
    assert trunk is not None
    trunk = replace(trunk, place=trunk.place - _signed(rng, 0.02, 0.06, 3))
    return replace(robot, recording=replace(robot.recording, trunk=trunk)), ("imu_lever", "")


def late_imu(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    trunk, t = robot.recording.trunk, robot.recording.t
    assert trunk is not None
    by = rng.uniform(0.006, 0.02)
    return robot.with_imu(_late(t, trunk.omega, by), _late(t, trunk.force, by)), ("imu_delay", "")


def bias(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    trunk = robot.recording.trunk
    assert trunk is not None
    return robot.with_imu(trunk.omega, trunk.force + _signed(rng, 0.2, 0.6, 3)), ("accelerometer_bias", "")


def feet(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    root, by = ElementTree.fromstring(robot.urdf), float(rng.uniform(0.008, 0.015))
    for name in _base(robot).contact_frames:
        sphere = root.find(f"link[@name='{name}']/collision/geometry/sphere")
        assert sphere is not None
        sphere.set("radius", repr(float(str(sphere.get("radius"))) - by))
    return replace(robot, urdf=ElementTree.tostring(root, encoding="unicode")), ("foot_radius", "")


def leg_link(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    base = _base(robot).legs
    heavy = [j for j in range(base.n) if base.pi[10 * j] > 0.5]
    j = heavy[int(rng.integers(len(heavy)))]
    factor = float(rng.uniform(0.55, 0.75))
    return robot.with_link(base.body_names[j], lambda pi: factor * pi), ("link_inertia", base.joint_names[j])


def trunk_com(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    base, by = _base(robot), _signed(rng, 0.01, 0.025, 3)

    def moved(pi: FloatArray) -> FloatArray:
        m, c, moments = inertial_parameters.to_com(pi)
        return inertial_parameters.from_com(m, c - by, moments)

    return robot.with_link(base.trunk, moved), ("link_inertia", base.robot.joint_names[5])


def payload(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    place = np.array([*rng.uniform(-0.08, 0.08, 2), rng.uniform(0.03, 0.07)])
    body = inertial_parameters.from_com(float(rng.uniform(1.0, 2.0)), place, 0.002 * np.eye(3))
    return robot.with_link(_base(robot).trunk, lambda pi: pi - body), ("payload", "")


def swapped(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    r, n = robot.recording, robot.v.shape[1]
    assert r.v is not None
    a, b = rng.choice(n // 3, 2, replace=False)
    order = np.arange(n).reshape(-1, 3)
    order[[a, b]] = order[[b, a]]
    own = order.ravel()
    shown = replace(r, q=r.q[:, own], v=r.v[:, own], tau=r.tau[:, own])
    return replace(robot, recording=shown), ("joint_order", _base(robot).legs.joint_names[3 * a])


def backwards(robot: Robot, rng: np.random.Generator) -> tuple[Robot, tuple[str, str]]:
    r = robot.recording
    assert r.v is not None
    j, name = _joint(robot, rng)
    sign = np.where(np.arange(robot.v.shape[1]) == j, -1.0, 1.0)
    return replace(robot, recording=replace(r, q=sign * r.q, v=sign * r.v, tau=sign * r.tau)), ("joint_sign", name)


KINDS: dict[str, Hide] = {
    "dry friction": dry, "viscous friction": viscous, "rotors": rotors, "gain": gain, "offset": offset,
    "late torque": late_torque, "IMU tilt": tilt, "IMU lever": lever, "late IMU": late_imu, "IMU bias": bias, "feet": feet,
    "leg link": leg_link, "trunk com": trunk_com, "payload": payload, "swapped legs": swapped, "backwards": backwards,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Trial:
    """One robot: what was hidden, what was told with its probability, whether one of the hidden ones is told first, whether all
    are told, and whether nothing else is; what the peer names, and whether that is one of them."""

    seed: int
    hidden: tuple[str, ...]
    told: tuple[tuple[str, float], ...]
    first: bool
    all_told: bool
    exact: bool
    peer: str
    peer_first: bool


def simulated(simulator: str, name: str, gait: str, seed: int, seconds: float) -> Robot:
    """A robot that hides nothing but, in MuJoCo, masses that are 2 % off; in PyBullet an A1 whose description is right.

    Raises:
        SettingsError: it falls.
    """
    extent = 1.4 if gait == "sway" else 1.0
    if simulator == "mujoco":
        scenario = LeggedScenario(
            robot=name, gait=gait, seed=seed, duration=seconds, extent=extent, encoder_step=1e-4, imu_rate=250, mass_error=0.02
        )
        record: LeggedRecord | QuadrupedRecord = simulate_legged(scenario, start_time=START)
    else:
        torques = QuadrupedScenario(gait=gait, seed=seed, duration=seconds, extent=extent, encoder_noise=1e-4)
        record = simulate_quadruped(torques, start_time=START)
    base, recording = recorded(record, gait)
    t, v = np.array([START + x.t for x in record.exact]), np.stack([x.v for x in record.exact])
    names = list(record.truth["joint_names"])
    order = [names.index(joint) for joint in base.legs.joint_names]
    a = np.gradient(v, t, axis=0)
    v, a = (np.stack([np.interp(recording.t, t, x[:, j]) for j in order], axis=1) for x in (v, a))
    return Robot(recording, record.urdf, v, a)


Told = tuple[str, tuple[str, ...], float]
"""An effect that is told, its joints, and its probability."""


def likeliest_alone(judged: Judged) -> Told:
    """What the peer names."""
    problem, library = judged.train.problem, judged.selection.library
    assert isinstance(library, LegLibrary)
    scorer = Scorer(problem, problem.fit([], inexact=True))
    rows = float(np.log(problem.y[:, problem.active].size))

    def gain(term: Term) -> float:
        return scorer.whole(term).gain - 0.5 * term.cost * rows

    best = max(library.candidates(), key=gain)
    if gain(best) <= 0.0:
        return "", (), 0.0
    return best.id, tuple(library.robot.joint_names[j] for j in best.joints), 1.0


def trial(robot: Robot, seed: int, kinds: tuple[str, ...]) -> Trial:
    """Hide some kinds in a robot and diagnose it."""
    rng = np.random.default_rng([seed, *(list(KINDS).index(kind) for kind in kinds)])
    truth = []
    for kind in kinds:
        robot, hidden = KINDS[kind](robot, rng)
        truth.append(hidden)
    base = _base(robot)
    judged, _, _, channels = judged_on_legs(base, [robot.recording])
    told = [(f.id, f.joints, f.probability or 0.0) for f in report(judged).causes]
    names = base.legs.joint_names
    told += [(f.effect.id, tuple(names[j] for j in f.joints), f.probability or 0.0) for f in channels.faults]
    peer = likeliest_alone(judged)

    def right(found: Told, alone: bool = False) -> bool:
        here = [where for name, where in truth if name == found[0]]
        alone = alone and found[0] != "joint_order"  # of two legs
        return any(not where or (found[1] == (where,) if alone else where in found[1]) for where in here)

    named = [any(f[0] == name and (not where or where in f[1]) for f in told) for name, where in truth]
    shown = tuple((name, round(p, 3)) for name, _, p in told)
    exact = all(named) and len(told) == len(truth) and all(right(f, alone=True) for f in told)
    return Trial(seed, kinds, shown, bool(told) and right(told[0]), all(named), exact, peer[0], right(peer))


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--simulator", type=click.Choice(["mujoco", "pybullet"]), default="mujoco", show_default=True)
@click.option("--robot", default="go2", show_default=True, help="By name; of MuJoCo.")
@click.option("--gait", default="sway", show_default=True, help="That is recorded: sway, trot, flying_trot.")
@click.option("--only", default=",".join(KINDS), help="Some of the causes; all of them without.")
@click.option("--seconds", default=20.0, show_default=True, help="Of the recording.")
@click.option("--seeds", type=click.IntRange(1), default=3, show_default=True, help="Simulated robots.")
@click.option("--first-seed", type=int, default=500, show_default=True)
@click.option("--pairs", type=click.IntRange(0), default=4, show_default=True, help="With two causes, of each simulated robot.")
@click.option("--json", "json_path", type=click.Path(path_type=Path, dir_okay=False), help="Write the results.")
def main(
    simulator: str,
    robot: str,
    gait: str,
    only: str,
    seconds: float,
    seeds: int,
    first_seed: int,
    pairs: int,
    json_path: Path | None,
) -> int:  # fmt: skip
    """Diagnose robots on legs; a simulated one with all that is hidden in it takes some five minutes.

    \b
    Example:
      python benchmarks/legs_diagnose.py --seeds 1 --pairs 0
    """
    if unknown := sorted(set(only.split(",")) - set(KINDS)):
        raise click.UsageError(f"only has {', '.join(unknown)}; it has some of {', '.join(KINDS)}.")
    console = Console(width=150)
    trials: list[Trial] = []
    for seed in range(first_seed, first_seed + seeds):
        try:
            own = simulated(simulator, robot, gait, seed, seconds)
        except SettingsError as error:
            console.print(f"{robot} {seed}: {error}")
            continue
        rng = np.random.default_rng([seed, 1])
        two = [tuple(str(x) for x in rng.choice(list(KINDS), 2, replace=False)) for _ in range(pairs)]
        for kinds in [(), *((kind,) for kind in only.split(",")), *two]:
            t = trial(own, seed, kinds)
            trials.append(t)
            told = ", ".join(f"{name} {p:.2f}" for name, p in t.told)
            mark = "exact" if t.exact else "first" if t.first else "healthy" if not (t.hidden or t.told) else "no"
            console.print(
                f"{seed} {' and '.join(kinds) or 'healthy'}: {mark}; told {told or 'nothing'}; peer {t.peer or 'nothing'}"
            )
    if not trials:
        raise click.UsageError("every robot has fallen; take other seeds.")
    groups = [[t for t in trials if len(t.hidden) == n] for n in range(3)]
    table = Table(
        "robots", "told first", "exactly", "all told", "peer: first", title="What is told of robots on legs", title_justify="left"
    )
    for name, group in zip(("healthy", "one cause", "two causes"), groups, strict=True):
        if group:
            parts = [
                f"{100 * np.mean([getattr(t, key) for t in group]):.0f} %" for key in ("first", "exact", "all_told", "peer_first")
            ]
            table.add_row(f"{len(group)} {name}", *parts)
    console.print(table)
    healthy, single, double = groups
    targets = [
        Target("hidden cause told first", float(np.mean([t.first for t in single])), low=0.9),
        Target("exactly the hidden cause told", float(np.mean([t.exact for t in single])), low=0.85),
        Target("nothing told of healthy robots", float(np.mean([not t.told for t in healthy])), low=0.97),
    ]
    if double:
        targets.append(Target("both of two hidden causes told", float(np.mean([t.all_told for t in double])), low=0.75))
    return conclude("legs_diagnose", targets, {"trials": [asdict(t) for t in trials]}, json_path)


if __name__ == "__main__":
    sys.exit(main(standalone_mode=False))
