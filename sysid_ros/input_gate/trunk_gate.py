"""TrunkGate: IMU and contact messages, checked, and put beside the joint states by their stamps."""

from __future__ import annotations

from collections import Counter, deque

import numpy as np

from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.input_gate.rejections import Rejection
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.rotation import rotation_of
from sysid_ros.sample import ContactRecord, FloatArray, ImuRecord, Measurement, TrunkReading

_WAIT = 0.1
"""A measurement waits for the IMU for so long, by the stamps of the joints [s]."""
_KEPT = 1.0
"""IMU messages are kept for so long [s]."""
_FASTEST, _HARDEST = 60.0, 1000.0
"""Angular velocity [rad/s] and specific force [m/s^2] that are believed."""
_WEIGHTLESS, _IN_G = 1.0, 4.0
"""A mean specific force below the first [m/s^2] has gravity taken out, one below the second is in units of gravity."""
_AVERAGE = 200
"""Messages over which it is averaged."""
_POLLED = 0.05
"""A driver that polls a slower IMU repeats its values for less than this [s]."""
_MOVED = 0.01
"""A leg has moved if one of its joints has by so much [rad]."""


class TrunkGate:
    """Gives each measurement of the joints the angular velocity, the specific force and the contacts of its instant.

    Between two IMU messages the values are interpolated; a measurement waits until an IMU message of its stamp or a later one is
    there. Contacts carry no stamp: the last one received holds. Where the IMU sits comes from the setting ``imu_frame``, else
    from the message's ``frame_id``, a link that is fixed to the trunk; or from ``imu_xyz`` and ``imu_rpy``, where they are set.

    A message that repeats all values of the one before is of a driver that polls a slower IMU, or hangs. It is left out, unless
    they have stayed for longer than a slower IMU makes them and the legs have not moved since, so that they may be true.

    Args:
        base: the robot. settings: ``imu_frame``, ``imu_xyz``, ``imu_rpy`` and ``sensor_timeout`` are read.

    Attributes:
        counts: rejected messages by reason; those of the joints that found no IMU are among them. last_texts: a sentence each.
        imu_messages: received.

    Raises:
        RobotModelError: ``imu_frame`` is no link of the URDF.
    """

    def __init__(self, base: FloatingBase, settings: OnlineSettings) -> None:
        self._base, self._settings, self._delay = base, settings, base.setup.delay
        self.counts: Counter[str] = Counter()
        self.last_texts: dict[str, str] = {}
        self.imu_messages = 0
        self._poses: dict[str, tuple[FloatArray, FloatArray] | Rejection] = {}
        self._imu: deque[tuple[float, FloatArray, FloatArray, FloatArray]] = deque()
        self._waiting: deque[tuple[Measurement, FloatArray | None]] = deque()
        self._contacts: FloatArray | None = None
        self._mean = np.array([0.0, 0.0, 9.81])
        self._seen = 0
        self._newest: tuple[float, FloatArray] = -np.inf, np.zeros(6)
        self._legs: FloatArray | None = None
        self._legs_then: FloatArray | None = None
        self._frozen = False
        if settings.imu_frame:
            base.legs.frame_id(settings.imu_frame)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was found doubtful of the IMU without being rejected."""
        if self._seen < _AVERAGE:
            return ()
        mean = float(np.linalg.norm(self._mean))
        if mean < _WEIGHTLESS:
            return (
                f"The IMU's linear_acceleration is {mean:.2f} m/s^2 on average; standing still it must be 9.81, the specific "
                "force. The driver takes gravity out: publish the raw acceleration.",
            )
        if mean < _IN_G:
            return (
                f"The IMU's linear_acceleration is {mean:.2f} on average; it must be in m/s^2, about 9.81 at rest. "
                "Convert it from units of gravity in the driver.",
            )
        return ()

    def imu(self, record: ImuRecord) -> list[Measurement]:
        """Take in a message of the IMU; the measurements that waited for it."""
        self.imu_messages += 1
        rejection = self._take_imu(record)
        if rejection is not None:
            self._reject(rejection)
            return []
        return self._released()

    def contacts(self, record: ContactRecord) -> None:
        """Take in which feet stand."""
        feet = self._base.contact_frames
        try:
            values = np.asarray(record.values, dtype=float)
        except (TypeError, ValueError) as error:
            self._reject(Rejection("contacts_malformed", f"A contact message holds something else than numbers: {error}."))
            return
        if values.shape != (len(feet),) or not np.isfinite(values).all():
            self._reject(
                Rejection(
                    "contacts_length",
                    f"A contact message holds {values.size} values, {np.isfinite(values).sum()} of them finite; it must hold one "
                    f"for each of {', '.join(feet)}. Set contact_frames to the feet in the order of the message.",
                )
            )
            return
        self._contacts = values

    def joints(self, measurement: Measurement) -> list[Measurement]:
        """Take in a measurement of the joints; those that are complete now, in the order of time."""
        if self._waiting and measurement.t <= self._waiting[-1][0].t:
            self._waiting.clear()
        self._waiting.append((measurement, self._contacts))
        self._legs = measurement.q
        return self._released()

    def reset(self) -> None:
        """Forget all messages, as after a jump of time."""
        self._imu.clear()
        self._waiting.clear()
        self._newest, self._frozen = (-np.inf, self._newest[1]), False

    def _released(self) -> list[Measurement]:
        out = []
        while self._waiting:
            measurement, contacts = self._waiting[0]
            reading = self._reading(measurement.t, contacts)
            if reading is None:
                if self._waiting[-1][0].t - measurement.t <= _WAIT:
                    break
                self._reject(self._no_imu(measurement.t))
            else:
                out.append(Measurement(measurement.t, measurement.q, measurement.v, measurement.tau, reading))
            self._waiting.popleft()
        return out

    def _reading(self, t: float, contacts: FloatArray | None) -> TrunkReading | None:
        imu = self._imu
        while len(imu) > 1 and imu[1][0] <= t:
            imu.popleft()
        if not imu or imu[0][0] > t or (imu[0][0] < t and len(imu) < 2):
            return None
        before = imu[0]
        if before[0] == t:
            return TrunkReading(before[1], before[2], before[3], contacts)
        after = imu[1]
        if after[0] - before[0] > _WAIT:
            return None
        part = (t - before[0]) / (after[0] - before[0])
        omega, force = (1.0 - part) * before[1] + part * after[1], (1.0 - part) * before[2] + part * after[2]
        return TrunkReading(omega, force, after[3], contacts)

    def _no_imu(self, t: float) -> Rejection:
        if self.imu_messages == 0:
            return Rejection(
                "imu_missing",
                "There is no message of the IMU; a floating base needs its angular velocity and specific force. Publish "
                "sensor_msgs/Imu, name its topic (--imu-topic), or set base to 'fixed' if nothing floats.",
            )
        if self._frozen:
            return Rejection(
                "imu_frozen",
                "No value of the IMU has changed while the legs move: its driver repeats old ones. Check driver and cable.",
            )
        if self._imu and self._imu[0][0] < t < self._imu[-1][0]:
            return Rejection("imu_gap", f"For more than {_WAIT:g} s there was no message of the IMU. Check its driver and cable.")
        if self._imu:
            offset = self._imu[-1][0] - t
            return Rejection(
                "imu_stamps",
                f"The stamps of the IMU are {abs(offset):.2f} s {'ahead of' if offset > 0 else 'behind'} those of the joints; "
                f"within {_WAIT:g} s they are matched. Synchronise the clocks, or stamp both messages when they are measured.",
            )
        worst = next(reversed(self.last_texts.values()), "No message of the IMU was usable.")
        return Rejection("imu_unusable", f"No message of the IMU is usable: {worst}")

    def _take_imu(self, record: ImuRecord) -> Rejection | None:
        pose = self._poses.get(record.frame_id)
        if pose is None:
            pose = self._poses[record.frame_id] = self._pose(record.frame_id)
        if isinstance(pose, Rejection):
            return pose
        try:
            omega, force = np.asarray(record.omega, dtype=float), np.asarray(record.specific_force, dtype=float)
        except (TypeError, ValueError) as error:
            return Rejection("imu_malformed", f"A message of the IMU holds something else than numbers: {error}.")
        # not <, so that NaN does not pass
        if not (np.abs(omega).max() <= _FASTEST and np.abs(force).max() <= _HARDEST):
            return Rejection(
                "imu_range",
                f"The IMU tells {omega} rad/s and {force} m/s^2; finite numbers up to {_FASTEST:g} rad/s and {_HARDEST:g} m/s^2 "
                "are believed. If they are in degrees, make the driver publish rad/s.",
            )
        setup = self._base.setup
        if setup.delay != self._delay:
            self._imu = deque((at - (setup.delay - self._delay), w, f, place) for at, w, f, place in self._imu)
            self._delay = setup.delay
        t = (record.stamp or record.receive_time) - setup.delay
        if self._imu and t <= self._imu[-1][0]:
            if self._imu[-1][0] - t < _KEPT:
                return Rejection(
                    "imu_stamp_order", f"The IMU's stamp {t:.6f} s is not after the last one. Check for a second publisher."
                )
            self.reset()
        if self._repeats(t, np.concatenate((omega, force))):
            return None
        rotation, place = pose
        omega, force = setup.rotation @ rotation @ omega, setup.corrected(rotation @ force)
        self._imu.append((t, omega, force, place + setup.lever))
        while t - self._imu[0][0] > _KEPT:
            self._imu.popleft()
        self._seen += 1
        self._mean += max(1.0 / self._seen, 1.0 / _AVERAGE) * (self._imu[-1][2] - self._mean)
        return None

    def _repeats(self, t: float, values: FloatArray) -> bool:
        """Whether a message of t [s] with the values (6,) repeats the one before, and is to be left out."""
        since, before = self._newest
        if t < since or not np.array_equal(values, before):
            self._newest, self._legs_then, self._frozen = (t, values), self._legs, False
            return False
        moved = self._legs is not None and self._legs_then is not None and np.abs(self._legs - self._legs_then).max() > _MOVED
        self._frozen = bool(moved) and t - since > _POLLED
        return self._frozen or t - since < _POLLED

    def _pose(self, frame_id: str) -> tuple[FloatArray, FloatArray] | Rejection:
        s, legs = self._settings, self._base.legs
        if any(s.imu_xyz) or any(s.imu_rpy):
            return rotation_of(s.imu_rpy), np.array(s.imu_xyz)
        frame = s.imu_frame or frame_id
        fixed = self._base.trunk_frames
        if frame in fixed:
            rotation, place = legs.frame_placement(np.zeros(legs.n), frame)
            return rotation, place
        found = f"has the frame '{frame}', which is" if frame else "names no frame_id, and none is"
        return Rejection(
            "imu_frame",
            f"The IMU {found} no link that is fixed to the trunk '{self._base.trunk}'; those are {', '.join(fixed)}. Set "
            "imu_frame to one of them, or imu_xyz and imu_rpy to where the IMU sits in the trunk.",
        )

    def _reject(self, rejection: Rejection) -> None:
        self.counts[rejection.reason] += 1
        self.last_texts.pop(rejection.reason, None)  # the newest comes last
        self.last_texts[rejection.reason] = rejection.text
