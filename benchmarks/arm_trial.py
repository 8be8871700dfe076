"""One simulated arm that picks up and drops a payload: the estimate against the truth, the events against the changes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from sysid_ros.identification import collect_rows, free_model, identify
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.simulation import ArmRecord, ArmScenario, simulate_arm
from sysid_ros.torque.model_file import ModelFile

VISCOUS = (2.0, 2.0, 1.5, 1.5, 0.8, 0.5, 0.3)
COULOMB = (1.5, 1.5, 1.0, 1.0, 0.6, 0.4, 0.3)
OFFSET = (0.4, -0.3, 0.2, -0.2, 0.1, 0.0, 0.05)
AFTER_PICK = 2.0
FRICTION: dict[str, Any] = {"viscous_friction": VISCOUS, "coulomb_friction": COULOMB, "torque_offset": OFFSET}


@dataclass(frozen=True, slots=True)
class Variant:
    """What differs from the plain trial.

    Attributes:
        changes: fields of the scenario.
        colour: factor a sample of first-order autoregressive torque noise of the same standard deviation; 0: white.
        random_pick: the pick is at a random time.
        friction: drives with friction and offset, the model of which was identified on an empty run.
    """

    changes: tuple[tuple[str, float], ...] = ()
    colour: float = 0.0
    random_pick: bool = False
    friction: bool = False


VARIANTS = {
    "plain": Variant(),
    "random pick": Variant(random_pick=True),
    "coloured torque noise": Variant(colour=0.98),
    "encoder noise 1e-4": Variant(changes=(("encoder_noise", 1e-4),)),
    "250 Hz": Variant(changes=(("rate", 250),)),
    "friction, identified": Variant(friction=True),
}


@dataclass(frozen=True, slots=True)
class Score:
    """One estimate against the truth.

    Attributes:
        mass_error: relative. com_error: [m].
        covered: the ten parameters and com x, y, z: truth inside the 95 % interval, 13 of 0 or 1; empty without a covariance.
        nees: (theta - truth)' covariance^-1 (theta - truth) / 10, NaN without a covariance.
        errors: of the ten parameters in their own standard deviations.
        status: the estimate's own word.
    """

    mass_error: float
    com_error: float
    covered: tuple[int, ...] = ()
    nees: float = float("nan")
    errors: tuple[float, ...] = ()
    status: str = ""


@dataclass(frozen=True, slots=True)
class Change:
    """A pick or a drop.

    Attributes:
        kind: "pick" or "drop".
        delay: from the change to the sample with which it was found [s], NaN where it was missed.
        stamp_error: stamp that the event bears minus the truth [s].
        called: what it was called.
    """

    kind: str
    delay: float
    stamp_error: float
    called: str


def scenario(seed: int, variant: Variant, duration: float = 12.0) -> ArmScenario:
    """Payload 0.5 to 3 kg with an offset com, picked up at 5 s (or 3.5 to 6 s) and dropped at 9 s."""
    rng = np.random.default_rng([seed, 2024])
    mass = rng.uniform(0.5, 3.0)
    com = (*rng.uniform(-0.06, 0.06, 2), rng.uniform(0.02, 0.12))
    pick = round(float(rng.uniform(3.5, 6.0)), 3) if variant.random_pick else 5.0
    plain = ArmScenario(
        seed=seed, duration=duration, payload_mass=mass, payload_com=com, pick_time=pick, drop_time=9.0, velocity=False,
        torque_noise=0.0 if variant.colour else 0.1,
    )  # fmt: skip
    changes: dict[str, Any] = dict(variant.changes)
    if variant.friction:
        changes.update(FRICTION)
    return replace(plain, **changes)


def record_of(seed: int, variant: Variant) -> ArmRecord:
    """The recording of a trial."""
    record = simulate_arm(scenario(seed, variant))
    if not variant.colour:
        return record
    rng = np.random.default_rng([seed, 98])
    noise = np.empty_like(record.tau)
    state = rng.standard_normal(record.tau.shape[1])
    for k, white in enumerate(rng.standard_normal(record.tau.shape)):
        state = variant.colour * state + np.sqrt(1.0 - variant.colour**2) * white
        noise[k] = 0.1 * state
    return replace(record, tau=record.tau + noise)


def known_model(variant: Variant, seed: int) -> ModelFile | None:
    """The model identified on two other, empty runs of 30 s with friction, or None where the arm is ideal."""
    return _identified(1000 + seed % 4) if variant.friction else None


@lru_cache(maxsize=8)
def _identified(seed: int) -> ModelFile:
    rows = []
    for k in range(2):
        run = simulate_arm(ArmScenario(seed=seed + 10 * k, duration=30.0, velocity=False, **FRICTION))
        robot = RobotModel.from_urdf(run.urdf)
        rows.append(collect_rows(free_model(robot), run.measurements(), f"run {k}"))
    return identify(free_model(robot), rows, [], {}).model


def run(
    robot: RobotModel, measurements: Iterable[Measurement], settings: OnlineSettings, known: ModelFile | None
) -> tuple[list[PayloadEstimate], list[float], OnlineEstimation]:
    """All estimates, the stamps at which events were found, and the estimation itself."""
    estimation = OnlineEstimation(robot, settings, known)
    estimates: list[PayloadEstimate] = []
    found: list[float] = []
    for m in measurements:
        estimate = estimation.step(m)
        if len(estimation.events) > len(found):
            found.append(m.t)
        elif len(estimation.events) < len(found):
            found.clear()
        if estimate is not None:
            estimates.append(estimate)
    return estimates, found, estimation


def at(estimates: list[PayloadEstimate], t: float) -> PayloadEstimate:
    """The newest estimate at ``t``."""
    return next(e for e in reversed(estimates) if e.t <= t)


def score(theta: FloatArray, covariance: FloatArray | None, truth: FloatArray, status: str = "") -> Score:
    """Compare ten parameters with the true ones."""
    com, true_com = theta[1:4] / theta[0], truth[1:4] / truth[0] if truth[0] else np.full(3, np.nan)
    mass_error, com_error = float(abs(theta[0] / truth[0] - 1.0)) if truth[0] else np.nan, float(np.linalg.norm(com - true_com))
    if covariance is None:
        return Score(mass_error, com_error, status=status)
    error, std = theta - truth, np.sqrt(np.diag(covariance))
    jacobian = np.column_stack([-com / theta[0], np.eye(3) / theta[0]])
    com_std = np.sqrt(np.diag(jacobian @ covariance[:4, :4] @ jacobian.T))
    inside = [*(np.abs(error) < 1.96 * std), *(np.abs(com - true_com) < 1.96 * com_std)]
    nees = float(error @ np.linalg.solve(covariance, error)) / 10.0
    return Score(mass_error, com_error, tuple(int(x) for x in inside), nees, tuple((error / std).tolist()), status)


def match(estimation: OnlineEstimation, found: list[float], truth: list[dict[str, object]]) -> tuple[list[Change], int]:
    """The true changes with the events that tell of them, and the number of events that tell of nothing."""
    left = list(zip(estimation.events, found, strict=True))
    changes = []
    for true in truth:
        t, kind = float(str(true["t"])), str(true["kind"])
        near = [pair for pair in left if -0.1 <= pair[0].t - t <= 1.0]
        if near:
            event, seen = near[0]
            left.remove(near[0])
            changes.append(Change(kind, seen - t, event.t - t, event.kind))
        else:
            changes.append(Change(kind, float("nan"), float("nan"), ""))
    return changes, len(left)
