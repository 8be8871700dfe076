"""What is done with one bag, in whatever process: from its path to the rows of the store."""

from __future__ import annotations

import importlib
import threading
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from itertools import islice
from pathlib import Path
from typing import Any

from sysid_ros import __version__
from sysid_ros.exceptions import BagError, SettingsError, SysidError, in_a_line
from sysid_ros.fleet.bags import at_hand, content_hash
from sysid_ros.fleet.dates import Told
from sysid_ros.fleet.rules import Entry
from sysid_ros.fleet.store import Results
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.urdf import read_urdf
from sysid_ros.sources import BagSource, TableSource, open_source
from sysid_ros.torque.model_file import ModelFile

JOBS = {
    "track": "sysid_ros.fleet.track_job",
    "replay": "sysid_ros.library.fleet_jobs",
    "identify": "sysid_ros.library.fleet_jobs",
    "diagnose": "sysid_ros.library.fleet_jobs",
}
"""Each job and the module whose function of its name does it: imported where and when it runs."""

_LATEST = 1e11
"""A stamp beyond it is none [s]."""
_ALONE = threading.Lock()
"""One bag at a time in a process: robots' models hold what was worked out last."""


@dataclass(frozen=True, slots=True)
class Task:
    """A bag and what to do with it, in plain values.

    Attributes:
        bag: path or URL. stamp: as of :func:`.bags.stamp_of`. jobs: names of :data:`JOBS`. told: of its date, by each entry that
            its robot may be; without any, its own stamps count.
    """

    bag: str
    stamp: str
    jobs: tuple[str, ...]
    told: tuple[Told, ...] = ()

    def of(self, k: int) -> Told:
        """What the entry of an index tells of its date."""
        return self.told[k] if self.told else Told()


@dataclass(frozen=True, slots=True)
class Opened:
    """A bag that a job works on.

    Attributes:
        bag: path or URL. path: of its files here. source: its joint states. entry: its robot. key: columns that all rows of its
            tables share.
    """

    bag: str
    path: Path
    source: BagSource | TableSource
    entry: Entry
    key: dict[str, Any]

    @property
    def settings(self) -> OnlineSettings:
        """Of the entry."""
        return OnlineSettings.from_mapping(dict(self.entry.settings), f"settings of {self.entry.robot}")

    @property
    def urdf(self) -> str:
        """The URDF's text.

        Raises:
            BagError: there is none.
        """
        text = self.entry.urdf or self.source.robot_description
        if not text:
            raise BagError(
                f"bag '{self.bag}' holds no /robot_description, and the rule of {self.entry.robot} names no urdf. Add one to it."
            )
        return text

    @property
    def model(self) -> ModelFile | None:
        """The model.yaml; None where there is none."""
        return ModelFile.of_text(self.entry.model, self.entry.model_name) if self.entry.model else None


Job = Callable[[Opened], Results]
"""Does it, and returns rows; of the table bags only what it knows beside the key."""


def job_of(name: str) -> Job:
    """The function of a job.

    Raises:
        SettingsError: there is no such job.
    """
    if name not in JOBS:
        raise SettingsError(f"there is no job '{name}'; the jobs are {', '.join(JOBS)}.")
    found: Job = getattr(importlib.import_module(JOBS[name]), name)
    return found


def fingerprint(bag: str) -> str:
    """The hash of a bag's content; empty where it can't be read."""
    try:
        with at_hand(bag) as path:
            return content_hash(path)
    except SysidError:
        return ""


def run(task: Task, entries: Sequence[Entry]) -> list[Results]:
    """Do the jobs of a task. Nothing is raised for a bad bag: its rows say why.

    Args:
        entries: what the bag's robot may be, the first that fits counts.
    """
    with _ALONE:
        began = time.thread_time()
        content = ""
        try:
            with at_hand(task.bag) as path:
                content = content_hash(path)
                return _each(task, entries, content, path, began)
        except SysidError as error:
            when = task.of(0).columns(None)
            return [_failed(task, _key(content, entries[0], job) | when, str(error), began) for job in task.jobs]


def _each(task: Task, entries: Sequence[Entry], content: str, path: Path, began: float) -> list[Results]:
    """The results of each job on a bag that is here.

    Raises:
        SysidError: it can't be opened, or is of none of the robots.
    """
    try:
        source = open_source(path, entries[0].topic)
        which = _entry(task, entries, source)
        entry = entries[which]
        if entry.topic != entries[0].topic:
            source = open_source(path, entry.topic)
        facts = _facts(source)
        facts |= task.of(which).columns(facts["date"])
    except SysidError:
        raise
    except Exception as error:  # of a reader, in a file that is damaged in a way it does not know
        raise BagError(f"bag '{task.bag}' can't be read: {type(error).__name__}: {in_a_line(error)}.") from error
    out = []
    for job in task.jobs:
        key = _key(content, entry, job) | {"date": facts["date"]}
        opened = Opened(task.bag, path, source, entry, {"bag": task.bag, **key})
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            out.append(_one(task, job, opened, facts, began))
        _say(out[-1], [str(w.message) for w in said if issubclass(w.category, UserWarning)])
        began = time.thread_time()
    return out


def _one(task: Task, job: str, opened: Opened, facts: dict[str, Any], began: float) -> Results:
    try:
        result = job_of(job)(opened)
    except SysidError as error:
        return _failed(task, opened.key | facts, str(error), began)
    except Exception as error:  # noqa: BLE001 - one bag must not stop the others
        reason = f"job {job} failed unexpectedly: {type(error).__name__}: {in_a_line(error)}."
        return _failed(task, opened.key | facts, reason, began)
    own = {"reason": "", "stamp": task.stamp, "status": "ok", "seconds": time.thread_time() - began}
    result.bag = {**opened.key, **facts, **own, **result.bag}
    return result


def _say(result: Results, sentences: list[str]) -> None:
    result.bag["reason"] = " ".join(dict.fromkeys(filter(None, [result.bag["reason"], *sentences])))


def _failed(task: Task, columns: dict[str, Any], reason: str, began: float) -> Results:
    own = {"bag": task.bag, "status": "failed", "reason": reason, "stamp": task.stamp, "seconds": time.thread_time() - began}
    return Results({**columns, **own})


def _key(content: str, entry: Entry, job: str) -> dict[str, Any]:
    return {
        "hash": content, "model": entry.digest, "version": __version__, "job": job, "robot": entry.robot, "kind": entry.kind,
    }  # fmt: skip


def _entry(task: Task, entries: Sequence[Entry], source: BagSource | TableSource) -> int:
    """Index of the first entry that fits the URDF in the bag.

    Raises:
        BagError: none does.
    """
    name = ""
    for k, entry in enumerate(entries):
        if not entry.description:
            return k
        name = name or _robot_name(source)
        if fnmatchcase(name, entry.description):
            return k
    asked = ", ".join(entry.description for entry in entries)
    raise BagError(f"bag '{task.bag}' is of robot '{name or 'without a name'}'; the rules for its path ask for {asked}.")


def _robot_name(source: BagSource | TableSource) -> str:
    import xml.etree.ElementTree as ElementTree

    text = source.robot_description
    if not text:
        return ""
    read_urdf(text)  # says what is wrong with it
    return ElementTree.fromstring(text).get("name", "")


def _facts(source: BagSource | TableSource) -> dict[str, Any]:
    """Columns of the table bags that every job has."""
    first = next(islice(source, 1), None)
    start = 0.0 if first is None else first.stamp if 0.0 < first.stamp < _LATEST else first.receive_time
    date = datetime.fromtimestamp(start, UTC) if 0.0 < start < _LATEST else None
    n, duration = source.message_count, source.duration
    return {"date": date, "duration": duration, "samples": n, "rate": (n - 1) / duration if duration > 0.0 else None}
