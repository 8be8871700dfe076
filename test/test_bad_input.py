"""Bad input of every kind to every command: one clear sentence on what is wrong, exit code 2, nothing left behind."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import bad_files as bad
import numpy as np
import pytest

import sysid_ros as sysid
from sysid_ros.cli.main import run
from sysid_ros.exceptions import SysidError
from sysid_ros.sources.table import read_table

LONGEST = 420
"""Letters of a sentence that can still be read, the path of the file left out."""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    # it compiles what these recordings do not reach
    monkeypatch.setattr("sysid_ros.cli.replay.warm_up", lambda robot, settings: 0)
    Path("log.csv").write_text(bad.csv(bad.table()))
    Path("two.urdf").write_text(bad.URDF)


def put(path: str, content: bad.Content) -> str:
    """Write it where it is not None; the path."""
    target = Path("in", path)
    target.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(content, str):
        target.write_text(content)
    elif isinstance(content, bytes):
        target.write_bytes(content)
    elif content is not None:
        bad.bag(target, content)
    return str(target)


COMMANDS = {
    "replay": ["replay", "{log}", "--urdf", "{urdf}", "--series", "s.csv", "--plot", "p.png"],
    "identify": ["identify", "{log}", "--urdf", "{urdf}", "--out", "m.yaml", "--json", "m.json"],
    "diagnose": ["diagnose", "{log}", "--urdf", "{urdf}", "--out", "d", "--json", "d.json"],
    "frequency": ["frequency", "{log}", "--urdf", "{urdf}", "--json", "f.json"],
    "excite": ["excite", "--urdf", "{urdf}", "--out", "t.yaml"],
    "export": ["export", "{model}", "--urdf", "{urdf}", "--out", "x.xml"],
}


def refused(
    command: str, capsys: pytest.CaptureFixture[str], *more: str, log: str = "log.csv", urdf: str = "two.urdf", model: str = ""
) -> str:
    """What a command says that ends with 2, after a look at whether a user can read it."""
    arguments = [word.format(log=log, urdf=urdf, model=model) for word in COMMANDS[command]]
    before = {p for p in Path.cwd().rglob("*") if p.is_file()}
    capsys.readouterr()
    assert run([*arguments, *more]) == 2
    captured = capsys.readouterr()
    left = {p.relative_to(Path.cwd()).as_posix() for p in Path.cwd().rglob("*") if p.is_file() and p not in before}
    if captured.out.startswith("No answer: "):
        # the page and the document of a refusal say why
        assert left == {"d/report.html", "d/diagnosis.json", "d.json"}
        return " ".join(captured.out.split())
    assert not left
    said = captured.err[captured.err.index("Error: ") :].removesuffix("\n")
    assert "\n" not in said
    assert said[-1] in ".]" or said.endswith(("xacro", ".urdf", "--dst x")), said
    assert ".." not in said.replace("...", ""), said
    assert len(said) < LONGEST, said
    assert not re.search(r"Traceback|<class|\bobject at 0x|codec can't", said)
    return said


def cases(table: Mapping[str, object]) -> list[Any]:
    """Each case with one other command, another each time; slowly with all of them."""
    quick = [pytest.param(case, k, id=case) for k, case in enumerate(table)]
    return quick + [pytest.param(case, None, id=f"{case}, all commands", marks=pytest.mark.slow) for case in table]


def among(commands: Sequence[str], turn: int | None) -> Sequence[str]:
    return commands if turn is None else [commands[turn % len(commands)]]


@pytest.mark.parametrize(("case", "turn"), cases(bad.LOGS))
def test_a_recording_that_tells_nothing(case: str, turn: int | None, capsys: pytest.CaptureFixture[str]) -> None:
    path, make = bad.LOGS[case]
    if path.endswith(".parquet"):
        pytest.importorskip("pyarrow", reason="pyarrow is not installed (extra tables)")
    log = put(path, make())
    assert re.search(bad.WORDS["logs"][case], refused("replay", capsys, log=log))
    for command in among(("identify", "diagnose", "frequency"), turn):
        refused(command, capsys, log=log)


@pytest.mark.parametrize(("case", "turn"), cases(bad.ROBOTS))
def test_a_description_that_is_no_robot(case: str, turn: int | None, capsys: pytest.CaptureFixture[str]) -> None:
    path, text = bad.ROBOTS[case]
    if case.startswith("MJCF"):
        pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")
    urdf = put(path, text)
    if case == "folder":
        urdf = str(Path(urdf).parent)
    said = refused("replay", capsys, urdf=urdf)
    assert re.search(bad.WORDS["robots"][case], said), said
    # of links without mass their mass may be asked for
    for command in among(("diagnose",) if case == "no inertial" else ("identify", "diagnose", "excite"), turn):
        refused(command, capsys, urdf=urdf)


@pytest.mark.parametrize(("case", "turn"), cases(bad.MODELS))
def test_a_file_that_is_no_model_of_the_robot(case: str, turn: int | None, capsys: pytest.CaptureFixture[str]) -> None:
    model = put("model.yaml", bad.MODELS[case]())
    said = refused("export", capsys, model=model)
    assert re.search(bad.WORDS["models"][case], said), said
    for command in among(("replay", "diagnose", "frequency"), turn):
        refused(command, capsys, "--model", model)


@pytest.mark.parametrize(("case", "turn"), cases(bad.COLUMNS))
def test_a_mapping_that_does_not_fit_the_table(case: str, turn: int | None, capsys: pytest.CaptureFixture[str]) -> None:
    columns = put("columns.yaml", bad.COLUMNS[case])
    said = refused("replay", capsys, "--columns", columns)
    assert re.search(bad.WORDS["columns"][case], said), said
    for command in among(("identify", "diagnose", "frequency"), turn):
        refused(command, capsys, "--columns", columns)


@pytest.mark.parametrize(("case", "turn"), cases(bad.CONFIGS))
def test_parameters_that_cannot_be_meant(case: str, turn: int | None, capsys: pytest.CaptureFixture[str]) -> None:
    config = put("config.yaml", bad.CONFIGS[case])
    said = refused("replay", capsys, "--config", config)
    assert re.search(bad.WORDS["configs"][case], said), said
    for command in among(("identify", "frequency"), turn):
        refused(command, capsys, "--config", config)


READABLE = {
    "commas": bad.csv(bad.table()),
    "byte order mark": "\ufeff" + bad.csv(bad.table()),
    "lines of Windows": bad.csv(bad.table()).replace("\n", "\r\n"),
    "semicolons": bad.csv(bad.table(), mark=";"),
    "decimal commas": bad.csv(bad.table(), mark=";").replace(".", ","),
    "tabs": bad.csv(bad.table(), mark="\t"),
    "bars": bad.csv(bad.table(), mark="|"),
    "blanks": bad.csv(bad.table(), mark=" "),
    "quotes": bad.csv(bad.table(), [f'"{name}"' for name in bad.NAMES]),
}


@pytest.mark.parametrize("form", READABLE)
def test_every_usual_form_of_csv_gives_the_same(form: str) -> None:
    Path("x.csv").write_bytes(READABLE[form].encode())
    table = read_table(Path("x.csv"))
    assert table.joint_names == bad.JOINTS
    np.testing.assert_array_equal(np.column_stack([table.t, table.q, table.v, table.tau]), bad.table())  # type: ignore[list-item]


def test_a_blank_value_is_no_number_and_a_joint_without_effort_is_named() -> None:
    Path("x.csv").write_text(bad.csv(bad.table()[:, :6], bad.NAMES[:6]).replace("\n100.05,", "\n,"))
    table = read_table(Path("x.csv"))
    assert table.joint_names == ("a",)
    assert np.flatnonzero(np.isnan(table.t)).tolist() == [5]
    assert np.isfinite(table.q).all()
    assert "No column holds an effort for position_b" in " ".join(table.notes)


@pytest.mark.parametrize("arguments", [["identify", "log.csv", "--out", "m.yaml", "--cutoff"], ["frequency", "log.csv", "--top"]])
def test_nan_is_no_number_of_an_option(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*arguments, "nan"]) == 2
    assert "'nan' is not a number" in capsys.readouterr().err


LIBRARY: dict[str, tuple[Callable[[], object], str]] = {
    "no recording to identify": (lambda: sysid.identify([], "two.urdf"), "no recording is given"),
    "no recording to diagnose": (lambda: sysid.diagnose([], "two.urdf"), "no recording is given"),
    "no recording to check": (lambda: sysid.frequency([], "two.urdf"), "no recording is given"),
    "two recordings to replay": (
        lambda: sysid.replay(["log.csv", "log.csv"], "two.urdf"),  # type: ignore[arg-type]
        "takes one recording; 2 are given",
    ),
    "a start of one joint": (lambda: sysid.excite("two.urdf", start=[1.0]), r"start has the shape \(1,\); it must be \(2,\)"),
    "a robot of a name that is none": (lambda: sysid.Robot("**"), "no robot of that name"),
    "a robot of an unknown name": (lambda: sysid.Robot("robby"), "no robot of that name"),
    "arrays of other lengths": (lambda: sysid.load(t=[1.0, 2.0], q=[[1.0, 2.0]], tau=[[1.0, 2.0]]), r"\(2,\)"),
    "arrays without a shape": (
        lambda: sysid.load(t=[1.0], q=[[1.0, 2.0], [3.0]], tau=[[1.0]]),
        "something else than real numbers",
    ),
    "words for times": (lambda: sysid.load(t=["a"], q=[[1.0]], tau=[[1.0]]), "something else than real numbers"),
    "a cut-off that is none": (lambda: sysid.identify("log.csv", "two.urdf", cutoff_hz=np.nan), "cut-off is nan"),
    "a band that is none": (lambda: sysid.frequency("log.csv", "two.urdf", top_hz=np.nan), "nan Hz is asked for"),
    "an unknown setting": (lambda: sysid.replay("log.csv", "two.urdf", colour=1), "unknown setting colour"),
    "a model that is not there": (lambda: sysid.replay("log.csv", "two.urdf", model="no.yaml"), "No such file"),
}


@pytest.mark.parametrize("case", LIBRARY)
def test_the_library_says_what_it_can_not_take(case: str) -> None:
    call, words = LIBRARY[case]
    with pytest.raises(SysidError, match=words):
        call()
