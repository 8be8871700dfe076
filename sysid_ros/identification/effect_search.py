"""Effects that are asked for become free where they predict what was not fitted better than the model does without them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from sysid_ros.effects import Effect
from sysid_ros.identification.effect_choice import alternatives, those_that_gain
from sysid_ros.identification.free_effects import add_effects, free_model, own_knobs, places, wishes
from sysid_ros.identification.knob_search import KnobSearch
from sysid_ros.identification.result import Knob as FoundKnob
from sysid_ros.identification.rows import SmoothRecording
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.torque_model import TorqueModel

_ROUNDS = 3
"""Times that effects are asked for beside each other at most."""


def choose_effects(
    robot: RobotModel,
    friction: str,
    effects: Sequence[str],
    method: str,
    recordings: Sequence[SmoothRecording],
    progress: Callable[[str], None],
) -> tuple[list[Effect], list[FoundKnob]]:
    """Effects that are free beside the usual ones or in their place, and the knobs that were searched for.

    Each effect that is asked for becomes free on the joints, or for the whole arm, where it predicts what was not fitted better
    than the model does without it, see :func:`~sysid_ros.identification.effect_choice.those_that_gain`.

    Where several are asked for, each is asked for again beside what was chosen of the others, until that changes no more. The
    knobs minimise the weighted sum of squares that is left when all linear parameters are solved for (variable projection: Golub,
    Pereyra 1973), first on a grid over their range, then on finer ones around the best. Joints whose columns share no row are
    searched in turn until none changes, others each by itself.

    Args:
        friction, effects: as of :func:`~sysid_ros.identification.free_effects.wishes`. method: of the least squares.
        recordings: to find them in.
    """
    asked = wishes(friction, effects)
    chosen = [wish.effect(robot) for wish in asked if wish.everywhere]
    knobs: dict[type[Effect], list[FoundKnob]] = {}
    for _ in range(_ROUNDS):
        before = [(type(e), e.joint_names, e.settings) for e in chosen]
        for wish in (w for w in asked if not w.everywhere):
            progress(f"asking the recordings for {wish.effect.label}")
            others = [e for e in chosen if type(e) is not wish.effect]
            candidates, found, tried = _candidates(robot, wish.effect, others, recordings, method)
            model = TorqueModel(robot, [*free_model(robot, others).free, *candidates])
            bags = [recording.rows(model) for recording in recordings]
            gaining = those_that_gain(model, bags, alternatives(model, candidates), tried, method)
            chosen = add_effects(others, _joined([candidates[k] for k in gaining]))
            knobs[wish.effect] = [knob for k in gaining for knob in found[k]]
        # what one effect explained may be another's, which was not there when it was asked for, or was hidden by it
        if len(asked) < 2 or [(type(e), e.joint_names, e.settings) for e in chosen] == before:
            break
    there = {(type(e), joint) for e in chosen for joint in ("", *e.joint_names)}
    return chosen, [k for kind, found in knobs.items() for k in found if (kind, k.joint) in there]


def _joined(effects: Sequence[Effect]) -> list[Effect]:
    """The same effects, joints with the same settings in one."""
    out: list[Effect] = []
    for effect in effects:
        same = next((e for e in out if e.settings == effect.settings), None)
        if same is None:
            out.append(effect)
        else:
            joints = [*same.joint_names, *effect.joint_names]
            out[out.index(same)] = type(same).from_settings(same.robot, joints, same.settings)
    return out


def _candidates(
    robot: RobotModel, effect: type[Effect], chosen: Sequence[Effect], recordings: Sequence[SmoothRecording], method: str
) -> tuple[list[Effect], list[list[FoundKnob]], int]:
    """The effect at each of its places with the best setting, what was found of its knobs, and how many settings were tried."""
    where, knobs = places(effect, robot), own_knobs(effect)
    if not knobs:
        return [effect(robot, joints) for joints in where], [[] for _ in where], 1
    rest = [e for e in free_model(robot, chosen).free if not e.family or e.family != effect.family]
    search = KnobSearch(TorqueModel(robot, rest), effect, where, knobs, recordings, method)
    settings, determined = search.run()
    out = [search.effect(u, setting) for u, setting in enumerate(settings)]
    found = [
        [
            FoundKnob(knob.name, ", ".join(joints), float(value), search.unit(joints, knob), sure)
            for knob, value, sure in zip(knobs, setting, certain, strict=True)
        ]
        for joints, setting, certain in zip(where, settings, determined, strict=True)
    ]
    return out, found, search.tried
