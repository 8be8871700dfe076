"""ArmSimulation: a scenario step by step; ComputedTorque: makes its arm follow a motion whatever it carries."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from sysid_ros.control import Reference
from sysid_ros.robot.drive import Drive
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.simulation.arm import ArmWorld
from sysid_ros.simulation.bullet_world import STEP
from sysid_ros.simulation.description import HOME, TIP_LINK, arm_description
from sysid_ros.simulation.payload import Payload, urdf_with_payload
from sysid_ros.simulation.scenario import CONTROL_RATE, ArmScenario
from sysid_ros.simulation.simulation import Simulation
from sysid_ros.simulation.trajectory import ExcitingTrajectory

_FREQUENCY = 50.0
_DAMPING = 0.7
_STIFFENING = 0.02


class ComputedTorque:
    """Computed torque with a feedback that is weighted by the inertia and stiffened where the arm alone weighs next to nothing::

        u   = w^2 (q_d - q) + 2 zeta w (v_d - v)
        tau = M(q) (a_d + u) + C(q, v) v + g(q) + J a_d + (J + D) u

    J are the rotor inertias. D stands for the inertia that an unknown payload may add: an iiwa's last joint alone turns 0.001 kg
    m^2, and gains weighted by that would let any payload hang down. With w = 50 rad/s and zeta = 0.7 the sampled loop is well
    damped with 0 to 5 kg at the flange (damping ratio 0.7 down to 0.2), and an unknown payload of 3 kg bends the wrist by some
    hundredths of a radian.

    Reference: Siciliano et al. 2009, "Robotics", section 8.5.2.

    Args:
        robot: the model that the controller believes, with or without the payload.
        rotor_inertia: shape (n,) [kg m^2].
    """

    def __init__(self, robot: RobotModel, rotor_inertia: FloatArray) -> None:
        self._robot = robot
        self._rotor = rotor_inertia
        # from the flange backwards: the last joint 0.01, the two before 0.02, the next two 0.05 kg m^2
        steps = np.array([0.5, 1.0, 1.0, 2.5, 2.5])[: robot.n]
        self._stiffening = np.zeros(robot.n)
        self._stiffening[robot.n - len(steps) :] = _STIFFENING * steps[::-1]

    def torque(self, q: FloatArray, v: FloatArray, q_d: FloatArray, v_d: FloatArray, a_d: FloatArray) -> FloatArray:
        """Joint torques (n,) [N m] at the state q, v for the wanted q_d, v_d, a_d, each of shape (n,)."""
        u = _FREQUENCY**2 * (q_d - q) + 2.0 * _DAMPING * _FREQUENCY * (v_d - v)
        return self._robot.rnea(q, v, a_d + u) + self._rotor * a_d + (self._rotor + self._stiffening) * u


_BLOCK = 1000

Command = Callable[[FloatArray, FloatArray, Reference], FloatArray]
"""Torques for the exact state q, v and what is wanted, shape (n,) each."""


class ArmSimulation(Simulation[Measurement]):
    """The arm of a scenario, one message at a time.

    A message at t holds q at t, the torque that acts from t on (for one physics step), and as velocity the mean of the steps
    before and after t: the three belong to the same instant, see :class:`ArmWorld`. Noise is added to the messages, not to what
    the controller sees, so the motion does not depend on it.

    Args:
        scenario: what is simulated.
        command: what moves the arm, asked at every physics step; None: a stiff controller of its own.

    Attributes:
        robot: model of the empty arm.
        push: force on the payload frame's origin along the base's axes, shape (3,) [N]; it stays until another is set.
    """

    def __init__(self, scenario: ArmScenario, command: Command | None = None) -> None:
        super().__init__(scenario, arm_description(), TIP_LINK)
        self.scenario: ArmScenario = scenario
        self.robot = RobotModel.from_urdf(self.urdf)
        n = self.robot.n
        rotor = scenario.per_joint("rotor_inertia", n)
        self._offset = scenario.per_joint("torque_offset", n)
        self._drive = Drive(scenario.per_joint("viscous_friction", n), scenario.per_joint("coulomb_friction", n), rotor, STEP)
        loaded = self.robot
        if self.payload is not None:
            loaded = RobotModel.from_urdf(urdf_with_payload(self.urdf, self.frame, self.payload))
        self._models = {False: self.robot, True: loaded}
        self._controllers = {
            False: ComputedTorque(self.robot, rotor),
            True: ComputedTorque(loaded if scenario.controller_knows_payload else self.robot, rotor),
        }
        self._command = command or self.own_command
        motion_seed, noise_seed = np.random.SeedSequence(scenario.seed).spawn(2)
        self._noise = np.random.default_rng(noise_seed)
        self.trajectory = _motion(scenario, np.random.default_rng(motion_seed), self.robot, loaded)
        self._schedule = _schedule(scenario)
        self._tip = self.robot.frame_id(self.frame)
        self.push: FloatArray = np.zeros(3)
        self.world: ArmWorld = ArmWorld(self.urdf, self.frame)
        self.world.reset(self.trajectory.centre, np.zeros(n))

    @property
    def carries(self) -> bool:
        return self.world.body.tied

    def _tie(self, payload: Payload) -> None:
        self.world.pick(payload)

    def _untie(self) -> None:
        self.world.body.untie()

    def step(self) -> Measurement:
        """Simulate until the next message and return this one, without noise; see :meth:`noisy`."""
        t = self.t
        q, v, tau = self._physics_step()
        for _ in range(CONTROL_RATE // self.scenario.rate - 1):
            self._physics_step()
        return Measurement(t, q, v, tau + self._offset)

    def noisy(self, exact: Measurement) -> Measurement:
        s, n = self.scenario, self.robot.n
        noise = self._noise.standard_normal((3, n))
        v = None if exact.v is None or not s.velocity else exact.v + s.velocity_noise * noise[2]
        return Measurement(exact.t, exact.q + s.encoder_noise * noise[0], v, exact.tau + s.torque_noise * noise[1])

    def truth(self, start_time: float = 0.0) -> dict[str, Any]:
        """All that the recording hides, in plain types; times are stamps, ``start_time`` [s] is the first one."""
        s = self.scenario
        return self._truth(
            s,
            start_time,
            noise={"encoder": s.encoder_noise, "torque": s.torque_noise, "velocity": s.velocity_noise if s.velocity else None},
            effects={x.name: s.per_joint(x.name, self.robot.n).tolist() for x in s.joint_settings()},
            controller_knows_payload=s.controller_knows_payload,
            timing="q, velocity and effort belong to the header stamp; the effort is the torque of the 1 ms that begins there",
        )

    def _physics_step(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        for action in self._schedule.get(self._k, ()):
            action(self)
        if self._k % _BLOCK == 0:
            self._reference = self.trajectory.sample(np.arange(self._k, self._k + _BLOCK) / CONTROL_RATE)
        world, i = self.world, self._k % _BLOCK
        q, v = world.q, world.v
        q_d, v_d, a_d = self._reference
        tau = self._command(q, v, Reference(q_d[i], v_d[i], a_d[i]))
        at_links = self._drive.link_torque(self._models[self.carries], q, v, tau)
        if np.any(self.push):
            at_links = at_links + self.robot.frame_jacobian_along(q[None], self._tip)[0].T @ self.push
        world.step(at_links)
        self._k += 1
        return q, 0.5 * (v + world.v), tau

    def own_command(self, q: FloatArray, v: FloatArray, wanted: Reference) -> FloatArray:
        """Torques of the stiff controller, shape (n,) [N m]: what the arm does where nobody commands it."""
        return self._controllers[self.carries].torque(q, v, wanted.q, wanted.v, wanted.a)


def _motion(scenario: ArmScenario, rng: np.random.Generator, empty: RobotModel, loaded: RobotModel) -> ExcitingTrajectory:
    centre = np.array(HOME) + rng.uniform(-0.2, 0.2, empty.n)
    motion = ExcitingTrajectory(
        centre,
        empty.position_lower,
        empty.position_upper,
        rng,
        velocity_limit=np.minimum(1.5, empty.velocity_limit),
        base_frequency=scenario.base_frequency,
        duration=scenario.duration,
    )
    motion.limit_effort(loaded.rnea, loaded.effort_limit)
    return motion


def _schedule(scenario: ArmScenario) -> dict[int, list[Callable[[ArmSimulation], bool]]]:
    """What happens by itself before which physics step."""
    schedule: dict[int, list[Callable[[ArmSimulation], bool]]] = {}
    if scenario.payload_mass is None:
        return schedule
    for t, action in ((scenario.pick_time or 0.0, ArmSimulation.pick), (scenario.drop_time, ArmSimulation.drop)):
        if t is not None and math.isfinite(t):
            # at a message's stamp: the next one shows it
            step = math.ceil(t * scenario.rate - 1e-9) * (CONTROL_RATE // scenario.rate)
            schedule.setdefault(step, []).append(action)
    return schedule
