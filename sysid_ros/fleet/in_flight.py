"""InFlight: tasks at work on Dask, handed over and fetched many at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from sysid_ros import __version__
from sysid_ros.exceptions import ClusterError, in_a_line
from sysid_ros.fleet.cluster import require_dask

KILLED: Final = object()
"""In place of the result of a task over which workers died."""
LOST: Final = (
    "the connection to Dask's scheduler was lost. What was found till then is in the store; give the same command again, and it "
    "goes on from there."
)


class InFlight:
    """Calls at work. What is handed over at once goes to the scheduler in one message, and what is done at once comes back in
    one: with a hundred workers a message for each bag takes the driver longer than the workers need for it.

    Args:
        client: of Dask.
    """

    def __init__(self, client: Any) -> None:
        self._client, self._completed = client, require_dask().as_completed()
        self._running: dict[Any, list[Any]] = {}
        self._calls = 0

    def __len__(self) -> int:
        return self._calls

    def submit(self, function: Callable[..., Any], work: Sequence[tuple[Any, tuple[Any, ...]]], together: int = 1) -> None:
        """Hand over calls of a function.

        Args:
            work: what to know each call by, and its arguments. together: so many are one task of Dask's, which costs scheduler,
                worker and driver some milliseconds whatever is in it.
        """
        if work:
            groups = [work[k : k + together] for k in range(0, len(work), together)]
            arguments = [[each for _, each in group] for group in groups]
            futures = self._client.map(_calls, [function] * len(groups), arguments, pure=False)
            known_by = [[what for what, _ in group] for group in groups]
            self._running.update(zip((future.key for future in futures), known_by, strict=True))
            self._calls += len(work)
            self._completed.update(futures)

    def next(self) -> Iterator[tuple[Any, Any]]:
        """Wait for results; what each call that is done is known by, and its result or :data:`KILLED`.

        Raises:
            ClusterError: the scheduler was lost, or its workers can't run the package.
        """
        futures = self._completed.next_batch()
        for future, found in self._found(futures):
            future.release()
            known_by = self._running.pop(future.key)
            self._calls -= len(known_by)
            yield from zip(known_by, [KILLED] * len(known_by) if found is KILLED else found, strict=True)

    def _found(self, futures: list[Any]) -> Iterator[tuple[Any, Any]]:
        good = [future for future in futures if future.status == "finished"]
        try:
            values = self._client.gather(good)
        except Exception:  # noqa: BLE001 - of one of them, which says below what it is
            good, values = [], []
        yield from zip(good, values, strict=True)
        fetched = {future.key for future in good}
        yield from ((future, self._outcome(future)) for future in futures if future.key not in fetched)

    @staticmethod
    def _outcome(future: Any) -> Any:
        distributed = require_dask()
        try:
            return future.result()
        except distributed.KilledWorker:
            return KILLED
        except (distributed.CancelledError, OSError, TimeoutError) as error:
            raise ClusterError(LOST) from error
        except Exception as error:
            raise ClusterError(
                f"Dask's workers can't run the package: {type(error).__name__}: {in_a_line(error)}. Install the same sysid_ros "
                f"({__version__}) there as here."
            ) from error


def _calls(function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
    """What the function makes of each of some arguments."""
    return [function(*each) for each in arguments]
