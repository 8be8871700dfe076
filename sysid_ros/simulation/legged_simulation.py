"""LeggedSimulation: a robot on legs in MuJoCo, step by step, with its IMU at a rate of its own."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.floating.standing import inverse
from sysid_ros.robot.rotation import quaternion, rotation_of
from sysid_ros.sample import FREE, FloatArray, ImuRecord
from sysid_ros.simulation.gait_sequence import GaitSequence
from sysid_ros.simulation.legged_ground import LeggedGround
from sysid_ros.simulation.legged_robot import IMU_LINK, LeggedRobot
from sysid_ros.simulation.legged_scenario import OWN, SHIFT, LeggedScenario
from sysid_ros.simulation.legged_world import STEP, LeggedWorld
from sysid_ros.simulation.payload import Payload, box
from sysid_ros.simulation.played_motion import PlayedMotion
from sysid_ros.simulation.quadruped_scenario import SETTLE_TIME, fallen
from sysid_ros.simulation.quadruped_state import QuadrupedState
from sysid_ros.simulation.scenario import CONTROL_RATE
from sysid_ros.simulation.simulation import Simulation

_GRAVITY = np.array([0.0, 0.0, -9.81])
_BENDS = 0.06
"""By how much the weight on a leg bends it [rad]."""
_DAMPED, _MOST_DAMPED = 0.02, 0.2
"""Damping of the joints' controllers over their stiffness [s], and at most over the inertia of the joint times steps a second:
with more, a controller that works in steps chatters."""
_TOUCHES = 1.0
_PUSH, _PUSHED = 0.25, 0.3
"""Part of the weight that a push has, and how long it lasts [s]."""


class LeggedSimulation(Simulation[QuadrupedState]):
    """The robot of a scenario, one message of its joints at a time.

    A message at t holds positions and torques at t, and the mean of the velocities before and after the step that begins at t.
    The IMU shows the mean of the specific force since its message before, at the middle of that time, or that of one step.

    Args:
        scenario: what is simulated.

    Attributes:
        legged: the robot as it is described. imu: readings so far, at most a second of them: time at which they are stamped [s],
            and what they tell, as :class:`.ImuRecord`, without noise.
    """

    def __init__(self, scenario: LeggedScenario) -> None:
        self.legged = LeggedRobot.of(scenario.robot, scenario.imu_xyz, scenario.imu_rpy, scenario.foot_spheres)
        base = self.legged.base
        super().__init__(scenario, self.legged.urdf, base.trunk)
        self.scenario: LeggedScenario = scenario
        self.robot = base.legs
        motion, noise, hidden = (np.random.default_rng(s) for s in np.random.SeedSequence(scenario.seed).spawn(3))
        self._noise = noise
        n = base.legs.n
        self.hidden: dict[str, FloatArray] = {
            name: getattr(scenario, name) * hidden.uniform(0.7, 1.3, n)
            for name in ("leg_friction", "leg_damping", "rotor_inertia")
        }
        scale = {name: 1.0 + scenario.mass_error * float(np.clip(hidden.normal(), -2.5, 2.5)) for name in _links(self.urdf)}
        self._ground = LeggedGround(scenario.grip, scenario.sink, scenario.stairs)
        drives, normal = tuple(self.hidden.values()), scenario.ground.T[:, 2]
        self.world: LeggedWorld = LeggedWorld(self.legged, scale, drives, normal, self._ground)
        self.world.shift_trunk(np.array(scenario.trunk_com))
        self._gait = GaitSequence(scenario.gait, self.legged.feet, motion, scenario.extent, scenario.speed)
        self._played = PlayedMotion(Path(scenario.motion), base.legs.joint_names) if scenario.motion else None
        lift = np.abs(self.legged.feet[:, 2]).mean()
        self._stiffness = base.mass * 9.81 / 4.0 * 0.5 * lift / _BENDS
        rest, n = np.zeros(base.legs.n), base.legs.n
        still = base.legs.rnea(self.legged.posture, rest, rest).copy()
        inertia = np.array([(base.legs.rnea(self.legged.posture, rest, e) - still)[j] for j, e in enumerate(np.eye(n))])
        self._damping = np.minimum(_DAMPED * self._stiffness, _MOST_DAMPED * (inertia + self.hidden["rotor_inertia"]) / STEP)
        self._imu_every = CONTROL_RATE // (scenario.imu_rate or scenario.rate)
        self._every = CONTROL_RATE // scenario.rate
        self._axes = rotation_of(scenario.imu_rpy) @ rotation_of(scenario.imu_tilt)
        self._place = np.array(scenario.imu_xyz) + np.array(scenario.imu_lever)
        self._felt: deque[tuple[FloatArray, FloatArray]] = deque(maxlen=self._imu_every)
        self.imu: deque[ImuRecord] = deque(maxlen=CONTROL_RATE)
        self._contacts: deque[FloatArray] = deque(maxlen=round(scenario.contact_delay * CONTROL_RATE) + 1)
        self._schedule = _schedule(scenario)
        self.world.reset(self.legged.height + 0.002, self.legged.posture)
        self._target = self.legged.posture.copy()
        self._k = -round((SETTLE_TIME + 1.0) * CONTROL_RATE)
        while self._k < 0:
            self._physics_step()

    @property
    def carries(self) -> bool:
        return self.world.tied

    def _tie(self, payload: Payload) -> None:
        self.world.tie(payload)

    def _untie(self) -> None:
        self.world.untie()

    def _shift(self) -> bool:
        """The load slips to another place."""
        if self.payload is None or not self.carries:
            return False
        self.world.tie(self.shifted)
        self.events.append((self.t, "shift"))
        return True

    @property
    def shifted(self) -> Payload:
        """The load where it slips to."""
        s = self.scenario
        assert s.payload_mass is not None
        return box(s.payload_mass, np.add(s.payload_com, SHIFT).tolist(), s.payload_size, s.payload_rpy)

    def step(self) -> QuadrupedState:
        state = self._physics_step()
        for _ in range(self._every - 1):
            self._physics_step()
        return state

    def noisy(self, exact: QuadrupedState) -> QuadrupedState:
        s, n = self.scenario, self.robot.n
        joints, chance = self._noise.standard_normal((3, n)), self._noise.random(2)
        contacts = exact.contacts.copy()
        if chance[0] < s.contact_error:
            foot = int(chance[1] * contacts.size)
            contacts[foot] = 1.0 - contacts[foot]
        q = exact.q + s.encoder_noise * joints[0]
        if s.encoder_step > 0.0:
            q = s.encoder_step * np.round(q / s.encoder_step)
        return QuadrupedState(
            exact.t,
            q,
            exact.v + s.velocity_noise * joints[1],
            exact.tau + s.torque_noise * joints[2],
            exact.orientation,
            exact.omega,
            exact.specific_force,
            contacts,
            exact.forces,
        )

    def noisy_imu(self, exact: ImuRecord) -> ImuRecord:
        """A reading of the IMU with its noise and its biases."""
        s, noise = self.scenario, self._noise.standard_normal((2, 3))
        omega = np.asarray(exact.omega) + s.gyro_noise * noise[0] + np.array(s.gyro_bias)
        force = np.asarray(exact.specific_force) + s.accelerometer_noise * noise[1] + np.array(s.accelerometer_bias)
        return ImuRecord(exact.stamp, exact.receive_time, exact.frame_id, exact.orientation, omega, force)

    def _physics_step(self) -> QuadrupedState:
        t = self.t
        while self._schedule and self._k >= self._schedule[0][0]:
            _, kind = self._schedule.pop(0)
            _ = {"pick": self.pick, "drop": self.drop, "shift": self._shift}[kind]()
        world, s = self.world, self.scenario
        trunk, q, v = world.trunk, world.q, world.v
        heading = math.atan2(trunk.rotation[1, 0], trunk.rotation[0, 0])
        c, d = math.cos(heading), math.sin(heading)
        ahead = np.array([c * trunk.velocity[0] + d * trunk.velocity[1], c * trunk.velocity[1] - d * trunk.velocity[0]])
        tilt = np.array(
            [math.atan2(trunk.rotation[2, 1], trunk.rotation[2, 2]), -math.asin(min(max(trunk.rotation[2, 0], -1), 1))]
        )
        before, self._target = self._target, self._wanted(t, ahead, tilt)
        wanted = (self._target - before) / STEP
        tau = self._stiffness * (self._target - q) + self._damping * (wanted - v)
        tau += self._held_up(q)
        tau = np.clip(tau, -self.robot.effort_limit, self.robot.effort_limit)
        pushed = s.push_time is not None and s.push_time <= t < s.push_time + _PUSHED
        world.push(np.array([0.0, _PUSH * 9.81 * self.legged.base.mass, 0.0]) if pushed else np.zeros(3))
        world.step(tau)
        self._check_stands(t)
        state = self._observe(t, q, v, tau, trunk.rotation)
        self._feel(t, trunk)
        self._k += 1
        return state

    def _wanted(self, t: float, ahead: FloatArray, tilt: FloatArray) -> FloatArray:
        """Positions that the joints are to hold at t [s], shape (n,), for velocity ahead and tilt of the trunk, shape (2,)."""
        if self._played is not None:
            return self._played.at(t, self.legged.posture)
        ground = self._ground_at if self.scenario.stairs > 0.0 else None
        places = self._gait.places(max(t, 0.0), STEP if t > 0.0 else 0.0, ahead, tilt, ground)
        goal = places + np.outer(self.legged.radius, [0.0, 0.0, 1.0])
        return inverse(self.legged.base, self.legged.leg_joints, self._target, goal, steps=2)

    def _ground_at(self, place: FloatArray) -> float:
        """Height of the ground at a place in the trunk, shape (2,) [m]."""
        trunk = self.world.trunk
        heading = math.atan2(trunk.rotation[1, 0], trunk.rotation[0, 0])
        ahead = trunk.position[0] + math.cos(heading) * place[0] - math.sin(heading) * place[1]
        return self._ground.height(float(ahead))

    def _held_up(self, q: FloatArray) -> FloatArray:
        """Torques (n,) by which the feet that are to stand hold the empty robot, without which the legs would bend under it."""
        base, stands = self.legged.base, self._gait.stands
        _, jacobians = base.contacts.jacobians(np.concatenate([np.zeros(FREE), q]))
        share = base.mass * 9.81 / max(int(stands.sum()), 2)
        return np.asarray(-share * (stands @ jacobians[:, 2, FREE:]))

    def _observe(self, t: float, q: FloatArray, v: FloatArray, tau: FloatArray, rotation: FloatArray) -> QuadrupedState:
        world = self.world
        self._contacts.append((world.forces[:, 2] > _TOUCHES).astype(float))
        nothing = np.zeros(3)
        contacts, forces = self._contacts[0], world.forces @ rotation
        return QuadrupedState(t, q, 0.5 * (v + world.v), tau, np.zeros(4), nothing, nothing, contacts, forces)

    def _feel(self, t: float, before: Any) -> None:
        """Let the IMU measure the step that began at t [s]."""
        after, s, axes = self.world.trunk, self.scenario, before.rotation @ self._axes
        acceleration = (after.velocity_of(self._place) - before.velocity_of(self._place)) / STEP
        gravity = s.ground.T @ _GRAVITY
        self._felt.append((axes.T @ (0.5 * (before.omega + after.omega)), axes.T @ (acceleration - gravity)))
        if t < 0.0 or (self._k + 1) % self._imu_every:
            return
        omega, force = self._felt[-1]
        middle = t
        if s.imu_low_pass:
            omega, force = np.mean([x[0] for x in self._felt], axis=0), np.mean([x[1] for x in self._felt], axis=0)
            middle = t - 0.5 * (len(self._felt) - 1) * STEP
        stamp = middle + s.imu_delay
        self.imu.append(ImuRecord(stamp, t, IMU_LINK, np.array(quaternion(axes)), omega, force))

    def _check_stands(self, t: float) -> None:
        trunk = self.world.trunk
        height = trunk.position[2] - self._ground.height(trunk.position[0])
        if not 0.4 * self.legged.height < height < 2.0 * self.legged.height or trunk.rotation[2, 2] < 0.6:
            raise fallen(self.scenario, t)

    def truth(self, start_time: float = 0.0) -> dict[str, Any]:
        """All that the recording hides, in plain types; times are stamps, ``start_time`` [s] is the first one."""
        s = self.scenario
        noise = ("encoder", "velocity", "torque", "gyro", "accelerometer")
        placed = ("imu_xyz", "imu_rpy", "gyro_bias", "accelerometer_bias")
        return self._truth(
            s,
            start_time,
            simulator="mujoco",
            contact_frames=list(self.legged.base.contact_frames),
            imu_frame=IMU_LINK,
            gait=s.gait,
            slope=s.slope,
            slope_heading=s.slope_heading,
            foot_radius=self.legged.radius.tolist(),
            grip=s.grip,
            sink=s.sink,
            links_off=self.world.heavier,
            shifted=s.shift_time and {"theta": self.shifted.theta.tolist()},
            hidden={name: values.tolist() for name, values in self.hidden.items()},
            noise={name: getattr(s, f"{name}_noise") for name in noise} | {"contact_error": s.contact_error},
            imu={name.removeprefix("imu_"): list(getattr(s, name)) for name in placed},
            settings={name: value for name in OWN if isinstance(value := getattr(s, name), int | float | str | tuple | None)},
        )


def _links(urdf: str) -> list[str]:
    links = ElementTree.fromstring(urdf).findall("link")
    return [str(link.get("name")) for link in links if link.find("inertial") is not None]


def _schedule(scenario: LeggedScenario) -> list[tuple[int, str]]:
    if scenario.payload_mass is None:
        return []
    begin = -SETTLE_TIME if scenario.pick_time is None else scenario.pick_time
    times = [(begin, "pick"), (scenario.drop_time, "drop"), (scenario.shift_time, "shift")]
    return sorted((round(t * CONTROL_RATE), kind) for t, kind in times if t is not None and math.isfinite(t))
