"""draw_fleet: the robots, what they do each week, and what happens to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.robot.inertial_parameters import from_com
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.fleet.fleet_scenario import WEAR, Change, FleetScenario
from sysid_ros.simulation.fleet.stated_errors import LINEAR, stated_errors
from sysid_ros.simulation.trajectory import ExcitingTrajectory

USUAL = 35.0
"""Temperature of a joint at which its friction is stated [degrees Celsius]."""
_COULOMB, _VISCOUS, _ROTOR = (0.015, 0.05), (0.01, 0.03), 0.6
"""Friction as parts of the effort limit, between robots; rotor as a part of what the links weigh about the joint."""
_BY_TEMPERATURE = dict(zip(LINEAR[:2], (-0.004, -0.012), strict=True))
"""Change of dry and of viscous friction, the first two [1/K]: grease
(Bittencourt, Gunnarsson 2012, find that of viscous friction some times the Coulomb's)."""
SCATTER = {
    "coulomb_friction": 0.03,
    "viscous_friction": 0.05,
    "torque_offset": 0.0008,
    "torque_gain": 0.003,
    "joint_offset": 0.0,
    "rotor_inertia": 0.005,
    "torque_delay": 0.0001,
    "noise": 0.03,
}
"""From bag to bag: relative for frictions, rotor and noise, else of the effort limit [1], [1], [rad], and [s]."""
_WANDER = 0.35
"""Slow drift over a year as a part of the scatter."""
_NOISE = 0.006
"""Of the efforts as a part of their limit."""
_MASSES, _CENTRE = (0.3, 1.6), 0.06
_ON_JOINT = {
    "wear": ("coulomb_friction", "N m"),
    "torque_offset": ("torque_offset", "N m"),
    "zero_slip": ("joint_offset", "rad"),
    "torque_gain": ("torque_gain", "1"),
}
"""Parameter and unit of the changes of a joint."""
_EARLIEST, _LATEST = 0.2, 0.8
"""Between which parts of the time changes begin: something was seen before and after."""


@dataclass(frozen=True, eq=False, slots=True)
class FleetRobot:
    """One robot: parameters (n,) in SI by the names of the joints' table, loads theta (K, 10) that it may carry, programs."""

    name: str
    kind: str
    model: RobotModel
    nominal: Mapping[str, FloatArray]
    by_temperature: Mapping[str, FloatArray]
    loads: FloatArray
    programs: tuple[ExcitingTrajectory, ...]


@dataclass(frozen=True, eq=False, slots=True)
class FleetBag:
    """One recording before it is recorded: what was true in it.

    Attributes:
        robot: index. day: since the start. program: index. temperature: of the joints, shape (n,) [degrees Celsius].
        parameters: shape (n,) each. load: index of what is carried, -1 for nothing. carried: theta (10,) of all at the tip that
            the robot's model does not know. seed: of its noise.
    """

    name: str
    robot: int
    day: float
    program: int
    temperature: FloatArray
    parameters: Mapping[str, FloatArray]
    load: int
    carried: FloatArray
    seed: int


@dataclass(frozen=True, eq=False, slots=True)
class Fleet:
    """All of it."""

    scenario: FleetScenario
    urdfs: Mapping[str, str]
    robots: tuple[FleetRobot, ...]
    bags: tuple[FleetBag, ...]
    changes: tuple[Change, ...]

    def truth(self) -> dict[str, Any]:
        """What there is to be found, in plain types."""
        return {
            "format": 1,
            "start": self.scenario.start.isoformat(),
            "weeks": self.scenario.weeks,
            "seed": self.scenario.seed,
            "robots": {r.name: {"kind": r.kind, "nominal": {k: v.tolist() for k, v in r.nominal.items()}} for r in self.robots},
            "changes": [c.as_dict(self.scenario) for c in self.changes],
        }


def draw_fleet(scenario: FleetScenario, urdfs: Mapping[str, str]) -> Fleet:
    """Robots of the kinds ``urdfs`` (name: text of the URDF), in turn, and what they go through."""
    rng = np.random.default_rng([scenario.seed, 11])
    models = {kind: RobotModel.from_urdf(text) for kind, text in urdfs.items()}
    usual = {kind: _usual(model, rng) for kind, model in models.items()}
    kinds = list(models)
    robots = tuple(
        _robot(
            f"robot_{i + 1:02d}",
            kinds[i % len(kinds)],
            models[kinds[i % len(kinds)]],
            usual[kinds[i % len(kinds)]],
            scenario,
            rng,
        )
        for i in range(scenario.robots)
    )
    changes = _changes(scenario, robots, rng)
    of = {robot.name: [c for c in changes if c.robot == robot.name] for robot in robots}
    bags = tuple(bag for i, robot in enumerate(robots) for bag in _bags(scenario, i, robot, of[robot.name], rng))
    return Fleet(scenario, urdfs, robots, bags, changes)


def _usual(model: RobotModel, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Parameters that robots of a kind have on average, shape (n,) each."""
    limit, n = model.effort_limit, model.n
    inertia = np.array([np.mean([_mass_about(model, q, j) for q in rng.uniform(-1.0, 1.0, (5, n))]) for j in range(n)])
    return {
        "coulomb_friction": limit * rng.uniform(*_COULOMB, n),
        "viscous_friction": limit * rng.uniform(*_VISCOUS, n),
        "torque_offset": np.zeros(n),
        "torque_gain": np.ones(n),
        "joint_offset": np.zeros(n),
        "rotor_inertia": _ROTOR * inertia,
        "torque_delay": np.full(n, 0.002),
        "noise": _NOISE * limit,
    }


def _mass_about(model: RobotModel, q: FloatArray, j: int) -> float:
    unit, still = np.eye(model.n)[j], np.zeros(model.n)
    return float(model.rnea(q, still, unit)[j] - model.rnea(q, still, still)[j])


def _robot(
    name: str, kind: str, model: RobotModel, usual: Mapping[str, FloatArray], scenario: FleetScenario, rng: np.random.Generator
) -> FleetRobot:
    n, limit = model.n, model.effort_limit
    spread = {"coulomb_friction": 0.2, "viscous_friction": 0.2, "rotor_inertia": 0.02, "noise": 0.1}
    nominal = {p: value * np.exp(spread.get(p, 0.0) * rng.standard_normal(n)) for p, value in usual.items()}
    nominal["torque_offset"] = 0.004 * limit * rng.standard_normal(n)
    nominal["torque_gain"] = 1.0 + 0.01 * rng.standard_normal(n)
    nominal["joint_offset"] = 0.0005 * rng.standard_normal(n)
    heat = {p: k * np.exp(0.15 * rng.standard_normal(n)) for p, k in _BY_TEMPERATURE.items()}
    loads = np.array([_body(m, rng) for m in rng.uniform(*_MASSES, 2) * _strength(model)])
    programs = tuple(_program(model, scenario.duration, rng) for _ in range(3))
    return FleetRobot(name, kind, model, nominal, heat, loads, programs)


def _strength(model: RobotModel) -> float:
    """Loads of an arm in proportion to what moves it: 1 for one of 15 kg."""
    return float(model.pi.reshape(-1, 10)[:, 0].sum() / 15.0)


def _body(mass: float, rng: np.random.Generator, size: float = 0.1) -> FloatArray:
    com = np.array([_CENTRE, 0.0, 0.0]) + rng.uniform(-0.02, 0.02, 3)
    return from_com(mass, com, np.eye(3) * mass * size**2 / 6.0)


def _program(model: RobotModel, duration: float, rng: np.random.Generator) -> ExcitingTrajectory:
    lower, upper = np.maximum(model.position_lower, -2.4), np.minimum(model.position_upper, 2.4)
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    for _ in range(50):
        centre = middle + 0.3 * half * rng.uniform(-1.0, 1.0, model.n)
        if np.all(np.abs(model.gravity_torque(centre)) < 0.5 * model.effort_limit):
            break
    motion = ExcitingTrajectory(centre, lower, upper, rng, 1.6, 6.0, 0.15, 5, 1.2, duration, 1.2)
    motion.limit_effort(model.rnea, model.effort_limit)
    return motion


def _changes(scenario: FleetScenario, robots: tuple[FleetRobot, ...], rng: np.random.Generator) -> tuple[Change, ...]:
    wanted = [cause for cause, count in scenario.changes.items() for _ in range(count)]
    chosen = rng.permutation(len(robots))[: len(wanted)]
    return tuple(_change(scenario, robots[i], cause, rng) for cause, i in zip(wanted, chosen, strict=True))


def _change(scenario: FleetScenario, robot: FleetRobot, cause: str, rng: np.random.Generator) -> Change:
    """A change at a drawn time, on a joint where one bag tells it to better than its size."""
    size = scenario.sizes[cause]
    day, sign = scenario.days * rng.uniform(_EARLIEST, _LATEST), float(rng.choice([-1.0, 1.0]))
    if cause not in _ON_JOINT:
        return Change(robot.name, cause, "", "mass", day, day, size, "kg")
    parameter, unit = _ON_JOINT[cause]
    model = robot.model
    of = {"wear": robot.nominal["coulomb_friction"], "torque_offset": model.effort_limit}.get(cause, np.ones(model.n))
    known = np.max([_stds(robot, p, scenario.rate)[parameter] for p in robot.programs], axis=0)
    shows = np.flatnonzero(known <= size * of)
    if not shows.size:
        raise SettingsError(
            f"a change {cause} of {size:g} shows on no joint of {robot.kind} in a bag of this length; make it larger."
        )
    j = int(rng.choice(shows))
    until = day + WEAR if cause == "wear" else day
    size *= float(of[j]) * (1.0 if cause == "wear" else sign)
    return Change(robot.name, cause, model.joint_names[j], parameter, day, until, size, unit)


def _stds(robot: FleetRobot, program: ExcitingTrajectory, rate: float) -> dict[str, FloatArray]:
    """Standard deviations of one bag by parameter, shape (n,) each."""
    errors = stated_errors(robot.model, program, rate, robot.nominal["noise"], np.zeros(10))
    return {p: np.array([np.sqrt(errors.joint(j)[i, i]) for j in range(robot.model.n)]) for i, p in enumerate(LINEAR)}


def _bags(
    scenario: FleetScenario, index: int, robot: FleetRobot, changes: list[Change], rng: np.random.Generator
) -> list[FleetBag]:
    n, per_week = robot.model.n, scenario.bags_per_week
    count = scenario.weeks * per_week
    days = 7.0 * (np.arange(count) + rng.uniform(0.1, 0.7, count)) / per_week
    wander = {p: np.cumsum(rng.standard_normal((count, n)), axis=0) * _WANDER * s / np.sqrt(count) for p, s in SCATTER.items()}
    tool = _body(scenario.sizes.get("tool", 0.3), rng, 0.06)
    phase = 2.0 * np.pi * (days / 365.25 - 0.55)
    air = scenario.seasons * np.cos(phase) + 1.5 * rng.standard_normal(count)
    unit = {p: np.ones(n) for p in ("torque_gain", "joint_offset", "torque_delay")}
    unit["torque_offset"] = robot.model.effort_limit
    bags = []
    for k, day in enumerate(days.tolist()):
        temperature = USUAL + air[k] + 2.0 * rng.standard_normal(n)
        values = {p: np.array(v) for p, v in robot.nominal.items()}
        for p, by in robot.by_temperature.items():
            values[p] *= np.exp(by * (temperature - USUAL))
        for p, scatter in SCATTER.items():
            values[p] += unit.get(p, robot.nominal[p]) * (scatter * rng.standard_normal(n) + wander[p][k])
        load = int(rng.integers(-1, len(robot.loads)))
        carried = robot.loads[load].copy() if load >= 0 else np.zeros(10)
        for change in changes:
            if change.joint:
                values[change.parameter][robot.model.joint_names.index(change.joint)] += change.size * change.share(day)
            else:
                carried += tool * change.share(day)
        seed = int(rng.integers(2**31))
        bags.append(
            FleetBag(
                f"{robot.name}_{k:04d}",
                index,
                day,
                int(rng.integers(len(robot.programs))),
                temperature,
                values,
                load,
                carried,
                seed,
            )
        )
    return bags
