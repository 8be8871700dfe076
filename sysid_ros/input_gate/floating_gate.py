"""FloatingGate: the input gate of a robot on a floating base, joint states with IMU and contacts."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.input_gate.gate import InputGate
from sysid_ros.input_gate.health import GateHealth, Level
from sysid_ros.input_gate.trunk_gate import TrunkGate
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import ContactRecord, ImuRecord, JointStateRecord, Measurement

Record = JointStateRecord | ImuRecord | ContactRecord


class FloatingGate:
    """Checks the joint states as :class:`InputGate` does, and gives each the IMU and the contacts of its instant.

    What gravity does to the joints depends on the ground, so the joints' torques are not compared with it.

    Args:
        base: the robot. settings: of both gates.

    Attributes:
        joints, trunk: the two gates. accepted: measurements that found an IMU message.
    """

    def __init__(self, base: FloatingBase, settings: OnlineSettings) -> None:
        self._settings = settings
        self.joints = InputGate(base.legs, replace(settings, effort_type="external"))
        self.trunk = TrunkGate(base, settings)
        self.accepted = 0
        self._last_matched: float | None = None
        self._restarts = 0

    @property
    def received(self) -> int:
        """Messages of the joints."""
        return self.joints.received

    @property
    def others(self) -> int:
        """As of :class:`InputGate`."""
        return self.joints.others

    @property
    def notes(self) -> tuple[str, ...]:
        """As of :class:`InputGate`."""
        return self.joints.notes

    @property
    def counts(self) -> Counter[str]:
        """Rejected messages by reason."""
        return self.joints.counts + self.trunk.counts

    @property
    def last_texts(self) -> dict[str, str]:
        """The last sentence for each reason."""
        return self.joints.last_texts | self.trunk.last_texts

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was found doubtful without being rejected."""
        return (*self.joints.warnings, *self.trunk.warnings)

    @property
    def suspicion(self) -> str:
        """As of :class:`InputGate`."""
        return self.joints.suspicion

    @property
    def gaps(self) -> int:
        """As of :class:`InputGate`."""
        return self.joints.gaps

    @property
    def restarts(self) -> int:
        """As of :class:`InputGate`."""
        return self.joints.restarts

    def take(self, record: Record) -> list[Measurement]:
        """The measurements that a message completes."""
        if isinstance(record, ContactRecord):
            self.trunk.contacts(record)
            return []
        if isinstance(record, ImuRecord):
            found = self.trunk.imu(record)
        else:
            measurements = self.joints.take(record)
            if self.joints.restarts != self._restarts:
                self._restarts = self.joints.restarts
                self.trunk.reset()
            found = [matched for measurement in measurements for matched in self.trunk.joints(measurement)]
        if found:
            self.accepted += len(found)
            self._last_matched = record.receive_time
        return found

    def health(self, now: float) -> GateHealth:
        """As of :class:`InputGate`, with what is wrong with IMU and contacts."""
        health = self.joints.health(now)
        age = float("inf") if self._last_matched is None else now - self._last_matched
        level, text, doubtful = health.level, health.text, self.trunk.warnings
        if level >= Level.ERROR:
            unmatched = health.accepted > 0 and self.accepted == 0
            text += f" None of those before found its IMU message: {self._why_unmatched()}" if unmatched else ""
            doubtful = ()
        elif health.accepted > 0 and age > self._settings.sensor_timeout:
            level, text = Level.ERROR, f"No joint state finds its IMU message: {self._why_unmatched()}"
        else:
            age = health.age
            level, text = (Level.WARN, " ".join(doubtful)) if doubtful else (level, text)
        warnings = (*health.warnings, *doubtful)
        return replace(
            health, level=level, text=text, counts=dict(self.counts), accepted=self.accepted, age=age, warnings=warnings
        )

    def _why_unmatched(self) -> str:
        """What most of the messages of the trunk were rejected for."""
        counts = self.trunk.counts
        if not counts:
            return "The IMU is silent. Check its topic and that its driver runs."
        return self.trunk.last_texts[max(counts, key=lambda reason: counts[reason])]


Gate = InputGate | FloatingGate


def gate_for(robot: RobotModel, base: FloatingBase | None, settings: OnlineSettings) -> Gate:
    """The gate of an arm, or of a robot whose base floats."""
    return InputGate(robot, settings) if base is None else FloatingGate(base, settings)
