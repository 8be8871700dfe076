"""hide_in_arm: a recording of the simulated arm that hides what is asked for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.hidden_effects.bullet_run import move_in_pybullet
from sysid_ros.simulation.hidden_effects.catalogue import cause_of, hideable, realise
from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect
from sysid_ros.simulation.hidden_effects.motion import DiagnosisMotion
from sysid_ros.simulation.hidden_effects.run import HiddenRecording, move, publish, require_rate, stiffening_for, truth_of
from sysid_ros.simulation.hidden_effects.sensor_noise import Noise
from sysid_ros.simulation.hidden_effects.visibility import nominal_residual, shown

_REST = 0.8
_FAST_SHARE = 0.6
_SHORTEST = 8.0

Values = Mapping[str, tuple[float, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenScenario:
    """What is hidden in which recording.

    Attributes:
        hide: (effect id, joint or None) each; what is not given is drawn.
        values: "name" or "effect.name" -> numbers that are not drawn.
        hide_seed: of the drawn joints and sizes. seed: of motion and noise, so that two seeds give two recordings of one robot.
        duration: [s]. rate: [Hz], a divisor of 1000.
        encoder_noise, torque_noise, velocity_noise: standard deviations [rad], [N m], [rad/s].

    Raises:
        SettingsError: there is no such effect, or the recording is too short to show it.
    """

    hide: Sequence[tuple[str, str | None]]
    values: Values
    hide_seed: int = 0
    seed: int = 0
    duration: float = 25.0
    rate: int = 1000
    encoder_noise: float = 1e-5
    torque_noise: float = 0.1
    velocity_noise: float = 1e-3

    def __post_init__(self) -> None:
        for id_, _ in self.hide:
            if id_ not in (ids := hideable()):
                raise SettingsError(f"hide is '{id_}'; it must be one of {', '.join(ids)}.")
        require_rate(self.rate)
        # written so that NaN does not pass
        if not _SHORTEST <= self.duration < np.inf:
            raise SettingsError(f"duration is {self.duration} s; with hide it must be {_SHORTEST:g} s or more.")
        for name in ("encoder_noise", "torque_noise", "velocity_noise"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise SettingsError(f"{name} is {getattr(self, name)}; it must be 0 or more.")
        for name in ("seed", "hide_seed"):
            if getattr(self, name) < 0:
                raise SettingsError(f"{name} is {getattr(self, name)}; it must be 0 or more.")


def hide_in_arm(
    scenario: HiddenScenario, urdf: str, start: float, progress: Callable[[int], None] = lambda n: None
) -> tuple[HiddenRecording, dict[str, Any]]:
    """The recording, stamped from ``start`` [s] on, and its truth, with the size of what it hides in noise floors, a joint.

    Raises:
        SettingsError: a joint or a value does not fit, or the arm can't bear what is hidden.
    """
    robot = RobotModel.from_urdf(urdf)
    moving = scenario.duration - 3.0 * _REST
    parts = (_FAST_SHARE * moving, (1.0 - _FAST_SHARE) * moving, _REST)
    draw = np.random.default_rng([scenario.hide_seed, 1])
    noise = Noise(
        np.full(robot.n, scenario.torque_noise),
        np.zeros(robot.n),
        position=scenario.encoder_noise,
        resolution=0.0,
        velocity=scenario.velocity_noise,
    )
    # sizes come from a motion of their own, so that they are the same in every motion
    usual = Circumstances(robot, DiagnosisMotion(robot, draw, *parts), draw, 1.0, noise.torque)
    true = realise(robot, [_drawn(id_, joint, usual, scenario.values) for id_, joint in scenario.hide])
    _require_used(scenario.values, true.effects)
    rng = np.random.default_rng([scenario.seed, 2])
    motion = DiagnosisMotion(robot, rng, *parts)
    stiffening = stiffening_for(usual.torque)
    if true.needs_short_steps:
        simulator = "compiled"
        moved = move(true, motion, scenario.rate, stiffening)
    else:
        simulator = "pybullet"
        moved = move_in_pybullet(true, motion, scenario.rate, stiffening, progress)
    recording = publish("hidden", true, moved, noise, rng, start)
    seen = shown(nominal_residual(robot, recording.exact)[2], noise.floor(scenario.rate)) if scenario.torque_noise else None
    truth = truth_of(
        true,
        noise,
        scenario.rate,
        simulator,
        residual_over_noise=None if seen is None else seen.tolist(),
        start_time=start,
        duration=scenario.duration,
        seed=scenario.seed,
        hide_seed=scenario.hide_seed,
        frame=robot.default_frame,
    )
    return recording, truth


def _drawn(id_: str, joint: str | None, usual: Circumstances, values: Values) -> HiddenEffect:
    """The effect with its drawn sizes, and the given ones in their place."""
    names = usual.robot.joint_names
    if joint is not None and joint not in names:
        raise SettingsError(f"hide is '{id_}@{joint}'; the joint must be one of {', '.join(names)}.")
    effect = cause_of(id_).draw(replace(usual, only=None if joint is None else names.index(joint)))
    if joint is not None and (joint not in effect.joints or effect.joints == names):
        raise SettingsError(f"hide is '{id_}@{joint}', but {id_} can't be hidden on that joint. Name another, or none.")
    parameters = []
    for p in effect.parameters:
        given = values.get(f"{id_}.{p.name}", values.get(p.name))
        if given is None:
            parameters.append(p)
            continue
        count = len(p.value) if isinstance(p.value, tuple) else 1
        if isinstance(p.value, str) or len(given) != count:
            raise SettingsError(
                f"value {p.name} of {id_} is {given}; it must be {count} number{'s' if count > 1 else ''} [{p.unit}]."
            )
        parameters.append(replace(p, value=given if count > 1 else given[0]))
    return replace(effect, parameters=tuple(parameters))


def _require_used(values: Values, effects: Sequence[HiddenEffect]) -> None:
    allowed = {p.name for e in effects for p in e.parameters} | {f"{e.id}.{p.name}" for e in effects for p in e.parameters}
    for name in values:
        if name not in allowed:
            raise SettingsError(f"value names '{name}'; what is hidden has {', '.join(sorted(allowed)) or 'no number'}.")
