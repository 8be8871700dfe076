"""What is installed: versions, entry points, shared files, and no robot's name in the code."""

from __future__ import annotations

import ast
import importlib
import re
import runpy
import subprocess
import sys
import tokenize
import tomllib
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest

import sysid_ros

ROOT = Path(__file__).resolve().parents[1]
CODE = sorted((ROOT / "sysid_ros").rglob("*.py"))

ROBOT_NAMES = re.compile(
    r"\b(ur3|ur5|ur10|ur16|ur20|ur30)e?\b|universal.?robots|staubli|stäubli|\btx2?.?(40|60|90)\b|kuka|iiwa|franka|panda|\bfr3\b"
    r"|kinova|\bgen3\b|xarm|unitree|\bgo[12]\b|anymal|laikago|minitaur|\bfanuc\b|\babb\b|sawyer|baxter|solo12|minicheetah",
    re.IGNORECASE,
)


@pytest.fixture(scope="module")
def setup_arguments() -> dict[str, Any]:
    """What setup.py passes to setuptools."""
    captured: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("setuptools.setup", captured.update)
        runpy.run_path(str(ROOT / "setup.py"))
    return captured


def test_one_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    newest = re.search(r"^(\d+\.\d+\.\d+) \(", (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8"), re.MULTILINE)
    versions = {
        "sysid_ros/__init__.py": sysid_ros.__version__,
        "pyproject.toml": project["version"],
        "package.xml": ElementTree.parse(ROOT / "package.xml").findtext("version"),
        "CHANGELOG.rst": newest and newest[1],
    }
    assert len(set(versions.values())) == 1, versions


def test_package_xml_is_valid() -> None:
    package_parser = pytest.importorskip("catkin_pkg.package", reason="catkin_pkg is not installed")
    warnings: list[str] = []
    package = package_parser.parse_package(str(ROOT / "package.xml"), warnings=warnings)
    package.validate(warnings=warnings)
    assert not warnings
    assert package.name == "sysid_ros"
    assert package.package_format == 3
    assert package.get_build_type() == "ament_python"


def test_entry_points_can_be_imported(setup_arguments: dict[str, Any]) -> None:
    scripts = setup_arguments["entry_points"]["console_scripts"]
    assert {script.split(" = ")[0] for script in scripts} == {
        "sysid",
        "online_payload_estimator",
        "adaptive_controller",
        "simulated_robot",
    }
    missing = []
    for script in scripts:
        module, function = script.split(" = ")[1].split(":")
        if module.startswith("sysid_ros.nodes"):
            pytest.importorskip("rclpy", reason="rclpy is not installed (extra ros)")
        if not callable(getattr(importlib.import_module(module), function, None)):
            missing.append(script)
    assert not missing


def test_every_shared_file_is_installed(setup_arguments: dict[str, Any]) -> None:
    installed = {source: target for target, sources in setup_arguments["data_files"] for source in sources}
    for name in ("package.xml", "resource/sysid_ros"):
        assert name in installed
    for folder in ("launch", "config"):
        files = [path for path in (ROOT / folder).rglob("*") if path.is_file() and "__pycache__" not in path.parts]
        assert files, f"{folder}/ is empty"
        for path in files:
            relative = path.relative_to(ROOT)
            assert installed.get(relative.as_posix()) == f"share/sysid_ros/{relative.parent.as_posix()}"


def test_pixi_has_every_dependency_in_the_same_range() -> None:
    pixi = tomllib.loads((ROOT / "pixi.toml").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    called = {"pin": "pinocchio", "matplotlib": "matplotlib-base"}
    given = pixi["dependencies"] | pixi["pypi-dependencies"]
    needed = [
        re.split(r"(?=[<>=])", text, maxsplit=1) for text in (*project["dependencies"], *project["optional-dependencies"]["sim"])
    ]
    assert {called.get(name, name): span for name, span in needed}.items() <= given.items()
    assert pixi["workspace"]["name"] == project["name"]


def test_an_index_shows_no_link_that_leads_nowhere(monkeypatch: pytest.MonkeyPatch, setup_arguments: dict[str, Any]) -> None:
    """The README's pictures and links are paths in the repository, which an index does not have."""
    assert setup_arguments["long_description_content_type"] == "text/markdown"
    links = re.findall(r"\]\(([^)]*)\)", setup_arguments["long_description"])
    assert not [link for link in links if not re.match(r"https?:|#", link)]
    assert "getting started" in setup_arguments["long_description"]
    monkeypatch.setattr("setuptools.setup", lambda **_: None)
    functions = runpy.run_path(str(ROOT / "setup.py"))["long_description"].__globals__
    monkeypatch.setitem(functions["PROJECT"], "urls", {"Repository": "https://example.org/sysid_ros/"})
    text = functions["long_description"]()
    assert "![" in text
    assert "(https://example.org/sysid_ros/raw/HEAD/docs/images/payload.png)" in text
    assert "(https://example.org/sysid_ros/blob/HEAD/docs/getting_started.md)" in text


def test_shared_files_are_small() -> None:
    large = [path.name for path in (ROOT / "bags").rglob("*") if path.is_file() and path.stat().st_size > 2_000_000]
    assert not large, f"{large} are larger than 2 MB"


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def code_of(path: Path) -> str:
    """The source without comments, docstrings and the lines under a number that give its reason: a text may name a robot as an
    example, code may not."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [x for x in node.body if not _is_text(x)] or [ast.Pass()]
    return ast.unparse(tree)


@pytest.mark.parametrize("path", [path for path in CODE if "simulation" not in path.parts], ids=lambda path: path.stem)
def test_no_robot_has_its_name_in_the_code(path: Path) -> None:
    found = ROBOT_NAMES.search(code_of(path).replace("_", " "))
    assert not found, f"{path.relative_to(ROOT)} names {found and found[0]!r}"


@pytest.mark.parametrize("path", CODE, ids=lambda path: path.stem)
def test_nothing_is_left_undone(path: Path) -> None:
    with tokenize.open(path) as file:
        comments = [token.string for token in tokenize.generate_tokens(file.readline) if token.type == tokenize.COMMENT]
    assert not [comment for comment in comments if re.search(r"\b(TODO|FIXME|XXX)\b", comment)]


def test_core_imports_without_ros_and_pybullet() -> None:
    modules = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for path in CODE
        if not {"nodes", "simulation", "cli", "sources"} & set(path.parts) and path.stem != "__init__"
    ]
    code = (
        "import importlib, sys\n"
        "for blocked in ('rclpy', 'pybullet', 'pybullet_data'): sys.modules[blocked] = None\n"
        f"for name in {modules!r}: importlib.import_module(name)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
