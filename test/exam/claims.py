"""What a diagnosis claims of a case, each claim with the probability it is told with and whether it is true."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from sysid_ros.simulation.hidden_effects import CAUSES, cause_of

LEAST = 0.5
"""A cause that is told with no more than this probability is not claimed."""


def claims(truth: dict[str, Any], document: dict[str, Any]) -> list[dict[str, Any]]:
    """Each entry of ``effects``: its name, joints, probability (None where the document has none) and whether it is true.

    Args:
        truth: of the case. document: ``diagnosis.json``.
    """
    return [
        {
            "name": e["name"],
            "joints": list(e["joints"]),
            "probability": e.get("probability"),
            "headline": e.get("headline"),
            "true": is_true(e, truth["effects"]),
        }
        for e in document["effects"]
    ]


def claimed(claim: dict[str, Any]) -> bool:
    """Is it told as likelier than not? Without a probability everything that is told is claimed."""
    probability = claim.get("probability")
    return probability is None or probability > LEAST


def is_true(told: dict[str, Any], there: Iterable[dict[str, Any]]) -> bool:
    """The robot has it on one of its joints at least, or wherever where one of the two belongs to the whole arm."""
    return any(same_cause(told, e) and _meet(told, e) for e in there)


def same_cause(told: dict[str, Any], there: dict[str, Any]) -> bool:
    """The same id, a part of what is there, its companion, or an equivalent one that admits it."""
    name, cause = told["name"], cause_of(there["name"])
    if name == there["name"] or name in cause.within or name in cause.companions:
        return True
    return there["name"] in told.get("cannot_be_told_from", ()) and same(name, there["name"])


def same(one: str, other: str) -> bool:
    """One id, or two names of one thing in some motions."""
    return one == other or any(b in CAUSES[a].equivalent for a, b in ((one, other), (other, one)) if a in CAUSES)


def _meet(told: dict[str, Any], there: dict[str, Any]) -> bool:
    whole = any(id_ in CAUSES and CAUSES[id_].whole_arm for id_ in (told["name"], there["name"]))
    return whole or bool(set(told["joints"]) & set(there["joints"]))
