"""The robot of a diagnosis: its joints by their torque error before and after, and what was found, where it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sysid_ros.diagnosis.result import Diagnosis, Finding, TorqueRmse
from sysid_ros.pages.robot_view import Colouring, Ellipsoid, Ring, Track, View, ellipsoid, view
from sysid_ros.robot.robot_model import RobotModel

_MOST = 3
"""Causes that are drawn at most: more are no answer."""


def diagnosis_view(robot: RobotModel | None, urdf: Path | None, result: Diagnosis) -> View | None:
    """The view in the motion that the diagnosis was judged on; None where there is no robot, where
    nothing was judged, and on legs, whose rows are of the whole robot.

    Args:
        urdf: the robot's file, beside which meshes are looked for.
    """
    p = result.predictions
    if robot is None or p is None or p.q.shape[1] != robot.n:
        return None
    main = [f for f in result.causes if f.headline][:_MOST] or list(result.causes[:1])
    bodies = {i: body for i, f in enumerate(main) if (body := _body(robot, f)) is not None}
    rings = tuple(
        Ring(joints, f.label)
        for i, f in enumerate(main)
        if i not in bodies and (joints := tuple(robot.joint_names.index(name) for name in f.joints if name in robot.joint_names))
    )
    told = ["The motion that the models were judged on."]
    if result.torque is not None:
        told.append("Each joint has the colour of its torque error over the noise of its torque (both rms); 1 is noise alone.")
    if rings:
        told.append(f"Thick rings: {'; '.join(ring.label for ring in rings)}.")
    if bodies:
        told.append("A body that was found is drawn at its centre of mass, as a ball of water of its mass.")
    colourings = _errors(result.torque, bool(result.causes)) if result.torque is not None else ()
    return view(
        robot, urdf, [Track("", p.t, p.q)], " ".join(told), colourings=colourings, rings=rings, ellipsoids=tuple(bodies.values())
    )


def _errors(t: TorqueRmse, found: bool) -> tuple[Colouring, ...]:
    """As given and with the causes, on one scale. Over the noise, as the causes are weighed: where a joint has hardly any torque
    its error is all of it and tells nothing."""
    noise = np.where(t.noise_floor > 0.0, t.noise_floor, np.nan)
    models = {"as given": t.before / noise} | ({"with the causes": t.after / noise} if found else {})
    most = max([float(x) for ratios in models.values() for x in ratios if np.isfinite(x)], default=1.0)
    return tuple(_times(name, ratios.tolist(), most) for name, ratios in models.items())


def _times(name: str, ratios: list[float], most: float) -> Colouring:
    texts = [f"{x:.2g}" if x < 99.5 else f"{x:.0f}" for x in (*ratios, most)]
    told = tuple(f"{text} ×" if np.isfinite(x) else "–" for text, x in zip(texts, ratios, strict=False))
    return Colouring(name, tuple(ratios), told, most, ("0", f"{texts[-1]} × noise"))


def _body(robot: RobotModel, f: Finding) -> Ellipsoid | None:
    """The body that a finding tells of: one that has a mass, and a place or a first moment; None where it tells of none."""
    masses = [p for p in f.parameters if p.unit == "kg" and not isinstance(p.value, list)]
    for mass in masses:
        for p in f.parameters:
            if p.joint != mass.joint or not isinstance(p.value, list) or len(p.value) != 3 or p.unit not in ("m", "kg m"):
                continue
            if p.unit == "kg m" and not mass.low * mass.high > 0.0:
                continue
            com = np.asarray(p.value, dtype=float) / (1.0 if p.unit == "m" else mass.value)
            frame = robot.default_frame if p.joint is None else robot.body_names[robot.joint_names.index(p.joint)]
            label = f"{f.label}: {mass.value:+.3g} kg".replace("-", "−")
            std = np.asarray(p.std, dtype=float) if p.unit == "m" and p.std is not None else None
            return ellipsoid(robot, frame, mass.value, com, label, com_std=std)
    return None
