"""EventLog: what the jumps of the estimate were, once they have settled."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

from sysid_ros.online.payload_estimate import PayloadEvent


class EventLog:
    """Keeps events in order; the newest is refined until its payload is known.

    Args:
        empty: mass below which there is no payload [kg].
        settle_time: for how long after an event its mass is refined [s].
        same: jumps that follow one another within this are one event [s].

    Attributes:
        events: so far. open_until: time to which the newest is refined [s].
    """

    def __init__(self, empty: float, settle_time: float = 3.0, same: float = 0.5) -> None:
        self._same = same
        self._empty = empty
        self._settle_time = settle_time
        self.open_until = 0.0
        self._masses: deque[tuple[float, float]] = deque()
        self._before_lift: float | None = None
        self.events: list[PayloadEvent] = []

    def add(self, t: float, mass_before: float, mass_after: float) -> None:
        """A jump at ``t`` [s] with a first guess of the mass after it [kg]; soon after another one it is the same event."""
        if self.events and t - self.events[-1].t < self._same:
            return
        self.events.append(PayloadEvent(t, self._kind(mass_before, mass_after), mass_before, mass_after))
        self.open_until = t + self._settle_time

    def refine(self, t: float, mass: float) -> None:
        """The mass is known better at ``t`` [s]: correct the newest event until the settling time is over."""
        self._masses.append((t, mass))
        while t - self._masses[0][0] > self._settle_time:
            self._masses.popleft()
        if self.events and t <= self.open_until:
            newest = self.events[-1]
            self.events[-1] = replace(newest, mass_after=mass, kind=self._kind(newest.mass_before, mass))

    def lift(self, t: float) -> None:
        """A robot on legs was lifted off the ground at ``t`` [s]. Who lifts it pulls at it before: what has not settled by then
        was no change of the payload."""
        pulled = [e for e in self.events if e.t > t - self._settle_time]
        del self.events[len(self.events) - len(pulled) :]
        self.open_until = 0.0
        masses = [mass for _, mass in self._masses]
        self._before_lift = pulled[0].mass_before if pulled else masses[0] if masses else None

    def set_down(self, t: float, mass: float, std: float) -> None:
        """The mass [kg] is known again after the robot was set down at ``t`` [s]: an event where it is another than before."""
        before, self._before_lift = self._before_lift, None
        if before is not None and abs(mass - before) > max(self._empty, 4.0 * std):
            self.add(t, before, mass)

    def force(self, t: float, mass: float) -> None:
        """What was found since ``t`` [s] was no body but a force that passes; what is carried [kg] stays what it was."""
        self.withdraw(t)
        self.events.append(PayloadEvent(t, "external_force", mass, mass))

    def move(self, t: float, to: float) -> None:
        """What was found at ``t`` [s] happened at another time."""
        self.events = [replace(e, t=to) if e.t == t else e for e in self.events]

    def take_back(self, t: float) -> None:
        """What was found at ``t`` [s] has changed nothing; what has come since stays."""
        self.events = [e for e in self.events if abs(e.t - t) >= self._same]

    def withdraw(self, t: float) -> None:
        """What was found since ``t`` [s] has changed nothing."""
        self.events = [e for e in self.events if e.t < t - self._same]
        self.open_until = 0.0

    def body(self, t: float, now: float, mass_before: float, mass_after: float) -> None:
        """What was found at ``t`` [s] is a body, known at ``now`` [s]; the event then gets its masses [kg] and its kind."""
        for k, e in enumerate(self.events):
            if abs(e.t - t) < self._same:
                self.events[k] = PayloadEvent(e.t, self._kind(mass_before, mass_after), mass_before, mass_after)
                self.open_until = now + self._settle_time if k == len(self.events) - 1 else 0.0

    def _kind(self, before: float, after: float) -> str:
        if after < -self._empty:
            return "external_force"
        if before < self._empty <= after:
            return "pick"
        if after < self._empty <= before:
            return "drop"
        return "change"
