"""The verbs: replay, identify, diagnose, excite, frequency."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from sysid_ros import __version__
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.floating.floating_base import floating_base_of
from sysid_ros.input_gate import InputGate, gate_for
from sysid_ros.library.recording import Recording, load
from sysid_ros.library.results import Checked, Diagnosed, Excited, Identified, Replayed
from sysid_ros.library.robot import Robot
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording as Channels
from sysid_ros.sources import robot_of_source, temperatures, urdf_text
from sysid_ros.torque.model_file import ModelFile

Given = Recording | str | Path
Model = ModelFile | Identified | Diagnosed | str | Path | None


def replay(recording: Given, robot: Robot | str | Path | None = None, *, model: Model = None, **settings: Any) -> Replayed:
    """What was carried, as the node would have found it live.

    Args:
        recording: a recording, or the path of one. robot: a robot or its path; else the URDF recorded with it.
        model: of :func:`identify`, what is known of the arm itself. settings: of the node, such as ``frame_id="tool0"``.

    Raises:
        SysidError: anything of this can't be used.
    """
    from sysid_ros.online.online_estimation import OnlineEstimation
    from sysid_ros.online.replay import replay as run

    chosen = _settings(robot, settings)
    given, *others = _several(recording)
    if others:
        raise DataError(f"replay() takes one recording; {1 + len(others)} are given. Call it for each.")
    own, source = _robot_of(given, robot, chosen)
    estimation = OnlineEstimation(own, chosen, _model_file(model))
    gate = gate_for(own, estimation.base, chosen)
    records = source if estimation.base is None else _records(given, source)
    result = run(records, gate, estimation)
    if result.used == 0:
        worst = max(gate.counts, key=lambda reason: gate.counts[reason], default="joints_missing")
        raise DataError(f"{given.name}: no joint state of it can be used. {gate.last_texts.get(worst, '')}")
    _warn(result.warnings)
    return Replayed(result, own, _origin([given], "replay", robot))


def _records(given: Recording, source: Any) -> Any:
    """Joint states, IMU and contacts of a robot on legs."""
    from sysid_ros.sources import BagSource, FloatingBagSource

    if not isinstance(source, BagSource):
        raise DataError(f"{given.name} holds no IMU, which a robot on legs needs. Give a bag.")
    return FloatingBagSource(source, "", "")


def identify(
    recordings: Given | Iterable[Given],
    robot: Robot | str | Path | None = None,
    *,
    validate: Given | Iterable[Given] = (),
    loaded: Given | Iterable[Given] = (),
    settings: Mapping[str, Any] | None = None,
    cutoff_hz: float = 0.0,
    **choices: Any,
) -> Identified:
    """The arm's own dynamics from recordings in which it carries nothing.

    Args:
        recordings: one or several, or their paths. robot: as in :func:`replay`.
        validate: to judge on, never fitted. loaded: with a payload, which is found as the difference.
        settings: of the node, such as ``effort_scale``. cutoff_hz: of the low-pass [Hz]; 0 to choose it.
        choices: fields of :class:`.Choices`, such as ``friction="auto"``, ``effects=("cogging",)``.
    """
    from sysid_ros.diagnosis.whose.as_named import as_named
    from sysid_ros.identification import Choices, identify_recordings
    from sysid_ros.identification.result import Problem

    chosen = _settings(robot, settings or {})
    fitted, judged, with_payload = _several(recordings), _several(validate, False), _several(loaded, False)
    own: RobotModel | None = None
    channels: list[Channels] = []
    problems: list[Problem] = []
    for given in (*fitted, *judged, *with_payload):
        its, source = _robot_of(given, robot, chosen)
        own = _same(own, its, given)
        base = floating_base_of(own, chosen)
        gate = gate_for(own, base, chosen)
        records = _records(given, source) if base else source
        channels.append(Channels.from_measurements(given.name, (m for record in records for m in gate.take(record))))
        for key, n in gate.counts.items():
            problems.append(Problem(given.name, "", key, f"{n} of {gate.received} messages rejected: {gate.last_texts[key]}"))
        problems += [Problem(given.name, "", "gate", sentence) for sentence in gate.warnings]
    assert own is not None
    first, second = len(fitted), len(fitted) + len(judged)
    origin = _origin(fitted, "identify", robot)
    asked = Choices(**choices)
    problems += as_named(own, base, channels[:first], chosen.max_gap, asked.accept_doubts)
    result = identify_recordings(
        own, channels[:first], channels[first:second], origin, asked, cutoff_hz, chosen.max_gap,
        chosen.velocity_source == "message", problems, channels[second:], base=base, gravity=math.hypot(*chosen.gravity),
    )  # fmt: skip
    _warn([f"{p.bag}: {p.text}" if p.bag else p.text for p in result.problems])
    return Identified(result, own, origin)


def diagnose(
    recordings: Given | Iterable[Given],
    robot: Robot | str | Path | None = None,
    *,
    validate: Given | Iterable[Given] = (),
    model: Model = None,
    settings: Mapping[str, Any] | None = None,
    simulator: str | None = None,
) -> Diagnosed:
    """What the model of a robot gets wrong, why, and what the fix gains.

    Args:
        recordings, robot, validate, settings: as in :func:`identify`. model: the known part, as in :func:`replay`.
        simulator: of the gain in simulation: "pybullet" or "mujoco"; the first installed by default. Neither of the last two is
            of robots on legs.
    """
    from sysid_ros.diagnosis import diagnose as run
    from sysid_ros.diagnosis import diagnose_on_legs
    from sysid_ros.input_gate.raw_messages import read_messages
    from sysid_ros.signals.temperature import with_temperatures

    chosen = _settings(robot, settings or {})
    fitted, judged = _several(recordings), _several(validate, False)
    own: RobotModel | None = None
    channels: list[Channels] = []
    for given in (*fitted, *judged):
        its, source = _robot_of(given, robot, chosen)
        own = _same(own, its, given)
        if base := floating_base_of(own, chosen):
            gate = gate_for(own, base, chosen)
            taken = (m for record in _records(given, source) for m in gate.take(record))
            channels.append(Channels.from_measurements(given.name, taken))
            _warn(gate.warnings)
            continue
        read, sentences = read_messages(given.name, source, own, chosen)
        series, unread = temperatures(source)
        read, unused = with_temperatures(read, own, series)
        _warn([*sentences, *unread, *unused])
        channels.append(read)
    assert own is not None
    origin = _origin(fitted, "diagnose", robot) | {"validate": [given.name for given in judged]}
    n = len(fitted)
    if base := floating_base_of(own, chosen):
        if model is not None or simulator is not None:
            raise SettingsError("model or simulator is given of a robot on legs, where neither is used; leave them out.")
        gravity = math.hypot(*chosen.gravity)
        result = diagnose_on_legs(base, channels[:n], channels[n:], provenance=origin, gravity=gravity, max_gap=chosen.max_gap)
        return Diagnosed(result, own, origin)
    result = run(own, channels[:n], channels[n:], _model_file(model), provenance=origin, simulator=simulator)
    return Diagnosed(result, own, origin)


def frequency(
    recordings: Given | Iterable[Given],
    robot: Robot | str | Path | None = None,
    *,
    model: Model = None,
    settings: Mapping[str, Any] | None = None,
    top_hz: float = 0.0,
) -> Checked:
    """Up to what frequency a model holds, and what it misses beyond.

    Args:
        recordings, robot, settings: as in :func:`identify`. model: the known part. top_hz: upper end of the band [Hz]; 0: chosen.
    """
    from sysid_ros.frequency_domain import check_frequency

    chosen, file = _settings(robot, settings or {}), _model_file(model)
    own: RobotModel | None = None
    channels: list[Channels] = []
    several = _several(recordings)
    for given in several:
        its, source = _robot_of(given, robot, chosen)
        own = _same(own, its, given)
        gate = InputGate(own, chosen)
        channels.append(Channels.from_measurements(given.name, gate.measurements(source)))
    assert own is not None
    known, origin = file.known_effects(own) if file else [], _origin(several, "frequency", robot)
    result = check_frequency(own, channels, known, top_hz, chosen.max_gap, provenance=origin)
    _warn(result.warnings)
    return Checked(result, own, origin)


def excite(robot: Robot | str | Path, *, start: Sequence[float] | None = None, **settings: Any) -> Excited:
    """The motion from which an arm's parameters can be identified best; collisions are not checked, ``sysid excite`` does.

    Args:
        robot: the robot or its path. start: where it starts and ends, shape (n,) [rad or m]; anywhere without it.
        settings: fields of :class:`.ExcitationSettings`, such as ``duration=20.0``.
    """
    import numpy as np

    from sysid_ros.excitation.excitation_settings import ExcitationSettings
    from sysid_ros.excitation.excite import excite as run
    from sysid_ros.identification import free_model

    described = robot if isinstance(robot, Robot) else Robot(robot)
    own = described.model
    chosen = ExcitationSettings(**settings)
    if start is not None and np.shape(start) != (own.n,):
        raise SettingsError(f"start has the shape {np.shape(start)}; it must be ({own.n},), for {', '.join(own.joint_names)}.")
    result = run(free_model(own), chosen, start=None if start is None else np.asarray(start, dtype=float))
    _warn(result.warnings)
    return Excited(result, own, {"settings": chosen, **_file_of(described), "version": __version__})


def _several(given: Given | Iterable[Given], needed: bool = True) -> list[Recording]:
    some = [given] if isinstance(given, Recording | str | Path) else list(given)
    if needed and not some:
        raise DataError("no recording is given. Give at least one, or the path of one.")
    return [x if isinstance(x, Recording) else load(x) for x in some]


def _settings(robot: Robot | str | Path | None, values: Mapping[str, Any]) -> OnlineSettings:
    own = {} if not isinstance(robot, Robot) else {"gravity": robot.gravity, "joint_names": robot.joint_names}
    return OnlineSettings.from_mapping({**own, **values}, "settings")


def _robot_of(given: Recording, robot: Robot | str | Path | None, settings: OnlineSettings) -> tuple[RobotModel, Any]:
    """The model of the joints that a recording names, and its source with their names."""
    text = urdf_text(None, given.source) if robot is None else (robot if isinstance(robot, Robot) else Robot(robot)).urdf
    source, own = robot_of_source(given.source, text, settings)
    return own, source


def _same(first: RobotModel | None, own: RobotModel, given: Recording) -> RobotModel:
    if first is not None and own.joint_names != first.joint_names:
        raise DataError(
            f"{given.name} has joints {', '.join(own.joint_names)}, the first has {', '.join(first.joint_names)}. Use "
            "recordings of the same robot."
        )
    return first or own


def _model_file(model: Model) -> ModelFile | None:
    if model is None or isinstance(model, ModelFile):
        return model
    if isinstance(model, str | Path):
        return ModelFile.read(Path(model))
    found: ModelFile | None = model.details.model
    if found is None:
        raise DataError("The diagnosis that was given as model has none.")
    return found


def _origin(recordings: Sequence[Recording], verb: str, robot: Robot | str | Path | None) -> dict[str, Any]:
    bags = {"bags": [given.name for given in recordings]}
    return {**bags, **_file_of(robot), "command": f"sysid_ros.{verb}", "version": __version__}


def _file_of(robot: Robot | str | Path | None) -> dict[str, str]:
    """The robot's file, beside which its meshes may be, where it came from one."""
    path = (robot if isinstance(robot, Robot) else Robot(robot)).path if robot is not None else None
    return {"urdf": str(path)} if path is not None and path.is_file() else {}


def _warn(sentences: Iterable[str]) -> None:
    for sentence in sentences:
        warnings.warn(sentence, stacklevel=3)
