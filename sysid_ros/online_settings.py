"""Settings: dataclasses that the nodes, the replay and the configuration file share.

Every field carries its unit, its range and a description, from which a node declares its ROS parameters and the replay reads
``--config``. So a setting is written down once.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, ClassVar, Self

import numpy as np

from sysid_ros.estimators import ESTIMATORS
from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray


def setting(
    default: Any,
    description: str,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: Collection[str] = (),
    fixed: bool = False,
) -> Any:
    """A field with what a parameter tells of itself; ``fixed``: it can't be set while its node runs."""
    metadata = {"description": description, "unit": unit, "low": low, "high": high, "choices": choices, "fixed": fixed}
    if isinstance(default, tuple):
        return field(default_factory=lambda: default, metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """A group of settings that are checked when they are made; ``prefix`` stands before their names.

    Raises:
        SettingsError: a value is of the wrong type or out of its range.
    """

    prefix: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for f in fields(self):
            default = f.default if f.default_factory is MISSING else f.default_factory()
            object.__setattr__(self, f.name, _checked(self.prefix + f.name, getattr(self, f.name), f.metadata, default))

    @classmethod
    def from_mapping(cls, values: dict[str, Any], where: str) -> Self:
        """Settings from a mapping; ``where`` names its origin in the message.

        Raises:
            SettingsError: a name is unknown, or a value is not allowed.
        """
        known = {f.name for f in fields(cls)}
        unknown = sorted(set(values) - known)
        if unknown:
            raise SettingsError(f"{where}: unknown setting {', '.join(unknown)}. Known are {', '.join(sorted(known))}.")
        try:
            return cls(**values)
        except SettingsError as error:
            raise SettingsError(f"{where}: {error}") from None


@dataclass(frozen=True, slots=True, kw_only=True)
class CommitSettings(Settings):
    """When an estimate is committed, see :class:`.live_estimation.CommitGate`."""

    prefix: ClassVar[str] = "commit."
    mass_std: float = setting(0.1, "largest standard deviation of the mass that is committed", "kg", 0.0, 100.0)
    com_std: float = setting(
        0.02, "largest standard deviation of the centre of mass, on its worst axis, that is committed", "m", 0.0, 10.0
    )
    dwell: float = setting(1.0, "the estimate must stay within the dead band for so long before it is committed", "s", 0.0, 600.0)
    mass_dead_band: float = setting(
        0.05, "a mass that differs by less from the committed one is not committed anew", "kg", 0.0, 100.0
    )
    com_dead_band: float = setting(
        0.01, "a centre of mass that differs by less from the committed one is not committed anew", "m", 0.0, 10.0
    )
    refinement: float = setting(
        3.0, "a committed value is committed anew once its std has fallen by this factor; 0: never", "", 0.0, 1000.0
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class OnlineSettings(Settings):
    """Settings of :class:`.online_estimation.OnlineEstimation` and of the :class:`.input_gate.InputGate` before it."""

    # what is read
    joint_names: tuple[str, ...] = setting(
        (), "joints that are used; empty: every movable joint of the URDF that the messages name"
    )
    frame_id: str = setting("", "frame that the payload is expressed in; empty: the arm's flange")
    gravity: tuple[float, ...] = setting((0.0, 0.0, -9.81), "gravity in the base frame", "m/s^2", -30.0, 30.0)
    base: str = setting(
        "auto",
        "the robot's base: fixed, or floating on legs; auto: floating where the URDF's root carries three legs or more",
        choices=("auto", "fixed", "floating"),
    )
    contact_frames: tuple[str, ...] = setting(
        (), "feet of a floating base, in the order of the contact messages; empty: the end of each leg, in the order of the URDF"
    )
    foot_radius: float = setting(
        0.0, "radius of the feet; 0: that of the sphere in the URDF's collision, a point where it has none", "m", 0.0, 0.5
    )
    imu_frame: str = setting("", "link that the IMU is fixed to, part of the trunk; empty: the frame_id of its messages")
    imu_xyz: tuple[float, ...] = setting(
        (0.0, 0.0, 0.0), "where the IMU sits in the trunk, in place of imu_frame", "m", -10.0, 10.0
    )
    imu_rpy: tuple[float, ...] = setting(
        (0.0, 0.0, 0.0), "how the IMU is turned in the trunk, in place of imu_frame", "rad", -7.0, 7.0
    )
    imu_tilt_std: float = setting(
        0.03, "how well the IMU's axes in the trunk are known, a standard deviation; 0: exactly", "rad", 0.0, 0.5
    )
    imu_lever_std: float = setting(
        0.02, "how well the IMU's place in the trunk is known, a standard deviation; 0: exactly", "m", 0.0, 1.0
    )
    imu_delay_std: float = setting(
        0.005, "by how much the IMU's stamps may be late against those of the joints, a standard deviation; 0: not", "s", 0.0, 0.1
    )
    accelerometer_bias_std: float = setting(
        0.0, "prior standard deviation of the IMU's bias, which is then estimated; 0: it has none", "m/s^2", 0.0, 2.0
    )
    effort_scale: tuple[float, ...] = setting(
        (), "factor a joint from effort to torque; empty: 1", "N m per unit of effort", 1e-9, 1e9
    )
    effort_preset: str = setting(
        "", "arm whose driver's efforts are meant, such as motor currents, in place of effort_scale; its name in docs/inputs.md"
    )
    effort_sign: tuple[float, ...] = setting((), "+1 or -1 a joint; empty: +1", "", -1.0, 1.0)
    effort_type: str = setting(
        "total", "what effort is: the joint's torque, or what is left after the robot's own model", choices=("total", "external")
    )
    velocity_source: str = setting(
        "position", "velocity from positions by the filter, or from the message", choices=("position", "message")
    )
    allow_unstamped: bool = setting(False, "use the receive time where a message has no stamp")
    sensor_timeout: float = setting(0.5, "without a usable sample for so long the estimate is stale", "s", 0.01, 60.0)
    max_gap: float = setting(0.1, "a longer gap between samples restarts the filters", "s", 0.002, 10.0)

    # filters
    cutoff_hz: float = setting(
        0.0, "cut-off of the low-pass on both sides of the equation; 0: 10, less for slow data", "Hz", 0.0, 200.0
    )
    update_rate: float = setting(100.0, "updates of the estimator a second at most", "Hz", 5.0, 1000.0)
    standstill_velocity: float = setting(
        0.05, "below it on every joint the robot stands and nothing is updated", "rad/s", 0.0, 1.0
    )
    low_velocity: float = setting(0.15, "below it on every joint stiction is added to the noise", "rad/s", 0.0, 1.0)

    # estimator
    estimator: str = setting(
        "variable", "how is forgotten: by the innovations, by a constant, or another way", choices=ESTIMATORS
    )
    forgetting_time: float = setting(60.0, "time constant of the forgetting towards the prior", "s", 0.1, 1e6)
    torque_std: tuple[float, ...] = setting((), "torque noise a joint; empty: from the model, else estimated", "N m", 1e-9, 1e6)
    estimate_friction: bool = setting(True, "correct offset, Coulomb and viscous friction of each joint beside the payload")
    friction_drift: float = setting(
        0.1, "part of the known friction by which it may have changed since it was identified", "", 0.0, 2.0
    )
    friction_unknown: float = setting(0.1, "without a model, friction expected as a part of the effort limit", "", 0.0, 2.0)
    link_mass_error: float = setting(
        0.025, "without a model, error of the links' masses in the URDF, as a part of them; 0: they are exact", "", 0.0, 0.5
    )
    link_com_error: float = setting(
        0.003, "without a model, error of each coordinate of the links' centres of mass in the URDF", "m", 0.0, 0.1
    )
    effort_gain_error: float = setting(
        0.01,
        "without a model, error of each joint's effort, and on legs of all in common, as a part of it: torque constants, "
        "calibration; 0: none",
        "",
        0.0,
        0.5,
    )
    base_tilt_std: float = setting(
        0.02,
        "prior standard deviation of how far an arm's base is tilted, about two axes; 0: not at all",
        "rad",
        0.0,
        0.5,
    )
    stiction: float = setting(0.3, "torque that may hide in friction while the robot hardly moves", "N m", 0.0, 1e3)
    prior_mass_std: float = setting(2.0, "prior standard deviation of the payload's mass", "kg", 1e-3, 1e3)
    prior_first_moment_std: float = setting(0.3, "prior standard deviation of mass times centre of mass", "kg m", 1e-4, 1e3)
    prior_inertia_std: float = setting(
        0.1, "prior standard deviation of the inertia about the frame's origin", "kg m^2", 1e-6, 1e3
    )
    no_payload_mass: float = setting(0.15, "less mass than this is called no payload", "kg", 0.0, 100.0)

    mass_std_limit: float = setting(
        0.1,
        "above this std (or 5 % of the mass, or 3 % of a robot on legs) the payload is not known yet",
        "kg",
        1e-4,
        100.0,
    )

    # output
    publish_rate: float = setting(50.0, "estimates published a second", "Hz", 0.1, 1000.0)

    @property
    def payload_prior(self) -> FloatArray:
        """Prior standard deviation of the payload's ten parameters, shape (10,)."""
        return np.array([self.prior_mass_std] + [self.prior_first_moment_std] * 3 + [self.prior_inertia_std] * 6)


def _checked(name: str, value: Any, meta: Any, default: Any) -> Any:
    if isinstance(value, list):
        value = tuple(value)
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise SettingsError(f"{name} is {value!r}; it must be true or false.")
        return value
    if meta["choices"]:
        if value not in tuple(meta["choices"]):  # it may be something that has no hash
            raise SettingsError(f"{name} is {value!r}; it must be one of {', '.join(meta['choices'])}.")
        return value
    if meta["low"] is None:
        one = isinstance(default, str)
        if not (isinstance(value, str) if one else isinstance(value, tuple) and all(isinstance(x, str) for x in value)):
            raise SettingsError(f"{name} is {value!r}; it must be {'a string' if one else 'a list of strings'}.")
        return value
    vector = isinstance(default, tuple) and len(default) == 3
    if isinstance(value, tuple) != isinstance(default, tuple) or (vector and len(value) != 3):
        expected = "three numbers" if vector else "a list of numbers" if isinstance(default, tuple) else "a number"
        raise SettingsError(f"{name} is {value!r}; it must be {expected}.")
    numbers = value if isinstance(value, tuple) else (value,)
    for x in numbers:
        if isinstance(x, bool) or not isinstance(x, int | float) or not meta["low"] <= x <= meta["high"]:
            unit = f" {meta['unit']}" if meta["unit"] else ""
            raise SettingsError(f"{name} is {value!r}; it must be a number from {meta['low']:g} to {meta['high']:g}{unit}.")
    return tuple(float(x) for x in value) if isinstance(value, tuple) else float(value)
