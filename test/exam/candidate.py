"""The diagnosis that sits the exam, through its Python interface."""

from __future__ import annotations

from typing import Any

from exam.case import Case
from sysid_ros.simulation.hidden_effects import HiddenRecording


def diagnosis_of(case: Case) -> dict[str, Any]:
    """``diagnosis.json`` of a case."""
    from sysid_ros.diagnosis import diagnose

    result = diagnose(case.nominal.model(), [recording_of(r) for r in case.train], [recording_of(r) for r in case.validate])
    document: dict[str, Any] = result.as_dict()
    return document


def recording_of(recording: HiddenRecording) -> Any:
    from sysid_ros.signals.recording import Recording

    return Recording(name=recording.name, t=recording.t, q=recording.q, v=recording.v, tau=recording.tau)
