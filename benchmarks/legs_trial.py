"""One recording of a robot on legs that is not as its description says, and what the live estimator made of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.input_gate import gate_for
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import ContactRecord, FloatArray, ImuRecord, JointStateRecord
from sysid_ros.simulation.legged_record import LeggedRecord, simulate_legged
from sysid_ros.simulation.legged_scenario import LeggedScenario
from sysid_ros.simulation.quadruped_record import QuadrupedRecord, simulate_quadruped
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario

START = 1000.0
WARM, SETTLED, SEEN = 3.0, 1.0, 0.75
"""Time from the begin and from a change after which estimates count, and within which an event belongs to a change [s]."""
LOADS = {"solo12": (0.1, 0.6, 0.06), "anymal": (3.0, 15.0, 0.2)}
"""Load from, to [kg] and how far from the middle of the back it is put [m]; others carry 0.5 to 5 kg at up to 0.12 m."""
ROTORS = {"solo12": 5e-4, "anymal": 0.04}
BOUNDS = {"stand": 0.02, "sway": 0.02, "step": 0.02, "flying_trot": 0.04}
"""What the mass may be wrong by, as a part; 0.025 in a trot and all gaits that have none. At least LEAST [kg]."""
LEAST, LEAST_TARED, EMPTY_PART, COM = 0.08, 0.03, 0.007, 8e-3
"""The same in kg, after a tare without a load [kg], of an empty robot as a part of it, and of a load's place [m]."""
NAMED = ("IMU shows", "IMU is turned", "IMU sits", "ms late against", "ms early against")
"""What a status says of the IMU where that is what is wrong, beside advice to check it."""
PICKED = {"pick_time": 6.0, "drop_time": 10.0, "duration": 13.0}
TARE_TIME = 5.5


@dataclass(frozen=True, slots=True)
class Condition:
    """What is otherwise: settings of the simulation, contacts that are told ('', 'none', 'inverted'), whether there is a load,
    whether the empty robot is tared, and a factor on what the mass may be wrong by."""

    settings: dict[str, Any] = field(default_factory=dict)
    contacts: str = ""
    loaded: bool = True
    tared: bool = False
    wider: float = 1.0


_OFF = {"mass_error": 0.02}
CONDITIONS: dict[str, Condition] = {
    "plain": Condition(),
    "links 2 %": Condition(_OFF),
    "links 2 % no sphere": Condition(_OFF | {"foot_spheres": False}, wider=1.5),
    "links 2 % tared": Condition(_OFF | {"pick_time": 6.0, "duration": 18.0}, tared=True),
    "empty": Condition(_OFF, loaded=False),
    "empty tared": Condition(_OFF, loaded=False, tared=True),
    "picked": Condition(PICKED),
    "no sphere": Condition({"foot_spheres": False}, wider=1.5),
    "IMU tilted 3 deg": Condition({"imu_tilt": (0.04, -0.035, 0.0)}),
    "IMU 3 cm away": Condition({"imu_lever": (0.03, 0.0, 0.02)}),
    "IMU 10 ms late": Condition({"imu_delay": 0.01}),
    "IMU bias": Condition({"accelerometer_bias": (0.1, -0.1, 0.2), "gyro_bias": (0.01, 0.01, -0.01)}),
    "IMU aliased": Condition({"imu_low_pass": False}),
    "no contacts": Condition(contacts="none"),
    "contacts inverted": Condition(contacts="inverted"),
    "contacts late": Condition({"contact_delay": 0.03}),
    "contacts wrong": Condition({"contact_error": 0.3}),
    "push": Condition({"push_time": 7.0}),
    "slip": Condition({"grip": 0.25}),
    "soft ground": Condition({"sink": 0.01}),
    "stairs": Condition({"stairs": 0.04, "speed": 0.4}),
    "shifted": Condition({"shift_time": 7.0}),
}
_ALSO_BULLET = ("accelerometer_bias", "gyro_bias", "contact_error", "duration", "pick_time", "drop_time")
"""Settings that the simulation in PyBullet has, too."""


@dataclass(frozen=True, slots=True)
class Task:
    """Which recording: of which condition, simulator ('mujoco', 'pybullet'), robot, gait and seed; ``seconds``: of how long, 0:
    that of the condition."""

    condition: str
    simulator: str
    robot: str
    gait: str
    seed: int
    seconds: float = 0.0

    @property
    def line(self) -> str:
        """Of the table."""
        return f"{self.simulator} {self.robot} {self.gait}: {self.condition}"

    @property
    def possible(self) -> bool:
        """Whether the simulator has it."""
        condition = CONDITIONS[self.condition]
        return self.simulator == "mujoco" or (
            set(condition.settings) <= set(_ALSO_BULLET) and self.gait in QuadrupedScenario.gaits and self.robot == "a1"
        )


@dataclass(frozen=True, slots=True)
class Trial:
    """What became of a recording.

    Attributes:
        mass, robot: of load and robot [kg]. error, std: of the mass at the end of the load, and its standard deviation [kg].
        links: of which the described links' masses are off [kg]. com: error of the load's place across gravity [m].
        near: the mass is as near as is asked. beside: it would be, were the links known. count, ok: estimates that count, of
            those with status ok. bad: of those beyond 3 std. worst: the largest error of those over std.
        false, missed: events. late: how far from the change each event is [s]. named: what is said of the IMU.
    """

    task: Task
    mass: float
    robot: float
    error: float
    std: float
    links: float
    com: float
    status: str
    near: bool
    beside: bool
    count: int
    ok: int
    bad: int
    worst: float
    false: int
    missed: int
    late: list[float]
    named: str

    @property
    def inside(self) -> bool:
        return abs(self.error) < 1.96 * self.std


def legged(task: Task) -> LeggedRecord:
    """The recording of a seed in MuJoCo; one that falls is tried with the next load.

    Raises:
        SettingsError: it always falls.
    """
    robot, gait = task.robot, task.gait
    for attempt in range(8):
        rng = np.random.default_rng([task.seed, attempt, len(gait), len(robot)])
        low, high, reach = LOADS.get(robot, (0.5, 5.0, 0.12))
        rotor = ROTORS.get(robot, 0.01)
        dry = rng.uniform(0.1, 0.5) * (rotor / 0.01) ** 0.7
        values: dict[str, Any] = {
            "payload_mass": rng.uniform(low, high),
            "payload_com": (*rng.uniform(-0.4, 0.4, 2) * reach, rng.uniform(0.4, 1.0) * reach),
            "leg_friction": dry,
            "leg_damping": 0.2 * dry,
            "rotor_inertia": rotor,
            "accelerometer_bias": tuple(rng.normal(0.0, 0.02, 3)),
        }
        settings = {"duration": 12.0, "encoder_step": 1e-4, "imu_rate": 250} | values | _settings(task)
        try:
            return simulate_legged(
                LeggedScenario(robot=robot, gait=gait, seed=task.seed + 10_000 * attempt, **settings), start_time=START
            )
        except SettingsError as error:
            fallen = error
    raise fallen


def bullet(task: Task) -> QuadrupedRecord:
    """The same of the torque-controlled quadruped of PyBullet, whose description is right."""
    rng = np.random.default_rng([task.seed, len(task.gait)])
    place = rng.uniform(-0.12, 0.12), rng.uniform(-0.07, 0.07), rng.uniform(0.07, 0.2)
    settings = {"duration": 12.0, "encoder_noise": 1e-4, "payload_mass": rng.uniform(0.5, 5.0)} | _settings(task)
    scenario = QuadrupedScenario(gait=task.gait, seed=task.seed, payload_com=place, **settings)
    return simulate_quadruped(scenario, start_time=START)


def _settings(task: Task) -> dict[str, Any]:
    condition = CONDITIONS[task.condition]
    out = dict(condition.settings)
    if not condition.loaded:
        out["payload_mass"] = None
    if task.seconds > 0.0:
        out["duration"] = task.seconds
    return out


def _messages(record: LeggedRecord | QuadrupedRecord, contacts: str) -> Iterator[JointStateRecord | ImuRecord | ContactRecord]:
    for message in record.records(contacts=contacts != "none"):
        if contacts == "inverted" and isinstance(message, ContactRecord):
            yield replace(message, values=1.0 - np.asarray(message.values))
        else:
            yield message


def estimated(
    record: LeggedRecord | QuadrupedRecord, condition: Condition
) -> tuple[list[PayloadEstimate], list[PayloadEvent], float, str]:
    """All estimates of a recording, the events, what the robot weighs [kg], and what was warned of."""
    legs, settings = RobotModel.from_urdf(record.urdf), OnlineSettings(contact_frames=tuple(record.truth["contact_frames"]))
    estimation = OnlineEstimation(legs, settings)
    assert estimation.base is not None
    gate = gate_for(legs, estimation.base, settings)
    series, untared = [], condition.tared
    for message in _messages(record, condition.contacts):
        for measurement in gate.take(message):
            if untared and measurement.t > START + TARE_TIME:
                estimation.tare()
                untared = False
            estimate = estimation.step(measurement)
            if estimate is not None:
                series.append(estimate)
    return series, estimation.events, estimation.base.mass, " ".join(estimation.warnings)


def _theta(truth: dict[str, Any], kind: str) -> FloatArray:
    """What is carried after an event, shape (10,)."""
    return np.zeros(10) if kind == "drop" else np.array(truth["payload" if kind == "pick" else "shifted"]["theta"])


def judged(task: Task, record: LeggedRecord | QuadrupedRecord) -> Trial:
    """What became of a recording."""
    condition, truth = CONDITIONS[task.condition], record.truth
    series, events, robot, warned = estimated(record, condition)
    changes = [(e["t"], _theta(truth, e["kind"])) for e in truth["events"]]
    happened = [t for t, _ in changes if t > START + 0.5]
    begin = START + max(WARM, TARE_TIME if condition.tared else 0.0)

    def carried(t: float) -> FloatArray:
        known = [theta for since, theta in changes if since <= t]
        return known[-1] if known else np.zeros(10)

    counted = [e for e in series if e.t > begin and all(not 0.0 <= e.t - t < SETTLED for t in happened)]
    ok = [e for e in counted if e.status in ("ok", "no_payload")]
    off = [abs(float(e.theta[0] - carried(e.t)[0])) / e.mass_std for e in ok]
    found = [e.t for e in events]
    late = [min((abs(x - t) for x in found), default=np.inf) for t in happened]
    false = sum(not any(abs(t - x) < SEEN for t in happened) for x in found)
    last = [e for e in counted if not condition.loaded or carried(e.t)[0] > 0.0][-1]
    theta = carried(last.t)
    error, com, links = float(last.theta[0] - theta[0]), np.nan, truth.get("links_off", 0.0)
    most = LEAST_TARED if condition.tared else max(LEAST, EMPTY_PART * robot)
    if condition.loaded:
        com = float(np.abs(last.com[:2] - theta[1:3] / theta[0]).max())
        most = condition.wider * max(BOUNDS.get(task.gait, 0.025) * theta[0], LEAST)
    return Trial(
        task, float(theta[0]), robot, error, last.mass_std, links, com, last.status, bool(abs(error) <= most),
        bool(abs(error - (0.0 if condition.tared else links)) <= most), len(counted), len(ok),
        sum(x > 3.0 for x in off), max(off, default=0.0), false, sum(x >= SEEN for x in late), [x for x in late if x < SEEN],
        next((x for x in NAMED if x in last.reason + warned), ""),
    )  # fmt: skip


def run(task: Task) -> Trial | str:
    """A recording from its simulation to its judgement; why there is none where it falls with every load."""
    try:
        record: LeggedRecord | QuadrupedRecord = legged(task) if task.simulator == "mujoco" else bullet(task)
    except SettingsError as error:
        return f"{task.line}, seed {task.seed}: {error}"
    return judged(task, record)
