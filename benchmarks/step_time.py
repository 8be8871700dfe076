"""Time of one ``step()`` of the online estimation, and of one update of an estimator against other libraries.

Measured, all in one process on one core, everything compiled and warm:

- ``OnlineEstimation.step``: filter, RNEA, payload columns, low-pass, update; a 7-joint arm at 1 kHz that picks up and drops a
  payload, with the ten payload parameters alone and with the default 31 (offset, Coulomb and viscous friction of each joint
  beside them), these with a model.yaml too; and an arm of 30 joints. Each call is timed by itself; ticks with an update and
  ticks that also give an estimate out are told apart.
- One update with 10 parameters and 7 rows: the compiled kernel, the package's two estimators in full, ``filterpy``'s
  KalmanFilter, ``padasip``'s FilterRLS (one call a row, as it has one output) and plain numpy, all fed the same rows of the
  same arm. They take turns in blocks of 50 updates, in an order that is drawn anew each round, so that all of them see the
  same load of the machine.

What computes the same thing must give the same parameters: the largest difference is in units of the standard deviation.

Exit codes: 0 every target held; 1 one was missed; 2 bad usage.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter_ns
from typing import Any, NamedTuple

import click
import numpy as np
from filterpy.kalman import KalmanFilter
from padasip.filters import FilterRLS
from rich.console import Console
from rich.table import Table
from verdict import Target, conclude

from sysid_ros.effects import CoulombFriction, LinkInertia, Payload, RotorInertia, TorqueOffset, ViscousFriction
from sysid_ros.estimators import ConstantForgetting, JumpRule, Problem, VariableForgetting, kernels
from sysid_ros.online.front_end import FrontEnd
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.rows import Rows
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.body_torque import BodyTorque
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.simulation import ArmScenario, simulate_arm
from sysid_ros.torque.model_file import EffectBlock, ModelFile
from sysid_ros.torque.torque_model import TorqueModel

PRIOR_STD = np.array([2.0, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
ROW_STD = 0.03
PERIOD = 0.01
EVERY = 10
BLOCK = 50

Update = Callable[[FloatArray, FloatArray], object]


class NumpyJoseph:
    """Block Joseph form in plain numpy: ``P <- (1 - K Y) P (1 - K Y)' + K R K'``."""

    def __init__(self) -> None:
        self.theta, self.P, self.R, self._one = np.zeros(10), np.diag(PRIOR_STD**2), ROW_STD**2 * np.eye(7), np.eye(10)

    def update(self, Y: FloatArray, tau: FloatArray) -> None:
        PY = self.P @ Y.T
        K = np.linalg.solve(Y @ PY + self.R, PY.T).T
        self.theta = self.theta + K @ (tau - Y @ self.theta)
        rest = self._one - K @ Y
        self.P = rest @ self.P @ rest.T + K @ self.R @ K.T


def contestants() -> dict[str, tuple[Update, Callable[[], FloatArray]]]:
    """For each: what updates it, and what its parameters are now."""
    variance = np.full(7, ROW_STD**2)
    theta, P = np.zeros(10), np.diag(PRIOR_STD**2)
    constant = ConstantForgetting(PRIOR_STD, variance)
    least = np.full(10, np.inf)
    least[0], least[1:4] = 0.03, 5e-3
    variable = VariableForgetting(Problem(PRIOR_STD, variance, PERIOD, 60.0, JumpRule(slice(0, 10), least, 0.125)))
    plain = NumpyJoseph()
    filters = []
    for _ in range(2):
        kalman = KalmanFilter(dim_x=10, dim_z=7)
        # Its default Q is the identity, which would be a random walk of the parameters.
        kalman.x, kalman.P, kalman.R, kalman.Q = np.zeros(10), np.diag(PRIOR_STD**2), ROW_STD**2 * np.eye(7), np.zeros((10, 10))
        filters.append(kalman)
    only, both = filters

    def predict_and_update(Y: FloatArray, tau: FloatArray) -> None:
        both.predict()
        both.update(tau, H=Y)

    # Its prior is one number for all parameters and its noise is 1: scaled rows make both what the others have.
    rls = FilterRLS(10, mu=1.0, eps=1.0, w="zeros")

    def row_by_row(Y: FloatArray, tau: FloatArray) -> None:
        for i in range(7):
            rls.adapt(tau[i], Y[i])

    return {
        "sysid_ros kernel (joseph_update)": (lambda Y, tau: kernels.joseph_update(theta, P, Y, tau, variance), lambda: theta),
        "sysid_ros ConstantForgetting.update": (constant.update, lambda: constant.theta),
        "sysid_ros VariableForgetting.update": (variable.update, lambda: variable.theta),
        "filterpy KalmanFilter update": (lambda Y, tau: only.update(tau, H=Y), lambda: only.x),
        "filterpy KalmanFilter predict + update": (predict_and_update, lambda: both.x),
        "padasip FilterRLS, 7 rows": (row_by_row, lambda: PRIOR_STD * rls.w),
        "numpy Joseph": (plain.update, lambda: plain.theta),
    }


def time_updates(rows: list[Rows], rounds: int) -> dict[str, dict[str, Any]]:
    """Times of one update [us] of each contestant over all rounds, and its parameters after the last row."""
    plain = [(r.Y, r.y) for r in rows]
    scaled = [(r.Y * PRIOR_STD / ROW_STD, r.y / ROW_STD) for r in rows]
    rng = np.random.default_rng(0)
    times: dict[str, list[int]] = {}
    theta: dict[str, FloatArray] = {}
    for turn in range(rounds + 1):
        entered = contestants()
        for start in range(0, len(rows), BLOCK):
            for name in rng.permutation(list(entered)).tolist():
                update, _ = entered[name]
                for Y, tau in (scaled if "padasip" in name else plain)[start : start + BLOCK]:
                    t = perf_counter_ns()
                    update(Y, tau)
                    if turn > 0:  # the first round warms up
                        times.setdefault(name, []).append(perf_counter_ns() - t)
        theta = {name: read() for name, (_, read) in entered.items()}
    return {name: {**_summary(np.array(times[name])), "theta": theta[name]} for name in theta}


class Case(NamedTuple):
    """Something of which steps are timed."""

    robot: RobotModel
    settings: OnlineSettings
    known: ModelFile | None
    measurements: list[Measurement]


def cases_of(robot: RobotModel, measurements: list[Measurement]) -> dict[str, Case]:
    """By name: the arm at hand with fewer or all parameters and with a model, and a long one."""
    long, motion = long_arm(30, 0.5 * measurements[-1].t)
    return {
        "10 parameters": Case(robot, OnlineSettings(estimate_friction=False), None, measurements),
        "31 parameters": Case(robot, OnlineSettings(), None, measurements),
        "31 parameters, model.yaml": Case(robot, OnlineSettings(), known_model(robot), measurements),
        "30 joints, 100 parameters": Case(long, OnlineSettings(), None, motion),
    }


def known_model(robot: RobotModel) -> ModelFile:
    """A model of the effects that 'sysid identify' finds on a usual arm, with 25 directions of their error."""
    kinds = (LinkInertia, ViscousFriction, CoulombFriction, RotorInertia, TorqueOffset)
    effects = [kind(robot) for kind in kinds]
    theta = [robot.pi if e.id == LinkInertia.id else np.full(e.p, 1e-3) for e in effects]
    blocks = [
        EffectBlock(e.id, e.joint_names, e.settings, x, e.parameter_names, e.units, None)
        for e, x in zip(effects, theta, strict=True)
    ]
    uncertainty = 1e-4 * np.random.default_rng(0).normal(size=(sum(e.p for e in effects), 25))
    std = np.full(robot.n, 0.05)
    return ModelFile(robot.name, robot.joint_names, "", tuple(blocks), std, std, uncertainty)


def long_arm(joints: int, duration: float) -> tuple[RobotModel, list[Measurement]]:
    """A chain of so many hinges that carries 1.5 kg, swinging on each, at 1 kHz with noise."""
    rng, parts = np.random.default_rng(0), ['<robot name="long"><link name="link0"/>']
    for i in range(1, joints + 1):
        axis = " ".join("1" if k == i % 3 else "0" for k in range(3))
        parts.append(
            f'<joint name="joint{i}" type="revolute"><parent link="link{i - 1}"/><child link="link{i}"/>'
            f'<origin xyz="0.02 0.01 0.1" rpy="0.1 0.2 0"/><axis xyz="{axis}"/>'
            f'<limit lower="-3" upper="3" effort="100" velocity="3"/></joint><link name="link{i}"><inertial>'
            f'<origin xyz="0.01 0.02 0.05"/><mass value="{rng.uniform(0.5, 1.5):.3f}"/>'
            '<inertia ixx="0.003" iyy="0.003" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
    robot = RobotModel.from_urdf("".join([*parts, "</robot>"]))
    t, w, phase = 1e-3 * np.arange(round(1e3 * duration)), rng.uniform(1.0, 4.0, joints), rng.uniform(0.0, 6.0, joints)
    angle = np.multiply.outer(t, w) + phase
    q, v, a = 0.5 * np.sin(angle), 0.5 * w * np.cos(angle), -0.5 * w**2 * np.sin(angle)
    payload = BodyTorque(robot, robot.frame_id(robot.flange))
    theta = np.array([1.5, 0.0, 0.0, 0.1, 0.02, 0.0, 0.02, 0.0, 0.0, 0.02])
    tau = robot.rnea_along(q, v, a) + np.array([payload(*state, theta) for state in zip(q, v, a, strict=True)])
    tau += 0.05 * rng.normal(size=tau.shape)
    q += 1e-5 * rng.normal(size=q.shape)
    return robot, [Measurement(1.0 + t[k], q[k].copy(), None, tau[k].copy()) for k in range(len(t))]


def time_steps(cases: dict[str, Case], rounds: int) -> dict[str, dict[str, dict[str, float]]]:
    """Times of one ``step()`` [us] of each case, by kind of tick."""
    times: dict[str, list[FloatArray]] = {name: [] for name in cases}
    published: dict[str, FloatArray] = {}
    for turn in range(rounds + 1):
        runs = {name: OnlineEstimation(case.robot, case.settings, case.known) for name, case in cases.items()}
        taken = {name: np.zeros(len(case.measurements)) for name, case in cases.items()}
        given = {name: np.zeros(len(case.measurements), dtype=bool) for name, case in cases.items()}
        for start in range(0, max(len(case.measurements) for case in cases.values()), 500):
            for name, estimation in runs.items():
                measurements = cases[name].measurements
                for k in range(start, min(start + 500, len(measurements))):
                    t = perf_counter_ns()
                    estimate = estimation.step(measurements[k])
                    taken[name][k] = perf_counter_ns() - t
                    given[name][k] = estimate is not None
        for name in cases:
            published[name] = given[name]
            if turn > 0:
                times[name].append(taken[name])
    summary: dict[str, dict[str, dict[str, float]]] = {}
    for name in cases:
        ticks = np.concatenate(times[name])
        gives = np.tile(published[name], rounds)
        # Every second update gives an estimate out, at 50 of 100 Hz.
        updates = np.logical_or(gives, np.roll(gives, -EVERY))
        summary[name] = {
            "all ticks": _summary(ticks),
            "with an update": _summary(ticks[updates]),
            "with an estimate given out": _summary(ticks[gives]),
            "without an update": _summary(ticks[~updates]),
        }
    return summary


def rows_of(robot: RobotModel, measurements: list[Measurement]) -> list[Rows]:
    front_end = FrontEnd(TorqueModel(robot, [Payload(robot)]), 1e-3, 100.0)
    return [rows for m in measurements for rows in front_end.push(m)]


def _summary(nanoseconds: FloatArray) -> dict[str, float]:
    us = nanoseconds / 1e3
    return {
        "median": float(np.median(us)),
        "p95": float(np.percentile(us, 95)),
        "mean": float(us.mean()),
        "count": int(us.size),
    }


def _table(title: str, rows: dict[str, dict[str, Any]], extra: dict[str, str]) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column("")
    for column in ("median", "p95", "mean", *extra):
        table.add_column(column, justify="right")
    for name, row in rows.items():
        table.add_row(name, *(f"{row[k]:.1f}" for k in ("median", "p95", "mean")), *(str(row.get(k, "")) for k in extra.values()))
    return table


@click.command(help=__doc__.split("\n")[0])
@click.option("--rounds", default=5, show_default=True, help="Repetitions of everything; one more warms up.")
@click.option("--duration", default=12.0, show_default=True, help="Of the motion [s].")
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Write the result for machines.")
def main(rounds: int, duration: float, json_path: Path | None) -> None:
    record = simulate_arm(
        ArmScenario(
            seed=1, duration=duration, payload_mass=1.5, pick_time=0.4 * duration, drop_time=0.8 * duration, velocity=False
        )
    )
    robot = RobotModel.from_urdf(record.urdf)
    measurements = record.measurements()
    steps = time_steps(cases_of(robot, measurements), rounds)
    # Only what comes before the pick: the parameters are constant there, so all must agree.
    rows = rows_of(robot, [m for m in measurements if m.t < 0.4 * duration])
    updates = time_updates(rows, rounds)

    Y = np.concatenate([r.Y for r in rows])
    std = np.sqrt(np.diag(np.linalg.inv(Y.T @ Y / ROW_STD**2 + np.diag(PRIOR_STD**-2))))
    reference = updates["numpy Joseph"]["theta"]
    own = updates["sysid_ros VariableForgetting.update"]["median"]
    for row in updates.values():
        row["difference"] = float(np.max(np.abs(row["theta"] - reference) / std))
        row["times"], row["apart"] = f"{row['median'] / own:.1f}", f"{row['difference']:.1e}"
    console = Console(width=130)
    for name, ticks in steps.items():
        console.print(_table(f"step(), 1 kHz, {name}: us", ticks, {}))
    title = "One update, 10 parameters, 7 rows: us; difference of the result from numpy's in std"
    console.print(_table(title, updates, {"times own": "times", "difference": "apart"}))

    peers = {k: v["median"] for k, v in updates.items() if "filterpy" in k or "padasip" in k}
    same = max(v["difference"] for k, v in updates.items() if "Variable" not in k)
    kernel = updates["sysid_ros kernel (joseph_update)"]["median"]
    targets = [
        Target("update: kernel, median (us)", kernel, high=10.0),
        Target("update: VariableForgetting in full, median (us)", own, high=10.0),
    ]
    for name, median in peers.items():
        targets.append(Target(f"{name}: times the kernel, which computes the same", median / kernel, low=5.0))
        targets.append(Target(f"{name}: times VariableForgetting in full", median / own, low=5.0))
    for name, ticks in steps.items():
        most = 120.0 if "joints" in name else 60.0
        targets.append(Target(f"step(), {name}: all ticks, mean (us)", ticks["all ticks"]["mean"], high=most))
        targets.append(Target(f"step(), {name}: ticks with an update, median (us)", ticks["with an update"]["median"], high=most))
    more = [steps[f"31 parameters{what}"]["with an update"]["median"] for what in (", model.yaml", "")]
    targets.append(
        Target("step() with a model.yaml: ticks with an update, median, more than without (us)", more[0] - more[1], high=5.0)
    )
    targets.append(Target("largest difference between those that compute the same (std)", same, high=1e-3))
    sys.exit(conclude("step_time", targets, {"step_us": steps, "update_us": updates}, json_path))


if __name__ == "__main__":
    main()
