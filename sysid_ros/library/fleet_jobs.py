"""The jobs of a fleet that are verbs of the library: replay, identify, diagnose on one bag, as rows of the store."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from sysid_ros.files import plain
from sysid_ros.fleet.jobs import Opened
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.fleet.store import Results
from sysid_ros.library import verbs
from sysid_ros.library.recording import Recording
from sysid_ros.library.results import Identified, Result
from sysid_ros.library.robot import Robot
from sysid_ros.online.carried import Carried

_TENSOR = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def replay(opened: Opened) -> Results:
    """What was carried, as the node would have found it live.

    Raises:
        SysidError: the bag can't be used.
    """
    entry = opened.entry
    frame = {"frame_id": entry.frame} if entry.frame else {}
    found = verbs.replay(_recording(opened), _robot(opened), model=opened.model, **{**entry.settings, **frame})
    at = found.details
    document = found.as_dict()
    for took in ("realtime_factor", "seconds"):
        document.pop(took, None)
    results = _results(found, document)
    results.payloads = [_payload(opened.key, one, at.start) for one in at.payloads]
    results.events = [
        {**opened.key, "t": e.t - at.start, "kind_of_event": e.kind, "mass_before": e.mass_before, "mass_after": e.mass_after}
        for e in at.events
    ]
    return results


def identify(opened: Opened) -> Results:
    """The arm's own dynamics from this bag alone, in which it must carry nothing.

    Raises:
        SysidError: the bag can't be used.
    """
    found = verbs.identify([_recording(opened)], _robot(opened), settings=opened.entry.settings)
    results = _results(found, found.as_dict())
    results.joints = [_joint(opened.key, found, name) for name in found.joint_names]
    return results


def diagnose(opened: Opened) -> Results:
    """What the known model gets wrong in this bag, and why.

    Raises:
        SysidError: the bag can't be used.
    """
    found = verbs.diagnose([_recording(opened)], _robot(opened), model=opened.model, settings=opened.entry.settings)
    return _results(found, found.as_dict())


def _recording(opened: Opened) -> Recording:
    return Recording(opened.path.name, opened.source)


def _robot(opened: Opened) -> Robot | None:
    return Robot(opened.entry.urdf) if opened.entry.urdf else None


def _results(found: Result, document: dict[str, Any]) -> Results:
    return Results({"document": json.dumps(plain(document), allow_nan=False)})


def _payload(key: dict[str, Any], one: Carried, start: float) -> dict[str, Any]:
    e = one.estimate
    row = {**key, "t_from": one.t0 - start, "t_to": one.t1 - start, "frame": e.frame, "status": e.status}
    row |= {"mass": e.mass, "mass_std": e.mass_std}
    for axis, value, std, told in zip("xyz", e.com, e.com_std, e.observable[1:4], strict=True):
        if told and np.isfinite(value) and np.isfinite(std):
            row |= {f"com_{axis}": float(value), f"com_{axis}_std": float(std)}
    told = bool(e.observable.all()) and bool(np.isfinite(e.inertia_com).all())
    return row | {"inertia": [float(e.inertia_com[at]) for at in _TENSOR] if told else None}


def _joint(key: dict[str, Any], found: Identified, joint: str) -> dict[str, Any]:
    """The parameters of a joint that are columns of the store: friction, offset and rotor by the names of their effects."""
    row = {**key, "joint": joint}
    for parameter in found.parameters:
        if parameter.joint == joint and parameter.effect in JOINT_PARAMETERS:
            row |= {parameter.effect: float(parameter.value), f"{parameter.effect}_std": float(parameter.std)}
    return row
