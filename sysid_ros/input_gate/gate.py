"""InputGate: from received joint states to measurements that can be believed."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from sysid_ros.input_gate import gravity_check, health, kernel, rejections
from sysid_ros.input_gate.gravity_check import GravityCheck
from sysid_ros.input_gate.health import GateHealth
from sysid_ros.input_gate.joined import JoinedRecords
from sysid_ros.input_gate.mapping import Mapping, largest_gravity_torque, limit_table
from sysid_ros.input_gate.rejections import Rejection
from sysid_ros.input_gate.velocity_agreement import VelocityAgreement
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.effort_presets import said
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import ContactRecord, FloatArray, ImuRecord, JointStateRecord, Measurement

_BACK_IN_TIME = 1.0  # s; more is a restart of the clock, less a message that was overtaken
_LATEST_STAMP = 1e12
_KINDS_OF_MESSAGES = 64
_REMEMBERED_EVENTS = 8192


class InputGate:
    """Maps joints by name, applies ``effort_scale`` and ``effort_sign``, unwraps angles, rejects what can't be true, and counts.

    Never raises on a message and repairs nothing: what it does not believe it rejects with a reason. Where the stamps jump back
    by more than a second, as when a bag is played again, the message is accepted and ``restarts`` goes up by one. A gap longer
    than ``max_gap`` is accepted too and counted in ``gaps``. In both cases differences must not be taken across it: who uses the
    measurements sees the same from their times.

    Velocities are passed on while they agree with the positions; else ``Measurement.v`` is None and a warning says so.

    Args:
        robot: whose ``joint_names`` are the order of every measurement.
        settings: ``effort_scale``, ``effort_sign``, ``effort_type``, ``velocity_source``, ``allow_unstamped``, ``max_gap``,
            ``sensor_timeout``, ``standstill_velocity`` are read.

    Attributes:
        received, accepted: number of messages, those of other publishers apart. others: of these, see :class:`.JoinedRecords`.
        counts: rejected messages by reason. gaps, restarts: see above.
        last_texts: the last sentence for each reason. last_rejection: of the last message that was not used.

    Raises:
        SettingsError: ``effort_scale`` or ``effort_sign`` does not fit the robot.
    """

    def __init__(self, robot: RobotModel, settings: OnlineSettings) -> None:
        self.robot = robot
        self.settings = settings
        self.received = self.accepted = self.gaps = self.restarts = 0
        self.counts: Counter[str] = Counter()
        self.last_texts: dict[str, str] = {}
        self.last_rejection = Rejection("", "")
        self._needs_velocity = settings.velocity_source == "message"
        self._total_effort = settings.effort_type == "total"
        self._allow_unstamped = settings.allow_unstamped
        self._max_gap = settings.max_gap
        self._standstill = settings.standstill_velocity
        self._mappings: dict[tuple[str, ...], Mapping | Rejection] = {}
        self._names: tuple[str, ...] | None = None
        self._mapping: Mapping | Rejection = self.last_rejection
        self._joined = JoinedRecords(robot.joint_names, settings.max_gap)
        self._limits = limit_table(robot, settings)
        self._state, self._held = kernel.nothing_seen(robot.n)
        self._clock = np.zeros(6)
        self._clock[kernel.FRESH] = 1.0
        self._last_t = -np.inf
        self._weightless_level = 0.02 * float(largest_gravity_torque(robot).max())
        self._gravity = GravityCheck(robot, settings.frame_id, settings.payload_prior)
        self._next_gravity = -np.inf
        self._may_be_zero = not self._total_effort
        self._velocity = VelocityAgreement()
        self._past_warnings: dict[str, str] = {}
        self._events: deque[tuple[float, str]] = deque(maxlen=_REMEMBERED_EVENTS)
        self._repeated: list[Measurement] = []
        self._last_received: float | None = None
        self._last_accepted: tuple[float, float] | None = None  # receive time, stamp
        self._compile()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was found doubtful since the start without being rejected, the last sentence of each kind."""
        return tuple(self._past_warnings.values())

    @property
    def others(self) -> int:
        """Messages of other publishers on the topic."""
        return self._joined.left_out.total()

    @property
    def notes(self) -> tuple[str, ...]:
        """What efforts are taken for, what was put together from several publishers and what was left out, a sentence each."""
        return (*said(self.settings.effort_preset), *self._joined.notes)

    def accept(self, record: JointStateRecord) -> Measurement | Rejection:
        """The measurement that a message holds, or why it is not used; at once, also if it may be a repeated one."""
        return next(iter(self.take(record, at_once=True)), self.last_rejection)

    def measurements(self, records: Iterable[JointStateRecord]) -> Iterator[Measurement]:
        """What many messages hold, without those that are not used."""
        return (measurement for record in records for measurement in self.take(record))

    def take(self, record: JointStateRecord | ImuRecord | ContactRecord, at_once: bool = False) -> list[Measurement]:
        """The measurements that are believed now that a message is in, one as a rule; an IMU tells nothing of an arm.

        A message in which no effort has changed while the arm moves repeats an old one. Unless asked for ``at_once`` it is kept
        until the next one that differs; where none comes in time, as of a driver that hangs, none of them is used.
        """
        if not isinstance(record, JointStateRecord):
            return []
        self._last_received = record.receive_time
        if (record.names is self._names or record.names == self._names) and isinstance(self._mapping, Mapping):
            found = self._judged(record)
        else:
            found = [measurement for whole in self._whole(record) for measurement in self._judged(whole)]
        if at_once:
            return found
        self._repeated += found
        if not found or self._clock[kernel.DOUBTFUL] != 0.0:
            return []
        self._repeated, found = [], self._repeated
        return found

    def _whole(self, record: JointStateRecord) -> Sequence[JointStateRecord]:
        """The messages with all of the joints that one makes; itself where it is to be judged for what it lacks."""
        others, joined = self.others, self._joined.joins
        try:
            found = self._joined.take(record)
        except (TypeError, ValueError):
            return (record,)
        if self._joined.joins and not joined:
            self.received -= self.counts.pop("joints_missing", 0)  # they lacked nothing: the others had not come yet
        if self.others > others:
            if rejection := rejections.of_names(tuple(record.names), self.robot.joint_names):
                self.last_rejection = rejection
                self.last_texts.setdefault(rejection.reason, rejection.text)
            self._events.append((record.receive_time, health.OTHERS))
        return found

    def _judged(self, record: JointStateRecord) -> list[Measurement]:
        """The measurement in a message with all of the joints, in a list that is empty where it is not used."""
        self.received += 1
        try:
            result = self._measurement(record)
        except (TypeError, ValueError, OverflowError) as error:
            result = Rejection("malformed", f"The message holds something else than numbers: {error}. Check the publisher.")
        if isinstance(result, Rejection):
            self._reject(result, record.receive_time)
            return []
        self.accepted += 1
        self._last_accepted = (record.receive_time, self._last_t)
        self._events.append((record.receive_time, health.ACCEPTED))
        return [result]

    def _reject(self, rejection: Rejection, receive_time: float) -> None:
        reason, self.last_rejection = rejection.reason, rejection
        self.counts[reason] += 1
        if reason == rejections.STUCK:
            self.accepted -= len(self._repeated)
            self.counts[reason] += len(self._repeated)
            self._repeated.clear()
        self.last_texts.pop(reason, None)  # the newest comes last
        self.last_texts[reason] = rejection.text
        self._events.append((receive_time, reason))

    @property
    def suspicion(self) -> str:
        """What the effort is, if something else says that it does not fit the model: see :class:`.GravityCheck`."""
        return self._gravity.suspicion()

    def health(self, now: float) -> GateHealth:
        """The state of the input at ``now`` [s], a time of the clock that ``receive_time`` is from."""
        events: Counter[str] = Counter()
        first = last = now
        for t, reason in reversed(self._events):
            if abs(now - t) > 1.0:
                break
            if reason == health.ACCEPTED:
                first, last = t, (t if events[reason] == 0 else last)
            events[reason] += 1
        rate = (events[health.ACCEPTED] - 1) / (last - first) if last > first else 0.0
        age = now - self._last_accepted[0] if self._last_accepted else np.inf
        offset = self._last_accepted[0] - self._last_accepted[1] if self._last_accepted else 0.0
        level, text, warnings = health.judge(
            None if self._last_received is None else now - self._last_received,
            age,
            self.settings.sensor_timeout,
            events,
            self.last_texts,
            rate,
            offset,
            errors=(self._gravity.error,),
            warnings=(self._gravity.warning, self._velocity.warning),
        )
        return GateHealth(
            level=level, text=text,
            counts=dict(self.counts),
            recent={reason: n for reason, n in events.items() if reason not in health.NO_FAULTS},
            received=self.received, accepted=self.accepted, others=self.others,
            rate=rate, last_stamp=self._last_accepted[1] if self._last_accepted else None,
            age=age,
            gaps=self.gaps, restarts=self.restarts,
            clock_offset=offset, warnings=warnings,
        )  # fmt: skip

    def _measurement(self, record: JointStateRecord) -> Measurement | Rejection:
        names = record.names
        mapping = self._mapping if names is self._names or names == self._names else self._mapping_of(tuple(names))
        if isinstance(mapping, Rejection):
            return mapping
        position, velocity, effort = record.position, record.velocity, record.effort
        has_velocity = len(velocity) > 0
        if len(position) != mapping.size or len(effort) != mapping.size or (has_velocity and len(velocity) != mapping.size):
            return rejections.of_length(record, mapping.size)
        if self._needs_velocity and not has_velocity:
            return rejections.no_velocity()
        t = float(record.stamp)  # another type would be compiled for anew
        if t == 0.0 and self._allow_unstamped:
            t = float(record.receive_time)
        dt = t - self._last_t
        if not 0.0 < dt <= self._max_gap or not t < _LATEST_STAMP:
            if not 0.0 < t < _LATEST_STAMP or -_BACK_IN_TIME <= dt <= 0.0:
                return rejections.of_stamp(t, self._last_t)
            if dt <= 0.0:
                self._restart(record.receive_time)
            else:
                self._start_afresh()
        mapping.position[:] = position
        mapping.effort[:] = effort
        if has_velocity:
            mapping.velocity[:] = velocity
        out = np.empty((3, self.robot.n))
        code = kernel.check(
            mapping.raw, has_velocity, self._needs_velocity, self._velocity.proven, mapping.index, t, self._may_be_zero,
            self._standstill, self._limits, self._state, self._clock, self._held, out,
        )  # fmt: skip
        if code == kernel.EFFORT_ZERO and self._is_weightless(mapping.position[mapping.index]):
            self._may_be_zero = True
            return self._measurement(record)
        if code % kernel.CODES > kernel.WINDOW_DISAGREES:
            return rejections.of_check(code, self.robot.joint_names, mapping.raw[:, mapping.index], self._limits, dt)
        if dt > self._max_gap and self._last_t > 0.0:
            self.gaps += 1
            self._events.append((record.receive_time, health.GAP))
        self._last_t = t
        if code != kernel.OK:
            self._velocity.compare(code, self.robot.joint_names)
            if self._velocity.warning:
                self._past_warnings["velocity"] = self._velocity.warning
        q, v, tau = out
        if t >= self._next_gravity and self._total_effort:
            self._look_at_gravity(t, q, tau)
        return Measurement(t, q, v if self._velocity.trusted and v[0] == v[0] else None, tau)

    def _mapping_of(self, names: tuple[str, ...]) -> Mapping | Rejection:
        mapping = self._mappings.get(names)
        if mapping is None:
            mapping = rejections.of_names(names, self.robot.joint_names) or Mapping.of(names, self.robot.joint_names)
            if len(self._mappings) < _KINDS_OF_MESSAGES:
                self._mappings[names] = mapping
        self._names, self._mapping = names, mapping
        return mapping

    def _compile(self) -> None:
        """Compile now and not at the first message; NaN is rejected and changes nothing."""
        n = self.robot.n
        kernel.check(
            np.full((3, n), np.nan), False, False, False, np.arange(n, dtype=np.intp), 0.0, True, 0.0,
            self._limits, self._state, self._clock, self._held, np.empty((3, n)),
        )  # fmt: skip

    def _start_afresh(self) -> None:
        self._clock[kernel.FRESH] = 1.0
        self._gravity.restart()

    def _restart(self, receive_time: float) -> None:
        self.restarts += 1
        self._events.append((receive_time, health.RESTART))
        self._last_t = self._next_gravity = -np.inf
        self._state, self._held = kernel.nothing_seen(self.robot.n)
        self._start_afresh()

    def _look_at_gravity(self, t: float, q: FloatArray, tau: FloatArray) -> None:
        self._next_gravity = t + gravity_check.PERIOD
        if self._may_be_zero:
            self._may_be_zero = self._is_weightless(q)
        self._gravity.add(t, q, tau)
        for kind, sentence in (("gravity_sign", self._gravity.error), ("gravity_ratio", self._gravity.warning)):
            if sentence:
                self._past_warnings[kind] = sentence

    def _is_weightless(self, q: FloatArray) -> bool:
        return float(np.abs(self.robot.gravity_torque(q)).max()) <= self._weightless_level
