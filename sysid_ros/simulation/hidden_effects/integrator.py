"""The compiled loop: a controlled arm, step by step, with everything that its joints hide."""

from typing import NamedTuple

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects.chain import Chain, force_torque, inverse_dynamics, mass_matrix, place
from sysid_ros.simulation.hidden_effects.joint_physics import (
    Joints,
    compliance_torque,
    dry_levels,
    invert,
    motor_side_torque,
    smooth_damping,
    solve_dry_friction,
    spring_torque,
)

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}
FREQUENCY = 25.0
"""Of the position control [rad/s]."""
DAMPING = 0.8
COMMAND_MARGIN = 2.0
"""A saturated motor is asked for at most this multiple of its limit."""
_LOST = 1.0


class State(NamedTuple):
    """What a step starts from, what it ends with, and scratch; shape (n,) where nothing else is said.

    Attributes:
        q, v: of the links. angle, rate: of the motors, the same where the joint is rigid.
        v_next, rate_next: at the step's end. acceleration: of the links in the step.
        command: torque asked of the motors. link_torque: on the links.
        bristle, friction: memory of the dry friction.
        vectors: shape (8, n). matrices: (3, n, n). rotation, offset, work: see :mod:`.chain`.
    """

    q: FloatArray
    v: FloatArray
    angle: FloatArray
    rate: FloatArray
    v_next: FloatArray
    rate_next: FloatArray
    acceleration: FloatArray
    command: FloatArray
    link_torque: FloatArray
    bristle: FloatArray
    friction: FloatArray
    vectors: FloatArray
    matrices: FloatArray
    rotation: FloatArray
    offset: FloatArray
    work: FloatArray


def state_at(links: FloatArray, motors: FloatArray) -> State:
    """At rest, with positions of links and motors of shape (n,) [rad]."""
    n = links.size
    arrays = {name: np.zeros(n) for name in State._fields}
    arrays |= {"q": links.copy(), "angle": motors.copy(), "vectors": np.zeros((8, n)), "matrices": np.zeros((3, n, n))}
    arrays |= {"rotation": np.zeros((n, 3, 3)), "offset": np.zeros((n, 3)), "work": np.zeros((6, n + 1, 3))}
    return State(**arrays)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _control(joints: Joints, stiffening: FloatArray, wanted: FloatArray, state: State) -> None:
    """Torque asked of each motor and, in place of the feedforward, what it gives; with the damping of the feedback."""
    angle, rate, command, n = state.angle, state.rate, state.command, state.q.size
    feedforward, u, damping, mass = state.vectors[1], state.vectors[3], state.vectors[5], state.matrices[0]
    for j in range(n):
        u[j] = FREQUENCY**2 * (wanted[0, j] - angle[j]) + 2.0 * DAMPING * FREQUENCY * (wanted[1, j] - rate[j])
    for j in range(n):
        command[j] = feedforward[j] + (joints.rotor[j] + stiffening[j]) * u[j]
        for i in range(n):
            command[j] += mass[j, i] * u[i]
        bound = COMMAND_MARGIN * joints.limit[j]
        command[j] = min(max(command[j], -bound), bound)
        torque = min(max(command[j], -joints.limit[j]), joints.limit[j])
        # no damping of the feedback at the step's end where the motor is at its limit
        damping[j] = 2.0 * DAMPING * FREQUENCY * stiffening[j] if torque == command[j] else 0.0
        feedforward[j] = torque


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _load_joint(joints: Joints, j: int, t: float, h: float, state: State) -> None:
    """What joint j puts on its link: its row of the system, the right-hand side in place of the velocity, levels of friction."""
    q, v, angle, rate, n = state.q, state.v, state.angle, state.rate, state.q.size
    bias, motor, push, rhs = state.vectors[0], state.vectors[1], state.vectors[2], state.vectors[4]
    damping, forward, backward = state.vectors[5], state.vectors[6], state.vectors[7]
    mass, system = state.matrices[0], state.matrices[1]
    # friction belongs to the mean of the velocities before and after the step, which is what a row says
    speed = rate[j] if joints.stiffness[j] > 0.0 else rhs[j]
    level_forward, level_backward = dry_levels(joints, j, t, q, speed, state.link_torque[j])
    viscous = smooth_damping(joints, j, t, q)
    slope = 0.5 * viscous + joints.quadratic[j] * abs(rate[j]) + damping[j]
    drive = motor[j] - viscous * rate[j] - joints.quadratic[j] * abs(rate[j]) * rate[j]
    drive -= motor_side_torque(joints, j, t, angle[j])
    if joints.presliding[j] > 0.0:
        z_s = joints.presliding[j]
        state.bristle[j] = (state.bristle[j] + h * rate[j]) / (1.0 + h * abs(rate[j]) / z_s)
        drive -= level_forward * state.bristle[j] / z_s
        level_forward = level_backward = 0.0
    forward[j], backward[j] = level_forward, level_backward
    for i in range(n):
        system[j, i] = mass[j, i]
    rhs[j] = push[j] - spring_torque(joints, j, q[j]) - bias[j]
    if joints.stiffness[j] > 0.0:
        carried = compliance_torque(joints, j, angle[j] - q[j], rate[j] - v[j])
        rhs[j] += carried
        inertia = joints.rotor[j] + joints.motor_inertia[j] + h * slope
        free = rate[j] + h * (drive - carried) / inertia
        dry = min(max(free * inertia / h, -level_backward), level_forward)
        state.rate_next[j] = free - h * dry / inertia
        forward[j] = backward[j] = 0.0
    else:
        rhs[j] += drive
        system[j, j] += joints.rotor[j] + h * slope


@njit(**_JIT)  # type: ignore[untyped-decorator]
def solve_step(
    believed: Chain,
    links: Chain,
    joints: Joints,
    force: FloatArray,
    stiffening: FloatArray,
    wanted: FloatArray,
    t: float,
    h: float,
    state: State,
) -> None:
    """Velocities at the end of a step of length h that starts at t, and the torques that lead there; positions stay.

    ``believed`` is the controller's model, ``links`` the true ones; ``wanted``, shape (3, n), is q, v, a to follow. The damping
    of the feedback by ``stiffening`` acts on the velocity at the step's end, which keeps wrists that weigh nothing stable.
    """
    q, v, angle, rate, command = state.q, state.v, state.angle, state.rate, state.command
    rotation, offset, work, n = state.rotation, state.offset, state.work, state.q.size
    bias, feedforward, push, rhs = state.vectors[0], state.vectors[1], state.vectors[2], state.vectors[4]
    damping, forward, backward = state.vectors[5], state.vectors[6], state.vectors[7]
    mass, system, response = state.matrices[0], state.matrices[1], state.matrices[2]
    place(believed, angle, rotation, offset)
    inverse_dynamics(believed, rotation, offset, rate, wanted[2], 1.0, feedforward, work)
    place(links, q, rotation, offset)
    mass_matrix(links, rotation, offset, mass, work)
    # Coriolis torques belong to the velocity in the middle of the steps before and after, like the position's second difference
    for j in range(n):
        rhs[j] = v[j] + 0.5 * h * state.acceleration[j]
    push[:] = 0.0
    inverse_dynamics(links, rotation, offset, rhs, push, 1.0, bias, work)
    if np.any(force != 0.0):
        force_torque(links, rotation, offset, force, push)
    _control(joints, stiffening, wanted, state)
    for j in range(n):
        _load_joint(joints, j, t, h, state)
    invert(system, response)
    for i in range(n):
        state.v_next[i] = v[i]
        for j in range(n):
            response[i, j] *= h
            state.v_next[i] += response[i, j] * rhs[j]
    solve_dry_friction(state.v_next, response, forward, backward, state.friction)
    for j in range(n):
        state.acceleration[j] = (state.v_next[j] - v[j]) / h
    for j in range(n):
        state.link_torque[j] = bias[j] - push[j]
        for i in range(n):
            state.link_torque[j] += mass[j, i] * state.acceleration[i]
        if joints.stiffness[j] == 0.0:
            state.rate_next[j] = state.v_next[j]
        command[j] -= damping[j] * (state.rate_next[j] - rate[j])


@njit(**_JIT)  # type: ignore[untyped-decorator]
def integrate(
    believed: Chain,
    before: Chain,
    after: Chain,
    change_time: float,
    joints: Joints,
    force: FloatArray,
    stiffening: FloatArray,
    reference: FloatArray,
    reference_period: float,
    steps_per_reference: int,
    stride: int,
    state: State,
    out: FloatArray,
) -> int:
    """Follow a reference; how many rows of ``out`` were filled (all, unless the arm was lost).

    Args:
        believed: the controller's model. before, after: the true links before and from ``change_time`` [s] on.
        force: in the world, on the tip link's origin, shape (3,) [N].
        stiffening: inertia that the feedback is weighted with beside the true one, shape (n,) [kg m^2].
        reference: q, v, a wanted, shape (K, 3, n), every ``reference_period`` [s].
        stride: steps a row of ``out``.
        out: shape (rows, 3, n): position and velocity at the motor, torque asked of the motor.

    Semi-implicit Euler. The control is as fast as the physics, so the torque belongs to the row's instant; the velocity of a
    row is the mean of the steps before and after it.
    """
    n = reference.shape[2]
    h = reference_period / steps_per_reference
    wanted = np.zeros((3, n))
    row = 0
    for step in range(out.shape[0] * stride):
        t = step * h
        k, part = step // steps_per_reference, (step % steps_per_reference) / steps_per_reference
        for i in range(3):
            for j in range(n):
                wanted[i, j] = (1.0 - part) * reference[k, i, j] + part * reference[k + 1, i, j]
        solve_step(believed, before if t < change_time else after, joints, force, stiffening, wanted, t, h, state)
        if step % stride == 0:
            for j in range(n):
                out[row, 0, j] = state.angle[j]
                out[row, 1, j] = 0.5 * (state.rate[j] + state.rate_next[j])
                out[row, 2, j] = state.command[j]
            row += 1
        for j in range(n):
            state.q[j] += h * state.v_next[j]
            state.v[j] = state.v_next[j]
            state.angle[j] = state.angle[j] + h * state.rate_next[j] if joints.stiffness[j] > 0.0 else state.q[j]
            state.rate[j] = state.rate_next[j]
            if not abs(state.angle[j] - wanted[0, j]) < _LOST:
                return row
    return row
