"""From the messages of a recording to its raw channels.

Nothing that a diagnosis must see is rejected here: an effort that is a thousand times too large is a finding, not a bad message.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from sysid_ros.exceptions import DataError
from sysid_ros.input_gate.joined import JoinedRecords
from sysid_ros.input_gate.mapping import effort_factor
from sysid_ros.input_gate.rejections import of_length, of_names
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.effort_presets import said
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.signals.recording import Recording

_LATEST_STAMP = 1e12


def read_messages(
    name: str,
    records: Iterable[JointStateRecord],
    robot: RobotModel,
    settings: OnlineSettings,
    advance: Callable[[int], None] = lambda steps: None,
) -> tuple[Recording, tuple[str, ...]]:
    """The raw channels of a robot's joints, in the order of recording, and a sentence for each kind of message that is not used.

    An effort that is missing is NaN. Angles go on over a whole turn.

    Args:
        settings: ``effort_scale``, ``effort_sign`` and ``allow_unstamped`` are read.

    Raises:
        DataError: no message can be used; it says why.
    """
    joined = JoinedRecords(robot.joint_names, settings.max_gap)
    rows, received, reasons = _collect(_joined(records, joined, advance), robot)
    notes = tuple(f"{name}: {count} messages are not used: {text}" for text, count in reasons.items())
    notes += tuple(f"{name}: {text}" for text in joined.notes)
    notes += said(settings.effort_preset)
    if not rows:
        why = next(iter((*reasons, *joined.notes)), "There is none. Record /joint_states while the robot moves.")
        raise DataError(f"{name}: no message can be used. {why}")
    values = np.array(rows)
    t, q, v, tau = values[:, 0, 0], values[:, 1], values[:, 2], values[:, 3]
    if settings.allow_unstamped and not np.any(t):
        t = np.array(received)
    used = (t > 0.0) & (t < _LATEST_STAMP) & np.isfinite(q).all(axis=1)
    if not used.any():
        raise DataError(f"{name}: {_unusable(t, q, robot)}")
    if lost := int(np.sum(~used)):
        notes += (f"{name}: {lost} messages are not used: {_unusable(t[~used], q[~used], robot)}",)
    t, q, v, tau = t[used], _unwrapped(q[used], robot), v[used], tau[used] * effort_factor(robot, settings)
    measured = bool(np.isfinite(v).all())
    return Recording(name, t, q, v if measured else None, tau), notes


def _joined(
    records: Iterable[JointStateRecord], joined: JoinedRecords, advance: Callable[[int], None]
) -> Iterator[JointStateRecord]:
    """The messages with all of the joints."""
    for record in records:
        advance(1)
        yield from joined.take(record)


def _collect(records: Iterable[JointStateRecord], robot: RobotModel) -> tuple[list[FloatArray], list[float], Counter[str]]:
    """Stamp, positions, velocities and efforts of each message as rows of (4, n); NaN where it holds none."""
    n = robot.n
    index: dict[tuple[str, ...], NDArray[np.intp] | str] = {}
    rows: list[FloatArray] = []
    received: list[float] = []
    reasons: Counter[str] = Counter()
    for record in records:
        where = index.get(record.names)
        if where is None:
            rejection = of_names(record.names, robot.joint_names)
            where = rejection.text if rejection else np.array([record.names.index(j) for j in robot.joint_names], dtype=np.intp)
            index[record.names] = where
        count = len(record.names)
        lengths = len(record.position), len(record.velocity), len(record.effort)
        if isinstance(where, str) or lengths[0] != count or lengths[1] not in (0, count) or lengths[2] not in (0, count):
            reasons[where if isinstance(where, str) else of_length(record, count).text] += 1
            continue
        row = np.full((4, n), np.nan)
        try:
            row[0] = record.stamp
            row[1] = np.asarray(record.position, dtype=float)[where]
            if lengths[1]:
                row[2] = np.asarray(record.velocity, dtype=float)[where]
            if lengths[2]:
                row[3] = np.asarray(record.effort, dtype=float)[where]
        except (TypeError, ValueError) as error:
            reasons[f"It holds something else than numbers: {error}. Check the publisher."] += 1
            continue
        rows.append(row)
        received.append(record.receive_time)
    return rows, received, reasons


def _unusable(t: FloatArray, q: FloatArray, robot: RobotModel) -> str:
    """Why messages with these stamps and positions can't be used."""
    if np.all(t == 0.0):
        return "The stamp is 0: the driver never fills it in. Make it do so, or set allow_unstamped to use the receive time."
    bad = [name for j, name in enumerate(robot.joint_names) if not np.isfinite(q[:, j]).all()]
    if bad:
        return f"The position of {', '.join(bad)} is no number. The driver can't read this joint: check its hardware."
    return f"The stamp is {t[0]:g} s; it must be a time after 0. Correct the driver."


def _unwrapped(q: FloatArray, robot: RobotModel) -> FloatArray:
    """Angles without the jumps by whole turns of a driver that publishes them between -pi and pi."""
    out = q.copy()
    for j in np.flatnonzero(~robot.is_prismatic):
        turns = np.round(np.diff(q[:, j]) / (2.0 * np.pi))
        off = np.abs(np.diff(q[:, j]) - 2.0 * np.pi * turns)
        out[1:, j] -= 2.0 * np.pi * np.cumsum(np.where(off < 0.5, turns, 0.0))
    return out
