"""Who uses effects and estimators asks them; nobody asks for their names or classes. Walks the package and fails on who does.

An id of several words, such as ``rotor_inertia``, is an effect's name, but in a list that holds other words too. One that is a
plain word, such as ``payload``, is also a key of documents: it counts where it meets what holds an effect's name.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
from pathlib import Path

import pytest

import sysid_ros.effects
import sysid_ros.estimators
from sysid_ros.effects import CHANNEL_EFFECTS, EFFECTS, ChannelEffect, Effect
from sysid_ros.estimators.estimator import Estimator

PACKAGE = Path(__file__).resolve().parents[1] / "sysid_ros"
# An effect's own files: what is known of it, and how a simulation hides it.
EXEMPT = ("effects", "simulation/hidden_effects")

IDS = set(EFFECTS) | set(CHANNEL_EFFECTS)
ONE_MEANING = {name for name in IDS if "_" in name}
HOLDERS = {"id", "effect", "effect_id", "kind"}
"""Names of variables and attributes that hold an effect's name."""
ASKED_BY_NAME = {"known_theta", "local", "whole", "local_options"}
"""Calls whose first argument is an effect's name."""
REGISTRIES = {"EFFECTS", "CHANNEL_EFFECTS"}


def _classes() -> set[str]:
    found = set()
    for package in (sysid_ros.effects, sysid_ros.estimators):
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            for name, value in vars(importlib.import_module(module.name)).items():
                if inspect.isclass(value) and issubclass(value, Effect | ChannelEffect | Estimator):
                    found.add(name)
    return found


CLASSES = _classes()


def _last(node: ast.AST) -> str:
    """The last part of a name: ``b`` of ``a.b``, ``local`` of ``library.local(...)``."""
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


def _named(node: ast.AST) -> str:
    """The effect that an expression names, as a string or as ``Class.id``."""
    if isinstance(node, ast.Constant) and node.value in IDS:
        return str(node.value)
    if isinstance(node, ast.Attribute) and node.attr == "id" and _last(node.value) in CLASSES:
        return f"{_last(node.value)}.id"
    return ""


def _comparison(node: ast.Compare) -> str:
    sides = [node.left, *node.comparators]
    if any(isinstance(op, ast.Is | ast.IsNot) for op in node.ops):
        of_type = any(isinstance(s, ast.Call) and _last(s.func) == "type" for s in sides)
        return "compares with a class" if of_type and any(_last(s) in CLASSES for s in sides) else ""
    if any(_last(s) in REGISTRIES for s in sides):
        return ""  # whether such an effect exists
    if any(isinstance(s, ast.Attribute) and s.attr == "id" for s in sides):
        return "compares ids"
    parts = [x for s in sides for x in (s.elts if isinstance(s, ast.Tuple | ast.List | ast.Set) else [s])]
    names = [n for n in map(_named, parts) if n]
    held = any(_last(s) in HOLDERS for s in sides)
    return "compares with an effect's name" if any(held or n not in IDS or n in ONE_MEANING for n in names) else ""


def _display(elements: list[ast.expr | None]) -> str:
    names = {_named(e) for e in elements if e is not None}
    return "lists effects by name" if len(names) > 1 and "" not in names and names - (IDS - ONE_MEANING) else ""


def asks_for_a_name(node: ast.AST) -> str:
    """What is wrong with a node, empty where nothing is."""
    if isinstance(node, ast.Compare):
        return _comparison(node)
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        return _display(list(node.elts))
    if isinstance(node, ast.Dict):
        return _display(list(node.keys))
    if isinstance(node, ast.Call) and _last(node.func) in ("isinstance", "issubclass"):
        classes = {_last(n) for n in ast.walk(node.args[1])}
        return "asks for a class" if classes & CLASSES else ""
    if isinstance(node, ast.Call) and _last(node.func) in ASKED_BY_NAME and node.args:
        return "asks by name" if _named(node.args[0]) else ""
    if isinstance(node, ast.Subscript) and _last(node.value) in REGISTRIES:
        return "asks by name" if _named(node.slice) else ""
    if isinstance(node, ast.MatchClass):
        return "asks for a class" if _last(node.cls) in CLASSES else ""
    return ""


def findings(path: Path) -> list[str]:
    where = path.relative_to(PACKAGE.parent)
    tree = ast.parse(path.read_text())
    return [f"{where}:{node.lineno} {what}" for node in ast.walk(tree) if (what := asks_for_a_name(node))]  # type: ignore[attr-defined]


def _of(entry: str) -> list[str]:
    path = PACKAGE / entry
    return [line for file in ([path] if path.is_file() else sorted(path.rglob("*.py"))) for line in findings(file)]


def _allowed(path: Path) -> bool:
    inside = path.relative_to(PACKAGE).as_posix()
    return any(inside == entry or inside.startswith(f"{entry}/") for entry in EXEMPT)


def test_nobody_asks_an_effect_or_an_estimator_for_its_name() -> None:
    wrong = [line for path in sorted(PACKAGE.rglob("*.py")) if not _allowed(path) for line in findings(path)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    "source",
    [
        'term.id == "payload"',
        "term.id in names",
        "a.id != b.id",
        'block.effect == "payload"',
        'effect_id in ("spring", "cogging")',
        'name == "rotor_inertia"',
        '"time_delay" in found',
        'x = ("rotor_inertia", "payload")',
        'x = {"rotor_inertia": 1, "time_delay": 2}',
        "x = [Backlash.id, JointElasticity.id]",
        "isinstance(effect, LinkInertia | RotorInertia)",
        "isinstance(effect, effects.Payload)",
        "isinstance(estimator, (VariableForgetting, int))",
        "type(effect) is Payload",
        'model.known_theta("coulomb_friction")',
        'EFFECTS["stribeck_friction"]',
        'library.local("torque_offset", 0)',
    ],
)
def test_the_rule_finds(source: str) -> None:
    assert [n for n in ast.walk(ast.parse(source)) if asks_for_a_name(n)], source


@pytest.mark.parametrize(
    "source",
    [
        'document["payload"]',
        'x = {"payload": 1, "status": "ok"}',
        'x = {"payload": 1, "spring": 2}',
        'x = ("seed", "viscous_friction", "coulomb_friction")',
        'event.what == "payload"',
        "block.effect in EFFECTS",
        "EFFECTS[block.effect].replaces_links",
        "term.kind is other.kind",
        "isinstance(value, float)",
        "LinkInertia(robot)",
        'node.declare_parameter("payload_frame", "")',
        "term.effect.companion == other",
    ],
)
def test_the_rule_leaves_alone(source: str) -> None:
    assert not [n for n in ast.walk(ast.parse(source)) if asks_for_a_name(n)], source
