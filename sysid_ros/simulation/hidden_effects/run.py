"""Run a true robot through a motion, and record what its messages say."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.simulation.hidden_effects.chain import chain_of, inverse_dynamics, place
from sysid_ros.simulation.hidden_effects.channels import Signals
from sysid_ros.simulation.hidden_effects.integrator import FREQUENCY, integrate, state_at
from sysid_ros.simulation.hidden_effects.motion import PlannedMotion
from sysid_ros.simulation.hidden_effects.sensor_noise import Noise
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot

_REFERENCE_PERIOD = 1e-3
_STEPS = 2
_STEPS_OF_FAST_PHYSICS = 8
_LOST = 0.5
_GIVE = 0.03


@dataclass(frozen=True, slots=True)
class HiddenRecording:
    """A recording with what it hides.

    Attributes:
        name: of the recording. joint_names: the channels' order.
        t: stamps, shape (N,) [s]. q, v, tau: as published, shape (N, n).
        exact: the same messages without noise and without resolution of the sensors.
        true: motion and torque of the motors themselves, before anything between robot and messages.
    """

    name: str
    joint_names: tuple[str, ...]
    t: FloatArray
    q: FloatArray
    v: FloatArray
    tau: FloatArray
    exact: Signals
    true: Signals

    def records(self) -> list[JointStateRecord]:
        """As messages, received at their stamps."""
        rows = zip(self.t.tolist(), self.q, self.v, self.tau, strict=True)
        return [JointStateRecord(t, t, self.joint_names, q, v, tau) for t, q, v, tau in rows]


def move(true: TrueRobot, motion: PlannedMotion, rate: int, stiffening: FloatArray) -> Signals:
    """Positions and velocities at the motors and the torque asked of them, every 1/rate [s].

    Raises:
        SettingsError: the arm does not follow the motion, or ``rate`` is no divisor of 1000 Hz.
    """
    require_rate(rate)
    joints = true.joints
    steps = _STEPS_OF_FAST_PHYSICS if true.needs_short_steps else _STEPS
    count = int(motion.duration * rate)
    grid = np.arange(int(motion.duration / _REFERENCE_PERIOD) + 1002) * _REFERENCE_PERIOD
    reference = np.stack(motion.sample(grid), axis=1)
    out = np.zeros((count, 3, true.robot.n))
    before = chain_of(true.robot, true.pi, true.gravity)
    after = chain_of(true.robot, true.pi_after, true.gravity)
    believed = chain_of(true.robot, true.robot.pi, true.robot.gravity)
    rows = integrate(
        believed,
        before,
        after,
        true.change_time,
        joints,
        true.force,
        stiffening,
        reference,
        _REFERENCE_PERIOD,
        steps,
        1000 // rate * steps,
        state_at(_loaded(true, reference[0, 0]), reference[0, 0]),
        out,
    )
    t = np.arange(count, dtype=np.float64) / rate
    check_followed(true, motion, t[:rows], out[:rows, 0])
    return Signals(t, out[:, 0].copy(), out[:, 1].copy(), out[:, 2].copy())


def require_rate(rate: int) -> None:
    """Messages fall on steps of the reference.

    Raises:
        SettingsError: they do not.
    """
    if rate <= 0 or 1000 % rate:
        raise SettingsError(f"rate is {rate}; it must be a divisor of 1000 Hz: 1000, 500, 250, 200, 125, 100, ...")


def check_followed(true: TrueRobot, motion: PlannedMotion, t: FloatArray, q: FloatArray) -> None:
    """The positions (K, n) that were reached at t (K,) are those of the motion.

    Raises:
        SettingsError: they are not.
    """
    error = np.abs(q - motion.sample(t)[0]).max(axis=0)
    # not <=, so that NaN does not pass
    if not np.all(error < _LOST):
        worst = int(np.argmax(np.nan_to_num(error, nan=np.inf)))
        raise SettingsError(
            f"joint {true.robot.joint_names[worst]} is up to {error[worst]:.2f} rad away from the motion; "
            f"{_LOST} rad is allowed. Hide something smaller."
        )


def _loaded(true: TrueRobot, q: FloatArray) -> FloatArray:
    """Positions of the links, shape (n,), where elastic joints already bear their load: nothing swings at the start."""
    joints, chain, n = true.joints, chain_of(true.robot, true.pi, true.gravity), true.robot.n
    links = q.copy()
    rotation, offset, work, torque = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros((6, n + 1, 3)), np.zeros(n)
    give = np.where(joints.stiffness > 0.0, 1.0 / np.where(joints.stiffness > 0.0, joints.stiffness, 1.0), 0.0)
    for _ in range(20):
        place(chain, links, rotation, offset)
        inverse_dynamics(chain, rotation, offset, np.zeros(n), np.zeros(n), 1.0, torque, work)
        links = q - give * torque - 0.5 * joints.gap * np.sign(torque)
    return links


def stiffening_for(torque_scale: FloatArray) -> FloatArray:
    """Weight of the feedback that lets the usual torque of a joint, shape (n,) [N m], bend it by some hundredths of a radian."""
    return np.asarray(torque_scale / (FREQUENCY**2 * _GIVE))


def publish(
    name: str, true: TrueRobot, moved: Signals, noise: Noise, rng: np.random.Generator, start: float = 0.0
) -> HiddenRecording:
    """What the messages of a run say: sensors with their noise, then the channels, then stamps from ``start`` [s] on."""
    count, n = moved.q.shape
    period = float(moved.t[1] - moved.t[0])
    q = moved.q + noise.position * rng.standard_normal((count, n))
    read = replace(
        moved,
        q=noise.read(q),
        v=moved.v + noise.velocity * rng.standard_normal((count, n)),
        tau=moved.tau + noise.of_torque(count, period, rng),
    )
    exact = moved
    for channel in true.channels:
        read, exact = channel(read, moved), channel(exact, moved)
    return HiddenRecording(name, true.robot.joint_names, moved.t + start, read.q, read.v, read.tau, exact, moved)


def truth_of(true: TrueRobot, noise: Noise, rate: int, simulator: str, **more: Any) -> dict[str, Any]:
    """All that a recording hides, in plain types: what ``NAME.truth.json`` holds."""
    return {
        "format": 1,
        "robot": true.robot.name,
        "joint_names": list(true.robot.joint_names),
        "simulator": simulator,
        "rate": rate,
        "effects": [effect.as_dict() for effect in true.effects],
        "noise": {
            "torque": noise.torque.tolist(),
            "coloured": noise.coloured.tolist(),
            "memory": noise.memory,
            "encoder": noise.position,
            "resolution": np.asarray(noise.resolution).tolist(),
            "velocity": noise.velocity,
        },
        **more,
    }
