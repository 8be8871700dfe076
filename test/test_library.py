"""``import sysid_ros``: what Python users call, and what its results do."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import yaml

import sysid_ros as sysid
from sysid_ros.exceptions import DataError, RobotModelError, SettingsError
from sysid_ros.library import Identified, Replayed
from sysid_ros.robot.packaged import packaged

BAGS = Path(__file__).parents[1] / "bags"
NOTEBOOK = Path(__file__).parents[1] / "docs" / "tutorial.ipynb"


@pytest.fixture(scope="module")
def run() -> sysid.Recording:
    return sysid.load(BAGS / "arm_pick_and_drop")


@pytest.fixture(scope="module")
def replayed(run: sysid.Recording) -> Replayed:
    return sysid.replay(run)


@pytest.fixture(scope="module")
def identified() -> Identified:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sysid.identify(BAGS / "arm_empty")


def test_importing_it_imports_nothing_heavy() -> None:
    code = "import sys, sysid_ros; print(sysid_ros.__version__, sorted({'numpy', 'pinocchio', 'numba'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split(maxsplit=1)[1].strip() == "[]"


def test_names_are_listed_and_others_are_refused() -> None:
    assert {"load", "Robot", "replay", "identify", "diagnose", "excite", "frequency"} <= set(dir(sysid))
    with pytest.raises(AttributeError, match="it has Recording, Robot"):
        getattr(sysid, "estimate")  # noqa: B009 - as an attribute it would not pass the type check


def test_a_recording_tells_what_it_is(run: sysid.Recording, tmp_path: Path) -> None:
    assert repr(run).startswith("Recording arm_pick_and_drop: 3500 joint states, 14.00 s, 250 Hz")
    again = sysid.load(run.save(tmp_path / "log.npz"))
    np.testing.assert_array_equal(again.arrays().tau, run.arrays().tau)
    assert again.joint_names == run.joint_names


def test_arrays_and_frames_replay_as_the_bag_does(run: sysid.Recording, replayed: Replayed) -> None:
    pandas = pytest.importorskip("pandas")
    a, robot = run.arrays(), sysid.Robot(run.urdf or "")
    arrays = sysid.load(t=a.t, q=a.q, tau=a.tau, v=a.v, joint_names=a.joint_names)
    columns = {f"{what}_{j}": x[:, k] for what, x in (("q", a.q), ("tau", a.tau)) for k, j in enumerate(a.joint_names)}
    frame = sysid.load(pandas.DataFrame({"t": a.t} | columns))
    for recording in (arrays, frame):  # the velocity is not needed
        assert sysid.replay(recording, robot).as_dict()["payloads"] == replayed.as_dict()["payloads"]


def test_a_replay_answers(replayed: Replayed, tmp_path: Path) -> None:
    (one,) = replayed.payloads
    assert one.estimate.mass == pytest.approx(1.8, abs=1.96 * one.estimate.mass_std)
    assert len(repr(replayed).splitlines()) <= 10
    assert "1.79" in repr(replayed) or "1.80" in repr(replayed)
    assert replayed._repr_html_().startswith("<pre>Carried in arm_pick_and_drop")
    assert json.loads(replayed.save(tmp_path / "out.json").read_text())["payloads"][0]["mass"] == one.estimate.mass
    assert replayed.save(tmp_path / "out.csv").read_text().startswith("t0,t1,mass")
    assert "<html" in replayed.report(tmp_path / "out.html").read_text()
    assert replayed.plot(tmp_path / "out.png").axes
    assert (tmp_path / "out.png").stat().st_size > 10_000


def test_an_identification_is_the_model_of_the_next(run: sysid.Recording, identified: Identified, tmp_path: Path) -> None:
    assert len(repr(identified).splitlines()) <= 10
    path = identified.save(tmp_path / "model.yaml")
    assert yaml.safe_load(path.read_text())["format"] == 1
    by_file, by_result = (sysid.replay(run, model=model).payloads[0].estimate for model in (path, identified))
    np.testing.assert_array_equal(by_file.theta, by_result.theta)
    assert by_result.mass == pytest.approx(1.8, abs=0.01)
    assert "<html" in identified.report(tmp_path / "out.html").read_text()
    assert identified.save(tmp_path / "arm.urdf").read_text().startswith("<?xml")
    assert identified.plot().axes


@pytest.mark.slow
def test_frequency_is_a_verb_too(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = sysid.frequency(BAGS / "arm_empty")
    assert "Hz" in repr(found)
    assert found.save(tmp_path / "f.json").is_file()


def test_robots_by_name_and_by_file(run: sysid.Recording, tmp_path: Path) -> None:
    if packaged("panda") is None:
        pytest.skip("example-robot-data is not installed")
    assert repr(sysid.Robot("panda")).startswith("Robot panda: 8 joints")
    with pytest.raises(RobotModelError, match="no robot of that name"):
        sysid.Robot("r2d2")
    (tmp_path / "arm.urdf").write_text(run.urdf or "")
    robot = sysid.Robot(tmp_path / "arm.urdf", joint_names=run.joint_names[:3])
    assert robot.model.joint_names == run.joint_names[:3]


def test_bad_calls_are_a_sentence(replayed: Replayed, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="needs a path"):
        sysid.load()
    with pytest.raises(SettingsError, match="suffix must be one of"):
        replayed.save(tmp_path / "out.docx")
    with pytest.raises(SettingsError, match="does not exist"):
        replayed.report(tmp_path / "no" / "out.html")
    with pytest.raises(SettingsError, match="unknown setting"):
        sysid.replay(BAGS / "arm_pick_and_drop", publish=3.0)


@pytest.mark.slow
def test_the_tutorial_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cell after cell, as a notebook does it."""
    cells = [c for c in json.loads(NOTEBOOK.read_text())["cells"] if c["cell_type"] == "code"]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bags").symlink_to(BAGS)
    scope: dict[str, object] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for cell in cells:
            exec("".join(cell["source"]), scope)
    assert len(cells) >= 6
