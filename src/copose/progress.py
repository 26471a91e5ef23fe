"""Progress, time limit and interruption of a long call.

They are kept in a context variable: rooms far below the call tell their stage and ask whether they
may go on, and no function between has to pass that down.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from numbers import Real
from typing import TypeAlias

from copose.errors import CoposeError, InputError


@dataclass(frozen=True)
class Progress:
    """The progress of a call: its stage, how far that is, and the best objective so far.

    Attributes:
        stage: in a few words.
        done: parts of the stage that are done; None where they are not counted.
        total: all parts of the stage; None where they are not counted.
        best: the best objective so far, None where there is none yet.
        elapsed: s since the call, or the command, began.
        left: s until the stage ends, about; None where that is not known.
    """

    stage: str
    done: int | None
    total: int | None
    best: float | None
    elapsed: float
    left: float | None = None


Tell: TypeAlias = Callable[[Progress], object]
"""A callback that is given the progress, in the thread of the call."""


class StoppedError(CoposeError):
    """The time limit of a call has passed, or it was interrupted; says at which stage."""


class Watch:
    """The progress and the deadline of one call."""

    def __init__(
        self, tell: Tell | None, limit: float | None, began: float, outer: Watch | None
    ) -> None:
        """A call that begins, as part of an outer one if there is one; see `watched`."""
        self.told, self.began, self._limit = tell, began, limit
        self._deadline = math.inf if limit is None else began + limit
        self._interrupted = False
        # Depths of nested `sheltered` and `hushed` blocks.
        self._sheltered, self._hushed = 0, 0
        self._whole = self
        if outer is not None:
            self._whole, self._sheltered, self._hushed = (
                outer._whole,
                outer._sheltered,
                outer._hushed,
            )
            if outer._deadline < self._deadline:
                self._limit, self._deadline = outer._limit, outer._deadline
        self._now = Progress("beginning", None, None, None, 0.0)
        if outer is not None:
            self._now = replace(outer._now, best=None)
        self._ended_in: str | None = None

    @property
    def interrupted(self) -> bool:
        """True once someone has asked for the end of the call."""
        return self._whole._interrupted

    @property
    def over(self) -> bool:
        """True once the call has to end."""
        return self.interrupted or time.perf_counter() >= self._deadline

    def interrupt(self) -> None:
        """Ask the call to end at its next stage or unit of work; any thread may."""
        self._whole._interrupted = True

    def heed(self) -> None:
        """See `heed`."""
        # Asked between any two units of work: without the detour by `over`.
        if self._sheltered or not (
            self._whole._interrupted or time.perf_counter() >= self._deadline
        ):
            return
        if self._ended_in is None:
            self._ended_in = self._now.stage
        cause = "interrupted" if self.interrupted else f"stopped by the limit of {self._limit:g} s"
        raise StoppedError(f"{cause} while {self._ended_in}")

    def attained(self, objective: float) -> None:
        """See `attained`."""
        now = self._now
        if math.isfinite(objective) and (now.best is None or objective > now.best):
            self._say(replace(now, best=objective))

    def stage(
        self, name: str, done: int | None, total: int | None, left: float | None = None
    ) -> None:
        """See `stage`."""
        self._say(Progress(name, done, total, self._now.best, 0.0, left))

    def _say(self, now: Progress) -> None:
        if self._hushed:
            return
        self._now = replace(now, elapsed=time.perf_counter() - self.began)
        if self.told is not None:
            self.told(self._now)


_watch: ContextVar[Watch | None] = ContextVar("watch", default=None)


@contextmanager
def watched(
    tell: Tell | None = None, limit: float | None = None, began: float | None = None
) -> Iterator[Watch]:
    """A call whose progress is told and whose time may be limited.

    Within another watched call it is a part of that: it uses that call's callback unless it has its
    own, counts time from that call's beginning, and ends by that call's deadline.

    Args:
        tell: a callback that is given the progress.
        limit: s that the call may take.
        began: when, on the clock of `time.perf_counter`; default now.

    Raises:
        InputError: a limit is no finite number above 0.
    """
    if limit is not None and not (
        isinstance(limit, Real) and not isinstance(limit, bool) and 0 < limit < math.inf
    ):
        raise InputError(f"{limit!r} is no finite number of seconds above 0", key="time_limit")
    outer = _watch.get()
    if outer is not None:
        tell = outer.told if tell is None else tell
        began = outer.began if began is None else began
    began = time.perf_counter() if began is None else began
    watch = Watch(tell, limit, began, outer)
    token = _watch.set(watch)
    try:
        yield watch
    finally:
        _watch.reset(token)


def stage(
    name: str, done: int | None = None, total: int | None = None, left: float | None = None
) -> None:
    """Tell the stage that begins, in a word that ends in -ing, how far it is, and s until its end.

    Raises:
        StoppedError: the call has to end.
    """
    watch = _watch.get()
    if watch is not None:
        watch.heed()
        watch.stage(name, done, total, left)


def attained(objective: float) -> None:
    """Tell an objective that was reached; only the best so far counts."""
    watch = _watch.get()
    if watch is not None:
        watch.attained(objective)


def heed() -> None:
    """Go on, unless the call has to end; called between units of work.

    Raises:
        StoppedError: the call has to end.
    """
    watch = _watch.get()
    if watch is not None:
        watch.heed()


def over() -> bool:
    """True once the call has to end, for code that may not raise."""
    watch = _watch.get()
    return watch is not None and watch.over


@contextmanager
def sheltered() -> Iterator[None]:
    """Work that no deadline stops: putting an answer together, or calls that must not raise."""
    watch = _watch.get()
    if watch is None:
        yield
        return
    watch._sheltered += 1
    try:
        yield
    finally:
        watch._sheltered -= 1


@contextmanager
def hushed() -> Iterator[None]:
    """Work whose progress is not told: a search inside another, perhaps of another objective."""
    watch = _watch.get()
    if watch is None:
        yield
        return
    watch._hushed += 1
    try:
        yield
    finally:
        watch._hushed -= 1
