"""Findings in words."""

from __future__ import annotations

from collections.abc import Sequence

from sysid_ros.effects.wording import listed

_MOST_NAMED = 3
"""Causes that one sentence names."""


def sentence(words: str, gain: float | None) -> str:
    """One sentence for an engineer: what, where, how large, and how much of the error it makes."""
    return f"{capital(words)}." if gain is None else f"{capital(words)}. It {makes(gain)}."


def makes(gain: float) -> str:
    """A share of the error in words; that of a cause which does harm beside the others is negative."""
    if gain <= -0.0005:
        return f"makes the error on data that were not fitted {percent(-gain)} larger"
    return f"makes {percent(gain)} of the error"


def percent(gain: float | None) -> str:
    """A share in per cent; a dash where there is none."""
    if gain is None:
        return "-"
    size = abs(gain)
    digits = 0 if size >= 0.0995 else 1
    return f"{100 * gain:.{digits}f} %" if size >= 0.0005 else "below 0.1 %" if size > 0.0 else "0 %"


def answer(
    verdict: str, refusal: str | None, main: Sequence[str], gain: float, others: int, faults: Sequence[str], left: float
) -> str:
    """The first sentence of a report: what an engineer would answer who was asked what is wrong.

    Args:
        main: the causes of the headline in words. gain: what all of them make of the error. others: number of the other causes.
        faults: of the data, in words. left: part of the error that nothing explains.
    """
    if verdict == "refused":
        return f"No answer: {first_sentence(refusal or 'these recordings can not be judged.')[0]}"
    data = f" The data have {'a fault' if len(faults) == 1 else 'faults'} of their own: {listed(faults)}." if faults else ""
    if verdict == "unexplained":
        return f"The model is wrong, and no cause that is known here explains it.{data}"
    if not main and not others:
        if faults:
            return f"The model is right, the data are not: {listed(faults)}."
        return "Nothing is wrong that these recordings could show: the model predicts the torques down to their noise."
    if not main:
        return f"What was found in the fitted recordings does not make the error on other data smaller.{data}"
    named = [*main[:_MOST_NAMED], *([f"{len(main) - _MOST_NAMED} more"] if len(main) > _MOST_NAMED else [])]
    first = "Mostly: " if others else ""
    whole = f"{first}{_in_a_row(named)}. {'It makes' if len(main) == 1 else 'Together they make'} {percent(gain)} of the error"
    rest = f"; {percent(left)} of it is of no cause that is known here" if verdict == "partly_explained" and left >= 0.005 else ""
    return f"{capital(whole)}{rest}.{data}"


def first_sentence(text: str) -> tuple[str, str]:
    """A text's first sentence, and what follows it."""
    first, stop, rest = text.partition(". ")
    return f"{first}." if stop else first, rest


def _in_a_row(clauses: Sequence[str]) -> str:
    return listed(clauses) if all("," not in c and ";" not in c for c in clauses) else "; ".join(clauses)


def capital(text: str) -> str:
    """With a capital at its beginning."""
    return text[:1].upper() + text[1:]
