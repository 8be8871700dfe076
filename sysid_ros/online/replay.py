"""replay: the online estimation over a recording, with the same gate and the same ``step()`` as the live node."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from sysid_ros.files import plain, whole
from sysid_ros.input_gate import Gate
from sysid_ros.online.carried import Carried, carried
from sysid_ros.online.live_estimation import explained
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import ContactRecord, ImuRecord, JointStateRecord
from sysid_ros.signals.postures import PostureLog, Postures


@dataclass(frozen=True)
class Replay:
    """What a replay gave.

    Attributes:
        series: every estimate that a node would have published.
        final: the last one; the prior where the recording gave none.
        read, used: number of messages, those of other publishers apart. rejected: by reason. notes: what was put together from
            several publishers, and what was left out.
        feet: of a floating base, samples by what was doubtful about its feet.
        postures: that the robot had; None where no message was used.
        start: first stamp [s]. duration: of the recording by its stamps [s]. seconds: that the replay took [s].
    """

    series: list[PayloadEstimate]
    final: PayloadEstimate
    events: list[PayloadEvent]
    read: int
    used: int
    rejected: dict[str, int]
    start: float
    duration: float
    seconds: float
    status: str
    reason: str
    warnings: list[str] = field(default_factory=list)
    feet: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    postures: Postures | None = None

    @cached_property
    def payloads(self) -> list[Carried]:
        """What was carried, in order."""
        return carried(self.series, self.events, self.start + self.duration)


def replay(
    records: Iterable[JointStateRecord | ImuRecord | ContactRecord],
    gate: Gate,
    estimation: OnlineEstimation,
    progress: Callable[[int], None] = lambda n: None,
) -> Replay:
    """Feed every record through gate and estimation.

    Args:
        progress: called with the number of records since the last call, now and then.
    """
    series = []
    start = time.perf_counter()
    first_t, last_t, last_received = math.nan, math.nan, math.nan
    last_accepted = math.nan
    read = 0
    log = PostureLog()
    for record in records:
        if isinstance(record, JointStateRecord):
            read += 1
            if read % 1000 == 0:
                progress(1000)
        elif isinstance(record, ImuRecord):
            log.turn(record)
        last_received = record.receive_time
        for measurement in gate.take(record):
            last_t, last_accepted = measurement.t, record.receive_time
            log.add(measurement)
            if math.isnan(first_t):
                first_t = last_t
            estimate = estimation.step(measurement)
            if estimate is not None:
                series.append(estimate)
    progress(read % 1000)
    final = series[-1] if series else estimation.prior()
    status, reason = final.status, explained(final, gate)
    timeout = estimation.settings.sensor_timeout
    if not last_received - last_accepted <= timeout and read > 0:
        status, reason = "stale", f"The recording ends without a usable sample for more than {timeout:g} s."
    return Replay(
        series=series,
        final=final,
        events=estimation.events,
        read=gate.received,
        used=gate.accepted,
        rejected=dict(gate.counts),
        start=first_t,
        duration=0.0 if math.isnan(first_t) else last_t - first_t,
        seconds=time.perf_counter() - start,
        status=status,
        reason=reason,
        warnings=_warnings(gate, estimation, bool(series)),
        feet=estimation.stance_counts,
        notes=gate.notes,
        postures=log.postures(),
    )


def _warnings(gate: Gate, estimation: OnlineEstimation, told: bool) -> list[str]:
    """What the user should know, a sentence or a few each; ``told``: there was an estimate at all."""
    out = [*estimation.warnings, *gate.warnings]
    out += [f"{n} of {gate.received} messages rejected: {gate.last_texts[key]}" for key, n in gate.counts.items()]
    if estimation.fault:
        out.append(estimation.fault)
    if not told:
        out.append("The recording gave no estimate at all: it is too short, or no sample of it was usable.")
    return out


def as_json(result: Replay) -> dict[str, Any]:
    """The replay in plain types, as ``sysid replay --json`` writes it; what is not known is null."""
    final = result.final
    document: dict[str, Any] = {
        "frame": final.frame,
        "samples": {"read": result.read, "used": result.used, "rejected": result.rejected},
        "duration_s": result.duration,
        "realtime_factor": result.duration / result.seconds,
        "payload": {
            "mass": final.mass,
            "com": final.com,
            "inertia_com": final.inertia_com,
            "mass_std": final.mass_std,
            "com_std": final.com_std,
            "theta": final.theta,
            "covariance": final.covariance,
        },
        "status": result.status,
        "reason": result.reason,
        "observable": final.observable,
        "events": [{"t": e.t, "kind": e.kind, "mass_before": e.mass_before, "mass_after": e.mass_after} for e in result.events],
        "warnings": result.warnings,
        "notes": list(result.notes),
        "payloads": [_entry(c) for c in result.payloads],
    }
    if result.feet:
        document["feet"] = result.feet
    cleaned: dict[str, Any] = plain(document)
    return cleaned


def _entry(of: Carried) -> dict[str, Any]:
    e = of.estimate
    return {
        "t0": of.t0,
        "t1": of.t1,
        "mass": e.mass,
        "mass_std": e.mass_std,
        "com": e.com,
        "com_std": e.com_std,
        "inertia_com": e.inertia_com,
        "inertia_com_std": of.inertia_std,
        "theta": e.theta,
        "covariance": e.covariance,
        "observable": e.observable,
        "status": e.status,
    }


def write_series(path: Path, series: list[PayloadEstimate]) -> None:
    """One row an estimate: t, the ten parameters, their standard deviations, com, status."""
    names = inertial_parameters.NAMES
    with whole(path) as beside, beside.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", *names, *(f"{name}_std" for name in names), "com_x", "com_y", "com_z", "status"])
        for e in series:
            writer.writerow(
                [repr(e.t), *map(repr, e.theta.tolist()), *map(repr, e.std.tolist()), *map(repr, e.com.tolist()), e.status]
            )
