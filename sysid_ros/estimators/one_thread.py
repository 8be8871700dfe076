"""Linear algebra on one thread: thousands of small matrices, on which threads wait for each other longer than they work."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
T = TypeVar("T")


def on_one_thread(call: Callable[P, T]) -> Callable[P, T]:
    """The same call, in which BLAS and LAPACK use one thread; afterwards as many as before."""

    @wraps(call)
    def limited(*args: P.args, **kwargs: P.kwargs) -> T:
        with threadpool_limits(1, user_api="blas"):
            return call(*args, **kwargs)

    return limited
