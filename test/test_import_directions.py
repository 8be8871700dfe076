"""Imports run one way. Walks every import of the package and fails on an arrow that runs back."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "sysid_ros"

# Each unit (a module of the root, or a sub-package) imports only units of earlier rows, and itself.
LEVELS = (
    {"exceptions", "sample"},
    {"files"},
    {"estimators"},
    {"online_settings"},
    {"robot"},
    {"signals"},
    {"blackbox"},
    {"effects"},
    {"floating"},
    {"torque"},
    {"excitation", "input_gate"},
    {"online"},
    {"control"},
    {"simulation"},
    {"identification"},
    {"diagnosis", "frequency_domain"},
    {"sources"},
    {"pages"},
    {"nodes"},
    {"fleet"},
    {"cli"},
    {"library"},
)
LEVEL_OF = {unit: level for level, units in enumerate(LEVELS) for unit in units}

# Estimators know no robotics: of the package they see errors and the array type.
ONLY = {"estimators": {"exceptions", "sample"}}

# Where each foreign package may be imported. Message packages are ROS as much as rclpy is.
ROS = ("rclpy", "ament_index_python", "builtin_interfaces", "rcl_interfaces", "launch", "launch_ros")
CONFINED = {
    **{package: {"nodes"} for package in ROS},
    "mujoco": {"robot", "simulation"},
    "pybullet": {"simulation", "nodes"},
    "pybullet_data": {"simulation", "nodes"},
    "pybullet_utils": {"simulation", "nodes"},
    "pinocchio": {"robot", "floating"},
    "coal": {"robot"},
    "click": {"cli"},
}


@dataclass(frozen=True)
class Import:
    """One import: which file and line, of which unit, of what."""

    path: Path
    line: int
    unit: str
    target: str

    def __str__(self) -> str:
        return f"{self.path.relative_to(PACKAGE.parent)}:{self.line} imports {self.target}"


def unit_of(path: Path) -> str:
    first = path.relative_to(PACKAGE).parts[0]
    return first.removesuffix(".py")


def imports_of(path: Path, tree: ast.Module) -> list[Import]:
    """Every import of a file, also those inside functions and under TYPE_CHECKING, with relative ones resolved."""
    unit = unit_of(path)
    package = ("sysid_ros", *path.relative_to(PACKAGE).parent.parts)
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [Import(path, node.lineno, unit, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(part for part in (base, node.module) if part)
            if module == "sysid_ros":
                found += [Import(path, node.lineno, unit, f"sysid_ros.{alias.name}") for alias in node.names]
            else:
                found.append(Import(path, node.lineno, unit, module))
    return found


FILES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


@cache
def imports() -> list[Import]:
    return [found for path in FILES for found in imports_of(path, ast.parse(path.read_text(encoding="utf-8")))]


@cache
def inside() -> list[Import]:
    return [found for found in imports() if found.target.startswith("sysid_ros.") and found.target != "sysid_ros.__version__"]


def test_every_unit_has_a_level() -> None:
    unknown = sorted({unit_of(path) for path in FILES} - set(LEVEL_OF))
    assert not unknown, f"{unknown} stand in no row of LEVELS: say which units they may import."


def test_no_import_runs_back() -> None:
    back = []
    for found in inside():
        target = found.target.split(".")[1]
        if target != found.unit and LEVEL_OF.get(target, len(LEVELS)) >= LEVEL_OF.get(found.unit, -1):
            back.append(str(found))
    assert not back, "\n".join(back)


@pytest.mark.parametrize("unit", sorted(ONLY))
def test_unit_sees_only(unit: str) -> None:
    allowed = ONLY[unit] | {unit}
    too_much = [str(found) for found in inside() if found.unit == unit and found.target.split(".")[1] not in allowed]
    assert not too_much, "\n".join(too_much)


@pytest.mark.parametrize("foreign", sorted(CONFINED))
def test_foreign_package_stays_in_its_place(foreign: str) -> None:
    outside = [str(found) for found in imports() if found.target.split(".")[0] == foreign and found.unit not in CONFINED[foreign]]
    assert not outside, "\n".join(outside)


def test_ros_messages_are_imported_only_by_nodes() -> None:
    outside = [
        str(found)
        for found in imports()
        if found.unit != "nodes" and found.target.split(".")[0].endswith(("_msgs", "_srvs", "_interfaces"))
    ]
    assert not outside, "\n".join(outside)


def test_package_init_imports_nothing() -> None:
    """Names come when they are first used, so that commands start quickly."""
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(node) for node in imports] == ["import importlib"]


def test_an_arrow_that_runs_back_is_seen() -> None:
    code = "def f():\n    from ..nodes import x\n    from sysid_ros import online\n    import rclpy.node\n"
    found = imports_of(PACKAGE / "effects" / "new.py", ast.parse(code))
    assert [(one.unit, one.target) for one in found] == [
        ("effects", "sysid_ros.nodes"),
        ("effects", "sysid_ros.online"),
        ("effects", "rclpy.node"),
    ]
