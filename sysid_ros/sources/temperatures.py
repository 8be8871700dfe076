"""Temperatures that were recorded beside the joint states.

Drivers publish one ``sensor_msgs/Temperature`` a joint, on a topic each or all on one, with the joint or its link in
``frame_id``; ros2_control's joint_state_broadcaster publishes the state interface ``temperature`` of joints on
``/dynamic_joint_states``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from sysid_ros.exceptions import BagError
from sysid_ros.sample import TemperatureSeries
from sysid_ros.sources.bag import BagSource
from sysid_ros.sources.joint_state_cdr import typestore
from sysid_ros.sources.own_types import own_types, store_of
from sysid_ros.sources.table import TableSource

TEMPERATURE = "sensor_msgs/msg/Temperature"
DYNAMIC = "control_msgs/msg/DynamicJointState"
_INTERFACES = ("motor_temperature", "temperature", "present_temperature")
"""State interfaces of joints, the nearest to the friction first."""
_STEP = 0.1
"""Time between the dynamic joint states that are decoded: they come at the rate of the controller [s]."""
_SEARCHED = 20
"""Dynamic joint states without a temperature after which the topic is given up."""

Reading = tuple[str, float, float]
"""Frame, time [s] and value [degrees Celsius]."""


def temperatures(source: BagSource | TableSource) -> tuple[list[TemperatureSeries], tuple[str, ...]]:
    """Every temperature in a bag, a series a topic and frame, and a sentence for each topic that can't be read."""
    found: list[TemperatureSeries] = []
    notes: list[str] = []
    if isinstance(source, TableSource):
        return found, ()
    for topic, (kind, count) in sorted(source.topics.items()):
        readers = {TEMPERATURE: _stamped, DYNAMIC: _dynamic}
        if kind not in readers or count == 0:
            continue
        by_frame: dict[str, list[tuple[float, float]]] = {}
        try:
            for frame, t, value in readers[kind](source, topic):
                by_frame.setdefault(frame, []).append((t, value))
        except BagError as error:
            notes.append(f"No temperatures are read from {topic}: {error}")
            continue
        found += [TemperatureSeries(topic, frame, *np.array(rows, dtype=float).T) for frame, rows in by_frame.items()]
    return found, tuple(notes)


def _stamped(source: BagSource, topic: str) -> Iterator[Reading]:
    for received, message in _messages(source, topic, typestore(), 0.0):
        yield message.header.frame_id, _stamp(message, received), message.temperature


def _dynamic(source: BagSource, topic: str) -> Iterator[Reading]:
    found = False
    for searched, (received, message) in enumerate(_messages(source, topic, _types(source, topic), _STEP), start=1):
        for joint, values in zip(message.joint_names, message.interface_values, strict=False):
            named = {n.lower().replace(" ", "_"): v for n, v in zip(values.interface_names, values.values, strict=False)}
            name = next((n for n in _INTERFACES if n in named), None)
            if name is not None:
                found = True
                yield joint, _stamp(message, received), named[name]
        if not found and searched >= _SEARCHED:
            return


def _messages(source: BagSource, topic: str, types: Any, step: float) -> Iterator[tuple[float, Any]]:
    """Receive time [s] and message, not more often than each ``step`` [s]."""
    last = -np.inf
    for nanoseconds, data, kind in source.raw_messages(topic):
        received = nanoseconds * 1e-9
        if received - last < step:
            continue
        last = received
        try:
            message = types.deserialize_cdr(data, kind)
        except Exception as error:
            raise BagError(f"a message can't be decoded as {kind}: {error}.") from error
        yield received, message


def _types(source: BagSource, topic: str) -> Any:
    """The message types that a bag itself defines for a topic.

    Raises:
        BagError: it defines none.
    """
    return store_of(own_types(source.definition(topic), source.topics[topic][0]))


def _stamp(message: Any, received: float) -> float:
    stamp = message.header.stamp
    return float(stamp.sec + 1e-9 * stamp.nanosec) or received
