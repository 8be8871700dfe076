"""Is there another single cause that this recording could not tell from the hidden one?

Only what is exactly as linear as the hidden cause is asked, by least squares; the hidden one says which causes those are. A case
that another cause explains to within the noise has two right answers and is drawn again.
"""

from __future__ import annotations

import numpy as np

from sysid_ros.simulation.hidden_effects import PlannedMotion, TrueRobot, cause_of

_GRID = 0.1
_TOLD = 3.0


def _left(columns: np.ndarray, torque: np.ndarray, floor: np.ndarray) -> float:
    """Largest rms over the joints, in floors, that columns (N, n, p) leave of a torque (N, n)."""
    weighted = (columns / floor[:, None]).reshape(-1, columns.shape[2])
    wanted = (torque / floor).reshape(-1)
    left = (wanted - weighted @ np.linalg.lstsq(weighted, wanted, rcond=None)[0]).reshape(torque.shape)
    return float(np.sqrt(np.mean(left**2, axis=0)).max())


def told_apart(true: TrueRobot, motion: PlannedMotion, floor: np.ndarray, told: float = _TOLD) -> bool:
    """False where another cause than the first effect of ``true`` explains what it does to within ``told`` noise floors."""
    effect = true.effects[0]
    q, v, a = motion.sample(np.arange(0.0, motion.duration, _GRID))
    torque, others = cause_of(effect.id).rivals(effect, true, q, v, a)
    return all(_left(columns, torque, floor) >= told for columns in others)
