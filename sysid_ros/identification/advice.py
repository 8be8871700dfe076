"""What to record next, so that the next identification knows more."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sysid_ros.identification.result import BaseGroup, Repeatability
from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.robot.robot_model import RobotModel

_NAMED = 4


def record_next(
    robot: RobotModel,
    bags: Sequence[BagRows],
    groups: Sequence[BaseGroup],
    repeated: Sequence[Repeatability],
    condition_number: float,
) -> tuple[str, ...]:
    """Sentences, the most useful first.

    Args:
        condition_number: of the scaled base columns of these bags.
    """
    out = []
    if len(bags) == 1:
        out.append(
            "Record a second run along another path: one run does not show how well the model holds elsewhere, nor how well its "
            "parameters repeat."
        )
    share = np.sum([b.moves.sum(axis=0) for b in bags], axis=0) / sum(len(b.t) for b in bags)
    seldom = [f"{name} ({100 * s:.0f} % of the time)" for name, s in zip(robot.joint_names, share, strict=True) if s < TOL.seldom]
    if seldom:
        out.append(f"Move {', '.join(seldom)} for longer: friction is learned only while a joint moves.")
    one_way = [name for name, way in zip(robot.joint_names, _lesser_way(bags), strict=True) if way < TOL.one_way]
    if one_way:
        out.append(
            f"Move {', '.join(one_way)} in both directions for about as long: from one direction alone, Coulomb friction and "
            "offset can't be separated."
        )
    left = [g.name for g in groups if g.determined_by == "prior"]
    if left:
        named = ", ".join(left[:_NAMED]) + (f" and {len(left) - _NAMED} more" if len(left) > _NAMED else "")
        out.append(
            f"{len(left)} of {len(groups)} base parameters are left to the prior ({named}): move the joints before these links "
            "with more acceleration and through more of their range; 'sysid excite' designs such a motion."
        )
    if condition_number > TOL.well_conditioned:
        out.append(
            f"The condition number of these bags is {condition_number:.0f}; under {TOL.well_conditioned:.0f} is wanted. "
            "'sysid excite' designs a motion that has it."
        )
    changed = [r.name for r in repeated if r.between > TOL.changed * r.within and r.friction]
    if changed:
        named = ", ".join(changed[:_NAMED]) + (f" and {len(changed) - _NAMED} more" if len(changed) > _NAMED else "")
        out.append(
            f"{named} changed between the bags by more than {TOL.changed:g} times their intervals: let the drives warm up "
            "first, or record cold and warm runs so that the spread is known."
        )
    return tuple(out)


def _lesser_way(bags: Sequence[BagRows]) -> NDArray[np.float64]:
    """Part of the moving rows that go in the lesser direction, a joint, shape (n,)."""
    forward = np.sum([(b.moves & (b.v > 0.0)).sum(axis=0) for b in bags], axis=0)
    moving = np.maximum(np.sum([b.moves.sum(axis=0) for b in bags], axis=0), 1)
    goes = np.any([np.any(b.v != 0.0, axis=0) for b in bags], axis=0)
    part = np.where(goes, forward / moving, 0.5)  # the slides of a floating base have no velocity of their own
    return np.asarray(np.minimum(part, 1.0 - part))
