"""QuadrupedSimulation: a scenario step by step."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np

from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.rotation import quaternion, rotation_of
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.simulation.bullet_world import STEP
from sysid_ros.simulation.description import FEET, IMU_LINK, TRUNK, quadruped_description
from sysid_ros.simulation.payload import Payload
from sysid_ros.simulation.quadruped import Hoist, QuadrupedWorld
from sysid_ros.simulation.quadruped_controller import QuadrupedController
from sysid_ros.simulation.quadruped_motion import WALKS, Trot, TrunkMotion
from sysid_ros.simulation.quadruped_scenario import SETTLE_TIME, QuadrupedScenario, fallen
from sysid_ros.simulation.quadruped_state import QuadrupedState
from sysid_ros.simulation.scenario import CONTROL_RATE
from sysid_ros.simulation.simulation import Simulation
from sysid_ros.simulation.trunk_state import TrunkState

HEIGHT = 0.27
"""Of the trunk's origin over the ground [m]."""
_POSTURE = (0.0, 0.83, -1.66)
_GRAVITY = np.array([0.0, 0.0, -9.81])
_TOUCHES = 1.0


class QuadrupedSimulation(Simulation[QuadrupedState]):
    """The quadruped of a scenario, one message at a time.

    A message at t holds q at t, the torque that acts from t on, and the mean of the velocities and angular velocities before and
    after the step that begins at t. The specific force is what an integrating accelerometer tells: the change of velocity of its
    place over one message period around t, less gravity. Noise is added to the messages, not to what the controller sees.

    Args:
        scenario: what is simulated.

    Attributes:
        base: the robot without load. robot: model of its legs.
    """

    def __init__(self, scenario: QuadrupedScenario) -> None:
        super().__init__(scenario, quadruped_description(tuple(scenario.imu_xyz), tuple(scenario.imu_rpy)), TRUNK)
        self.scenario: QuadrupedScenario = scenario
        self.base = FloatingBase(RobotModel.from_urdf(self.urdf), FEET)
        self.robot = self.base.legs
        motion_seed, noise_seed = np.random.SeedSequence(scenario.seed).spawn(2)
        self._noise = np.random.default_rng(noise_seed)
        self._ground = scenario.ground
        yields = self.base.mass * 9.81 / 4.0 / scenario.sink if scenario.sink > 0.0 else math.inf
        self.world: QuadrupedWorld = QuadrupedWorld(self.urdf, FEET, self._ground[:, 2], scenario.grip, yields)
        names = self.base.legs.joint_names
        self._to_world = np.array([names.index(name) for name in self.world.joint_names])
        self._to_model = np.array([self.world.joint_names.index(name) for name in names])
        motion = TrunkMotion(scenario.gait, HEIGHT, np.random.default_rng(motion_seed), scenario.extent, scenario.speed)
        trot = Trot(len(FEET)) if scenario.gait in WALKS else None
        self._controller = QuadrupedController(self.base, motion, trot, self._ground)
        self._imu_rotation = rotation_of(scenario.imu_rpy)
        self._every = CONTROL_RATE // scenario.rate
        self._schedule = _schedule(scenario)
        self._hoist: Hoist | None = None
        if scenario.hoist_time is not None:
            self._hoist = Hoist(self.world, scenario.hoist_time, scenario.hoist_time + scenario.hoist_duration)
        self._stand()
        self._k = -round(SETTLE_TIME * CONTROL_RATE)
        self._steps: deque[QuadrupedState] = deque(maxlen=2 * (self._every // 2) + 1)
        while self._k < -(self._every // 2):
            self._physics_step()
        self._steps.clear()

    def _stand(self) -> None:
        q = np.tile(_POSTURE, len(FEET))
        centres, _ = self.base.contacts.jacobians(np.concatenate([np.zeros(FREE), q]))
        if self.scenario.lifted_foot:
            self._controller.lifted = FEET.index(self.scenario.lifted_foot)
        slide = HEIGHT * (self._ground.T @ _GRAVITY)[:2] / (self._ground.T @ _GRAVITY)[2]
        hips = centres[:, :2] - centres[:, :2].mean(axis=0) + 0.0
        place = np.zeros(2)
        if self._controller.lifted is not None:
            # the trunk goes over the triangle of the others
            place = 0.8 * np.delete(hips, self._controller.lifted, axis=0).mean(axis=0)
        q = self._posture(hips - slide - place)
        position = np.array([*place, HEIGHT])
        self._controller.start(place, hips)
        self.world.reset(self._ground, self._ground @ position, q[self._to_world])

    def _posture(self, feet: FloatArray) -> FloatArray:
        """Joint positions (n,) that put the feet at (k, 2) [m] in the trunk, on the ground."""
        goal = np.column_stack([feet, np.full(len(feet), -HEIGHT) + self.base.foot_radius])
        q = np.tile(_POSTURE, len(FEET)).astype(float)
        for _ in range(50):
            centres, jacobians = self.base.contacts.jacobians(np.concatenate([np.zeros(FREE), q]))
            error = (goal - centres).ravel()
            q = q + np.linalg.lstsq(jacobians[:, :3, FREE:].reshape(-1, q.size), error, rcond=1e-6)[0]
            if np.abs(error).max() < 1e-9:
                break
        return q

    @property
    def carries(self) -> bool:
        return self.world.body.tied

    def _tie(self, payload: Payload) -> None:
        self.world.body.tie(payload)
        if self.scenario.controller_knows_payload:
            self._controller.load = payload.theta

    def _untie(self) -> None:
        self.world.body.untie(remove=True)
        self._controller.load = np.zeros(10)

    def step(self) -> QuadrupedState:
        half = self._every // 2
        for _ in range(self._every if self._steps else 2 * half + 1):
            self._physics_step()
        weight = np.ones(2 * half + 1)
        if self._every % 2 == 0:
            weight[[0, -1]] = 0.5
        force = np.average([step.specific_force for step in self._steps], axis=0, weights=weight)
        step = self._steps[half]
        orientation = np.array(quaternion(step.orientation))
        return replace(step, orientation=orientation, specific_force=force)

    def noisy(self, exact: QuadrupedState) -> QuadrupedState:
        s, n = self.scenario, self.base.legs.n
        joints, imu, chance = self._noise.standard_normal((3, n)), self._noise.standard_normal((2, 3)), self._noise.random(2)
        contacts = exact.contacts.copy()
        if chance[0] < s.contact_error:
            foot = int(chance[1] * contacts.size)
            contacts[foot] = 1.0 - contacts[foot]
        return QuadrupedState(
            exact.t,
            exact.q + s.encoder_noise * joints[0],
            exact.v + s.velocity_noise * joints[1],
            exact.tau + s.torque_noise * joints[2],
            exact.orientation,
            exact.omega + s.gyro_noise * imu[0] + np.array(s.gyro_bias),
            exact.specific_force + s.accelerometer_noise * imu[1] + np.array(s.accelerometer_bias),
            contacts,
            exact.forces,
        )

    def _physics_step(self) -> None:
        t = self.t
        while self._schedule and self._k >= self._schedule[0][0]:
            _, kind = self._schedule.pop(0)
            _ = self.pick() if kind == "pick" else self.drop()
        world = self.world
        trunk, q, v = world.trunk, world.q[self._to_model], world.v[self._to_model]
        if self._hoist is not None and self._hoist.active(t):
            self._hoist.pull(t)
            tau = self._controller.hold(q, v)
            if not self._hoist.active(t + STEP):
                self._controller.resume(trunk)
        else:
            tau = self._controller.torque(t, STEP, trunk, q, v)
        limit = self.base.legs.effort_limit
        tau = np.clip(tau, -limit, limit)
        world.step(tau[self._to_world])
        self._check_stands(t)
        self._steps.append(self._observe(t, trunk, q, v, tau))
        self._k += 1

    def _observe(self, t: float, trunk: TrunkState, q: FloatArray, v: FloatArray, tau: FloatArray) -> QuadrupedState:
        after, place = self.world.trunk, np.array(self.scenario.imu_xyz)
        axes = trunk.rotation @ self._imu_rotation
        acceleration = (after.velocity_of(place) - trunk.velocity_of(place)) / STEP
        omega = 0.5 * (trunk.omega + after.omega)
        forces = self.world.foot_forces
        return QuadrupedState(
            t=t,
            q=q,
            v=0.5 * (v + self.world.v[self._to_model]),
            tau=tau,
            orientation=axes,
            omega=axes.T @ omega,
            specific_force=axes.T @ (acceleration - _GRAVITY),
            contacts=(forces @ self._ground[:, 2] > _TOUCHES).astype(float),
            forces=forces @ trunk.rotation,
        )

    def _check_stands(self, t: float) -> None:
        height = float(self._ground[:, 2] @ self.world.trunk.position)
        if not 0.1 < height < 0.5:
            raise fallen(self.scenario, t)

    def truth(self, start_time: float = 0.0) -> dict[str, Any]:
        """All that the recording hides, in plain types; times are stamps, ``start_time`` [s] is the first one."""
        s = self.scenario
        noise = ("encoder", "velocity", "torque", "gyro", "accelerometer")
        placed = ("imu_xyz", "imu_rpy", "gyro_bias", "accelerometer_bias")
        return self._truth(
            s,
            start_time,
            contact_frames=list(FEET),
            imu_frame=IMU_LINK,
            gait=s.gait,
            slope=s.slope,
            slope_heading=s.slope_heading,
            lifted_foot=s.lifted_foot or None,
            grip=s.grip,
            sink=s.sink,
            noise={name: getattr(s, f"{name}_noise") for name in noise} | {"contact_error": s.contact_error},
            imu={name.removeprefix("imu_"): list(getattr(s, name)) for name in placed},
        )


def _schedule(scenario: QuadrupedScenario) -> list[tuple[int, str]]:
    if scenario.payload_mass is None:
        return []
    times = [(-SETTLE_TIME if scenario.pick_time is None else scenario.pick_time, "pick"), (scenario.drop_time, "drop")]
    return [(round(t * CONTROL_RATE), kind) for t, kind in times if t is not None and math.isfinite(t)]
