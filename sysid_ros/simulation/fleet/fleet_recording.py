"""What a bag of a simulated fleet holds: the motion that its controller held, and the efforts that it took."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.fleet.drawn_fleet import Fleet, FleetBag
from sysid_ros.simulation.fleet.stated_errors import with_carried

_ENCODER, _SPEED = 2e-5, 1e-3
"""Noise of positions [rad] and velocities [rad/s]."""


@dataclass(frozen=True, eq=False, slots=True)
class FleetRecording:
    """Messages: t (N,) since the first one [s], q, v, tau (N, n)."""

    t: FloatArray
    q: FloatArray
    v: FloatArray
    tau: FloatArray


def record(fleet: Fleet, bag: FleetBag) -> FleetRecording:
    """The recording of a bag: ``tau = gain (ID(q - delta) + J a + Fc sign(v) + b v) + offset + noise``, late by its delay.

    The controller holds what its encoders say: a zero that slipped by delta turns the true posture by -delta.
    """
    scenario, robot, true = fleet.scenario, fleet.robots[bag.robot], bag.parameters
    model, rng = robot.model, np.random.default_rng([scenario.seed, bag.seed])
    t = np.arange(round(scenario.duration * scenario.rate)) / scenario.rate
    q, v, a = robot.programs[bag.program].sample(t)
    posture = q - true["joint_offset"]
    links = with_carried(model, bag.carried).rnea_along(posture, v, a)
    drive = true["rotor_inertia"] * a + true["coulomb_friction"] * smoothed_sign(v) + true["viscous_friction"] * v
    exact = true["torque_gain"] * (links + drive) + true["torque_offset"]
    late = np.column_stack([np.interp(t - d, t, column) for d, column in zip(true["torque_delay"], exact.T, strict=True)])
    noise = rng.standard_normal((3, *q.shape))
    return FleetRecording(t, q + _ENCODER * noise[0], v + _SPEED * noise[1], late + true["noise"] * noise[2])
