"""One joint about a posture: torque and velocity, and what the rigid model says of them.

Rigid: ``M a + D v + K (q - q0) = tau``, with M, D and K entries of the joint at the mean posture, so that torque to velocity
is ``G = s / (M s^2 + D s + K)``. The true joint has ``G / H``, where H is what the measured torque is of the model's: its poles
are those of G and the zeros of H, its zeros those of G and the poles of H. H is identified rather than G / H, since the model's
torque comes from positions with next to no noise and the measured one is noisy: noise of an input would move the poles. It needs
no small motion either, as the model's torque is that of the whole motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.frequency_domain.lines import ComplexArray, cleaned_torque
from sysid_ros.frequency_domain.stretches import Stretch
from sysid_ros.frequency_domain.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel

_WHITENED = 0.98
_SLOWEST = 30.0
"""Rate of the signals at least [Hz]."""
_PER_CYCLE = 5.0
"""Samples a cycle of the highest frequency that is judged."""


@dataclass(frozen=True, eq=False)
class Linearised:
    """Signals of one joint about a posture.

    Attributes:
        u, y: torque of the model and measured one, both without dry friction, of each stretch, shape (N,) each [N m].
        period: between samples [s]. inertia, damping, stiffness: M [kg m^2], D [N m s/rad], K [N m/rad], of the rigid model.
        posture: of all joints, shape (n,) [rad]. small: whether the motion is small enough for the model to be linear in it.
    """

    u: tuple[FloatArray, ...]
    y: tuple[FloatArray, ...]
    period: float
    inertia: float
    damping: float
    stiffness: float
    posture: FloatArray
    small: bool

    @property
    def rigid_poles(self) -> ComplexArray:
        """Roots of ``M s^2 + D s + K``, shape (2,), complex [1/s]."""
        return np.asarray(np.roots([self.inertia, self.damping, self.stiffness]).astype(complex))


def linearised(stretches: Sequence[Stretch], joint: int, known: Sequence[KnownEffect], top_hz: float) -> Linearised | None:
    """The signals of a joint; None where it moves in no stretch long enough.

    Args:
        top_hz: highest frequency in which the motion tells anything [Hz]; the signals are kept up to twice and a half that.
    """
    from scipy import signal

    robot = stretches[0].motion.robot
    weights = np.array([len(s.motion.t) for s in stretches], dtype=float)
    posture = np.average([s.motion.q.mean(axis=0) for s in stretches], axis=0, weights=weights)
    nothing = np.zeros_like(posture)
    model = TorqueModel(robot, [], known)
    M = float(model.mass_along(posture[None])[0, joint, joint] + model.armature()[joint])
    D = float(model.damping()[joint])
    by_q, _, _ = robot.rnea_derivatives_along(posture[None], nothing[None], nothing[None])
    K = float(by_q[0, joint, joint])
    inputs, outputs, linear_power, rest_power = [], [], 0.0, 0.0
    every = max(1, int(1.0 / (stretches[0].period * max(_PER_CYCLE * top_hz, _SLOWEST))))
    for stretch in stretches:
        motion = stretch.motion
        whole, _, part = stretch.rests(joint)
        if not stretch.tells(whole, part):
            continue
        linear = M * motion.a[:, joint] + D * motion.v[:, joint] + K * (motion.q[:, joint] - posture[joint])
        u = stretch.smooth[:, joint]
        y = cleaned_torque(stretch, joint) - stretch.model[:, joint] + u
        rest = stretch.smooth[:, joint] - linear
        linear_power += float(np.var(linear[whole])) * (whole.stop - whole.start)
        rest_power += float(np.var(rest[whole])) * (whole.stop - whole.start)
        both = np.stack([u, y], axis=1)[whole]
        if every > 1:
            both = signal.decimate(both, every, ftype="fir", axis=0)
        # the same difference on both sides keeps the response, and lets fast motion count beside slow
        both = both[1:] - _WHITENED * both[:-1]
        inputs.append(both[:, 0] - both[:, 0].mean())
        outputs.append(both[:, 1] - both[:, 1].mean())
    if not inputs:
        return None
    return Linearised(
        tuple(inputs),
        tuple(outputs),
        stretches[0].period * every,
        M,
        D,
        K,
        posture,
        rest_power < TOLERANCES.small**2 * linear_power,
    )
