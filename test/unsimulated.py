"""For tests that ask nothing of the simulation, which a diagnosis ends with: an eighth of its time, after all that is found.

A file that imports :func:`unsimulated` has its diagnoses made as where no simulator is installed.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from sysid_ros.simulation import simulators


@pytest.fixture(scope="module", autouse=True)
def unsimulated() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulators, "is_installed", lambda name: False)
        yield
