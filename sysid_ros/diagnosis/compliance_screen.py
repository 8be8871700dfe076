"""Which stiffness or play of which joint is searched for in full: many are tried on the joint's own rows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS, Effect
from sysid_ros.sample import FloatArray

_LEAST = 12.0
"""Likelihood that a compliance must gain on its joint's rows. Nothing but this sees the loads without the noise of the positions,
which an elastic joint takes away from all rows as a filter does, so it is the one that decides."""
_AS_MADE_FOR = 0.2, 3.0
"""The fitted compliance over that of the columns."""

_ALIKE = 0.02
"""Part by which loads may differ (rms) for columns that are only screened."""

Settings = tuple[type[Effect], Mapping[str, Any]]


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
        causes = sum(t.p for t in fit.terms)
        for joint, (index, columns_of_all) in fit.blocks.items():
            X = columns_of_all[:, index < causes]  # inexact links are free within narrow bounds only
            settings, columns = self._options(joint)
            root = 1.0 / np.sqrt(fit.variance[:, joint, None])
            kinds = list(dict.fromkeys(kind for kind, _ in settings))
            present = {t.kind for t in fit.terms if t.row == joint}
            missing = [x for x in dict.fromkeys(kind.companion for kind in kinds) if x and EFFECTS[x] not in present]
            beside = np.concatenate([X, *(self._library.local(x, joint).columns for x in missing)], axis=1)
            basis = _orthonormal(beside * root)
            z = fit.residual[:, joint] * root[:, 0]
            power = float(z @ z)
            z = z - basis @ (basis.T @ z)
            C = columns * root
            C -= basis @ (basis.T @ C)
            size = np.maximum(np.sum(C**2, axis=0), 1e-30)
            theta = (C.T @ z) / size
            drop = theta**2 * size + (power - float(z @ z) if missing else 0.0)
            gain = 0.5 * len(z) * np.log(power / np.maximum(power - drop, 1e-9 * power))
            made_for = np.array([s["around"] for _, s in settings])
            gain[(theta < _AS_MADE_FOR[0] * made_for) | (theta > _AS_MADE_FOR[1] * made_for)] = 0.0
            for kind in kinds:
                own = [i for i, (k, _) in enumerate(settings) if k is kind]
                best = own[int(np.argmax(gain[own]))]
                if gain[best] > _LEAST:
                    out.append(self._library.whole(kind.id, (joint,), **settings[best][1]))
        return out

    def _options(self, joint: int) -> tuple[list[Settings], FloatArray]:
        loads = [m.link_torque[:, joint] for m in self._library.motions]
        if joint in self._rows:
            before, settings, columns = self._rows[joint]
            if all(_alike(x, y) for x, y in zip(before, loads, strict=True)):
                return settings, columns
        motions, robot = self._library.motions, self._library.robot
        searched = [kind for kind in EFFECTS.values() if kind.deflection]
        settings = [(kind, c.settings) for kind in searched for c in kind.candidates(motions, joint)]
        effects = [kind.from_settings(robot, [robot.joint_names[joint]], dict(s)) for kind, s in settings]
        curves = [np.stack([effect.own_curve(motion) for effect in effects]) for motion in motions]
        columns = self._library.band.joint_curves(joint, curves)
        self._rows[joint] = loads, settings, columns
        return settings, columns


def _orthonormal(columns: FloatArray) -> FloatArray:
    """A basis of what columns (K, m) span, shape (K, r)."""
    scale = np.sqrt(np.maximum(np.sum(columns**2, axis=0), 1e-300))
    U, s, _ = np.linalg.svd(columns / scale, full_matrices=False)
    return np.asarray(U[:, s > 1e-6 * s.max(initial=0.0)])


def _alike(x: FloatArray, y: FloatArray) -> bool:
    return x.shape == y.shape and float(np.sum((x - y) ** 2)) <= _ALIKE**2 * float(np.sum(x**2))
