"""What commands write: checked before the work, whole or not at all, and never over a result of before without --force."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from sysid_ros.cli.main import run
from sysid_ros.exceptions import OutputError
from sysid_ros.files import check_bag, check_file, whole, whole_files, whole_folder, write_text

# Each command with the options that name a file; the inputs are not there, so that a check that comes late is seen.
FILES = {
    "replay --json": ["replay", "no.mcap", "--json"],
    "replay --series": ["replay", "no.mcap", "--series"],
    "replay --payloads": ["replay", "no.mcap", "--payloads"],
    "replay --plot": ["replay", "no.mcap", "--plot"],
    "identify --out": ["identify", "no.mcap", "--out"],
    "identify --urdf-out": ["identify", "no.mcap", "--out", "m.yaml", "--urdf-out"],
    "identify --report": ["identify", "no.mcap", "--out", "m.yaml", "--report"],
    "identify --json": ["identify", "no.mcap", "--out", "m.yaml", "--json"],
    "diagnose --json": ["diagnose", "no.mcap", "--out", "d", "--json"],
    "frequency --plot": ["frequency", "no.mcap", "--plot"],
    "frequency --json": ["frequency", "no.mcap", "--json"],
    "excite --out": ["excite", "--urdf", "no.urdf", "--out"],
    "excite --plot": ["excite", "--urdf", "no.urdf", "--out", "t.yaml", "--plot"],
    "excite --json": ["excite", "--urdf", "no.urdf", "--out", "t.yaml", "--json"],
    "export --out": ["export", "no.yaml", "--urdf", "no.urdf", "--out"],
    "control --plot": ["control", "--plot"],
    "control --json": ["control", "--json"],
    "simulate arm --json": ["simulate", "arm", "--bag", "b", "--json"],
    "simulate quadruped --json": ["simulate", "quadruped", "--bag", "b", "--json"],
    "doctor --json": ["doctor", "--json"],
}
FOLDERS = {
    "diagnose --out": ["diagnose", "no.mcap", "--out"],
    "excite --bag": ["excite", "--urdf", "no.urdf", "--out", "t.yaml", "--bag"],
    "simulate arm --bag": ["simulate", "arm", "--bag"],
    "simulate quadruped --bag": ["simulate", "quadruped", "--bag"],
}


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What is said of a command that ends with 2; it leaves nothing that was not there."""
    if arguments[0] in ("simulate", "control"):
        pytest.importorskip("pybullet", reason="pybullet is not installed (extra sim)")
    before = sorted(Path.cwd().rglob("*"))
    assert run(arguments) == 2
    assert sorted(Path.cwd().rglob("*")) == before
    captured = capsys.readouterr()
    assert captured.out == ""
    return captured.err


@pytest.mark.parametrize("case", FILES)
def test_a_file_is_checked_before_the_work(case: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments, option = FILES[case], case.split()[-1]
    suffix = ".csv" if arguments[0] == "export" else ".png"
    assert f"{option} is 'no/x{suffix}', but the folder 'no' does not exist" in refused([*arguments, f"no/x{suffix}"], capsys)
    Path(f"there{suffix}").write_text("mine")
    said = refused([*arguments, f"there{suffix}"], capsys)
    assert f"{option}: 'there{suffix}' exists already and is not overwritten. Choose another name, or give --force." in said
    Path(f"folder{suffix}").mkdir()
    assert f"{option} is 'folder{suffix}', which is a folder." in refused([*arguments, f"folder{suffix}"], capsys)
    said = refused([*arguments, f"there{suffix}/x{suffix}"], capsys)
    assert f"'there{suffix}' is a file, not a folder" in said
    assert Path(f"there{suffix}").read_text() == "mine"


@pytest.mark.parametrize("case", FOLDERS)
def test_a_folder_is_checked_before_the_work(case: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments, option = FOLDERS[case], case.split()[-1]
    Path("file").write_text("mine")
    assert f"{option}" in refused([*arguments, "file"], capsys)
    assert "'file'" in refused([*arguments, "file/in"], capsys)
    Path("old").mkdir()
    Path("old", "model.yaml").write_text("mine")
    Path("old", "metadata.yaml").write_text("mine")
    assert "--force" in refused([*arguments, "old"], capsys)
    Path("old", "thesis.tex").write_text("mine")
    if option == "--bag":
        assert "is no bag" in refused([*arguments, "old", "--force"], capsys)
    assert Path("old", "thesis.tex").read_text() == "mine"


def test_two_results_in_one_file_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert "another option names too" in refused(["replay", "no.mcap", "--json", "x", "--series", "./x"], capsys)


def test_force_replaces_and_an_empty_file_is_no_result(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sysid_ros.cli.doctor._ATTEMPTS", {})
    Path("empty.json").touch()
    assert run(["doctor", "--json", "empty.json"]) == 0
    text = Path("empty.json").read_text()
    assert run(["doctor", "--json", "empty.json"]) == 2
    Path("empty.json").write_text("old")
    assert run(["doctor", "--json", "empty.json", "--force"]) == 0
    assert Path("empty.json").read_text() == text
    assert [p.name for p in Path.cwd().iterdir()] == ["empty.json"]


# Whole or not at all.


def failing(path: Path) -> None:
    with whole(path) as beside:
        beside.write_text("half")
        raise KeyboardInterrupt


def test_what_is_interrupted_leaves_what_was_there() -> None:
    path = Path("x.json")
    with pytest.raises(KeyboardInterrupt):
        failing(path)
    assert not list(Path.cwd().iterdir())
    path.write_text("before")
    with pytest.raises(KeyboardInterrupt):
        failing(path)
    assert path.read_text() == "before"
    assert len(list(Path.cwd().iterdir())) == 1


def test_a_link_stays_a_link_and_rights_stay() -> None:
    Path("deep").mkdir()
    real, link = Path("deep/real.json"), Path("link.json")
    real.write_text("before")
    real.chmod(0o640)
    link.symlink_to(real)
    write_text(link, "after")
    assert link.is_symlink()
    assert real.read_text() == "after"
    assert real.stat().st_mode & 0o777 == 0o640
    write_text(Path("new.json"), "x")
    usual = Path("usual")
    usual.touch()
    assert Path("new.json").stat().st_mode == usual.stat().st_mode


def test_a_stream_is_written_to_as_it_is() -> None:
    check_file(Path("/dev/null"), False, "--json")
    write_text(Path("/dev/null"), "x")
    with pytest.raises(OutputError, match="No space left on device"):
        write_text(Path("/dev/full"), "x")
    os.mkfifo("pipe")
    reader = os.open("pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_text(Path("pipe"), "told")
    assert os.read(reader, 10) == b"told"
    os.close(reader)
    assert Path("pipe").is_fifo()


def test_a_folder_comes_whole() -> None:
    bag = Path("bag")

    def write(text: str, fails: bool = False, replace: bool = True) -> None:
        with whole_folder(bag, replace) as folder:
            folder.mkdir()
            (folder / "metadata.yaml").write_text(text)
            if fails:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write("1", fails=True)
    assert not list(Path.cwd().iterdir())
    write("1")
    for fails, replace, error in ((True, True, KeyboardInterrupt), (False, False, OutputError)):
        with pytest.raises(error):
            write("2", fails, replace)
        assert (bag / "metadata.yaml").read_text() == "1"
    check_bag(bag, True, "--bag")
    write("2")
    assert (bag / "metadata.yaml").read_text() == "2"
    assert [p.name for p in Path.cwd().iterdir()] == ["bag"]


def test_files_that_belong_together_come_together() -> None:
    folder, names = Path("a/b"), ("one", "two")

    def write(*written: str, fails: bool = False) -> None:
        with whole_files(folder, names) as room:
            for name in written:
                (room / name).write_text(f"{written}")
            if fails:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write("one", fails=True)
    assert not list(Path.cwd().iterdir())
    write("one", "two")
    (folder / "mine").write_text("mine")
    with pytest.raises(KeyboardInterrupt):
        write("one", fails=True)
    assert (folder / "one").read_text() == "('one', 'two')"
    write("one")
    # what is left of the two of before would not belong to what is there now
    assert sorted(p.name for p in folder.iterdir()) == ["mine", "one"]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 64 kB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", str(disk)], capture_output=True, check=False)
    if made.returncode:
        pytest.skip("no rights to mount a small disk")
    yield disk
    subprocess.run(["umount", "--lazy", str(disk)], check=True)


def test_a_full_disk_is_said_before_the_work_and_leaves_nothing(small_disk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_text(small_disk / "old.json", "old")
    with pytest.raises(OutputError, match=r"No space left on device\. Make room"):
        write_text(small_disk / "old.json", "x" * 200_000)
    assert (small_disk / "old.json").read_text() == "old"
    assert [p.name for p in small_disk.iterdir()] == ["old.json"]
    with pytest.raises(OSError, match="No space left"):
        (small_disk / "rest").write_bytes(bytes(200_000))
    said = refused(["replay", "no.mcap", "--json", str(small_disk / "x.json")], capsys)
    assert re.search(r"--json: '.*x\.json' can't be written: No space left on device\. Make room", said)


def test_a_bag_on_a_full_disk_leaves_nothing(small_disk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pybullet", reason="pybullet is not installed (extra sim)")
    for storage in ("mcap", "sqlite3"):
        arguments = ["simulate", "arm", "--duration", "1", "--rate", "500", "--storage", storage]
        assert run([*arguments, "--bag", str(small_disk / "bag")]) == 2
        said = capsys.readouterr().err
        assert "can't be written" in said
        assert not list(small_disk.iterdir())


# Streams of a process.

STAND_IN = """
import sys, time, types
from pathlib import Path
import click
from sysid_ros.cli import main
from sysid_ros.cli.output import report
from sysid_ros.files import whole

@click.command()
def command():
    {body}

module = types.ModuleType("stand_in")
module.command = command
sys.modules["stand_in"] = module
main.COMMANDS["stand-in"] = ("stand_in", "For this test.")
sys.argv = ["sysid", "stand-in"]
main.main()
"""


def sysid(body: str, **streams: Any) -> subprocess.Popen[str]:
    """The process of a command that does this. It heeds ctrl-C, which a shell lets ignore what it starts in the background."""
    return subprocess.Popen(
        [sys.executable, "-c", STAND_IN.format(body=body)],
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
        stderr=subprocess.PIPE,
        text=True,
        **{"stdout": subprocess.PIPE, **streams},
    )


@pytest.mark.parametrize("how", ["report().print('x' * 100)", "print('x' * 100)", "click.echo('x' * 100)"])
def test_a_reader_that_goes_ends_it_quietly(how: str) -> None:
    process = sysid(f"[{how} for _ in range(9999)]")
    assert process.stdout is not None
    assert process.stdout.readline()
    process.stdout.close()
    process.stdout = None
    assert process.communicate(timeout=60)[1] == ""
    assert process.returncode == 141


@pytest.mark.parametrize("how", ["report().print('x')", "print('x')"])
def test_standard_output_that_is_full_is_said(how: str) -> None:
    with open("/dev/full", "w") as full:
        process = sysid(how, stdout=full)
        assert process.communicate(timeout=60)[1] == "Error: standard output: No space left on device.\n"
    assert process.returncode == 2


def test_a_closed_stream_and_plain_letters_do_no_harm() -> None:
    for how, code in (("report().print('±')", "{python} -c '{code}' >&-"), ("click.echo('±')", "{python} -c '{code}'")):
        line = code.format(python=sys.executable, code=STAND_IN.format(body=how).replace("'", '"'))
        environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
        done = subprocess.run(line, shell=True, capture_output=True, env=environment, timeout=60, check=False)
        assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize(("sign", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=["ctrl-C", "terminated"])
def test_a_signal_while_it_writes_leaves_nothing(sign: signal.Signals, code: int) -> None:
    body = "\n    ".join(["with whole(Path('x.json')) as beside:", "    print('now', flush=True)", "    time.sleep(60)"])
    process = sysid(body)
    assert process.stdout is not None
    assert process.stdout.readline() == "now\n"
    assert len(list(Path.cwd().iterdir())) == 1
    process.send_signal(sign)
    _, said = process.communicate(timeout=60)
    assert process.returncode == code, said
    assert said.strip() in ("", "Interrupted.")
    assert not list(Path.cwd().iterdir())
