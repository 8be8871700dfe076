"""PlayedMotion: a joint trajectory from a file as a robot's controller of positions follows it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.interpolate import CubicHermiteSpline

from sysid_ros.exceptions import SettingsError, in_a_line
from sysid_ros.sample import FloatArray

_COMES = 1.0
"""Time in which the robot comes to the start of the motion, before the recording begins [s]."""


class PlayedMotion:
    """Positions over time between the points of a ``trajectory_msgs/JointTrajectory``, at rest before and after them.

    Args:
        path: the message as YAML. joint_names: joints in the wanted order, n of them.

    Attributes:
        start: positions of the first point, shape (n,) [rad].

    Raises:
        SettingsError: the file can't be read, is no such message, or lacks a joint.
    """

    def __init__(self, path: Path, joint_names: tuple[str, ...]) -> None:
        message = _read(path)
        try:
            names, points = list(message["joint_names"]), message["points"]
            times = [p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points]
            q, v = (np.array([p[key] for p in points], dtype=float) for key in ("positions", "velocities"))
            columns = [names.index(name) for name in joint_names]
            self._spline = CubicHermiteSpline(np.array(times, dtype=float), q[:, columns], v[:, columns])
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise SettingsError(
                f"motion '{path}' is no trajectory_msgs/JointTrajectory of {', '.join(joint_names)} with positions and "
                f"velocities: {in_a_line(error)}. sysid excite writes one."
            ) from None
        self._begin, self._end = times[0], times[-1]
        self.start: FloatArray = q[0, columns]

    def at(self, t: float, standing: FloatArray) -> FloatArray:
        """Positions wanted at t [s], shape (n,); before, the robot comes to the start from where it stands, shape (n,)."""
        if t <= self._begin:
            u = min(max(1.0 + (t - min(self._begin, 0.0)) / _COMES, 0.0), 1.0)
            return np.asarray(standing + u**3 * (10.0 - 15.0 * u + 6.0 * u**2) * (self.start - standing))
        return np.asarray(self._spline(min(t, self._end)))


def _read(path: Path) -> Any:
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except OSError as error:
        raise SettingsError(f"motion '{path}' can't be read: {error.strerror}.") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise SettingsError(f"motion '{path}' is not YAML: {in_a_line(error)}.") from None
