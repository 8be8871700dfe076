"""What of an estimate may be believed, as messages: the rest is NaN, so that nobody can take it for a number."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import InertiaStamped

from sysid_ros.input_gate import Level
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.robot.inertial_parameters import MESSAGE_NAMES, TO_MESSAGE_ORDER
from sysid_ros.sample import FloatArray

LEVEL_OF_STATUS = {
    "ok": Level.OK,
    "no_payload": Level.OK,
    "warming_up": Level.WARN,
    "not_excited": Level.WARN,
    "not_physical": Level.WARN,
    "inconsistent": Level.ERROR,
    "stale": Level.STALE,
}
"""How bad each status of an estimate is; those that are OK may be believed."""
LEVELS = {Level.OK: DiagnosticStatus.OK, Level.WARN: DiagnosticStatus.WARN, Level.ERROR: DiagnosticStatus.ERROR}
_OPEN = ("warming_up", "not_excited")
"""Not known well enough yet, and the standard deviations say how well."""
_AXES, _MOMENTS = "xyz", ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_PAIRS = list(combinations_with_replacement(range(10), 2))
_ROWS, _COLUMNS = np.array(_PAIRS).T
_UPPER = tuple(np.array(_MOMENTS).T)
_ORDER = np.ix_(TO_MESSAGE_ORDER, TO_MESSAGE_ORDER)
_NO_COVARIANCE = np.full((10, 10), np.nan)


def is_believed(status: str) -> bool:
    """True where numbers of this status may be used."""
    return LEVEL_OF_STATUS.get(status) == Level.OK


@dataclass(frozen=True, slots=True)
class Believed:
    """Numbers of an estimate, each NaN where its status or the motion leaves it open.

    Attributes:
        mass: [kg]. com: in the frame, shape (3,) [m]; NaN where nothing is carried.
        inertia: about the centre of mass, axes parallel to the frame, shape (3, 3) [kg m^2].
        theta: ten parameters about the frame's origin, pinocchio's order, shape (10,).
    """

    mass: float
    com: FloatArray
    inertia: FloatArray
    theta: FloatArray

    @classmethod
    def of(cls, estimate: PayloadEstimate, status: str) -> Believed:
        """The numbers of an estimate, judged by ``status``, which may be newer than its own."""
        e, seen = estimate, np.asarray(estimate.observable)
        if not is_believed(status) or not (e.is_empty or seen[0]):
            return _NOTHING
        if e.is_empty:
            return _EMPTY
        inertia = e.inertia_com if seen.all() else _NOTHING.inertia
        return cls(e.mass, np.where(seen[1:4], e.com, np.nan), inertia, np.where(seen, e.theta, np.nan))


_NOTHING = Believed(np.nan, np.full(3, np.nan), np.full((3, 3), np.nan), np.full(10, np.nan))
_EMPTY = Believed(0.0, np.full(3, np.nan), np.zeros((3, 3)), np.zeros(10))


def inertia_message(numbers: Believed, frame: str, stamp: Any) -> InertiaStamped:
    """The numbers as ``~/payload`` has them; where nothing is carried all are zero, the centre of mass too."""
    message = InertiaStamped()
    message.header.stamp, message.header.frame_id = stamp, frame
    i, com = message.inertia, np.zeros(3) if numbers.mass == 0.0 else numbers.com
    i.m = numbers.mass
    i.com.x, i.com.y, i.com.z = com.tolist()
    (i.ixx, i.ixy, i.ixz), (_, i.iyy, i.iyz), (_, _, i.izz) = numbers.inertia.tolist()
    return message


class EstimateMessage:
    """Everything under its name, with status and reason: what is drawn over the stamp, and read by people.

    The message is made once and filled again, which takes half the time.
    """

    def __init__(self) -> None:
        names = ["valid", "mass", "mass_std", *(f"com_{axis}" for axis in _AXES), *(f"com_{axis}_std" for axis in _AXES)]
        names += [f"i{_AXES[i]}{_AXES[j]}" for i, j in _MOMENTS]
        names += [f"{kind}.{name}" for kind in ("parameter", "std", "observable") for name in MESSAGE_NAMES]
        names += [f"covariance.{MESSAGE_NAMES[i]}.{MESSAGE_NAMES[j]}" for i, j in _PAIRS]
        self._status = KeyValue(key="status")
        self._numbers = [KeyValue(key=name) for name in names]
        self._told = DiagnosticStatus(name="payload", values=[self._status, *self._numbers])
        self._message = DiagnosticArray(status=[self._told])

    def of(self, estimate: PayloadEstimate, status: str, reason: str, numbers: Believed, stamp: Any) -> DiagnosticArray:
        """The message, until the next call; ``numbers`` are those of the estimate that may be believed with this status."""
        e, order = estimate, TO_MESSAGE_ORDER
        # of an estimate that is not known well enough yet, the standard deviations say how well
        covariance = e.covariance[_ORDER] if is_believed(status) or status in _OPEN else _NO_COVARIANCE
        com_std = np.where(np.isnan(numbers.com), np.nan, e.com_std)
        std = np.sqrt(np.diag(covariance))
        values = np.concatenate(
            [
                (float(is_believed(status)), numbers.mass, std[0]),
                *(numbers.com, com_std, numbers.inertia[_UPPER], numbers.theta[order], std, e.observable[order]),
                covariance[_ROWS, _COLUMNS],
            ]
        )
        self._status.value = status
        for pair, x in zip(self._numbers, values.tolist(), strict=True):
            pair.value = f"{x:.9g}"
        self._told.level = LEVELS.get(LEVEL_OF_STATUS.get(status, Level.WARN), DiagnosticStatus.STALE)
        self._told.message = f"{status}: {reason}" if reason else status
        self._message.header.stamp, self._message.header.frame_id = stamp, e.frame
        return self._message
