"""The smooth motion of recordings, and of a robot whose first six joints are those of its trunk, from a whole recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.trunk_channels import TrunkChannels, TrunkSetup
from sysid_ros.signals.zero_phase import KinematicFilter, SmoothMotion


def smooth_floating(
    kinematics: KinematicFilter,
    t: FloatArray,
    q: FloatArray,
    v: FloatArray | None,
    tau: FloatArray,
    trunk: TrunkChannels,
    spoiled: NDArray[np.bool_] | None = None,
) -> SmoothMotion | None:
    """All joints of a floating base after the zero-phase filter, as :class:`.FloatingDerivative` has them sample by sample.

    The turns of the trunk are the integral of the gyro, whose slope and second difference go through the same filter as those of
    the legs; the specific force is moved to the trunk's origin: ``s = f - dw x p - w x (w x p)``.

    Args:
        kinematics: the filter. t: stamps, shape (N,) [s]. q, tau: of the legs, shape (N, n). v: measured velocities to be taken,
            shape (N, n), or None. trunk: of the same stamps. spoiled: values of the legs that must not be used, shape (N, n).

    Returns:
        channels of shape (M, 6 + n), no torque in the first six; None where the stretch is shorter than the filter.
    """
    steps = np.diff(t, prepend=t[0])[:, None]
    before = np.vstack([trunk.omega[:1], trunk.omega[:-1]])
    turned = np.cumsum(0.5 * steps * (before + trunk.omega), axis=0)
    legs = None if v is None else np.hstack([trunk.omega, v])
    bad = None if spoiled is None else np.hstack([np.repeat(spoiled.any(axis=1, keepdims=True), 3, axis=1), spoiled])
    smooth = kinematics.apply(t, np.hstack([turned, q]), legs, np.hstack([trunk.force, tau]), bad)
    if smooth is None:
        return None
    w, dw, force, p = smooth.v[:, :3], smooth.a[:, :3], smooth.tau[:, :3], trunk.place
    origin = force - np.cross(dw, p) - np.cross(w, np.cross(w, p))
    # the acceleration of three turns at zero, one after the other, whose angular acceleration is dw
    turns = dw - np.stack([w[:, 1] * w[:, 2], -w[:, 0] * w[:, 2], w[:, 0] * w[:, 1]], axis=1)
    nothing = np.zeros((len(smooth.t), 3))
    return replace(
        smooth,
        q=np.hstack([nothing, nothing, smooth.q[:, 3:]]),
        v=np.hstack([nothing, w, smooth.v[:, 3:]]),
        a=np.hstack([origin, turns, smooth.a[:, 3:]]),
        tau=np.hstack([np.zeros((len(smooth.t), FREE)), smooth.tau[:, 3:]]),
        spoiled=np.hstack([np.repeat(smooth.spoiled[:, :1], FREE, axis=1), smooth.spoiled[:, 3:]]),
    )


def smooth_stretch(
    kinematics: KinematicFilter,
    stretch: Recording,
    measured_velocity: bool,
    spoiled: NDArray[np.bool_] | None,
    setup: TrunkSetup | None,
) -> SmoothMotion | None:
    """The smooth motion of a stretch; None where it is shorter than the filter.

    Args:
        kinematics: the filter. stretch: without a gap. measured_velocity: take the velocity of the messages, where there is one.
        spoiled: values that must not be used, shape (N, n). setup: by which its trunk is corrected; None: of an arm.
    """
    v = stretch.v if measured_velocity else None
    if setup is None or stretch.trunk is None:
        return kinematics.apply(stretch.t, stretch.q, v, stretch.tau, spoiled)
    trunk = stretch.trunk.corrected(stretch.t, setup)
    return smooth_floating(kinematics, stretch.t, stretch.q, v, stretch.tau, trunk, spoiled)


def contacts_at(t: FloatArray, trunk: TrunkChannels, grid: FloatArray) -> FloatArray | None:
    """Which feet were last reported to stand at other times (M,) [s] than the stamps t (N,), shape (M, k)."""
    if trunk.contacts is None:
        return None
    return trunk.contacts[np.clip(np.searchsorted(t, grid + 1e-9, side="right") - 1, 0, len(t) - 1)]
