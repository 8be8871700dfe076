"""The job ``track``: a bag's joints, payloads and events as rows of the store."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sysid_ros.fleet.jobs import Opened
from sysid_ros.fleet.known_robot import KnownRobot
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.fleet.store import Results
from sysid_ros.fleet.track import CarriedBody, Tracked
from sysid_ros.fleet.track import track as track_recording
from sysid_ros.input_gate.message_faults import at_own_times
from sysid_ros.input_gate.raw_messages import read_messages
from sysid_ros.robot.inertial_parameters import com_jacobian, to_com
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.temperature import with_temperatures
from sysid_ros.sources import robot_of_source, temperatures

_SURE = 3.0
"""Standard deviations by which a mass must differ from nothing to be one."""
_TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def track(opened: Opened) -> Results:
    """Track one bag.

    Raises:
        SysidError: it can't be used, and why.
    """
    settings = opened.settings
    source, robot = robot_of_source(opened.source, opened.urdf, settings)
    recording, notes = read_messages(opened.path.name, source, robot, settings)
    series, unread = temperatures(source)
    wanted = [one for one in series if opened.entry.temperature in ("", one.topic)]
    recording, unused = with_temperatures(recording, robot, wanted)
    recording, off = at_own_times(replace(recording.in_order(), name=opened.path.name))
    known = KnownRobot(robot, opened.model, opened.entry.frame or robot.default_frame, np.array(opened.entry.payload))
    found = track_recording(known, recording, settings.max_gap)
    said = [*source.notes, *notes, *([off] if off else []), *unread, *unused, *found.notes]
    warm = _temperature(recording)
    results = Results({"reason": " ".join(said), "temperature": _number(np.nanmean(warm)) if np.isfinite(warm).any() else None})
    results.joints = [_joint(opened.key, found, j, float(warm[j])) for j in range(robot.n)]
    results.payloads = [_payload(opened.key, found.frame, body) for body in found.carried]
    results.events = _events(opened.key, found, float(known.payload[0]))
    return results


def _temperature(recording: Recording) -> FloatArray:
    """Mean of each joint's, shape (n,) [degC], NaN where it is not known."""
    warm = recording.temperature
    if warm is None:
        return np.full(recording.q.shape[1], np.nan)
    known = np.isfinite(warm)
    return np.asarray(np.where(known, warm, 0.0).sum(axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan))


def _joint(key: dict[str, Any], found: Tracked, j: int, temperature: float) -> dict[str, Any]:
    row = {**key, "joint": found.joint_names[j], "temperature": _number(temperature)}
    for i, name in enumerate(JOINT_PARAMETERS):
        row[name], row[f"{name}_std"] = _number(found.values[i, j]), _number(found.std[i, j])
    return row | {
        "covariance": found.covariance[j].ravel().tolist(),
        "residual": _number(found.residual[j]),
        "torque": _number(found.torque[j]),
        "lever": _number(found.levers.reach[j]),
        "torque_per_zero": _number(found.levers.by_zero[j]),
        "torque_per_mass": _number(found.levers.by_mass[j]),
        "from_prior": ", ".join(found.from_prior[j]),
        "model_error": found.model_error[j],
    }


def _payload(key: dict[str, Any], frame: str, body: CarriedBody) -> dict[str, Any]:
    std = np.sqrt(np.diag(body.covariance))
    row = {**key, "t_from": body.t_from, "t_to": body.t_to, "frame": frame}
    if not body.told[0]:
        return row | {"status": "not_told"}
    row |= {"mass": float(body.theta[0]), "mass_std": float(std[0]), "status": "ok" if _is_there(body) else "none"}
    if not (_is_there(body) and body.told[:4].all()):
        return row
    _, com, inertia = to_com(body.theta)
    jacobian = com_jacobian(body.theta)
    com_std = np.sqrt(np.diag(jacobian @ body.covariance @ jacobian.T))
    for axis, value, its in zip("xyz", com, com_std, strict=True):
        row |= {f"com_{axis}": float(value), f"com_{axis}_std": float(its)}
    return row | {"inertia": [float(inertia[at]) for at in _TENSOR] if body.told.all() else None}


def _is_there(body: CarriedBody, empty: float = 0.0) -> bool:
    return bool(abs(body.theta[0] - empty) > _SURE * np.sqrt(body.covariance[0, 0]))


def _events(key: dict[str, Any], found: Tracked, empty: float) -> list[dict[str, Any]]:
    """A change of what is carried between each body and the next; ``empty`` is what the robot always carries [kg]."""
    kinds = {(False, True): "pick", (True, False): "drop"}
    rows = []
    for before, after in zip(found.carried, found.carried[1:], strict=False):
        kind = kinds.get((_is_there(before, empty), _is_there(after, empty)), "change")
        masses = {"mass_before": float(before.theta[0]), "mass_after": float(after.theta[0])}
        rows.append({**key, "t": after.t_from, "kind_of_event": kind, **masses})
    return rows


def _number(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None
