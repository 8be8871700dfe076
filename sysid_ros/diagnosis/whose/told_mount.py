"""A robot that is mounted otherwise than gravity is set, as a finding and in the extended model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sysid_ros.diagnosis.claims import Judged
from sysid_ros.diagnosis.evidence import Evidence, interval
from sysid_ros.diagnosis.fault_findings import with_findings
from sysid_ros.diagnosis.prepare import links_changed
from sysid_ros.diagnosis.result import Diagnosis, Finding
from sysid_ros.diagnosis.whose.mount import Mount
from sysid_ros.effects import EFFECTS, BaseTilt, Parameter, named
from sysid_ros.effects.base_tilt import tilt_of, tilted_gravity
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.model_file import EffectBlock, ModelFile

_STEP = 1e-5
"""Of central differences [rad], [m/s^2]: what is left out and what is rounded are both some 1e-10."""


class ToldMount(NamedTuple):
    """Gravity in the axes of the base, as all that was found leaves it, and the roll and pitch of the base that make it of the
    gravity that was set, with their covariances.

    Attributes:
        gravity: shape (3,) [m/s^2]. of_gravity: shape (3, 3). tilt: roll and pitch, shape (2,) [rad]. of_tilt: shape (2, 2).
    """

    gravity: FloatArray
    of_gravity: FloatArray
    tilt: FloatArray
    of_tilt: FloatArray

    @classmethod
    def of(cls, mount: Mount, judged: Judged, robot: RobotModel) -> ToldMount:
        """Of a mount under which something was found; ``robot``: under the gravity that was set."""
        gravity, spread = mount.gravity, mount.covariance
        for term in (t for t in judged.fit.terms if t.effect.leans):
            told = judged.values.of[term]
            by_tilt = _slopes(lambda x: tilted_gravity(mount.gravity, *x), told.values[:2])
            gravity, spread = tilted_gravity(mount.gravity, *told.values[:2]), by_tilt @ told.covariance[:2, :2] @ by_tilt.T
        by_gravity = _slopes(lambda g: tilt_of(robot.gravity, g), gravity)
        return cls(gravity, spread, tilt_of(robot.gravity, gravity), by_gravity @ spread @ by_gravity.T)

    def finding(self, mount: Mount, robot: RobotModel, evidence: Evidence) -> Finding:
        """What is wrong, which is no cause in the robot, but a setting."""
        values = [
            Parameter(name, None, float(x), "rad", float(std), *interval(float(x), float(std)))
            for name, x, std in zip(("roll", "pitch"), self.tilt, np.sqrt(np.diag(self.of_tilt)), strict=True)
        ]
        stds = np.sqrt(np.diag(self.of_gravity))
        ends = np.array([interval(float(x), float(s)) for x, s in zip(self.gravity, stds, strict=True)])
        values.append(Parameter("gravity", None, self.gravity.tolist(), "m/s^2", stds.tolist(), *ends.T.tolist()))
        was, now = _in_words(robot.gravity), _in_words(self.gravity)
        words = (
            f"the robot is mounted otherwise than the model has it: in the axes of its base gravity is ({now}) m/s², not ({was})"
        )
        return Finding(
            BaseTilt.id,
            "mounted otherwise",
            robot.joint_names,
            tuple(values),
            **evidence.figures(),
            cannot_be_told_from=(),
            words=words,
            signature=BaseTilt.signature,
            separated_by=BaseTilt.separated_by,
            of_data=True,
            probability=mount.probability,
            remark=f"Set the parameter gravity to [{now}], also of the nodes. All else was found with that.",
        )

    def in_model(self, model: ModelFile, robot: RobotModel, judged: Judged) -> ModelFile:
        """The model of a robot under the gravity that was set, as a tilt of its base."""
        others = [b for b in model.effects if not EFFECTS[b.effect].leans]
        effect = BaseTilt(robot, around=self.tilt.tolist(), links=links_changed(judged.fit).tolist())
        block = EffectBlock(
            effect.id, effect.joint_names, effect.settings, self.tilt, effect.parameter_names, effect.units, self.of_tilt
        )
        return replace(model, effects=(*others, block))


def otherwise(robot: RobotModel, mount: Mount) -> str:
    """That a robot is not mounted as its gravity is set, with the cure."""
    was, now = (_in_words(g) for g in (robot.gravity, mount.gravity))
    return (
        f"the torques are those of a robot that is mounted otherwise than it is set (probability {mount.probability:.2g}): "
        f"in the axes of its base gravity is about [{now}] m/s^2, and [{was}] is set. Set the parameter gravity in a file for "
        "--config; 'sysid diagnose' tells it exactly."
    )


def _in_words(gravity: FloatArray) -> str:
    """Three numbers [m/s^2], none of them a negative zero."""
    return ", ".join(f"{round(float(x), 2) + 0.0:.2f}" for x in gravity)


def with_mount(found: Diagnosis, mount: Mount, robot: RobotModel, judged: Judged, evidence: Evidence) -> Diagnosis:
    """The diagnosis of a mounted robot, with that as a finding in place of a base that stands askew, and with models of the robot
    under the gravity that was set.

    Args:
        robot: under that gravity. evidence: for the mount.
    """
    told = ToldMount.of(mount, judged, robot)
    found = with_findings(found, [f for f in found.findings if not ((kind := named(f.id)) and kind.leans)])
    every = (*found.causes, told.finding(mount, robot, evidence), *found.data_faults)
    assert found.model is not None
    assert found.urdf_model is not None
    models = [told.in_model(x, robot, judged) for x in (found.model, found.urdf_model)]
    verdict = "explained" if found.verdict == "nothing_wrong" else found.verdict
    return replace(found, verdict=verdict, findings=every, model=models[0], urdf_model=models[1])


def _slopes(function: Callable[[FloatArray], FloatArray], at: FloatArray) -> FloatArray:
    """Derivatives by central differences, a column for each of the arguments; of angles, which may jump by a turn."""
    steps = _STEP * np.eye(len(at))
    return np.stack([_turned_back(function(at + e) - function(at - e)) / (2.0 * _STEP) for e in steps], axis=1)


def _turned_back(change: FloatArray) -> FloatArray:
    small = np.abs(change) < np.pi
    return np.where(small, change, change - 2.0 * np.pi * np.round(change / (2.0 * np.pi)))
