"""The gain in simulation: what a controller must add to hold the recorded motion, and how far the simulated arm strays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from scipy import fft, interpolate

from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.effects import Motion
from sysid_ros.exceptions import RobotModelError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.held_motion import Arm, Controller, Held, Reference, hold
from sysid_ros.simulation.simulators import MISSING, simulated
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.torque_model import TorqueModel

_LONGEST = 30.0
"""Time of the held-out data that is simulated [s]."""
_STIFF = 50.0
"""Bandwidth of the controller that holds the motion: far above the band that is judged [Hz]."""
_SOFT = 8.0
"""That of the controller whose tracking error is reported: as wide as the band [Hz]."""
_LOST = (
    "A controller can't hold the recorded motion in the simulation, which therefore has no figures: some link has next to no "
    "inertia, or the model is far from the robot."
)
_SHOWN_EVERY = 5
"""Steps of the simulators between two points of a figure."""


@dataclass(frozen=True, eq=False)
class _Stretch:
    """A part of a motion that is simulated: which part of which motion, and its rows in the band."""

    index: int
    motion: Motion
    where: slice
    rows: slice
    t: FloatArray
    reference: Reference

    def along(self, coefficients: FloatArray) -> FloatArray:
        """Torque at the reference's times whose coefficients in the band these are, shape (K, n)."""
        whole = np.zeros((len(self.t), coefficients.shape[1]))
        whole[: self.rows.stop - self.rows.start] = coefficients[self.rows]
        return self.fine(fft.idct(whole, axis=0, norm="ortho"))

    def fine(self, values: FloatArray) -> FloatArray:
        """Values on the grid at the reference's times."""
        return np.asarray(interpolate.CubicSpline(self.t, values)(self.reference.t))

    def coarse(self, values: FloatArray) -> FloatArray:
        """Values at the reference's times on the grid."""
        inside = np.clip(self.t, self.reference.t[0], self.reference.t[-1])
        return np.asarray(interpolate.CubicSpline(self.reference.t, values)(inside))


def gain_or_why_not(
    prepared: Prepared,
    extended: Sequence[FloatArray],
    known: tuple[Sequence[KnownEffect], Sequence[KnownEffect]],
    noise: FloatArray,
    simulator: str | None,
) -> tuple[SimulationError | None, Tracking | None, tuple[str, ...]]:
    """The gain in simulation, or a sentence that says why there is none.

    Args:
        prepared, extended, noise: as :func:`simulation_gain` has them. known: effects before and after, as far as bodies can
            have them. simulator: None where none is installed.
    """
    if simulator is None:
        return None, None, (MISSING,)
    before, after = (TorqueModel(prepared.motions[0].robot, [], effects) for effects in known)
    try:
        gain = simulation_gain(prepared, extended, (before, after), noise, simulator)
    except RobotModelError as error:
        return None, None, (f"Nothing was simulated: {error}",)
    return (*gain, ()) if gain else (None, None, (_LOST,))


def simulation_gain(
    prepared: Prepared, extended: Sequence[FloatArray], models: tuple[TorqueModel, TorqueModel], noise: FloatArray, simulator: str
) -> tuple[SimulationError, Tracking] | None:
    """Held-out data in a simulator, with the nominal and with the extended robot; None where an arm is lost.

    Links, rotors and viscous friction are the simulator's; all else, dry friction among it, is the torque that the model has
    along the recorded motion. Two figures, in the band that is judged and, as every torque error here, where a joint moves:

    - *Torque.* A stiff controller with the nominal model's torque as feed-forward (computed torque) holds the recorded motion in
      each simulation. What it has to give, less what was measured, is that simulation's torque error. A perfect model would
      leave the noise floor.
    - *Tracking.* Each simulation gets the measured torque as feed-forward, and a controller as wide as the band keeps it on the
      recorded motion. How far it strays is what the model's error does to a motion, in radians, and does not grow with time.
      What a perfect model would leave is the same simulation of the extended model, driven by its own torque plus noise of the
      spectrum that was learned on the fitted data; its coefficients have that size and random signs, so that this is the
      figure to be expected. Recorded noise is one draw of it, which scatters by some per cent.

    Args:
        prepared: the held-out data. extended: torque of the extended model on its grids. models: nominal and extended, whose
            links, rotors and viscous friction are simulated. noise: variance of the coefficients, shape (K, n).

    Raises:
        RobotModelError: the simulator does not take a model.
    """
    stretches = _stretches(prepared)
    q = np.concatenate([s.motion.q[s.where] for s in stretches])[::20]
    largest = np.max([np.abs(m.tau).max(axis=0) for m in prepared.motions], axis=0)
    controllers = [Controller.of(models, q, largest, frequency) for frequency in (_STIFF, _SOFT)]
    signs = np.where(np.random.default_rng(0).random(noise.shape) < 0.5, -1.0, 1.0)
    errors, strayed = [], []
    for model, torque, more in zip(models, (prepared.nominal, extended), ([], [signs * np.sqrt(noise)]), strict=True):
        arm = simulated(model, simulator)
        try:
            given, runs = _held(arm, model, prepared, torque, stretches, controllers, more)
        finally:
            arm.close()
        if any(held.lost for held in chain(*runs)) or not all(np.isfinite(x).all() for x in given):
            return None
        errors.append(prepared.band.rows([x - m.tau for x, m in zip(given, prepared.motions, strict=True)]))
        strayed += runs
    return _figures(stretches, errors, noise, strayed, simulator), _shown(
        prepared.motions[0].robot.joint_names, stretches, strayed
    )


def _held(
    arm: Arm,
    model: TorqueModel,
    prepared: Prepared,
    torque: Sequence[FloatArray],
    stretches: Sequence[_Stretch],
    controllers: Sequence[Controller],
    more: Sequence[FloatArray],
) -> tuple[list[FloatArray], list[list[Held]]]:
    """What holds the motions of one simulated model, shape (N, n) each [N m], and how it strays under the measured torques and
    under its own with more, of these coefficients."""
    stiff, soft = controllers
    drives = [prepared.band.rows([m.tau - x for m, x in zip(prepared.motions, torque, strict=True)]), *more]
    # where nothing is simulated it is what the model says
    given = [np.array(x) for x in torque]
    runs: list[list[Held]] = [[] for _ in drives]
    for s in stretches:
        needed, nominal = s.reference.needed(model), prepared.nominal[s.index][s.where]
        forward = s.fine(nominal - torque[s.index][s.where])
        held = hold(arm, s.reference, needed, forward, model.damping(), stiff)
        given[s.index][s.where] = nominal + s.coarse(held.added)
        for coefficients, kept in zip(drives, runs, strict=True):
            kept.append(hold(arm, s.reference, needed, s.along(coefficients), model.damping(), soft))
    return given, runs


def _stretches(prepared: Prepared) -> list[_Stretch]:
    """Segments of the band, evenly spread over the held-out data, of about :data:`_LONGEST` in all."""
    slices = prepared.band.slices
    ends = np.cumsum([count for *_, count in slices]).tolist()
    length = sum((where.stop - where.start) * prepared.motions[i].period for i, where, _ in slices) / len(slices)
    out = []
    for k in np.unique(np.linspace(0, len(slices) - 1, min(len(slices), max(1, round(_LONGEST / length)))).astype(int)):
        i, where, count = slices[k]
        motion = prepared.motions[i]
        t = motion.t[where]
        out.append(_Stretch(i, motion, where, slice(ends[k] - count, ends[k]), t, Reference.of(t, motion.q[where])))
    return out


def _figures(
    stretches: Sequence[_Stretch],
    errors: Sequence[FloatArray],
    noise: FloatArray,
    strayed: Sequence[Sequence[Held]],
    simulator: str,
) -> SimulationError:
    rows = np.concatenate([np.arange(s.rows.start, s.rows.stop) for s in stretches])
    samples = sum(len(s.t) for s in stretches)
    torque = [np.sqrt(np.sum(power[rows], axis=0) / samples) for power in (errors[0] ** 2, errors[1] ** 2, noise)]
    position, velocity = ([_rms([getattr(h, name) for h in runs]) for runs in strayed] for name in ("position", "velocity"))
    seconds = sum(float(s.t[-1] - s.t[0]) for s in stretches)
    values = {
        f"{name}_rmse_{which}": value
        for name, found in (("position", position), ("velocity", velocity), ("torque", torque))
        for which, value in zip(("before", "after", "perfect"), found, strict=True)
    }
    return SimulationError(seconds, simulator, **values)


def _rms(values: Sequence[FloatArray]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(values) ** 2)))


def _shown(joints: tuple[str, ...], stretches: Sequence[_Stretch], strayed: Sequence[Sequence[Held]]) -> Tracking:
    """Position errors for a figure, with NaN between stretches."""
    gap = np.full((1, len(joints)), np.nan)
    t = np.concatenate([x for s in stretches for x in (s.reference.t[::_SHOWN_EVERY], [np.nan])])
    before, after, perfect = (np.concatenate([x for h in runs for x in (h.position[::_SHOWN_EVERY], gap)]) for runs in strayed)
    return Tracking(t, joints, before, after, perfect)


@dataclass(frozen=True)
class SimulationError:
    """What a controller that holds the recorded motion shows of a simulation, see
    :func:`sysid_ros.diagnosis.gain.simulation_gain`: with the nominal model, with the extended one, and what a perfect one
    would leave with this noise.

    Attributes:
        horizon_s: length of the simulated motion [s]. simulator: which it was.
        position_rmse, velocity_rmse: tracking error of the simulated arm under the measured torques, over all joints [rad],
            [rad/s]. torque_rmse: torque that holds the motion less the measured torque, a joint, shape (n,) each [N m].
    """

    horizon_s: float
    simulator: str
    position_rmse_before: float
    position_rmse_after: float
    position_rmse_perfect: float
    velocity_rmse_before: float
    velocity_rmse_after: float
    velocity_rmse_perfect: float
    torque_rmse_before: FloatArray
    torque_rmse_after: FloatArray
    torque_rmse_perfect: FloatArray

    @classmethod
    def as_dict(cls, simulation: SimulationError | None) -> dict[str, Any]:
        """As it stands in diagnosis.json; null where nothing was simulated."""
        values = {name: getattr(simulation, name, None) for name in cls.__dataclass_fields__}
        return {name: x.tolist() if isinstance(x, np.ndarray) else x for name, x in values.items()}


@dataclass(frozen=True)
class Tracking:
    """Position errors of the simulated arm under the measured torques: t since the first stamp, shape (N,), NaN between stretches
    [s]; nominal, extended and what noise alone makes, shape (N, n) each [rad]."""

    t: FloatArray
    joints: tuple[str, ...]
    before: FloatArray
    after: FloatArray
    perfect: FloatArray
