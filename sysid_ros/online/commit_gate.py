"""CommitGate: which estimates are good enough to be set in a robot's controller, where a value is set rarely and for long."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from sysid_ros.exceptions import SettingsError
from sysid_ros.online.payload_estimate import PayloadEstimate


def _gate(default: float, description: str, unit: str, high: float) -> Any:
    return field(default=default, metadata={"description": description, "unit": unit, "low": 0.0, "high": high, "choices": ()})


@dataclass(frozen=True, slots=True, kw_only=True)
class CommitSettings:
    """When an estimate is committed.

    Raises:
        SettingsError: a value is not a number or out of its range.
    """

    mass_std: float = _gate(0.1, "largest standard deviation of the mass that is committed", "kg", 100.0)
    com_std: float = _gate(
        0.02, "largest standard deviation of the centre of mass, on its worst axis, that is committed", "m", 10.0
    )
    dwell: float = _gate(1.0, "the estimate must stay within the dead band for so long before it is committed", "s", 600.0)
    mass_dead_band: float = _gate(0.05, "a mass that differs by less from the committed one is not committed anew", "kg", 100.0)
    com_dead_band: float = _gate(
        0.01, "a centre of mass that differs by less from the committed one is not committed anew", "m", 10.0
    )

    def __post_init__(self) -> None:
        for f in fields(self):
            value, high = getattr(self, f.name), f.metadata["high"]
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= high:
                raise SettingsError(f"commit.{f.name} is {value!r}; it must be a number from 0 to {high:g} {f.metadata['unit']}.")
            object.__setattr__(self, f.name, float(value))


class CommitGate:
    """Passes an estimate on when it is known well, has held still for a while, and differs from the last one that passed.

    Args:
        settings: the thresholds; may be replaced at any time.

    Attributes:
        committed: the last estimate that passed, or None. blocked: why nothing passes now, whatever is offered; empty: it may.
        reason: why the last estimate offered did not pass, or that it did.
    """

    def __init__(self, settings: CommitSettings) -> None:
        self.settings = settings
        self.committed: PayloadEstimate | None = None
        self.reason, self.blocked = "No estimate yet.", ""
        self._anchor: PayloadEstimate | None = None

    def interrupt(self, reason: str) -> None:
        """What came before says nothing about what comes next: the dwell starts anew."""
        self._anchor = None
        self.reason = reason

    def block(self, reason: str) -> None:
        """Let nothing pass until the reason is gone, that is, empty."""
        self.blocked = reason
        if reason:
            self.interrupt(reason)

    def offer(self, estimate: PayloadEstimate) -> PayloadEstimate | None:
        """The estimate if it is to be committed now, else None."""
        if refusal := self._refusal(estimate):
            self.interrupt(refusal)
            return None
        if self.committed is not None and not self._differ(estimate, self.committed):
            self._anchor = self.committed
            self.reason = "Committed; changes since are within the dead band."
            return None
        anchor = self._anchor
        if anchor is None or estimate.t < anchor.t or self._differ(estimate, anchor):
            self._anchor = anchor = estimate
        held = estimate.t - anchor.t
        if held < self.settings.dwell:
            self.reason = f"The estimate has held still for {held:.1f} of {self.settings.dwell:g} s."
            return None
        return self._pass(estimate)

    def commit_now(self, estimate: PayloadEstimate | None) -> tuple[bool, str]:
        """Commit without dwell and dead band; whether it was done, and a sentence."""
        if estimate is None:
            return False, "There is no estimate yet, so nothing was committed."
        if refusal := self._refusal(estimate):
            return False, refusal
        self._pass(estimate)
        if estimate.is_empty:
            return True, "Committed: no payload."
        return True, f"Committed: {estimate.mass:.3f} kg (std {estimate.mass_std:.3f} kg)."

    def _pass(self, estimate: PayloadEstimate) -> PayloadEstimate:
        self.committed = estimate
        self.reason = "Committed."
        return estimate

    def _refusal(self, estimate: PayloadEstimate) -> str:
        if self.blocked:
            return self.blocked
        if estimate.status not in ("ok", "no_payload"):
            return f"The status is {estimate.status}: {estimate.reason}"
        s = self.settings
        mass_std = math.sqrt(estimate.covariance[0, 0])
        if not mass_std <= s.mass_std:
            return f"The std of the mass is {mass_std:.3g} kg; at most {s.mass_std:g} kg is committed (commit.mass_std)."
        if estimate.status == "no_payload":
            return ""
        com_std = math.sqrt(max(estimate.body.com_covariance.diagonal().tolist()))
        if not com_std <= s.com_std:
            return f"The std of the centre of mass is {com_std:.3g} m; at most {s.com_std:g} m is committed (commit.com_std)."
        return ""

    def _differ(self, a: PayloadEstimate, b: PayloadEstimate) -> bool:
        if a.is_empty or b.is_empty:
            return a.is_empty != b.is_empty
        return (
            abs(a.body.mass - b.body.mass) > self.settings.mass_dead_band
            or math.dist(a.body.com, b.body.com) > self.settings.com_dead_band
            or a.frame != b.frame
        )
