"""What stands between a motor's torque and the links: friction, springs, ripple, compliance, as one compiled step.

One step of length h, with the motor on the joint (rigid) or behind a spring (elastic, or with a gap)::

    rigid    M(q) a + C v + g = tau - J a - f(v+) - s(q) + J_tip' F
    elastic  M(q) a + C v + g = T - s(q) + J_tip' F,      (J + Jm) alpha = tau - f(omega+) - T
             T = k dead_zone(theta - q) + d (omega - v)

    f(v) = b v + c abs(v) v + ripple(q) + dry friction
    dry  = level sign(v), any value in between at rest
    level = Fc + (Fs - Fc) exp(-(v / vs)^2) + mu abs(link torque) + rate t, never negative
    or, with a presliding displacement z_s:  Fc z / z_s,  dz/dt = v - abs(v) z / z_s
    s(q) = k (q - q0) + k_b sin(q - q_b)

Dry friction is solved for with the velocity at the step's end (boxes, by projected Gauss-Seidel), so joints stick and let go.
References: Armstrong-Helouvry, Dupont, Canudas de Wit 1994 (friction); Dahl 1976 (presliding); Spong 1987 (elastic joints).
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}
_SWEEPS = 100
_SETTLED = 1e-9


class Joints(NamedTuple):
    """Physics of the n joints, each of shape (n,); zero where there is nothing.

    Attributes:
        rotor: J [kg m^2]. viscous: b [N m s/rad]. quadratic: c [N m s^2/rad^2].
        coulomb_forward, coulomb_backward: dry friction's level for v > 0 and v < 0 [N m].
        breakaway: Fs - Fc [N m]. stribeck_speed: vs [rad/s]. load_factor: mu [-].
        presliding: z_s [rad]; 0: none. dry_rate, viscous_rate: change of dry friction and of b with time [N m/s], [N m/rad].
        spring, spring_origin: k [N m/rad], q0 [rad]. balancer, balancer_origin: k_b [N m], q_b [rad].
        ripple, ripple_harmonic, ripple_phase: amplitude [N m], periods per turn, phase [rad].
        stiffness: k of the elastic joint [N m/rad]; 0: rigid. gap: width of its dead zone [rad]. motor_inertia: Jm [kg m^2].
        compliance_damping: d [N m s/rad].
        limit: the motor's largest torque [N m]; infinite: none.
        neighbour: joint whose position changes this one's friction, as a float; -1: none. neighbour_friction: how much, relative.
        neighbour_damping: viscous friction per radian of the neighbour's position [N m s/rad^2].
        hum, hum_frequency: amplitude [N m] and frequency [Hz] of a disturbance in time.
    """

    rotor: FloatArray
    viscous: FloatArray
    quadratic: FloatArray
    coulomb_forward: FloatArray
    coulomb_backward: FloatArray
    breakaway: FloatArray
    stribeck_speed: FloatArray
    load_factor: FloatArray
    presliding: FloatArray
    dry_rate: FloatArray
    viscous_rate: FloatArray
    spring: FloatArray
    spring_origin: FloatArray
    balancer: FloatArray
    balancer_origin: FloatArray
    ripple: FloatArray
    ripple_harmonic: FloatArray
    ripple_phase: FloatArray
    stiffness: FloatArray
    gap: FloatArray
    motor_inertia: FloatArray
    compliance_damping: FloatArray
    limit: FloatArray
    neighbour: FloatArray
    neighbour_friction: FloatArray
    neighbour_damping: FloatArray
    hum: FloatArray
    hum_frequency: FloatArray


def ideal_joints(n: int) -> Joints:
    """Joints without friction, rotor or compliance; the arrays may be filled."""
    arrays = {name: np.zeros(n) for name in Joints._fields}
    arrays["stribeck_speed"] += 1.0
    arrays["limit"] += np.inf
    arrays["neighbour"] -= 1.0
    return Joints(**arrays)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def dry_levels(joints: Joints, j: int, t: float, q: FloatArray, speed: float, link_torque: float) -> tuple[float, float]:
    """Largest dry friction of joint j against a forward and against a backward motion [N m]."""
    more = joints.breakaway[j] * np.exp(-((speed / joints.stribeck_speed[j]) ** 2)) + joints.load_factor[j] * abs(link_torque)
    more += joints.dry_rate[j] * t
    factor = 1.0
    if joints.neighbour[j] >= 0.0:
        factor += joints.neighbour_friction[j] * np.sin(2.0 * q[int(joints.neighbour[j])])
    forward, backward = (joints.coulomb_forward[j] + more) * factor, (joints.coulomb_backward[j] + more) * factor
    return max(forward, 0.0), max(backward, 0.0)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def smooth_damping(joints: Joints, j: int, t: float, q: FloatArray) -> float:
    """Viscous coefficient of joint j now [N m s/rad]."""
    b = max(joints.viscous[j] + joints.viscous_rate[j] * t, 0.0)
    if joints.neighbour[j] >= 0.0:
        b += joints.neighbour_damping[j] * (1.0 + np.sin(q[int(joints.neighbour[j])]))
    return float(b)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def motor_side_torque(joints: Joints, j: int, t: float, angle: float) -> float:
    """Ripple and hum of joint j, against the motor [N m]."""
    ripple = joints.ripple[j] * np.sin(joints.ripple_harmonic[j] * angle + joints.ripple_phase[j])
    return float(ripple + joints.hum[j] * np.sin(2.0 * np.pi * joints.hum_frequency[j] * t))


@njit(**_JIT)  # type: ignore[untyped-decorator]
def spring_torque(joints: Joints, j: int, angle: float) -> float:
    """What cable and balancer of joint j take from the motor [N m]."""
    balancer = joints.balancer[j] * np.sin(angle - joints.balancer_origin[j])
    return float(joints.spring[j] * (angle - joints.spring_origin[j]) + balancer)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def compliance_torque(joints: Joints, j: int, deflection: float, rate: float) -> float:
    """T of an elastic joint for its deflection theta - q [rad] and the deflection's rate [rad/s], shape () [N m]."""
    half = 0.5 * joints.gap[j]
    if abs(deflection) <= half:
        return 0.0
    torque = joints.stiffness[j] * (deflection - np.sign(deflection) * half) + joints.compliance_damping[j] * rate
    # a gap's flank pushes and does not pull
    if half > 0.0 and torque * deflection < 0.0:
        return 0.0
    return float(torque)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def invert(matrix: FloatArray, out: FloatArray) -> None:
    """Inverse of a symmetric positive definite matrix by Gauss-Jordan without pivots; ``matrix`` is used up."""
    n = matrix.shape[0]
    for i in range(n):
        for k in range(n):
            out[i, k] = 1.0 if i == k else 0.0
    for i in range(n):
        scale = 1.0 / matrix[i, i]
        for k in range(n):
            matrix[i, k] *= scale
            out[i, k] *= scale
        for r in range(n):
            factor = matrix[r, i]
            if r != i and factor != 0.0:
                for k in range(n):
                    matrix[r, k] -= factor * matrix[i, k]
                    out[r, k] -= factor * out[i, k]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def solve_dry_friction(v: FloatArray, response: FloatArray, forward: FloatArray, backward: FloatArray, f: FloatArray) -> None:
    """Dry friction f (n,) that agrees with the velocity at the step's end; both are changed in place.

    On entry ``v`` is the velocity without friction and f the last step's friction, a first guess; ``response`` (n, n) is the
    velocity lost per friction. On exit: f_j = forward_j where v_j > 0, -backward_j where v_j < 0, in between where v_j = 0.
    """
    n = v.size
    for j in range(n):
        f[j] = min(max(f[j], -backward[j]), forward[j])
        for i in range(n):
            v[i] -= response[i, j] * f[j]
    for _ in range(_SWEEPS):
        largest = 0.0
        for j in range(n):
            if forward[j] + backward[j] > 0.0:
                wanted = min(max(f[j] + v[j] / response[j, j], -backward[j]), forward[j])
                change = wanted - f[j]
                if change != 0.0:
                    f[j] = wanted
                    for i in range(n):
                        v[i] -= response[i, j] * change
                    largest = max(largest, abs(change) * response[j, j])
        if largest < _SETTLED:
            return
