"""The lock of CasADi's symbols and solvers, which are not made for several threads at once."""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")

_LOCK = threading.RLock()
if hasattr(os, "register_at_fork"):
    # A child has only the thread that forked: what others had begun would stay half done there.
    os.register_at_fork(
        before=_LOCK.acquire, after_in_parent=_LOCK.release, after_in_child=_LOCK.release
    )


def one_at_a_time(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """A function that builds expressions or runs solvers, in one thread of the process at a time.

    Kernels need it to be built, not to be evaluated.
    """

    @functools.wraps(function)
    def alone(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with _LOCK:
            return function(*args, **kwargs)

    return alone
