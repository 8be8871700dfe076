"""The compiled loop: a controlled arm, step by step, with everything that its joints hide."""

from __future__ import annotations

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
COMMAND_MARGIN = 1.3
"""A saturated motor is asked for at most this multiple of its limit."""


@njit(**_JIT)  # type: ignore[untyped-decorator]
def integrate(
    believed: Chain,
    before: Chain,
    after: Chain,
    change_time: float,
    joints: Joints,
    force: FloatArray,
    stiffening: FloatArray,
    link_start: FloatArray,
    reference: FloatArray,
    reference_period: float,
    steps_per_reference: int,
    stride: int,
    out: FloatArray,
) -> int:
    """Follow a reference; how many rows of ``out`` were filled (all, unless the arm was lost).

    Args:
        believed: the controller's model. before, after: the true links before and from ``change_time`` [s] on.
        force: in the world, on the tip link's origin, shape (3,) [N].
        stiffening: inertia that the feedback is weighted with beside the true one, shape (n,) [kg m^2].
        link_start: positions of the links at the start, shape (n,) [rad]; the motors start on the reference.
        reference: q, v, a wanted, shape (K, 3, n), every ``reference_period`` [s].
        stride: steps a row of ``out``.
        out: shape (rows, 4, n): position and velocity at the motor, torque asked of the motor, position of the link.

    The control is as fast as the physics, so the torque belongs to the row's instant. Its damping by ``stiffening`` acts on the
    velocity at the step's end, which keeps wrists that weigh nothing stable.
    """
    n = reference.shape[2]
    h = reference_period / steps_per_reference
    q, v = link_start.copy(), reference[0, 1].copy()
    angle, rate = reference[0, 0].copy(), v.copy()
    bristle, f, link_torque = np.zeros(n), np.zeros(n), np.zeros(n)
    rotation, offset, work = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros((6, n + 1, 3))
    bias, feedforward, push = np.zeros(n), np.zeros(n), np.zeros(n)
    mass, system, response = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    u, command, torque, rhs, damping = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    forward, backward, v_next, rate_next = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    still, wanted = np.zeros(n), np.zeros((3, n))
    pushed = np.any(force != 0.0)
    row = 0
    for step in range(out.shape[0] * stride):
        t = step * h
        k, part = step // steps_per_reference, (step % steps_per_reference) / steps_per_reference
        for i in range(3):
            for j in range(n):
                wanted[i, j] = (1.0 - part) * reference[k, i, j] + part * reference[k + 1, i, j]
        place(believed, angle, rotation, offset)
        inverse_dynamics(believed, rotation, offset, rate, wanted[2], 1.0, feedforward, work)
        links = before if t < change_time else after
        place(links, q, rotation, offset)
        mass_matrix(links, rotation, offset, mass, work)
        inverse_dynamics(links, rotation, offset, v, still, 1.0, bias, work)
        if pushed:
            force_torque(links, rotation, offset, force, push)
        for j in range(n):
            u[j] = FREQUENCY**2 * (wanted[0, j] - angle[j]) + 2.0 * DAMPING * FREQUENCY * (wanted[1, j] - rate[j])
        for j in range(n):
            command[j] = feedforward[j] + (joints.rotor[j] + stiffening[j]) * u[j]
            for i in range(n):
                command[j] += mass[j, i] * u[i]
            bound = COMMAND_MARGIN * joints.limit[j]
            command[j] = min(max(command[j], -bound), bound)
            torque[j] = min(max(command[j], -joints.limit[j]), joints.limit[j])
            # damping of the feedback at the step's end, unless the motor is at its limit
            damping[j] = 2.0 * DAMPING * FREQUENCY * stiffening[j] if torque[j] == command[j] else 0.0
        for j in range(n):
            level_forward, level_backward = dry_levels(joints, j, t, q, rate[j], link_torque[j])
            viscous = smooth_damping(joints, j, t, q)
            slope = viscous + 2.0 * joints.quadratic[j] * abs(rate[j]) + damping[j]
            drive = torque[j] - viscous * rate[j] - joints.quadratic[j] * abs(rate[j]) * rate[j]
            drive -= motor_side_torque(joints, j, t, angle[j])
            if joints.presliding[j] > 0.0:
                z_s = joints.presliding[j]
                bristle[j] = (bristle[j] + h * rate[j]) / (1.0 + h * abs(rate[j]) / z_s)
                drive -= level_forward * bristle[j] / z_s
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
                f[j] = min(max(free * inertia / h, -level_backward), level_forward)
                rate_next[j] = free - h * f[j] / inertia
                forward[j] = backward[j] = 0.0
            else:
                rhs[j] += drive
                system[j, j] += joints.rotor[j] + h * slope
        invert(system, response)
        for i in range(n):
            v_next[i] = v[i]
            for j in range(n):
                response[i, j] *= h
                v_next[i] += response[i, j] * rhs[j]
        solve_dry_friction(v_next, response, forward, backward, f)
        for j in range(n):
            link_torque[j] = bias[j]
            for i in range(n):
                link_torque[j] += mass[j, i] * (v_next[i] - v[i]) / h
        if step % stride == 0:
            for j in range(n):
                elastic = joints.stiffness[j] > 0.0
                reached = rate_next[j] if elastic else v_next[j]
                out[row, 0, j] = angle[j]
                out[row, 1, j] = 0.5 * (rate[j] + reached)
                out[row, 2, j] = command[j] - damping[j] * (reached - rate[j])
                out[row, 3, j] = q[j]
            row += 1
        for j in range(n):
            q[j] += h * v_next[j]
            v[j] = v_next[j]
            if joints.stiffness[j] > 0.0:
                angle[j] += h * rate_next[j]
                rate[j] = rate_next[j]
            else:
                angle[j], rate[j] = q[j], v[j]
            if not abs(angle[j] - wanted[0, j]) < 1.0:
                return row
    return row
