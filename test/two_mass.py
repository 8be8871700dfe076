"""One joint of two masses in closed loop, with what its sensors publish: by the exact solution of its linear equations.

    Jm th'' + b th' + d (th' - q') + k (th - q) = tau + w,      M q'' + d (q' - th') + k (q - th) = 0
    tau = kp (r - th) + kd (r' - th')

th is the motor's angle, r the reference, w a disturbance. The axis is vertical, so gravity does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, signal

from sysid_ros.effects import RotorInertia, ViscousFriction
from sysid_ros.identification import Recording
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.known_effect import KnownEffect

FINE = 5e-4
START = 100.0


@dataclass(frozen=True)
class TwoMass:
    """Inertias [kg m^2], stiffness [N m/rad] (infinite: rigid), damping of the spring and of the motor [N m s/rad]."""

    link: float = 1.0
    motor: float = 0.5
    stiffness: float = np.inf
    spring_damping: float = 0.0
    damping: float = 2.0
    kp: float = 250.0
    kd: float = 30.0

    @property
    def locked(self) -> tuple[float, float]:
        """Frequency [Hz] and damping of the link with the motor held."""
        w = np.sqrt(self.stiffness / self.link)
        return float(w / (2.0 * np.pi)), float(self.spring_damping / (2.0 * np.sqrt(self.stiffness * self.link)))

    def plant(self) -> tuple[FloatArray, FloatArray]:
        """A (s, s) and B (s, 2) of the state (angles, velocities) for torque and disturbance on the motor."""
        if np.isinf(self.stiffness):
            J = self.link + self.motor
            return np.array([[0.0, 1.0], [0.0, -self.damping / J]]), np.array([[0.0, 0.0], [1.0 / J, 1.0 / J]])
        k, d, b, M, J = self.stiffness, self.spring_damping, self.damping, self.link, self.motor
        A = np.array(
            [
                [0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 1.0],
                [-k / J, k / J, -(d + b) / J, d / J],
                [k / M, -k / M, d / M, -d / M],
            ]
        )
        return A, np.array([[0.0, 0.0], [0.0, 0.0], [1.0 / J, 1.0 / J], [0.0, 0.0]])

    @property
    def poles(self) -> FloatArray:
        """From torque to motion [1/s]."""
        return np.asarray(linalg.eigvals(self.plant()[0]))

    def run(self, r: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Motor angle, link angle and torque for reference and disturbance on a grid of FINE, shape (N,) each."""
        A, B = self.plant()
        speed = 1 if len(A) == 2 else 2
        closed = A.copy()
        closed[:, 0] -= B[:, 0] * self.kp
        closed[:, speed] -= B[:, 0] * self.kd
        rate = np.gradient(r, FINE)
        inputs = np.outer(B[:, 0], self.kp * r + self.kd * rate) + np.outer(B[:, 1], w)
        values, vectors = linalg.eig(closed)
        modal = linalg.solve(vectors, inputs.astype(complex))
        # exact for inputs that run straight between grid points
        e = np.exp(values * FINE)
        now = (1.0 - (e - 1.0) / (values * FINE)) / -values
        before = (e - (e - 1.0) / (values * FINE)) / values
        states = [signal.lfilter([n, p], [1.0, -a], x) for n, p, a, x in zip(now, before, e, modal, strict=True)]
        x = np.real(vectors @ np.array(states))
        tau = self.kp * (r - x[0]) + self.kd * (rate - x[speed])
        return x[0], x[0] if speed == 1 else x[1], tau


def sweep(seconds: float, low: float, high: float, size: float) -> FloatArray:
    """A chirp whose torque is about even over frequency, shape (N,), at rest at both ends."""
    t = np.arange(round(seconds / FINE)) * FINE
    x = signal.chirp(t, low, seconds, high, method="logarithmic")
    f = low * (high / low) ** (t / seconds)
    return np.asarray(size * x * signal.windows.tukey(len(t), 0.1) / (1.0 + (f / 2.0) ** 1.5))


def multisine(period: float, periods: int, harmonics: FloatArray, size: float, seed: int) -> FloatArray:
    """Periods of random phases (Schroeder 1970 would do as well), shape (N,)."""
    t = np.arange(round(period * periods / FINE)) * FINE
    phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(harmonics))
    f = np.asarray(harmonics) / period
    amplitude = size / (1.0 + (f / 2.0) ** 1.5)
    return np.asarray(np.sum(amplitude[:, None] * np.sin(2.0 * np.pi * np.outer(f, t) + phase[:, None]), axis=0))


def urdf(link: float) -> str:
    """One link about a vertical axis."""
    return (
        '<robot name="one_joint"><link name="base"/><link name="arm"><inertial><mass value="1.0"/>'
        f'<inertia ixx="{link}" iyy="{link}" izz="{link}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="joint_1" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
        '<limit effort="300" velocity="10"/></joint></robot>'
    )


def model_of(joint: TwoMass) -> tuple[RobotModel, list[KnownEffect]]:
    """The rigid model of the joint, with its motor and its damping."""
    robot = RobotModel.from_urdf(urdf(joint.link))
    return robot, [
        KnownEffect(RotorInertia(robot), np.array([joint.motor])),
        KnownEffect(ViscousFriction(robot), np.array([joint.damping])),
    ]


def published(
    joint: TwoMass,
    r: FloatArray,
    seed: int,
    rate: float = 500.0,
    torque_noise: float = 0.1,
    colour: float = 0.0,
    disturbance: float = 0.0,
    encoder_noise: float = 2e-6,
    delay: float = 0.0,
    low_pass: float = 0.0,
    gain: float = 1.0,
    velocity_lag: float = 0.0,
    on_link: bool = False,
) -> Recording:
    """What the sensors publish.

    Args:
        delay: of the effort [s]. low_pass, velocity_lag: of effort and velocity [Hz]. gain: of the effort.
        disturbance: standard deviation of a slow torque on the motor that the loop fights [N m]. colour: of the torque's noise.
        on_link: the encoder stands on the link's side.
    """
    rng = np.random.default_rng([seed, 7])
    w = np.zeros(len(r))
    if disturbance:
        w = signal.lfilter([1.0], [1.0, -0.999], rng.standard_normal(len(r)))
        w *= disturbance / np.std(w)
    motor, link, tau = joint.run(r, w)
    position = link if on_link else motor
    speed = np.gradient(position, FINE)
    if low_pass:
        tau = first_order(tau, low_pass)
    if velocity_lag:
        speed = first_order(speed, velocity_lag)
    t = np.arange(len(r)) * FINE
    tau = gain * np.interp(t - delay, t, tau)
    every = round(1.0 / (rate * FINE))
    q, tau, speed = position[::every].copy(), tau[::every].copy(), speed[::every].copy()
    noise = rng.standard_normal(len(q) + 1000)
    noise = signal.lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], noise)[1000:]
    q += encoder_noise * rng.standard_normal(len(q))
    t = START + np.arange(len(q)) / rate
    return Recording(f"run {seed}", t, q[:, None], speed[:, None], (tau + torque_noise * noise)[:, None])


def first_order(x: FloatArray, cutoff: float) -> FloatArray:
    """Low-pass of the first order, for inputs that run straight between grid points."""
    a = 2.0 * np.pi * cutoff * FINE
    e = np.exp(-a)
    slope = (1.0 - e) / a
    return np.asarray(signal.lfilter([1.0 - slope, slope - e], [1.0, -e], x))
