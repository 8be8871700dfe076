"""What an identification found: everything that the tables, the JSON and the report show, in plain values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sysid_ros.blackbox.ceiling_result import Ceiling
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray
from sysid_ros.torque.base_parameters import BaseParameters
from sysid_ros.torque.model_file import ModelFile

if TYPE_CHECKING:
    from sysid_ros.identification.payload_difference import PayloadDifference
    from sysid_ros.identification.physical_consistency import PhysicalFit

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One standard parameter.

    Attributes:
        name: as in model.yaml, such as ``Fc[elbow]``. effect: id of its effect. joint: the joint, or the link of an inertial.
        value, unit. std: honest for coloured residuals. ci95: value -+ 1.96 std.
        crb: standard deviation by the Cramer-Rao bound, were the residuals white with the same power below the cut-off.
        prior_std: before any data. from_data: part of its information that comes from the bags, 0 (the prior's alone) to 1.
        between_bags: standard deviation of the values found in each bag alone; NaN where fewer than two do.
    """

    name: str
    effect: str
    joint: str
    value: float
    unit: str
    std: float
    crb: float
    ci95: tuple[float, float]
    prior_std: float
    from_data: float
    between_bags: float


@dataclass(frozen=True, slots=True)
class BaseGroup:
    """One base parameter: a parameter and what is lumped with it, ``value = parameter + sum_k coefficient_k parameter_k``.

    Attributes:
        name: of the parameter that stands for the group. terms: (coefficient, name) of what is lumped with it.
        words: the group in a line, such as ``I_zz[link_2] + I_yy[link_1] - 0.4 mc_x[link_1]``.
        value, unit, std, crb, ci95, from_data, between_bags: as of :class:`Parameter`, of the sum.
        determined_by: "bags", "bags and prior" or "prior": where the value comes from.
    """

    name: str
    terms: tuple[tuple[float, str], ...]
    words: str
    value: float
    unit: str
    std: float
    crb: float
    ci95: tuple[float, float]
    from_data: float
    determined_by: str
    between_bags: float


@dataclass(frozen=True, slots=True)
class TorqueError:
    """How well a model predicts a recording that it was not fitted to, a joint, shape (n,) each [N m].

    Attributes:
        name: the recording. residual: rms of the residual. torque: rms of the torque. nominal: rms of the residual of the URDF
            alone. urdf_friction: of the URDF's links with friction, rotors and offsets fitted to the same bags. Over all rows.
        residual_moving, torque_moving: the same over rows of moving joints only, where dry friction is determined.
    """

    name: str
    residual: FloatArray
    torque: FloatArray
    nominal: FloatArray
    urdf_friction: FloatArray
    residual_moving: FloatArray
    torque_moving: FloatArray

    @property
    def relative(self) -> FloatArray:
        """rms of the residual over rms of the torque, shape (n,)."""
        return self.residual / np.maximum(self.torque, 1e-12)


@dataclass(frozen=True, slots=True)
class ResidualSeries:
    """Measured and predicted torque of a recording that the model was not fitted to, after the low-pass, N rows.

    Attributes:
        name: the recording. kind: "held out" or "validation".
        t: stamps, shape (N,) [s]; rows after a gap follow with a jump. period: usual time between rows [s].
        q, v, a: shape (N, n). tau_measured, tau_predicted, tau_nominal (the URDF alone): shape (N, n) [N m].
        moving: rows that can be fitted: the joint's dry friction is determined there, shape (N, n), bool.
    """

    name: str
    kind: str
    t: FloatArray
    period: float
    q: FloatArray
    v: FloatArray
    a: FloatArray
    tau_measured: FloatArray
    tau_predicted: FloatArray
    tau_nominal: FloatArray
    moving: BoolArray

    @property
    def residual(self) -> FloatArray:
        """tau_measured - tau_predicted, shape (N, n) [N m]."""
        return self.tau_measured - self.tau_predicted


@dataclass(frozen=True, slots=True)
class JointNoise:
    """The residual of one joint in one bag that was fitted.

    Attributes:
        bag, joint: where. std: rms over the rows used [N m].
        density: spectral density at low frequency [(N m)^2 s], which decides how much information the data hold.
        correlation_time: density over twice the variance [s]. effective_rows: as many independent rows say. rows: used.
    """

    bag: str
    joint: str
    std: float
    density: float
    correlation_time: float
    effective_rows: float
    rows: int


@dataclass(frozen=True, slots=True)
class WhitenessTest:
    """Ljung-Box test of a joint's residual in a bag, on rows spaced so far that the low-pass itself does not correlate them.

    Attributes:
        statistic: Q ~ chi-squared with ``lags`` degrees of freedom if white. p_value. white: p_value of 0.01 or more.
        lag_one: correlation of neighbouring rows. spacing: of the rows [s].
    """

    bag: str
    joint: str
    statistic: float
    lags: int
    p_value: float
    lag_one: float
    spacing: float

    @property
    def white(self) -> bool:
        """Whether whiteness can't be denied."""
        return self.p_value >= TOL.white


@dataclass(frozen=True, slots=True)
class Repeatability:
    """A parameter of a joint as each bag alone gives it.

    Attributes:
        name, unit: of the parameter. values, stds: a bag, in the order of ``Identification.bags``; NaN where one does not say.
        between: standard deviation of the values. within: rms of the stds. Much more between than within means that the robot
            was not the same in all bags (temperature, load, wear), which no interval from one bag shows.
        friction: whether it is a parameter of the joint's friction.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    stds: tuple[float, ...]
    between: float
    within: float
    friction: bool = False


@dataclass(frozen=True, slots=True)
class Problem:
    """Something found in the data, in a sentence with the value found and the cure.

    Attributes:
        bag: name of the bag, empty where it concerns all. joint: its name, or empty. kind: a key such as ``frozen_effort``.
    """

    bag: str
    joint: str
    kind: str
    text: str


@dataclass(frozen=True, slots=True)
class CutOff:
    """The low-pass that both sides of the equation went through: hz [Hz] and why, in a sentence."""

    hz: float
    reason: str


@dataclass(frozen=True, slots=True)
class PriorChoice:
    """How strongly the URDF's link inertials were held to, chosen by the error expected on other motions.

    Attributes:
        weight: of the prior; a link whose ten parameters are uncertain by a part s of themselves has 1 / s^2, infinite
            keeps the URDF's links.
        weights, heldout: what was tried for all links alike and the held-out error of each, in parts of the error with the
            URDF's links (geometric mean over the joints).
        reason: in a sentence. links, link_weights: names of the links and the weight of each; ``weight`` is the least of them.
    """

    weight: float
    weights: tuple[float, ...]
    heldout: tuple[float, ...]
    reason: str
    links: tuple[str, ...] = ()
    link_weights: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Knob:
    """A nonlinear setting that was searched for: value, unit, joint, and whether the data determine it at all."""

    name: str
    joint: str
    value: float
    unit: str
    determined: bool


@dataclass(frozen=True, slots=True)
class Identification:
    """What identification found.

    Attributes:
        joint_names: n joints; every array of shape (n,) is in their order. bags, validation_bags: names.
        theta, covariance: of all effects side by side, shape (p,) and (p, p). names, units: p each.
        parameters: the same with intervals, p entries. groups: the base parameters in words.
        base: the base of the robot's own range, columns in the order of ``names``. bags_condition_number: of these bags.
        method, form, friction: as chosen on the command line. knobs: nonlinear settings found. cutoff, prior: chosen, and why.
        errors: torque error on recordings held out in turn. validation: on those that were never fitted.
        series: the same rows by rows: of ``validation`` if there are any, else of ``errors``.
        noise, whiteness: a joint and a bag. repeatability: of the parameters that each bag determines; empty with one bag.
        problems: found in the bags. record_next: what to record to know more, sentences.
        physical: outcome of the physical consistency; None where it was switched off. model: to be written to model.yaml.
        payload: what loaded runs carried, where some were given. ceiling: what black boxes predict of the rows of ``series``.
    """

    joint_names: tuple[str, ...]
    bags: tuple[str, ...]
    validation_bags: tuple[str, ...]
    theta: FloatArray
    covariance: FloatArray
    names: tuple[str, ...]
    units: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    groups: tuple[BaseGroup, ...]
    base: BaseParameters
    bags_condition_number: float
    method: str
    form: str
    friction: str
    knobs: tuple[Knob, ...]
    cutoff: CutOff
    prior: PriorChoice
    errors: tuple[TorqueError, ...]
    validation: tuple[TorqueError, ...]
    series: tuple[ResidualSeries, ...]
    noise: tuple[JointNoise, ...]
    whiteness: tuple[WhitenessTest, ...]
    repeatability: tuple[Repeatability, ...]
    problems: tuple[Problem, ...]
    record_next: tuple[str, ...]
    physical: PhysicalFit | None
    model: ModelFile
    payload: PayloadDifference | None = None
    ceiling: Ceiling | None = None
