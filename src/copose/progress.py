"""What a long call is doing, for whoever asked to be told, and when it has to end.

Both belong to the call, as a context variable does: rooms far below it say what they do and ask
whether they may go on, and nothing between them has to hand that down.
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
    """What a call is doing.

    Attributes:
        stage: what is done now, in a few words.
        done: parts of the stage that are behind; None where they are not counted.
        total: all of them, alike.
        best: the best objective so far, None where there is none yet.
        elapsed: s since the call, or the command, began.
    """

    stage: str
    done: int | None
    total: int | None
    best: float | None
    elapsed: float


Tell: TypeAlias = Callable[[Progress], object]
"""Called with what is being done, from the thread that does it."""


class StoppedError(CoposeError):
    """The time limit of a call has passed, or it was interrupted; says at which stage."""


class Watch:
    """One call: what it is doing, and when it has to end."""

    def __init__(
        self, tell: Tell | None, limit: float | None, began: float, outer: Watch | None
    ) -> None:
        """Nothing done yet.

        Args:
            tell: is told.
            limit: s that it may take, since it began; None for any.
            began: when, on the clock of `time.perf_counter`.
            outer: the call that it is part of.
        """
        self.told, self.began, self._limit = tell, began, limit
        self._deadline = math.inf if limit is None else began + limit
        self._interrupted = False
        # How deep within what may take its time, and within what nobody is told of.
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
        """Whether someone wants it to end."""
        return self._whole._interrupted

    @property
    def over(self) -> bool:
        """Whether it has to end."""
        return self.interrupted or time.perf_counter() >= self._deadline

    def interrupt(self) -> None:
        """End it at the next stage or unit of work; any thread may say so."""
        self._whole._interrupted = True

    def heed(self) -> None:
        """See `heed`."""
        if self._sheltered or not self.over:
            return
        if self._ended_in is None:
            self._ended_in = self._now.stage
        cause = "interrupted" if self.interrupted else f"stopped by the limit of {self._limit:g} s"
        raise StoppedError(f"{cause} while {self._ended_in}")

    def attained(self, objective: float) -> None:
        """See `attained`."""
        now = self._now
        if math.isfinite(objective) and (now.best is None or objective > now.best):
            self._say(now.stage, now.done, now.total, objective)

    def stage(self, name: str, done: int | None, total: int | None) -> None:
        """See `stage`."""
        self._say(name, done, total, self._now.best)

    def _say(self, stage: str, done: int | None, total: int | None, best: float | None) -> None:
        if self._hushed:
            return
        self._now = Progress(stage, done, total, best, time.perf_counter() - self.began)
        if self.told is not None:
            self.told(self._now)


_watch: ContextVar[Watch | None] = ContextVar("watch", default=None)


@contextmanager
def watched(
    tell: Tell | None = None, limit: float | None = None, began: float | None = None
) -> Iterator[Watch]:
    """A call that tells what it does and may take so long.

    Within another that is watched it is a part of that: it tells whom that tells, unless it has
    someone else to tell, counts from where that began, and ends where that has to.

    Args:
        tell: is told.
        limit: s that it may take.
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


def stage(name: str, done: int | None = None, total: int | None = None) -> None:
    """Tell what is done from now on, in a word that ends in -ing, and how far it is.

    Raises:
        StoppedError: the call has to end.
    """
    watch = _watch.get()
    if watch is not None:
        watch.heed()
        watch.stage(name, done, total)


def attained(objective: float) -> None:
    """Tell of an objective that was come to; only the best so far counts."""
    watch = _watch.get()
    if watch is not None:
        watch.attained(objective)


def heed() -> None:
    """Go on, unless the call has to end; asked between units of work.

    Raises:
        StoppedError: it has to.
    """
    watch = _watch.get()
    if watch is not None:
        watch.heed()


def over() -> bool:
    """Whether the call has to end, where nothing may be raised."""
    watch = _watch.get()
    return watch is not None and watch.over


@contextmanager
def sheltered() -> Iterator[None]:
    """What is done whatever the time: to put an answer together, or within what raises nothing."""
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
    """What nobody is told of: a search that serves another, whose objective it may not have."""
    watch = _watch.get()
    if watch is None:
        yield
        return
    watch._hushed += 1
    try:
        yield
    finally:
        watch._hushed -= 1
