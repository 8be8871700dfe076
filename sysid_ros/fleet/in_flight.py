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
    """Tasks at work. What is handed over at once goes to the scheduler in one message, and what is done at once comes back in
    one: with a hundred workers a message for each bag takes the driver longer than the workers need for it.

    Args:
        client: of Dask.
    """

    def __init__(self, client: Any) -> None:
        self._client, self._completed = client, require_dask().as_completed()
        self._running: dict[Any, Any] = {}

    def __len__(self) -> int:
        return len(self._running)

    def submit(self, function: Callable[..., Any], work: Sequence[tuple[Any, tuple[Any, ...]]]) -> None:
        """Hand over calls of a function.

        Args:
            work: what to know each call by, and its arguments, as many for each.
        """
        if work:
            futures = self._client.map(function, *zip(*(arguments for _, arguments in work), strict=True), pure=False)
            self._running.update(zip((future.key for future in futures), (what for what, _ in work), strict=True))
            self._completed.update(futures)

    def next(self) -> Iterator[tuple[Any, Any]]:
        """Wait for results; what each call that is done is known by, and its result or :data:`KILLED`.

        Raises:
            ClusterError: the scheduler was lost, or its workers can't run the package.
        """
        futures = self._completed.next_batch()
        for future, found in self._found(futures):
            future.release()
            yield self._running.pop(future.key), found

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
