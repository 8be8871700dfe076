"""One arm of a make that no simulator here was tuned on, in one of the conditions that robots really have, and what came of it.

The motion is prescribed and torques are pinocchio's inverse dynamics of the true arm, so that nothing of the package is in them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from other_arms import motion, urdf_of

from sysid_ros.input_gate import InputGate, Rejection
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.simulation.description import arm_description

ARMS = ("panda", "ur5", "iiwa")
RATES = (250, 500, 1000)
PICK, DROP, END = 6.0, 12.0, 14.0
LATENCIES = (0.15, 0.5, 1.0, 2.0, 5.0)
"""Times after the pick at which the estimate is compared with the truth [s]."""
SETTLES = 0.3
"""Time after a change during which an estimate need not be right [s]."""
NEAR = 1.0
"""An event tells of a change that was at most so long before it was found [s]."""


@dataclass(frozen=True, slots=True)
class Condition:
    """What differs from an ideal arm with encoder noise of 2e-5 rad and torque noise of 0.1 N m.

    Attributes:
        encoder, torque: standard deviations of the noise [rad], [N m].
        links: relative error of the masses in the URDF, either way. com: error of each coordinate of a link's com [m].
        tilt: of the base, which nobody told [rad]. push: force at the flange for a second [N]; at: when [s]. stands: the arm
            stands still around the push.
        friction: Coulomb friction as a part of a joint's effort limit, and as much a rad/s viscous. stated: it is in the URDF.
        gains: by what part of it each joint's effort is off, a standard deviation.
        colour: time constant of the torque noise [s]; 0: white. rod: length on which the payload swings [m]; 0: it is fixed.
        lost, jitter: part of the messages; standard deviation of the stamps [s]. late: of the torque [s].
        polled: a driver asks for the newest values so many times as often as there are new ones; 0: there is none.
        half: half of the payload is dropped at ``DROP``. again: it is picked up at 3 s as well and dropped at 4.5 s.
        duration: of a run without events, from the start with its payload [s]; 0: one with pick and drop.
        pauses: pick-and-place: moves of two seconds with pauses of half a second. slow: factor on the speed.
        spikes: part of the samples with a torque of three times the joint's limit. frozen: from 8 s on the effort of one joint
            (1), of all (2), or the position of one while messages hold velocities (3), stays. compensated: the effort lacks
            the links' gravity.
        tared: an empty estimate is taken as zero before the pick. wakes: until then every other joint moves by a twentieth only.
    """

    encoder: float = 2e-5
    torque: float = 0.1
    links: float = 0.0
    com: float = 0.0
    tilt: float = 0.0
    push: float = 0.0
    at: float = 4.0
    stands: bool = False
    friction: float = 0.0
    stated: bool = False
    colour: float = 0.0
    rod: float = 0.0
    lost: float = 0.0
    jitter: float = 0.0
    polled: float = 0.0
    late: float = 0.0
    half: bool = False
    again: bool = False
    duration: float = 0.0
    pauses: bool = False
    slow: float = 1.0
    tared: bool = False
    wakes: bool = False
    spikes: float = 0.0
    frozen: int = 0
    compensated: bool = False
    gains: float = 0.0


CONDITIONS: dict[str, Condition] = {
    "base": Condition(),
    "links 2 %": Condition(links=0.02),
    "links 2 %, com 2 mm": Condition(links=0.02, com=0.002),
    "links 2 %, tared": Condition(links=0.02, com=0.002, tared=True),
    "links 2 %, tared on another motion": Condition(links=0.02, com=0.002, tared=True, wakes=True),
    "efforts 1 % off": Condition(gains=0.01),
    "base tilted 5 deg": Condition(tilt=np.deg2rad(5.0)),
    "60 N contact 2 s before the pick": Condition(push=60.0, at=4.0),
    "60 N contact while carrying": Condition(push=60.0, at=8.0),
    "20 N contact while carrying": Condition(push=20.0, at=8.0),
    "60 N contact, standing": Condition(push=60.0, at=8.0, stands=True),
    "encoder 1e-4 rad": Condition(encoder=1e-4),
    "encoder 5e-4 rad": Condition(encoder=5e-4),
    "encoder 1e-4 rad, 60 s": Condition(encoder=1e-4, duration=60.0),
    "pick and place, unknown friction": Condition(pauses=True, friction=0.01),
    "swinging payload": Condition(rod=0.1),
    "friction in the URDF": Condition(friction=0.03, stated=True),
    "unknown friction": Condition(friction=0.01),
    "noise over 0.5 s": Condition(colour=0.5),
    "AR(1) 0.98": Condition(colour=0.05),
    "loss 1 %": Condition(lost=0.01),
    "jitter": Condition(jitter=2e-4),
    "polled": Condition(polled=1.02),
    "effort 2 ms late": Condition(late=0.002),
    "half dropped": Condition(half=True),
    "two picks": Condition(again=True),
    "slow": Condition(slow=0.4),
    "spikes": Condition(spikes=0.002),
    "one effort frozen": Condition(frozen=1),
    "all efforts frozen": Condition(frozen=2),
    "one position frozen": Condition(frozen=3),
    "gravity compensated": Condition(compensated=True),
}

FAULTS = ("spikes", "one effort frozen", "all efforts frozen", "one position frozen", "gravity compensated")
"""Conditions in which nothing need be found, but nothing wrong may be said."""


@dataclass(slots=True)
class Outcome:
    """What came of a run.

    Attributes:
        mass: of the payload [kg]. errors: of the mass at :data:`LATENCIES`, relative. com_error: 5 s after the pick [m].
        covered: whether mass, and each coordinate of the com, is inside its 95 % interval at 2 s and 5 s.
        nees: of the ten parameters over 10, at 2 s and 5 s. normalised, std: error of the mass over its own std at 5 s, and
            that [kg]. bound: Cramer-Rao bound of the ten parameters' std at 5 s, from true regressors.
        ok, bad: estimates that said ``ok``, and those of them beyond three standard deviations.
        worst: largest of these normalised errors. missed, false: events. late: from the pick to the event [s].
        within: time from pick until the mass is within 5 % for good [s]; NaN where it is not. statuses: how often each was.
        dropped: time from drop until the mass is within 75 g of what is left for good [s]; NaN where it is not.
        early_bound: as ``bound``, of the mass alone, 0.15 s after the pick [kg].
    """

    arm: str
    rate: int
    seed: int
    mass: float
    errors: list[float] = field(default_factory=list)
    com_error: float = np.nan
    covered: list[list[int]] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    normalised: float = np.nan
    std: float = np.nan
    theta_error: list[float] = field(default_factory=list)
    bound: list[float] = field(default_factory=list)
    ok: int = 0
    bad: int = 0
    worst: float = 0.0
    missed: int = 0
    false: int = 0
    late: float = np.nan
    within: float = np.nan
    dropped: float = np.nan
    early_bound: float = np.nan
    statuses: dict[str, int] = field(default_factory=dict)
    events: list[tuple[float, str]] = field(default_factory=list)
    trace: list[tuple[float, float, float, str, float]] = field(default_factory=list)


def robot_of(arm: str) -> RobotModel:
    """The arm without fingers."""
    text = arm_description() if arm == "iiwa" else urdf_of(arm)
    names = RobotModel.from_urdf(text).joint_names
    return RobotModel.from_urdf(text, [name for name in names if "finger" not in name])


def _moves(model: RobotModel, rng: np.random.Generator, t: FloatArray, c: Condition) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The motion: sines that grow, moves with pauses between them, or sines that stop around a push."""
    if c.pauses:
        return _pick_and_place(model, rng, t)
    if not c.stands:
        q, v, a = motion(model, rng, c.slow * t)
        return _wakes(q, v, a, t) if c.wakes else (q, c.slow * v, c.slow**2 * a)
    # time itself is slowed to a stop from a second before the push to two after it
    h = t[1] - t[0]
    ramp = np.clip(np.minimum(np.abs(t - c.at + 1.0), np.abs(t - c.at - 3.0)) / 0.8, 0.0, 1.0)
    speed = np.where((t > c.at - 1.0) & (t < c.at + 3.0), 0.0, ramp**2 * (3.0 - 2.0 * ramp))
    own = np.cumsum(speed) * h
    q, v, a = motion(model, rng, own)
    rate = np.gradient(speed, h)
    return q, v * speed[:, None], a * speed[:, None] ** 2 + v * rate[:, None]


def _wakes(q: FloatArray, v: FloatArray, a: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The motion, of which every other joint takes part by a twentieth until just before the pick, and wholly 1.5 s later."""
    x, some = np.clip((t - PICK + 0.1) / 1.5, 0.0, 1.0)[:, None], slice(None, None, 2)
    part, away = 0.05 + 0.95 * (10 * x**3 - 15 * x**4 + 6 * x**5), q[:, some] - q[:1, some]
    rate, bend = 0.95 * (30 * x**2 - 60 * x**3 + 30 * x**4) / 1.5, 0.95 * (60 * x - 180 * x**2 + 120 * x**3) / 1.5**2
    a[:, some] = part * a[:, some] + 2.0 * rate * v[:, some] + bend * away
    v[:, some] = part * v[:, some] + rate * away
    q[:, some] = q[:1, some] + part * away
    return q, v, a


def _pick_and_place(model: RobotModel, rng: np.random.Generator, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    lower, upper = np.maximum(model.position_lower, -2.0), np.minimum(model.position_upper, 2.0)
    middle, reach = 0.5 * (lower + upper), 0.3 * (upper - lower)
    points = middle + reach * rng.uniform(-1.0, 1.0, (int(t[-1] / 2.5) + 2, model.n))
    leg = (t / 2.5).astype(int)
    s = np.clip((t - 2.5 * leg) / 2.0, 0.0, 1.0)[:, None]
    step = points[leg + 1] - points[leg]
    q = points[leg] + (10 * s**3 - 15 * s**4 + 6 * s**5) * step
    v = (30 * s**2 - 60 * s**3 + 30 * s**4) * step / 2.0
    return q, v, (60 * s - 180 * s**2 + 120 * s**3) * step / 4.0


def _swings(place: FloatArray, t: FloatArray, mass: float, rod: float) -> FloatArray:
    """Force of a bob on a rod at the point it hangs from, shape (N, 3) [N], where that point moves along ``place`` (N, 3)."""
    h = t[1] - t[0]
    drive = np.gradient(np.gradient(place, h, axis=0), h, axis=0)
    gravity = np.array([0.0, 0.0, -9.81])
    relative, speed = np.array([0.0, 0.0, -rod]), np.zeros(3)
    force = np.zeros_like(place)
    for k in range(len(t)):
        along = relative / rod
        free = gravity - drive[k] - 0.5 * speed
        tension = free @ along + speed @ speed / rod
        acceleration = free - tension * along
        force[k] = mass * tension * along
        speed = speed + h * acceleration
        relative = relative + h * speed
        relative *= rod / np.linalg.norm(relative)
        speed -= (speed @ relative) * relative / rod**2
    return force


def _true_arm(model: RobotModel, rng: np.random.Generator, c: Condition) -> Any:
    """pinocchio's model of the arm as it really is: masses and places differ, the base is tilted."""
    true = model.model.copy()
    for i in range(1, true.njoints):
        scale = 1.0 + c.links * rng.choice([-1.0, 1.0])
        inertia = true.inertias[i]
        true.inertias[i] = pin.Inertia(scale * inertia.mass, inertia.lever + c.com * rng.normal(size=3), scale * inertia.inertia)
    if c.tilt:
        about = rng.uniform(0.0, 2.0 * np.pi)
        axis = np.array([np.cos(about), np.sin(about), 0.0])
        true.gravity.linear = pin.exp3(c.tilt * axis) @ true.gravity.linear
    return true


def _noise(rng: np.random.Generator, shape: tuple[int, int], c: Condition, rate: float) -> FloatArray:
    white: FloatArray = c.torque * rng.normal(size=shape)
    if not c.colour:
        return white
    keep = float(np.exp(-1.0 / (c.colour * rate)))
    out = np.empty_like(white)
    state = white[0]
    for k, w in enumerate(white):
        state = out[k] = keep * state + np.sqrt(1.0 - keep**2) * w
    return out


def run(name: str, seed: int, settings: OnlineSettings | None = None, keep: bool = False) -> Outcome:
    """One run of a condition; the arm, the rate and the mass follow from the seed. ``keep``: with the trace of the mass."""
    c = CONDITIONS[name]
    rng = np.random.default_rng([seed, 7])
    arm, rate = ARMS[seed % 3], RATES[(seed // 3) % 3]
    model = robot_of(arm)
    end = c.duration or END
    t = np.arange(0.0, end, 1.0 / rate)
    q, v, a = _moves(model, rng, t, c)
    mass = float(np.exp(rng.uniform(np.log(0.3), np.log(5.0))))
    size = 0.05
    body = pin.Inertia(mass, size * rng.uniform(-1.6, 1.6, 3), 2.0 * mass * size**2 * np.diag([0.5, 0.7, 0.9]))
    whole, half = body.toDynamicParameters(), 0.5 * body.toDynamicParameters()
    frame = model.frame_id(model.flange)
    true = _true_arm(model, rng, c)

    def carried(at: float) -> FloatArray:
        if c.duration or PICK <= at < DROP:
            return np.asarray(whole)
        if c.again and 3.0 <= at < 4.5:
            return np.asarray(whole)
        return np.asarray(half if c.half and at >= DROP else 0.0 * whole)

    data, geometry = true.createData(), model.model.createData()
    tau, loads = np.empty_like(q), np.empty((len(t), 10))
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    hangs = np.zeros((len(t), 3))
    if c.rod:
        hangs = _swings(_along(model, frame, q), t, mass, c.rod)
    columns = np.empty((len(t), model.n, 10))
    for k, at in enumerate(t):
        loads[k] = carried(at)
        tau[k] = pin.rnea(true, data, q[k], v[k], a[k])
        jacobian = pin.computeFrameJacobian(true, data, q[k], frame, pin.LOCAL)
        columns[k] = jacobian.T @ pin.frameBodyRegressor(true, data, frame)
        world = np.zeros(3)
        if c.rod and loads[k].any():
            world += hangs[k]
        elif loads[k].any():
            tau[k] += columns[k] @ loads[k]
        if c.push and c.at <= at < c.at + 1.0:
            world += c.push * direction
        if world.any():
            pin.framesForwardKinematics(model.model, geometry, q[k])
            tau[k] -= jacobian[:3].T @ (geometry.oMf[frame].rotation.T @ world)
    rub = c.friction * np.where(np.isfinite(model.effort_limit), model.effort_limit, 50.0)
    tau += rub * (np.tanh(v / 0.003) + v)
    if c.gains:
        tau *= 1.0 + c.gains * rng.normal(size=model.n)
    if c.late:
        behind = round(c.late * rate)
        tau[behind:] = tau[: len(tau) - behind].copy()
    tau += _noise(rng, tau.shape, c, rate)
    tau = _faults(tau, model, rng, t, q, c)
    shown = q + c.encoder * rng.normal(size=q.shape)
    if c.frozen == 3:
        _freeze(shown, rng, t)
    stamps = t + c.jitter * rng.normal(size=t.shape)
    kept = rng.uniform(size=t.shape) >= c.lost
    if c.stated:
        model.friction, model.damping = rub.copy(), rub.copy()
    outcome = Outcome(arm, rate, seed, mass)
    given, newest = t, np.arange(len(t))
    if c.polled:
        given = stamps = np.arange(0.3 / rate, t[-1], 1.0 / (c.polled * rate))
        newest, kept = np.floor(given * rate).astype(int), np.ones(len(given), dtype=bool)
    data_of = shown[newest], tau[newest]
    estimates, found, estimation = _estimate(
        model, settings or OnlineSettings(), given, stamps, *data_of, kept, c, v if c.frozen == 3 else None
    )
    _score(outcome, c, estimates, found, estimation, carried)
    outcome.bound = _bound(columns, v, t, c, model).tolist()
    outcome.early_bound = float(_bound(columns, v, t, c, model, LATENCIES[0])[0])
    if keep:
        outcome.trace = [(at, float(e.theta[0]), e.mass_std, e.status, float(carried(at)[0])) for at, e in estimates]
    return outcome


def _along(model: RobotModel, frame: int, q: FloatArray) -> FloatArray:
    """Where the frame's origin is, shape (N, 3) [m]."""
    data = model.model.createData()
    places = np.empty((len(q), 3))
    for k, posture in enumerate(q):
        pin.forwardKinematics(model.model, data, posture)
        places[k] = pin.updateFramePlacement(model.model, data, frame).translation
    return places


def _faults(
    tau: FloatArray, model: RobotModel, rng: np.random.Generator, t: FloatArray, q: FloatArray, c: Condition
) -> FloatArray:
    """What a driver may do to the efforts."""
    if c.compensated:
        tau = tau - np.array([model.gravity_torque(posture) for posture in q])
    if c.spikes:
        limit = np.where(np.isfinite(model.effort_limit), model.effort_limit, 50.0)
        hit = rng.uniform(size=tau.shape) < c.spikes
        tau = np.where(hit, 3.0 * limit * rng.choice([-1.0, 1.0], tau.shape), tau)
    if c.frozen in (1, 2):
        _freeze(tau, rng, t, slice(None) if c.frozen == 2 else None)
    return tau


def _freeze(values: FloatArray, rng: np.random.Generator, t: FloatArray, joints: slice | None = None) -> None:
    """From 8 s on the values of some joints, of one at random unless they are told, stay what they are."""
    since = int(np.searchsorted(t, 8.0))
    chosen = joints if joints is not None else int(rng.integers(values.shape[1]))
    values[since:, chosen] = values[since, chosen]


def _estimate(
    model: RobotModel, settings: OnlineSettings, t: FloatArray, stamps: FloatArray, q: FloatArray, tau: FloatArray,
    kept: Any, c: Condition, v: FloatArray | None,
) -> tuple[list[tuple[float, PayloadEstimate]], list[float], OnlineEstimation]:  # fmt: skip
    gate, estimation = InputGate(model, settings), OnlineEstimation(model, settings)
    estimates: list[tuple[float, PayloadEstimate]] = []
    found: list[float] = []
    for k in np.flatnonzero(kept):
        stamp = 100.0 + stamps[k]
        measurement = gate.accept(JointStateRecord(stamp, stamp, model.joint_names, q[k], () if v is None else v[k], tau[k]))
        if isinstance(measurement, Rejection):
            continue
        if c.tared and k and t[k - 1] < PICK - 0.2 <= t[k]:
            estimation.tare()
        estimate = estimation.step(measurement)
        del found[len(estimation.events) :]
        found += [float(t[k])] * (len(estimation.events) - len(found))
        if estimate is not None:
            estimates.append((float(t[k]), estimate))
    return estimates, found, estimation


def _score(
    out: Outcome, c: Condition, estimates: list[tuple[float, PayloadEstimate]], found: list[float],
    estimation: OnlineEstimation, carried: Callable[[float], FloatArray],
) -> None:  # fmt: skip
    changes = [] if c.duration else [*((3.0, 4.5) if c.again else ()), PICK, DROP]
    begin = 0.0 if c.duration else PICK
    truth = carried(begin)
    for after in LATENCIES:
        estimate = [e for at, e in estimates if at <= begin + after][-1] if begin + after > estimates[0][0] else None
        out.errors.append(abs(float(estimate.theta[0]) / truth[0] - 1.0) if estimate is not None else np.nan)
        if after < 2.0 or estimate is None:
            continue
        error, std = estimate.theta - truth, estimate.std
        com = truth[1:4] / truth[0]
        inside = [abs(error[0]) < 1.96 * std[0], *(np.abs(estimate.com - com) < 1.96 * estimate.com_std)]
        out.covered.append([int(x) for x in inside])
        out.nees.append(float(error @ np.linalg.solve(estimate.covariance, error)) / 10.0)
        if after == LATENCIES[-1]:
            out.com_error = float(np.linalg.norm(estimate.com - com))
            out.normalised, out.std, out.theta_error = float(error[0] / std[0]), float(std[0]), error.tolist()
    unsettled = [*changes, *((c.at, c.at + 1.0) if c.push else ())]
    for at, e in estimates:
        out.statuses[e.status] = out.statuses.get(e.status, 0) + 1
        if e.status != "ok" or any(0.0 <= at - change < SETTLES for change in unsettled):
            continue
        out.ok += 1
        normalised = abs(float(e.theta[0]) - carried(at)[0]) / e.mass_std
        out.bad += normalised > 3.0
        out.worst = max(out.worst, float(normalised))
    right = [abs(float(e.theta[0]) / truth[0] - 1.0) <= 0.05 for at, e in estimates if begin < at < DROP]
    times = [at for at, _ in estimates if begin < at < DROP]
    wrong = [k for k, inside in enumerate(right) if not inside]
    if not wrong or wrong[-1] + 1 < len(times):
        out.within = times[wrong[-1] + 1 if wrong else 0] - begin
    if DROP in changes:
        since = [(at - DROP, abs(float(e.theta[0]) - carried(at)[0]) <= 0.075) for at, e in estimates if at >= DROP]
        last = max((k for k, (_, inside) in enumerate(since) if not inside), default=-1)
        out.dropped = since[last + 1][0] if last + 1 < len(since) else np.nan
    left = [(e, at) for e, at in zip(estimation.events, found, strict=True) if e.kind != "external_force"]
    pushed = [at for e, at in zip(estimation.events, found, strict=True) if e.kind == "external_force"]
    for change in changes:
        near = [pair for pair in left if pair[0].t - change >= -0.1 and pair[1] - change <= NEAR]
        if not near:
            out.missed += 1
            continue
        left.remove(near[0])
        if change == PICK:
            out.late = near[0][1] - change
    if c.push:
        out.missed += not any(c.at <= at <= c.at + 3.0 for at in pushed)
        pushed = [at for at in pushed if not c.at <= at <= c.at + 3.0]
    if c.rod:
        left, pushed = [], []
    out.false = len(left) + len(pushed)
    out.events = [(round(e.t - 100.0, 3), e.kind) for e in estimation.events]


def _bound(
    columns: FloatArray, v: FloatArray, t: FloatArray, c: Condition, model: RobotModel, after_pick: float = 5.0
) -> FloatArray:
    """Cramer-Rao bound of the std of the ten parameters so long after the pick [s], from all rows up to then, shape (10,).

    Unknown are also what was carried before, and offset, Coulomb and viscous friction of each joint, with the settings' priors;
    regressors are true, and the noise is known to be as coloured as it is: rows are whitened by its recursion.
    """
    begin, n, s = 0.0 if c.duration else PICK, model.n, OnlineSettings()
    used = t < begin + after_pick
    body = [s.prior_mass_std] + [s.prior_first_moment_std] * 3 + [s.prior_inertia_std] * 6
    size = s.friction_unknown * np.where(np.isfinite(model.effort_limit), model.effort_limit, 50.0)
    prior = np.concatenate([body, body, 0.2 * size, size, 2.0 * size])
    curves = np.stack([np.ones_like(v), np.tanh(v / 0.003), v], axis=2)[used]
    loads, after = columns[used], (t[used] >= begin)[:, None]
    information = np.diag(prior**-2.0)
    keep = float(np.exp(-(t[1] - t[0]) / c.colour)) if c.colour else 0.0
    for j in range(n):
        Y = np.zeros((int(used.sum()), len(prior)))
        Y[:, :10], Y[:, 10:20] = loads[:, j] * after, loads[:, j] * ~after
        Y[:, 20 + j :: n] = curves[:, j]
        Y[1:] = (Y[1:] - keep * Y[:-1]) / np.sqrt(1.0 - keep**2)
        information += Y.T @ Y / max(c.torque, 1e-9) ** 2
    scale = 1.0 / np.sqrt(np.diag(information))
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information * np.outer(scale, scale)))[:10]) * scale[:10])
