"""Was something picked up or put down in a recording that is to be of the arm alone?"""

from __future__ import annotations

from sysid_ros.exceptions import SysidError
from sysid_ros.identification.result import Problem
from sysid_ros.online.carried import carried
from sysid_ros.online.online_estimation import OnlineEstimation
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import Measurement
from sysid_ros.signals.recording import Recording

_SURE = 5.0
"""Standard deviations by which its mass must be above zero."""


def check_carried(robot: RobotModel, recording: Recording) -> list[Problem]:
    """A problem for each thing that the online estimation believes was carried for a part of the recording, where nothing was in
    another part. What is carried all the time can't be told from the last link."""
    gravity = tuple(map(float, robot.gravity))
    try:
        estimation = OnlineEstimation(robot, OnlineSettings(joint_names=robot.joint_names, gravity=gravity))
    except SysidError:  # such a robot has no payload to look for
        return []
    v = recording.v if recording.v is not None else [None] * len(recording.t)
    rows = zip(recording.t.tolist(), recording.q, v, recording.tau, strict=True)
    steps = (estimation.step(Measurement(t, q, speed, tau)) for t, q, speed, tau in rows)
    series = [estimate for estimate in steps if estimate is not None]
    if not any(estimate.status == "no_payload" for estimate in series):  # it may be the arm
        return []
    found = []
    for one in carried(series, estimation.events, float(recording.t[-1])):
        e, part = one.estimate, one.t0 > series[0].t or one.t1 < recording.t[-1]
        if part and e.status == "ok" and e.mass > _SURE * e.mass_std:
            when = f"{one.t0 - recording.t[0]:.2f} to {one.t1 - recording.t[0]:.2f} s"
            text = (
                f"The arm carries {e.mass:.2f} kg (std {e.mass_std:.2g}) from {when}; identify from recordings without a payload."
            )
            found.append(Problem(recording.name, "", "carries", text))
    return found
