"""What the adaptive controller says of itself in ``/diagnostics``."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from sysid_ros.control.live_control import LiveControl
from sysid_ros.input_gate import Level
from sysid_ros.input_gate.health import GateHealth
from sysid_ros.nodes.diagnostics import status_message


class Heard(NamedTuple):
    """What a controller has heard.

    Attributes:
        age: time since the last joint state that was used [s]. old: states since the last report that came too late
            to be used, or with a stamp that fits none before it.
        refusal: why the last motion, or the last payload, was refused, or "".
    """

    age: float
    old: int
    refusal: str


def idle(state: str, problem: str) -> list[DiagnosticStatus]:
    """Of a node that is not active, or has no model; ``problem`` says why."""
    told = f"The node is {state}."
    level = Level.ERROR if problem else Level.STALE
    return [
        status_message("input", Level.STALE, f"{told} {problem}".strip(), {}),
        status_message("controller", level, problem or told, {"state": state}),
    ]


def input_status(health: GateHealth) -> DiagnosticStatus:
    """Of the joint states."""
    values = {"received": health.received, "accepted": health.accepted, "rate_hz": health.rate}
    return status_message("input", health.level, health.text, values | dict(health.counts))


def control_status(live: LiveControl, heard: Heard) -> DiagnosticStatus:
    """What the arm does, and what is wrong, in an order of its own: the worst decides the level."""
    level, texts = Level.OK, ["Following a motion." if live.following else "Holding the arm."]
    if live.yields:
        texts[0] = "Nothing is sent." if live.given_up else "Yielding."
    if live.clipped.any():
        where = ", ".join(name for name, k in zip(live.robot.joint_names, live.clipped, strict=True) if k)
        level, texts = Level.WARN, [*texts, f"Efforts reached their limit since the last report on {where}."]
    if heard.old:
        level, texts = Level.WARN, [*texts, f"Since the last report {_too_late(live, heard)}."]
    if heard.refusal:
        level, texts = Level.WARN, [*texts, heard.refusal]
    if live.told.refused:
        said = f"The payload of {live.told.mass:.2f} kg that was told is not what the arm carries: its torques do not show it."
        level, texts = Level.WARN, [*texts, said]
    if live.trouble:
        level, texts = Level.ERROR, [*texts, f"{live.trouble}."]
    if live.reference is None or heard.age > live.safety.state_timeout:
        level, texts[0] = Level.ERROR, _no_states(live, heard)
    if (beyond := live.unmodelled.strangest()) is not None:
        j = int(np.argmax(np.abs(beyond) / live.robot.effort_limit))
        texts = [
            *texts,
            f"{live.robot.joint_names[j]} took {abs(beyond[j]):.2g} more or less than the model and what was told explain: ",
        ]
        texts[-1] += "something is carried, rubs, or presses from outside."
    values: dict[str, Any] = {"state": "active", "mass": float(live.law.payload[0]), "acts_after": live.law.feedback.lead}
    values |= {f"error.{n}": float(x) for n, x in zip(live.robot.joint_names, live.error, strict=True)}
    return status_message("controller", level, " ".join(texts), values)


def _too_late(live: LiveControl, heard: Heard) -> str:
    return (
        f"{heard.old} came too late to be used, more than {1e3 * live.oldest:.0f} ms after the fastest (twice loop_delay, "
        "state_timeout), or with a stamp that fits none before"
    )


def _no_states(live: LiveControl, heard: Heard) -> str:
    late = f"{_too_late(live, heard)}; " if heard.old else ""
    if live.reference is None:
        return f"No usable joint states yet: {late}nothing is sent."
    return (
        f"No usable joint states for {heard.age:.1f} s: {late}the arm was brought to rest without feedback, and nothing is sent "
        "any more until they come."
    )
