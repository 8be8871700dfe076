"""Temperatures of joints: which sensor belongs to which joint, what of it can be believed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, TemperatureSeries
from sysid_ros.signals.recording import Recording

_COLDEST, _HOTTEST = -60.0, 200.0
"""No sensor in a robot that runs shows less or more [degrees Celsius]; kelvins are above."""
_HELD = 60.0
"""A reading holds before the first and after the last one for so long [s]."""
_WORDS = re.compile(r"(^|_)(motor_|joint_)?temp(erature)?s?(_|$)")

Known = NDArray[np.bool_]


def with_temperatures(
    recording: Recording, robot: RobotModel, found: Sequence[TemperatureSeries]
) -> tuple[Recording, tuple[str, ...]]:
    """The recording with the temperatures of its joints at its stamps, and a sentence for each reading that is not used.

    A sensor belongs to the joint that the frame of its messages names, or whose link it names, else to the one in the name of
    its topic. Readings are interpolated; they hold for a minute before the first and after the last.
    """
    where: dict[int, TemperatureSeries] = {}
    strangers, sentences = [], []
    values = np.full(recording.q.shape, np.nan)
    for series in found:
        j = joint_of(series, robot)
        if j is None:
            strangers.append(_named(series))
            continue
        if j in where:
            sentences.append(
                f"{robot.joint_names[j]} has more than one temperature: {_named(where[j])} is used, {_named(series)} is not."
            )
            continue
        believed, why = _believed(series)
        if believed is not None:
            values[:, j] = _at(recording.t, believed)
            if np.isnan(values[:, j]).any():
                why = "its stamps are not those of the joint states, or end more than a minute before them. Record both at once."
        if why:
            sentences.append(f"The temperature of {robot.joint_names[j]} ({_named(series)}): {why}")
        if np.isfinite(values[:, j]).any():
            where[j] = series
    if strangers:
        sentences.append(
            f"Temperatures that belong to no joint of {', '.join(robot.joint_names)} are not used: {', '.join(strangers)}. "
            "Put the name of the joint, or of the link that it moves, into frame_id or into the name of the topic."
        )
    if not where:
        return recording, tuple(f"{recording.name}: {s}" for s in sentences)
    return replace(recording, temperature=values), tuple(f"{recording.name}: {s}" for s in sentences)


def joint_of(series: TemperatureSeries, robot: RobotModel) -> int | None:
    """Index of the joint that a sensor sits in, None where no name tells."""
    segments = series.topic.strip("/").split("/")
    names = {*segments, *(_WORDS.sub("", s) for s in segments)}
    for of_robot in (robot.joint_names, robot.body_names):
        if (frame := series.frame.lstrip("/")) in of_robot:
            return of_robot.index(frame)
    named = {names_of.index(name) for names_of in (robot.joint_names, robot.body_names) for name in names if name in names_of}
    return named.pop() if len(named) == 1 else None


def known_everywhere(
    fitted: Sequence[Recording], judged: Sequence[Recording], joints: Sequence[str]
) -> tuple[list[Recording], tuple[str, ...]]:
    """Recordings to fit on with the temperatures of those joints alone that all recordings know, and a sentence on the others."""
    known = np.array([_known(r) for r in (*fitted, *judged)])
    missing = np.any(known, axis=0) & ~np.all(known, axis=0)
    if not np.any(missing):
        return list(fitted), ()
    names = ", ".join(name for name, m in zip(joints, missing.tolist(), strict=True) if m)
    out = []
    for r in fitted:
        if r.temperature is not None:
            r = replace(r, temperature=np.where(missing, np.nan, r.temperature))
        out.append(r)
    return out, (f"The temperature of {names} is not known in all of the recordings: no friction is asked to follow it.",)


def _known(recording: Recording) -> Known:
    if recording.temperature is None:
        return np.zeros(recording.q.shape[1], dtype=np.bool_)
    return np.asarray(np.isfinite(recording.temperature).all(axis=0))


def _believed(series: TemperatureSeries) -> tuple[TemperatureSeries | None, str]:
    """The readings that can be right, in the order of their stamps, and what was wrong with the others."""
    t, values = series.t, series.values
    if len(values) > 1 and not np.any(values):
        return None, "it is 0 all the time, as of a sensor that is not connected. It is not used."
    good = (values >= _COLDEST) & (values <= _HOTTEST)  # False for what is no number
    if not good.any():
        return None, (
            f"none of its {len(values)} readings lies between {_COLDEST:g} and {_HOTTEST:g} degrees Celsius (the first is "
            f"{values[0]:g}). It is not used; publish degrees Celsius."
        )
    why = ""
    if not good.all():
        first = float(values[~good][0])
        why = (
            f"{int(np.sum(~good))} of {len(values)} readings do not lie between {_COLDEST:g} and {_HOTTEST:g} degrees Celsius "
            f"(the first is {first:g}) and are left out."
        )
    t, values = t[good], values[good]
    t, index = np.unique(t, return_index=True)
    return replace(series, t=t, values=values[index]), why


def _at(t: FloatArray, series: TemperatureSeries) -> FloatArray:
    """Readings at other times, NaN where none is near."""
    near = (t >= series.t[0] - _HELD) & (t <= series.t[-1] + _HELD)
    out: FloatArray = np.where(near, np.interp(t, series.t, series.values), np.nan)
    return out


def _named(series: TemperatureSeries) -> str:
    return f"{series.topic} ({series.frame})" if series.frame else series.topic
