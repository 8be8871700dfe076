"""Rows of a fleet's store, drawn from the errors that one bag's least squares states: a year in seconds, without a bag."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid_ros.sample import FloatArray
from sysid_ros.simulation.fleet.drawn_fleet import Fleet, FleetBag, FleetRobot
from sysid_ros.simulation.fleet.stated_errors import LINEAR, StatedErrors, stated_errors

_LIGHTEST = 3.0
"""A centre of mass is told of a mass that is so many of its standard deviations [1]."""


@dataclass(frozen=True, slots=True)
class DrawnRows:
    """What a job on one bag would have written: a row of ``bags``, and rows of ``joints`` and ``payloads``."""

    bag: dict[str, Any]
    joints: list[dict[str, Any]]
    payloads: list[dict[str, Any]]


def drawn_rows(fleet: Fleet) -> Iterator[DrawnRows]:
    """The rows of each bag, in the order of the bags."""
    rate = fleet.scenario.rate
    known: dict[tuple[int, int, int], StatedErrors] = {}
    for bag in fleet.bags:
        robot = fleet.robots[bag.robot]
        key = (bag.robot, bag.program, bag.load)
        if key not in known:
            load = robot.loads[bag.load] if bag.load >= 0 else np.zeros(10)
            known[key] = stated_errors(robot.model, robot.programs[bag.program], rate, robot.nominal["noise"], load)
        yield _rows(fleet, bag, robot, known[key])


def _rows(fleet: Fleet, bag: FleetBag, robot: FleetRobot, errors: StatedErrors) -> DrawnRows:
    n, k = robot.model.n, len(LINEAR)
    rng = np.random.default_rng([fleet.scenario.seed, bag.seed])
    true = bag.parameters
    deviation = np.concatenate((np.column_stack([true[p] - robot.nominal[p] for p in LINEAR]).reshape(-1), bag.carried))
    estimate = errors.drawn(deviation, rng)
    key = {
        "hash": hashlib.sha256(f"{fleet.scenario.seed} {bag.name}".encode()).hexdigest(),
        "model": hashlib.sha256(robot.name.encode()).hexdigest(),
        "version": "drawn",
        "job": "track",
        "robot": robot.name,
        "kind": robot.kind,
        "date": fleet.scenario.date(bag.day),
        "bag": f"{robot.name}/{bag.name}",
    }
    row = {
        **key,
        "duration": fleet.scenario.duration,
        "rate": float(fleet.scenario.rate),
        "samples": round(fleet.scenario.duration * fleet.scenario.rate),
        "status": "ok",
        "reason": "",
        "temperature": float(bag.temperature.mean()) if fleet.scenario.temperature_known else None,
        "seconds": 0.0,
    }
    noise = true["noise"] * (1.0 + errors.noise * rng.standard_normal(n))
    joints = []
    for j, name in enumerate(robot.model.joint_names):
        block = np.zeros((k + 1, k + 1))
        block[:k, :k] = errors.joint(j)
        block[k, k] = (errors.noise * noise[j]) ** 2
        told = {p: float(robot.nominal[p][j] + estimate[j * k + i]) for i, p in enumerate(LINEAR)} | {"noise": float(noise[j])}
        stds = {f"{p}_std": float(np.sqrt(block[i, i])) for i, p in enumerate((*LINEAR, "noise"))}
        heat = float(bag.temperature[j]) if fleet.scenario.temperature_known else None
        costs = {
            "torque": errors.torque,
            "lever": errors.reach,
            "torque_per_zero": errors.by_zero,
            "torque_per_mass": errors.by_mass,
        }
        told |= stds | {column: float(values[j]) for column, values in costs.items()}
        joints.append({**key, "joint": name, "temperature": heat, **told, "covariance": block.reshape(-1).tolist()})
    return DrawnRows(row, joints, [{**key, **_payload(fleet, robot, estimate[-10:-6], errors.load)}])


def _payload(fleet: Fleet, robot: FleetRobot, theta: FloatArray, covariance: FloatArray) -> dict[str, Any]:
    mass, std = float(theta[0]), float(np.sqrt(covariance[0, 0]))
    row: dict[str, Any] = {"t_from": 0.0, "t_to": fleet.scenario.duration, "frame": robot.model.default_frame}
    row |= {"mass": mass, "mass_std": std, "status": "ok"}
    if mass > _LIGHTEST * std:
        for i, axis in enumerate("xyz", start=1):
            by = np.zeros(4)
            by[0], by[i] = -theta[i] / mass**2, 1.0 / mass
            row |= {f"com_{axis}": float(theta[i] / mass), f"com_{axis}_std": float(np.sqrt(by @ covariance @ by))}
    return row
