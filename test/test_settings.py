"""OnlineSettings: every field refuses what it can't be, and says what it can."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

from sysid_ros.exceptions import SettingsError
from sysid_ros.online_settings import OnlineSettings

FIELDS = {f.name: f for f in fields(OnlineSettings)}
DEFAULTS = OnlineSettings()


def kind(name: str) -> str:
    default, choices = getattr(DEFAULTS, name), FIELDS[name].metadata["choices"]
    if isinstance(default, bool):
        return "bool"
    if choices:
        return "choice"
    if isinstance(default, str):
        return "string"
    if isinstance(default, tuple):
        return "strings" if FIELDS[name].metadata["low"] is None else "numbers"
    return "number"


def made(name: str, value: Any) -> OnlineSettings:
    return OnlineSettings(**{name: value})


def bad_values(name: str) -> list[Any]:
    meta = FIELDS[name].metadata
    numbers: list[Any] = ["fast", None, True, float("nan"), float("inf"), {}]
    if kind(name) == "bool":
        return ["yes", 1, 0.0, None, [True]]
    if kind(name) == "choice":
        return ["other", "", None, 1, [], {}]
    if kind(name) == "string":
        return [1, None, ["a"], {}]
    if kind(name) == "strings":
        return ["turn", [1], None, ["turn", None], 3.0, {}]
    outside = [meta["low"] - 1.0, meta["high"] * 2.0 + 1.0]
    if kind(name) == "number":
        return [*numbers, *outside, [], [meta["high"]], [meta["high"], meta["high"]]]
    return [*numbers, *([x] for x in numbers), *([x] for x in outside), [[1.0]]]


CASES = [(name, value) for name in FIELDS for value in bad_values(name)]


@pytest.mark.parametrize(("name", "value"), CASES, ids=[f"{name}-{value!r}" for name, value in CASES])
def test_a_bad_value_is_named_with_what_is_allowed(name: str, value: Any) -> None:
    with pytest.raises(SettingsError) as caught:
        OnlineSettings(**{name: value})
    text = str(caught.value)
    assert text.startswith(f"{name} is ")
    assert repr(value) in text or repr(tuple(value)) in text
    assert "must be" in text


@pytest.mark.parametrize("name", FIELDS)
def test_every_field_has_a_description_and_numbers_a_range(name: str) -> None:
    meta = FIELDS[name].metadata
    assert meta["description"]
    if kind(name) in ("number", "numbers"):
        assert meta["low"] < meta["high"]
        value = getattr(DEFAULTS, name)
        assert all(meta["low"] <= x <= meta["high"] for x in (value if isinstance(value, tuple) else (value,)))
    if kind(name) == "choice":
        assert getattr(DEFAULTS, name) in meta["choices"]


@pytest.mark.parametrize("name", [n for n in FIELDS if kind(n) == "number"])
def test_the_ends_of_the_range_are_allowed_and_integers_too(name: str) -> None:
    meta = FIELDS[name].metadata
    for value in (meta["low"], meta["high"]):
        assert getattr(made(name, value), name) == value
    whole = int(meta["high"])
    if whole >= meta["low"]:
        assert isinstance(getattr(made(name, whole), name), float)


@pytest.mark.parametrize("gravity", [(), (9.81,), (0.0, -9.81), (0.0, 0.0, 0.0, -9.81), 9.81])
def test_gravity_has_three_components(gravity: Any) -> None:
    with pytest.raises(SettingsError, match="gravity"):
        OnlineSettings(gravity=gravity)


def test_lists_become_tuples_of_floats() -> None:
    settings = OnlineSettings(effort_scale=[1, 2.5], joint_names=["a", "b"], effort_sign=[1, -1])  # type: ignore[arg-type]
    assert settings.effort_scale == (1.0, 2.5)
    assert settings.joint_names == ("a", "b")
    assert settings.effort_sign == (1.0, -1.0)


def test_from_mapping_names_the_origin_and_what_is_unknown() -> None:
    assert OnlineSettings.from_mapping({"estimator": "constant"}, "here").estimator == "constant"
    assert OnlineSettings.from_mapping({}, "here") == DEFAULTS
    with pytest.raises(SettingsError, match=r"my\.yaml: unknown setting publish_rat\b.*publish_rate"):
        OnlineSettings.from_mapping({"publish_rat": 5.0}, "my.yaml")
    with pytest.raises(SettingsError, match=r"my\.yaml: publish_rate is -1"):
        OnlineSettings.from_mapping({"publish_rate": -1}, "my.yaml")
