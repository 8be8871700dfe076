"""Which stiffness or play of which joint is worth a closer look: many are tried on the joint's own rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import Backlash, JointElasticity
from sysid_ros.sample import FloatArray

_RESONANCES = np.geomspace(0.8, 25.0, 80)
"""Of elastic joints [Hz]: 4 % apart, as a spring that is hardly damped shows in a narrow line."""
_DAMPING = 0.05
WIDEST = 0.06
"""Of a gap [rad]."""
_GAPS = np.geomspace(2e-3, WIDEST, 8)
_PAYS = 12.0
"""Likelihood that a compliance must gain on its joint's rows. Nothing but this sees the loads without the noise of the positions,
which an elastic joint takes away from all rows as a filter does, so it is the one that decides."""
BOTH_SIDES = 0.02
"""Least part of the time that a link with play lies on each side: on one flank alone it is a wrong zero and an elastic joint."""
_AS_MADE_FOR = 0.2, 3.0
"""The fitted compliance over that of the columns."""

_EFFECTS: dict[str, type[JointElasticity | Backlash]] = {e.id: e for e in (JointElasticity, Backlash)}
Settings = tuple[str, dict[str, Any]]


class ComplianceScreen:
    """Elastic joints and joints with play, as terms with settings that fit the residual.

    Args:
        library: its motions; columns are kept as long as the links' torques stay the same.
    """

    def __init__(self, library: Library) -> None:
        self._library = library
        self._rows: dict[int, tuple[list[FloatArray], list[Settings], FloatArray]] = {}

    def terms(self, fit: Fit) -> list[Term]:
        """At most one term of each effect and joint."""
        out = []
        for joint, (_, X) in fit.blocks.items():
            settings, columns = self._options(joint)
            root = 1.0 / np.sqrt(fit.variance[:, joint, None])
            motor = not any(t.id == "rotor_inertia" and t.row == joint for t in fit.terms)
            beside = np.concatenate([X, self._library.local("rotor_inertia", joint).columns], axis=1) if motor else X
            basis = _orthonormal(beside * root)
            z = fit.residual[:, joint] * root[:, 0]
            power = float(z @ z)
            z = z - basis @ (basis.T @ z)
            C = columns * root
            C -= basis @ (basis.T @ C)
            size = np.maximum(np.sum(C**2, axis=0), 1e-30)
            theta = (C.T @ z) / size
            drop = theta**2 * size + (power - float(z @ z) if motor else 0.0)
            gain = 0.5 * len(z) * np.log(power / np.maximum(power - drop, 1e-9 * power))
            made_for = np.array([s["around"] for _, s in settings])
            gain[(theta < _AS_MADE_FOR[0] * made_for) | (theta > _AS_MADE_FOR[1] * made_for)] = 0.0
            for name in ("joint_elasticity", "backlash"):
                own = [i for i, (n, _) in enumerate(settings) if n == name]
                best = own[int(np.argmax(gain[own]))]
                if gain[best] > _PAYS:
                    out.append(self._library.whole(name, (joint,), **settings[best][1]))
        return out

    def _options(self, joint: int) -> tuple[list[Settings], FloatArray]:
        loads = [m.link_torque[:, joint] for m in self._library.motions]
        if joint in self._rows:
            before, settings, columns = self._rows[joint]
            if all(np.array_equal(x, y) for x, y in zip(before, loads, strict=True)):
                return settings, columns
        settings = self._settings(joint)
        robot = self._library.robot
        name = robot.joint_names[joint]
        curves = []
        for motion in self._library.motions:
            effects = [_EFFECTS[e](robot, [name], **s) for e, s in settings]
            own = np.stack([x[:, joint, joint] for x in motion.sensitivity], axis=1)
            lags = [e.lag(motion, joint) for e in effects]
            reverses = [bool(min(np.mean(x[:, 0] > 0.0), np.mean(x[:, 0] < 0.0)) > BOTH_SIDES) for x in lags]
            shown = [e.id != Backlash.id or r for e, r in zip(effects, reverses, strict=True)]
            curves.append(
                np.stack([-np.sum(own * x, axis=1) / e.around * s for e, x, s in zip(effects, lags, shown, strict=True)])
            )
        columns = self._library.band.joint_curves(joint, curves)
        self._rows[joint] = loads, settings, columns
        return settings, columns

    def _settings(self, joint: int) -> list[Settings]:
        inertia = float(np.mean([np.mean(m.sensitivity[2][:, joint, joint]) for m in self._library.motions]))
        out: list[Settings] = []
        for f in _RESONANCES:
            compliance = 1.0 / (max(inertia, 1e-9) * (2.0 * np.pi * float(f)) ** 2)
            out.append(("joint_elasticity", {"around": compliance, "damping": _DAMPING, "exact": False}))
        for gap in _GAPS:
            out += [("backlash", {"around": float(gap), "side": side, "exact": False}) for side in (-1, 1)]
        return out


def _orthonormal(columns: FloatArray) -> FloatArray:
    """A basis of what columns (K, m) span, shape (K, r)."""
    scale = np.sqrt(np.maximum(np.sum(columns**2, axis=0), 1e-300))
    U, s, _ = np.linalg.svd(columns / scale, full_matrices=False)
    return np.asarray(U[:, s > 1e-6 * s.max(initial=0.0)])
