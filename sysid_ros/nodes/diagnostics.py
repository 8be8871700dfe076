"""The three statuses on ``/diagnostics``: input, estimator, timing."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from sysid_ros.input_gate import GateHealth, Level
from sysid_ros.nodes.believed import LEVEL_OF_STATUS, LEVELS
from sysid_ros.nodes.messages import stamp_of
from sysid_ros.nodes.timing import TimingReport
from sysid_ros.online.live_estimation import LiveEstimation
from sysid_ros.robot.inertial_parameters import MESSAGE_NAMES, TO_MESSAGE_ORDER

_LATE = 0.1
_BUSY = 0.8


@dataclass(frozen=True, slots=True)
class NodeState:
    """What the node knows beside the estimation.

    Attributes:
        state: the lifecycle state's name.
        problem: why the node could not be configured or has no model yet; empty where it has one.
        topic: resolved name of the joint states.
        publishers: how many publish there.
        input_problem: what is wrong with how joint states are published, quality of service or type; empty where nothing is.
        troubles: messages that the node could not handle, by kind.
        published: number of estimates.
    """

    state: str
    problem: str
    topic: str
    publishers: int
    input_problem: str = ""
    troubles: dict[str, int] = field(default_factory=dict)
    published: int = 0


def input_status(node: NodeState, live: LiveEstimation | None, health: GateHealth | None, ros_time: float) -> DiagnosticStatus:
    """Level, text and counts of the input; ``live`` is None where no joint states are read."""
    if live is None:
        level, texts = Level.STALE, [f"No joint states are read: the node is {node.state}. {node.problem}".strip()]
    elif health is None or health.level == Level.STALE:
        text = health.text if health is not None else live.status(0.0)[1]
        level, texts = Level.STALE, [f"No messages are used on {node.topic}; publishers: {node.publishers}.", text]
    else:
        level, texts = health.level, [health.text]
        if node.publishers > 1:
            level = max(level, Level.WARN)
            texts.append(f"{node.publishers} publishers share {node.topic}; expected is one. See 'ros2 topic info -v'.")
    if not ros_time > 0.0:
        level, texts = (
            Level.ERROR,
            ["use_sim_time is set but nobody publishes /clock. Publish it, or unset it.", *texts],
        )
    if node.input_problem:
        level, texts = Level.ERROR, [node.input_problem, *texts]
    values: dict[str, Any] = {"topic": node.topic, "publishers": node.publishers}
    if health is not None:
        values |= {
            "received": health.received,
            "accepted": health.accepted,
            "rejected": sum(health.counts.values()),
            "of other publishers": health.others,
            "rate_hz": health.rate,
            "age_s": health.age,
            "gaps": health.gaps,
            "restarts": health.restarts,
            "clock_offset_s": health.clock_offset,
        }
        values |= {f"rejected.{reason}": n for reason, n in sorted(health.counts.items())}
    values |= {f"trouble.{kind}": n for kind, n in sorted(node.troubles.items())}
    return status_message("input", level, " ".join(texts), values)


def estimator_status(node: NodeState, live: LiveEstimation | None, age: float) -> DiagnosticStatus:
    """Status of the estimate in words and numbers; ``age`` of the last usable sample [s]."""
    if node.problem:
        return status_message("estimator", Level.ERROR, node.problem, {"state": node.state})
    if live is None:
        return status_message("estimator", Level.STALE, f"The node is {node.state}.", {"state": node.state})
    status, reason = live.status(age) if node.state == "active" else ("stale", f"The node is {node.state}.")
    level = LEVEL_OF_STATUS.get(status, Level.WARN)
    texts = [f"{status}: {reason}" if reason else status]
    if not live.enabled:
        level, texts = max(level, Level.WARN), ["Disabled: the estimate is frozen until ~/enable.", *texts]
    if live.troubles:
        level = max(level, Level.ERROR) if level != Level.STALE else level
        texts.append(f"{sum(live.troubles.values())} internal errors set the estimate back; the last: {live.last_trouble}.")
    values: dict[str, Any] = {"state": node.state, "status": status, "reason": reason, "enabled": live.enabled}
    estimation = live.estimation
    values |= {"frame_id": estimation.frame, "joints": ",".join(live.robot.joint_names)}
    if (e := estimation.latest) is not None:
        values |= {"mass": e.mass, "mass_std": e.mass_std}
        values |= {f"com_{axis}": x for axis, x in zip("xyz", e.com.tolist(), strict=True)}
        values |= {f"com_{axis}_std": x for axis, x in zip("xyz", e.com_std.tolist(), strict=True)}
        values |= {f"{name}_std": x for name, x in zip(MESSAGE_NAMES, e.std[TO_MESSAGE_ORDER].tolist(), strict=True)}
        values["observable"] = ",".join(n for n, seen in zip(MESSAGE_NAMES, e.observable[TO_MESSAGE_ORDER], strict=True) if seen)
    values["events"] = len(estimation.events)
    if estimation.events:
        last = estimation.events[-1]
        values |= {"last_event": last.kind, "last_event_time": f"{last.t:.3f}"}
        values |= {"last_event_mass_before": last.mass_before, "last_event_mass_after": last.mass_after}
    committed = live.commit.committed
    values |= {"commit": live.commit.reason, "committed_mass": "" if committed is None else committed.mass}
    values |= {f"trouble.{kind}": n for kind, n in sorted(live.troubles.items())}
    values |= {f"note_{k}": sentence for k, sentence in enumerate((*live.robot.notes, *estimation.warnings))}
    return status_message("estimator", level, " ".join(texts), values)


def timing_status(report: TimingReport, published: int) -> DiagnosticStatus:
    """How late the messages are and what a step costs."""
    level, text = Level.OK, f"{report.messages / report.period:.0f} messages a second, latency {_ms(report.latency[0])} ms."
    if report.messages == 0:
        level, text = Level.STALE, "No message since the last report."
    elif report.load > _BUSY:
        level = Level.WARN
        text = f"The steps take {100 * report.load:.0f} % of the time; free the processor, or lower the messages' rate."
    elif _LATE < report.latency[0] < 1e6:
        level = Level.WARN
        text = f"The messages are {report.latency[0]:.2f} s old when they are used; {_LATE} s is much. Check clocks and load."
    values: dict[str, Any] = {
        "messages_per_s": report.messages / report.period,
        "estimates_per_s": report.estimates / report.period,
        "published": published,
        "load": report.load,
    }
    for name, quantiles in (("latency", report.latency), ("step", report.step)):
        values |= {f"{name}_{q}_ms": _ms(x) for q, x in zip(("p50", "p99", "max"), quantiles, strict=True)}
    values |= {f"latency_{q}_since_start_ms": _ms(x) for q, x in zip(("p50", "p99"), report.total_latency, strict=True)}
    return status_message("timing", level, text, values)


def diagnostic_array(node: Node, ros_time: float, hardware_id: str, statuses: list[DiagnosticStatus]) -> DiagnosticArray:
    """The statuses in one message, each named 'node: status'; the node's name with its namespace, so that two arms differ."""
    message = DiagnosticArray(status=statuses)
    message.header.stamp = stamp_of(max(ros_time, 0.0))
    for status in statuses:
        status.name = f"{node.get_fully_qualified_name().lstrip('/')}: {status.name}"
        status.hardware_id = hardware_id
    return message


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3f}"


def status_message(name: str, level: Level, text: str, values: dict[str, Any]) -> DiagnosticStatus:
    """One status; numbers with six digits."""
    return DiagnosticStatus(
        name=name,
        level=LEVELS.get(level, DiagnosticStatus.STALE),
        message=text,
        values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()],
    )


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else str(value)
    return str(value)
