"""Arms of nine makes: the online estimate at the settings' defaults, without a simulator's arm to be tuned on.

Each arm of example-robot-data moves all its joints in random sines within its limits, at most 2 rad/s, from 2 s on. It
carries nothing, then from 5 to 11 s a payload on its last link, then nothing. Torques are pinocchio's inverse dynamics of the
arm, or of the arm with the payload as a part of its last link; they get friction (3 % of the joint's largest torque, Coulomb,
and as much a rad/s, viscous) that the estimator is not told of, and white noise of 2 % of that torque. Encoder noise is 2e-5
rad. Payloads are drawn up to a mass that fits the arm.
The links are exact, and the estimator is told so.

Measured: error of the mass and of the centre of mass at 10.9 s, coverage of the 95 % intervals of the ten parameters, the
normalised error of the mass, events.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.input_gate import InputGate, Rejection
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, JointStateRecord

# path below share/example-robot-data/robots, joints that move (part of the name), largest payload [kg]
ARMS = {
    "panda": ("panda_description/urdf/panda.urdf", "panda_joint", 3.0),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "", 4.0),
    "ur10": ("ur_description/urdf/ur10_robot.urdf", "", 4.0),
    "kinova": ("kinova_description/robots/kinova.urdf", "_joint_", 1.5),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", "", 4.0),
    "z1": ("z1_description/urdf/z1.urdf", "", 2.0),
    "so100": ("so_arm_description/urdf/so100.urdf", "", 0.3),
    "tiago": ("tiago_description/robots/tiago.urdf", "arm_", 2.0),
    "baxter": ("baxter_description/urdf/baxter.urdf", "left_", 2.0),
}
PICK, DROP, END, JUDGED = 5.0, 11.0, 16.0, 10.9


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of one run. Errors in %, mm; ``normalised``: error of the mass in its standard deviation."""

    arm: str
    seed: int
    payload: float
    mass_error: float
    com_error: float
    normalised: float
    covered: float
    status: str
    events: tuple[str, ...]


def urdf_of(arm: str) -> str:
    """Text of the arm's URDF."""
    for parent in Path(pin.__file__).parents:
        path = parent / "share/example-robot-data/robots" / ARMS[arm][0]
        if path.is_file():
            return path.read_text()
    raise click.ClickException("example-robot-data is not installed: pip install '.[dev]'")


def motion(model: RobotModel, rng: np.random.Generator, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sines that grow in the first two seconds: q, v, a, each of shape (len(t), n), from central differences of the formula."""
    lower = np.where(model.position_lower > -2.5, model.position_lower, -2.5)
    upper = np.where(model.position_upper < 2.5, model.position_upper, 2.5)
    frequency = rng.uniform(0.15, 0.6, (4, model.n))
    phase = rng.uniform(0.0, 2.0 * np.pi, (4, model.n))
    amplitude = rng.uniform(0.2, 1.0, (4, model.n))
    amplitude *= 0.35 * (upper - lower) / amplitude.sum(axis=0)
    fastest = 0.5 * np.minimum(model.velocity_limit, 2.0)
    amplitude *= np.minimum(1.0, fastest / (amplitude * 2.0 * np.pi * frequency).sum(axis=0))

    def position(at: FloatArray) -> FloatArray:
        s = np.clip(at / 2.0, 0.0, 1.0)[:, None]
        wave = np.sum(amplitude * np.sin(2.0 * np.pi * frequency * at[:, None, None] + phase), axis=1)
        return np.asarray(0.5 * (lower + upper) + (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5) * wave)

    h = 1e-4
    before, now, after = position(t - h), position(t), position(t + h)
    return now, (after - before) / (2.0 * h), (after - 2.0 * now + before) / h**2


def trial(arm: str, seed: int, rate: float, torque_noise: float) -> Trial:
    """One run of one arm."""
    rng = np.random.default_rng([seed, list(ARMS).index(arm)])
    _, part, heaviest = ARMS[arm]
    text = urdf_of(arm)
    names = [name for name in RobotModel.from_urdf(text).joint_names if part in name and "finger" not in name]
    model = RobotModel.from_urdf(text, names)
    t = np.arange(0.0, END, 1.0 / rate)
    q, v, a = motion(model, rng, t)
    mass = heaviest * rng.uniform(0.3, 1.0)
    size = 0.02 if heaviest < 1.0 else 0.05
    body = pin.Inertia(mass, size * rng.uniform(-1.6, 1.6, 3), 2.0 * mass * size**2 * np.diag([0.5, 0.7, 0.9]))
    frame = model.model.frames[model.frame_id(model.flange)]
    loaded = model.model.copy()
    loaded.appendBodyToJoint(frame.parentJoint, body, frame.placement)
    empty, full = model.model.createData(), loaded.createData()
    carries = (t >= PICK) & (t < DROP)
    tau = np.array(
        [
            pin.rnea(loaded, full, q[k], v[k], a[k]) if carries[k] else pin.rnea(model.model, empty, q[k], v[k], a[k])
            for k in range(len(t))
        ]
    )
    scale = np.abs(tau).max(axis=0)
    tau += 0.03 * scale * (np.tanh(v / 0.003) + v)
    tau += torque_noise * np.maximum(scale, np.median(scale)) * rng.normal(size=tau.shape)
    q = q + 2e-5 * rng.normal(size=q.shape)
    settings = OnlineSettings(link_mass_error=0.0, link_com_error=0.0, effort_gain_error=0.0)  # they are exact here
    gate, estimation = InputGate(model, settings), OnlineEstimation(model, settings)
    judged = None
    for k in range(len(t)):
        record = JointStateRecord(100.0 + t[k], 100.0 + t[k], model.joint_names, q[k], (), tau[k])
        measurement = gate.accept(record)
        if isinstance(measurement, Rejection):
            continue
        estimate = estimation.step(measurement)
        if estimate is not None and t[k] < JUDGED:
            judged = estimate
    if judged is None:
        raise click.ClickException(f"{arm}, seed {seed}: no estimate. {gate.warnings}")
    truth = body.toDynamicParameters()
    std = np.sqrt(np.diag(judged.covariance)[:10])
    error = judged.theta[:10] - truth
    return Trial(
        arm,
        seed,
        mass,
        float(100.0 * error[0] / mass),
        float(1e3 * np.linalg.norm(judged.theta[1:4] / judged.theta[0] - truth[1:4] / mass)),
        float(error[0] / std[0]),
        float(np.mean(np.abs(error) < 1.96 * std)),
        judged.status,
        tuple(event.kind for event in estimation.events),
    )


@click.command(help=__doc__.split("\n\nExit")[0])
@click.option("--seeds", default=4, show_default=True, help="Runs of each arm.")
@click.option("--first", default=0, show_default=True, help="First seed.")
@click.option("--rate", default=500.0, show_default=True, help="Messages a second.")
@click.option("--torque-noise", default=0.02, show_default=True, help="Part of the joint's largest torque.")
@click.option("--arm", "arms", multiple=True, type=click.Choice(list(ARMS)), help="Only this arm; several may be given.")
@click.option("--jobs", default=os.cpu_count() or 1, show_default=True)
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write the result for machines.")
def main(
    seeds: int, first: int, rate: float, torque_noise: float, arms: tuple[str, ...], jobs: int, json_path: Path | None
) -> None:
    chosen = arms or tuple(ARMS)
    with ProcessPoolExecutor(jobs) as pool:
        wanted = [(arm, seed) for arm in chosen for seed in range(first, first + seeds)]
        trials = list(pool.map(trial, *zip(*wanted, strict=True), [rate] * len(wanted), [torque_noise] * len(wanted)))
    table = Table(title=f"Arms of {len(chosen)} makes, {seeds} runs each, {rate:g} Hz, noise {torque_noise:g} of the torque")
    for column in (
        "",
        "mass %, median (max)",
        "com mm, median (max)",
        "coverage",
        "mass error / std, rms",
        "ok",
        "changes that never were",
    ):
        table.add_column(column, justify="left" if not column else "right")
    for arm in chosen:
        table.add_row(arm, *_summary([x for x in trials if x.arm == arm]))
    Console(width=130).print(table)
    covered = float(np.mean([x.covered for x in trials]))
    targets = [
        Target("mass error, median (%)", float(np.median([abs(x.mass_error) for x in trials])), high=1.0),
        Target("com error, median (mm)", float(np.median([x.com_error for x in trials])), high=3.0),
        Target("coverage of the ten parameters", covered, 0.9, 0.99),
        Target("pick and drop found, part of the runs", float(np.mean([len(x.events) >= 2 for x in trials])), 1.0),
        Target("events that never were", float(sum(max(len(x.events) - 2, 0) for x in trials)), high=0.0),
    ]
    sys.exit(conclude("other_arms", targets, {"trials": [asdict(x) for x in trials]}, json_path))


def _summary(trials: list[Trial]) -> list[str]:
    mass = np.abs([x.mass_error for x in trials])
    com = np.array([x.com_error for x in trials])
    return [
        f"{np.median(mass):.2g} ({mass.max():.2g})",
        f"{np.median(com):.2g} ({com.max():.2g})",
        f"{np.mean([x.covered for x in trials]):.3f}",
        f"{np.sqrt(np.mean([x.normalised**2 for x in trials])):.2f}",
        f"{sum(x.status == 'ok' for x in trials)} of {len(trials)}",
        str(sum(max(len(x.events) - 2, 0) for x in trials)),
    ]


if __name__ == "__main__":
    main()
