"""The state of the input in words and numbers, from which a node makes its diagnostics."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum


class Level(IntEnum):
    """As ``diagnostic_msgs/DiagnosticStatus`` numbers them."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class GateHealth:
    """What :meth:`InputGate.health` says.

    Attributes:
        level: OK, WARN, ERROR or STALE.
        text: one sentence or more: what, the value found, what is allowed, the cure.
        counts: rejected since the start, by reason.
        recent: rejected within the last second, by reason.
        received, accepted: messages since the start, those of other publishers apart. others: of these.
        rate: accepted samples a second over the last second [Hz], by the times they were received.
        last_stamp: stamp of the last accepted sample [s], None before the first.
        age: time since the last accepted sample was received [s], infinite before the first.
        gaps: gaps longer than ``max_gap`` since the start.
        restarts: jumps of the stamps back in time since the start.
        clock_offset: receive time minus stamp of the last accepted sample [s].
        warnings: what is doubtful now, one sentence each.
    """

    level: Level
    text: str
    counts: Mapping[str, int]
    recent: Mapping[str, int]
    received: int
    accepted: int
    others: int
    rate: float
    last_stamp: float | None
    age: float
    gaps: int
    restarts: int
    clock_offset: float
    warnings: tuple[str, ...]


STALE_AFTER = 2.0
"""Without any message for so long the input is stale [s]."""

GAP, RESTART, ACCEPTED, OTHERS = "gap", "restart", "", "other publisher"
NO_FAULTS = (GAP, RESTART, ACCEPTED, OTHERS)
"""Events beside the reasons of rejections."""

_CLOCK_TOLERANCE = 1.0
_OTHER_CLOCK = 1e6
_LOW_RATE = 40.0
_REJECTED_SHARE = 0.05


def judge(
    silence: float | None,
    age: float,
    timeout: float,
    recent: Mapping[str, int],
    texts: Mapping[str, str],
    rate: float,
    clock_offset: float,
    errors: Iterable[str],
    warnings: Iterable[str],
) -> tuple[Level, str, tuple[str, ...]]:
    """Level, text and warnings.

    Args:
        silence: time since any message was received [s], None before the first.
        age: time since the last accepted one [s].
        timeout: the longest age that is in order [s].
        recent: events of the last second, by reason.
        texts: the last sentence for each reason; that of the newest rejection is the last.
        rate: [Hz].
        clock_offset: receive time minus stamp [s].
        errors: sentences that are errors, of checks over many samples.
        warnings: sentences that are warnings, of checks over many samples.
    """
    if silence is None:
        return Level.STALE, "No message has arrived yet. Check the topic's name and that the robot's driver runs.", ()
    if silence > STALE_AFTER:
        before = (
            f" None of those before was usable; the last: {list(texts.values())[-1]}" if texts and age == float("inf") else ""
        )
        return Level.STALE, f"No message for {silence:.1f} s. Check that the robot's driver still runs.{before}", ()
    rejected = {reason: n for reason, n in recent.items() if reason not in NO_FAULTS}
    if age > timeout:
        since = "No usable message yet" if age == float("inf") else f"No usable message for {age:.1f} s"
        return Level.ERROR, f"{since}: {_why_none(rejected, recent, texts)}", ()
    found_errors, found = [sentence for sentence in errors if sentence], [sentence for sentence in warnings if sentence]
    if recent.get(RESTART, 0) > 1:
        found_errors.append(
            f"The stamps jumped back {recent[RESTART]} times within a second. "
            "Two publishers with different clocks share the topic: stop one."
        )
    found += _doubts(recent, rejected, texts, rate, clock_offset)
    if found_errors:
        return Level.ERROR, " ".join(found_errors), tuple(found_errors + found)
    if found:
        return Level.WARN, " ".join(found), tuple(found)
    return Level.OK, f"{rate:.0f} samples a second.", ()


def _why_none(rejected: Mapping[str, int], recent: Mapping[str, int], texts: Mapping[str, str]) -> str:
    """Why no message of the last second is usable."""
    if rejected:
        return texts[max(rejected, key=lambda reason: rejected[reason])]
    if recent.get(OTHERS, 0):
        return f"Only other publishers' messages arrive. {texts.get('joints_missing', '')}".rstrip()
    return "The messages have stopped."


def _doubts(
    recent: Mapping[str, int], rejected: Mapping[str, int], texts: Mapping[str, str], rate: float, clock_offset: float
) -> list[str]:
    """What is doubtful about the messages of the last second, a sentence each; arguments as of :func:`judge`."""
    found = []
    if recent.get(RESTART, 0) == 1:
        found.append("The stamps jumped back, as when a bag or a simulation starts again; the filters were restarted.")
    if recent.get(GAP, 0):
        found.append(
            f"{recent[GAP]} gaps between samples within the last second. Messages are lost, or their rate is below 1 / max_gap."
        )
    total = sum(rejected.values()) + recent.get(ACCEPTED, 0)
    if sum(rejected.values()) > _REJECTED_SHARE * total:
        worst = max(rejected, key=lambda reason: rejected[reason])
        found.append(f"{sum(rejected.values())} of {total} messages rejected within the last second: {texts[worst]}")
    if abs(clock_offset) > _OTHER_CLOCK:
        found.append(
            f"The stamps are {clock_offset:.0f} s behind the receiving clock: one of them is simulated time. "
            "Set use_sim_time alike on both."
        )
    elif abs(clock_offset) > _CLOCK_TOLERANCE:
        found.append(
            f"The stamps are {clock_offset:.2f} s behind the receiving clock; within 1 s is usual. "
            "Synchronise the computers' clocks."
        )
    if 0.0 < rate < _LOW_RATE:
        found.append(
            f"Only {rate:.0f} samples a second arrive; {_LOW_RATE:.0f} or more are needed to follow the motion. "
            "Raise the driver's rate."
        )
    return found
