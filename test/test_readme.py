"""What the documents say holds: commands parse, examples run, links resolve, tables list what there is."""

from __future__ import annotations

import ast
import inspect
import itertools
import re
import shlex
import sys
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import click
import pytest

from sysid_ros import effects, estimators
from sysid_ros.cli import main as cli
from sysid_ros.control.control_settings import ControlSettings, SafetySettings
from sysid_ros.online.payload_estimate import STATUSES
from sysid_ros.online_settings import CommitSettings, OnlineSettings

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
README, EXTENDING = ROOT / "README.md", DOCS / "extending.md"
BESIDE = [ROOT / "CONTRIBUTING.md", ROOT / "bags" / "README.md", ROOT / "benchmarks" / "README.md"]
DOCUMENTS = [README, *sorted(DOCS.rglob("*.md")), *BESIDE]
NODES = ROOT / "sysid_ros" / "nodes"
TOPICS = re.findall(r'"(~/\w+)"', (NODES / "messages.py").read_text(encoding="utf-8"))
_SERVICE = re.compile(r"def (\w+)\(live: LiveEstimation, request:")
SERVICES = [f"~/{name}" for name in _SERVICE.findall((NODES / "services.py").read_text(encoding="utf-8"))]

_FENCE = re.compile(r"(?:<!-- (?P<mark>[^\n]*?) -->\n)?^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"!?\[[^]]*\]\(([^)\s]+)\)")


@dataclass(frozen=True)
class Block:
    """One fenced block: the document and line it stands in, the mark in the comment above it, its language."""

    path: Path
    line: int
    mark: str
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.path.relative_to(ROOT)}:{self.line}"


def blocks(path: Path) -> list[Block]:
    text = path.read_text(encoding="utf-8")
    return [
        Block(path, text.count("\n", 0, m.start("text")) + 1, m["mark"] or "", m["language"], m["text"])
        for m in _FENCE.finditer(text)
    ]


def commands_of(block: Block) -> Iterator[list[str]]:
    """The words of each command, continued lines joined, comments left out."""
    for line in block.text.replace("\\\n", " ").splitlines():
        if words := shlex.split(line, comments=True):
            yield words


BLOCKS = [block for path in DOCUMENTS for block in blocks(path)]
COMMANDS = [(block, words) for block in BLOCKS if block.language == "sh" for words in commands_of(block)]


def starting_with(*first: str) -> list[Any]:
    """Parameters for the commands that begin with these words."""
    found = [(b, w) for b, w in COMMANDS if tuple(w[: len(first)]) == first]
    return [pytest.param(words[len(first) :], id=f"{block} {' '.join(words)[:60]}") for block, words in found]


def test_the_documents_hold_what_is_tested_here() -> None:
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 200
    assert len(starting_with("sysid")) > 5
    assert starting_with("make")
    assert starting_with("ros2", "run", "sysid_ros")
    assert [block.mark for block in blocks(EXTENDING)].count("run") > 5


@pytest.mark.parametrize("arguments", starting_with("sysid"))
def test_sysid_command_parses(arguments: list[str]) -> None:
    if arguments[0] in ("simulate", "control"):
        pytest.importorskip("pybullet", reason="pybullet is not installed (extra sim)")
    command: click.Command = cli.sysid
    rest = list(arguments)
    while isinstance(command, click.Group):
        found = command.get_command(click.Context(command), rest.pop(0))
        assert found is not None, arguments
        command = found
    command.make_context("sysid", rest)


@pytest.mark.parametrize("arguments", starting_with("make"))
def test_make_target_exists(arguments: list[str]) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for word in arguments:
        name, equals, _ = word.partition("=")
        pattern = rf"\b{name}\b" if equals else rf"^{re.escape(name)}:"
        assert re.search(pattern, makefile, re.MULTILINE), f"the Makefile has no {name}"


def node_parameters() -> set[str]:
    names = {f.name for f in fields(OnlineSettings)} | {f"commit.{f.name}" for f in fields(CommitSettings)}
    pytest.importorskip("rclpy", reason="rclpy is not installed (extra ros)")
    from sysid_ros.nodes.parameters import NodeSettings

    return names | {f.name for f in fields(NodeSettings)}


@pytest.mark.parametrize("arguments", starting_with("ros2", "run", "sysid_ros"))
def test_ros2_run_names_an_executable_and_its_parameters(arguments: list[str]) -> None:
    name = arguments[0]
    assert f'"{name} = ' in (ROOT / "setup.py").read_text(encoding="utf-8")
    given = [word.partition(":=")[0] for flag, word in itertools.pairwise(arguments) if flag == "-p"]
    if name == "simulated_robot":
        text = (ROOT / "sysid_ros" / "nodes" / "simulation_parameters.py").read_text(encoding="utf-8")
        assert not [parameter for parameter in given if f'"{parameter}"' not in text]
    else:
        assert set(given) <= node_parameters()


@pytest.mark.parametrize("arguments", starting_with("ros2", "launch", "sysid_ros"))
def test_launch_file_exists_with_its_arguments(arguments: list[str]) -> None:
    path = ROOT / "launch" / arguments[0]
    assert path.is_file()
    pytest.importorskip("rclpy", reason="rclpy is not installed (extra ros)")
    from sysid_ros.nodes.launch_plan import LAUNCH_FILES

    names = {argument.name for argument in LAUNCH_FILES[path.name].arguments(ROOT / "config")}
    assert not [word for word in arguments[1:] if ":=" in word and word.partition(":=")[0] not in names]


@pytest.mark.parametrize("kind", ["service", "topic"])
def test_ros2_commands_name_what_the_node_has(kind: str) -> None:
    for _, words in COMMANDS:
        if words[:2] == ["ros2", kind]:
            name = next(word for word in words[2:] if word.startswith("/"))
            if name.startswith("/online_payload_estimator/"):
                assert f"~/{name.rpartition('/')[2]}" in (TOPICS if kind == "topic" else SERVICES), name


@pytest.mark.parametrize("arguments", [p for p in starting_with("python") if str(p.values[0][0]).endswith(".py")])
def test_script_exists_with_its_options(arguments: list[str]) -> None:
    text = (ROOT / arguments[0]).read_text(encoding="utf-8")
    assert not [word for word in arguments[1:] if word.startswith("--") and f'"{word}"' not in text]


def anchors(path: Path) -> set[str]:
    """The anchors that GitHub gives to a document's headings."""
    headings = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_to_files_resolve(path: Path) -> None:
    text = _FENCE.sub("", path.read_text(encoding="utf-8"))
    for target in _LINK.findall(text):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        file = (path.parent / name).resolve() if name else path
        assert file.exists(), f"{target} is not there"
        assert not anchor or anchor in anchors(file), f"{file.name} has no heading {anchor}"


@pytest.mark.parametrize("block", [b for b in BLOCKS if b.language == "python"], ids=str)
def test_python_block_is_python(block: Block) -> None:
    ast.parse(block.text)


def test_every_page_stands_in_the_contents_of_the_site_and_names_what_is_there() -> None:
    contents = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert not [name for path in DOCS.rglob("*.md") if (name := path.relative_to(DOCS).as_posix()) not in contents]
    for path in sorted((DOCS / "api").glob("*.md")):
        for module in re.findall(r"^::: ([\w.]+)$", path.read_text(encoding="utf-8"), re.MULTILINE):
            assert (ROOT / module.replace(".", "/")).exists() or (ROOT / f"{module.replace('.', '/')}.py").exists(), module


def rows_of(path: Path) -> dict[str, list[str]]:
    """Rows of the tables whose first cell is one word in code, by that word."""
    cells = [
        [c.strip() for c in line.strip("|").split("|")]
        for line in path.read_text(encoding="utf-8").splitlines()
        if line[:1] == "|"
    ]
    return {m[1]: row[1:] for row in cells if (m := re.fullmatch(r"`([^`]+)`", row[0]))}


def in_yaml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(in_yaml(x) for x in value) + "]"
    return f'"{value}"' if value == "" else value if isinstance(value, str) else f"{value:g}"


def test_every_parameter_stands_in_the_page_of_the_node_with_its_default() -> None:
    rows = rows_of(DOCS / "node.md")
    expected = {f.name: getattr(OnlineSettings(), f.name) for f in fields(OnlineSettings)}
    expected |= {f"commit.{f.name}": getattr(CommitSettings(), f.name) for f in fields(CommitSettings)}
    if "rclpy" in sys.modules or _can_import("rclpy"):
        from sysid_ros.nodes.parameters import NodeSettings

        expected |= {f.name: getattr(NodeSettings(), f.name) for f in fields(NodeSettings)}
    stated = {name: rows.get(name, ["not there"])[0].strip("`") for name in expected}
    assert stated == {name: in_yaml(value) for name, value in expected.items()}


def test_every_parameter_of_the_controller_stands_in_its_page_with_its_default() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed (extra ros)")
    from sysid_ros.nodes.controller_settings import ControllerSettings

    rows = rows_of(DOCS / "control.md")
    expected = {f.name: getattr(c(), f.name) for c in (ControllerSettings, ControlSettings, SafetySettings) for f in fields(c)}
    stated = {name: rows.get(name, ["not there"])[0].strip("`") for name in expected}
    assert stated == {name: in_yaml(value) for name, value in expected.items()}


def _can_import(name: str) -> bool:
    try:
        __import__(name)
    except ImportError:
        return False
    return True


def test_every_status_topic_and_service_stands_in_its_page() -> None:
    rows, statuses = rows_of(DOCS / "node.md"), rows_of(DOCS / "replay.md")
    assert not [status for status in STATUSES if status not in statuses]
    assert len(TOPICS) >= 7
    assert len(SERVICES) >= 4
    assert not [name for name in (*TOPICS, *SERVICES) if name not in rows]


def module_of(mark: str, name: str) -> types.ModuleType:
    """The one block of docs/extending.md with this mark, as a module."""
    (block,) = [b for b in blocks(EXTENDING) if b.mark == mark]
    module = types.ModuleType(name)
    exec(compile(block.text, str(block), "exec", dont_inherit=True), module.__dict__)
    return module


@pytest.fixture
def extended(monkeypatch: pytest.MonkeyPatch) -> tuple[type, type]:
    """The package with the effect and the estimator of docs/extending.md named as it says."""
    effect = module_of("effect", "sysid_ros.effects.cubic_friction").CubicFriction
    estimator = module_of("estimator", "sysid_ros.estimators.random_walk").RandomWalk
    monkeypatch.setattr(effects, effect.__name__, effect, raising=False)
    monkeypatch.setattr(effects, "__all__", [*effects.__all__, effect.__name__])
    monkeypatch.setitem(effects.EFFECTS, effect.id, effect)
    monkeypatch.setattr(estimators, estimator.__name__, estimator, raising=False)
    monkeypatch.setitem(estimators.ESTIMATORS, "random_walk", estimator)
    return effect, estimator


def run_blocks(path: Path, folder: Path) -> None:
    """Run the marked blocks in order, as one session, in a folder that sees the repository's bags and test data."""
    for name in ("bags", "test"):
        (folder / name).symlink_to(ROOT / name)
    session: dict[str, Any] = {"__name__": "session"}
    sys.modules["session"] = types.ModuleType("session")
    for block in blocks(path):
        if block.mark.startswith("file: "):
            (folder / block.mark.removeprefix("file: ")).write_text(block.text, encoding="utf-8")
        elif block.mark == "run" and block.language == "python":
            exec(compile(block.text, str(block), "exec", dont_inherit=True), session)
        elif block.mark == "run":
            for words in commands_of(block):
                assert words[0] == "sysid", words
                assert cli.run(words[1:]) == 0, f"{block}: {words}"


WITH_EXAMPLES = [path for path in DOCUMENTS if path != EXTENDING and any(block.mark == "run" for block in blocks(path))]


def test_pages_with_examples_are_found() -> None:
    assert {README, DOCS / "getting_started.md", DOCS / "library.md"} <= set(WITH_EXAMPLES)


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=() if path == README else pytest.mark.slow) for path in WITH_EXAMPLES],
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_examples_of_a_page_run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run_blocks(path, tmp_path)


@pytest.mark.slow
def test_examples_of_extending_run(extended: tuple[type, type], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run_blocks(EXTENDING, tmp_path)


def run_suite(suite: types.ModuleType, argument: str, value: object) -> int:
    """Run every test of a suite that is parametrised over ``argument`` with one value; how many there were."""
    count = 0
    for name, test in inspect.getmembers(suite, inspect.isfunction):
        marks = [mark for mark in getattr(test, "pytestmark", []) if mark.name == "parametrize"]
        over = [
            (re.split(r"\s*,\s*", m.args[0]) if isinstance(m.args[0], str) else list(m.args[0]), list(m.args[1])) for m in marks
        ]
        if not name.startswith("test_") or [argument] not in [names for names, _ in over] or _is_slow(test):
            continue
        choices = [[(argument, value)] if names == [argument] else [*map(_pairing(names), values)] for names, values in over]
        for chosen in itertools.product(*choices):
            test(**_flat(chosen))
        count += 1
    return count


def _is_slow(test: Callable[..., None]) -> bool:
    return any(mark.name == "slow" for mark in getattr(test, "pytestmark", []))


def _pairing(names: list[str]) -> Callable[[Any], Any]:
    return lambda value: (names[0], value) if len(names) == 1 else tuple(zip(names, value, strict=True))


def _flat(chosen: tuple[Any, ...]) -> dict[str, Any]:
    pairs: list[tuple[str, Any]] = []
    for choice in chosen:
        pairs += [choice] if isinstance(choice[0], str) else list(choice)
    return dict(pairs)


def test_the_effect_of_extending_passes_the_conformance_suite(extended: tuple[type, type]) -> None:
    suite = pytest.importorskip("test_effects_conformance")
    suite.test_every_class_of_the_package_is_registered_by_its_id()
    assert run_suite(suite, "effect_id", extended[0].id) > 5  # type: ignore[attr-defined]


def test_the_estimator_of_extending_passes_the_conformance_suite(extended: tuple[type, type]) -> None:
    suite = pytest.importorskip("test_estimators_conformance")

    def make(prior_std: Any, variance: Any, period: float = 0.01, forgetting_time: float = 1e15) -> Any:
        return extended[1](prior_std, variance, period, forgetting_time)

    assert run_suite(suite, "make", make) > 5
