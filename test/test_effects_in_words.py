"""Parameters as sentences have them."""

from __future__ import annotations

import pytest

from sysid_ros.effects.parameter import Parameter
from sysid_ros.effects.wording import one


@pytest.mark.parametrize(
    ("std", "text"),
    [
        (None, "(0.0459, 0.0010, 0.0000) kg m"),
        ([0.004, 0.006, 0.005], "(0.0459, 0.0010, 0.0000) kg m"),
        ([0.004, 0.006, 10.0], "(0.0459, 0.0010, unseen) kg m"),
        ([10.0, 10.0, 10.0], "(unseen, unseen, unseen) kg m"),
    ],
)
def test_a_component_that_no_motion_has_shown_is_not_told(std: list[float] | None, text: str) -> None:
    assert one(Parameter("mc", "servo", [0.0459, 0.001, 0.0], "kg m", std)) == text
