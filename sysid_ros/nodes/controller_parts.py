"""What the adaptive controller is made of, from its parameters."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from sysid_ros.control import ArmTorque, ControlSettings, Reference, make_law
from sysid_ros.control.control_settings import SafetySettings
from sysid_ros.control.live_control import LiveControl
from sysid_ros.control.own_torque import OwnTorque
from sysid_ros.control.refined_payload import RefinedPayload
from sysid_ros.input_gate import InputGate
from sysid_ros.nodes.controller_settings import ControllerSettings
from sysid_ros.nodes.slow_start import COMPILES, said_if_slow
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.model_file import ModelFile


def make_control(
    urdf: str, settings: ControllerSettings, gains: ControlSettings, safety: SafetySettings, say: Callable[[str], object]
) -> tuple[LiveControl, ArmTorque, InputGate]:
    """The control, the arm's model, and the gate that its states come through; compiled, so that the first state is not late.
    ``say`` is told where that takes long.

    Raises:
        RobotModelError, ModelFileError, SettingsError: the URDF, the model or a setting does not fit.
    """
    known = ModelFile.read(Path(settings.model_path)) if settings.model_path else None
    robot = RobotModel.from_urdf(urdf, settings.joint_names or (known.joints if known else ()), settings.gravity)
    drives = settings.robot_adds != "gravity_and_friction"
    arm = ArmTorque(robot, known.known_effects(robot) if known else (), settings.frame_id or robot.flange, drives)
    still, refinement = np.zeros(robot.n), None
    # the law that is used has seen nothing
    with said_if_slow(say, COMPILES):
        if drives:  # else what moves the arm is not what was sent
            own = OwnTorque(robot, arm.payload.frame, known, gains.loop_delay)
            own.compile()
            refinement = RefinedPayload(own)
        make_law(settings.law, arm, gains).torque(still, still, Reference(still, still + 1.0, still), 0.001)
    live = LiveControl(make_law(settings.law, arm, gains), arm, safety, refinement)
    gate = OnlineSettings(
        gravity=settings.gravity, effort_type="external", velocity_source="message", sensor_timeout=safety.state_timeout
    )
    return live, arm, InputGate(robot, gate)
