"""The dispatcher of a study's points: batches go to workers, lines come back.

Every task is meant for one worker. So Dask never tries it again elsewhere, and what died with a
worker is known: a batch is split, and its points are tried alone, last.
"""

from __future__ import annotations

import itertools
import math
import time
from collections import deque
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field
from typing import Any

from distributed import Client, Future, KilledWorker, as_completed

from copose.batch.cluster.local_workers import LocalWorkers
from copose.batch.cluster.worker_tasks import (
    Batch,
    BatchLines,
    Root,
    build,
    find_files,
    ready,
    solve,
    write_files,
)
from copose.batch.plain_loop import crashed
from copose.batch.point_solver import Recipe
from copose.errors import CoposeError, InputError
from copose.progress import heed
from copose.studies.points.line import PointLine
from copose.studies.points.points import Point
from copose.studies.robot_files import RobotFiles
from copose.version import __version__


class SchedulerLostError(CoposeError):
    """A scheduler that is gone in the middle of a run; what came back before is recorded."""


@dataclass(frozen=True)
class DispatchOptions:
    """Sizes of batches, and times between looks at workers."""

    batch_s: float = 0.4  # time of a batch
    workers: int = 8  # of more, batches take longer in proportion: each costs 10 ms here
    largest: int = 500  # points of a batch
    growth: int = 2  # how many times as large as the one before a batch may be
    depth: int = 3  # batches that a worker has, the one that it solves included
    deaths: int = 2  # of a point's process, from which on it is not tried again
    roll_s: float = 0.5  # time between two looks at which workers there are
    pause_s: float = 0.02  # time between two looks for answers


@dataclass(eq=False)
class _Member:
    """A worker that takes part."""

    address: str  # by which Dask knows it
    size: int = 1  # points of its next batch
    solver: Future | None = None  # on it; None before it is built
    ready: bool = False  # whether the solver is built: whatever dies before counts for no point
    # What it has been asked for, and the batch that it is; None of what comes before.
    tasks: dict[Future, Batch | None] = field(default_factory=dict)


class Dispatcher:
    """The points of a run on their way to workers, and lines on their way back."""

    def __init__(
        self,
        client: Client,
        recipe: Recipe,
        points: Iterator[Point],
        robots: RobotFiles,
        local: LocalWorkers | None = None,
        options: DispatchOptions = DispatchOptions(),
    ) -> None:
        """Nothing handed out yet: points are taken as workers need them. Without local workers
        these are others' business.
        """
        self._client, self._recipe, self._robots = client, recipe, robots
        self._local, self._options = local, options
        first = next(points, None)
        self._first = {} if first is None else first.values
        self._points = points if first is None else itertools.chain((first,), points)
        self._exhausted = first is None
        self._members: dict[str, _Member] = {}
        self._asked: dict[Future, _Member] = {}
        self._alone = deque[Point]()
        self._given_up = deque[PointLine]()
        self._deaths: dict[int, int] = {}
        # Workers that have died while they built.
        self._unbuilt = 0
        self._looked = -math.inf
        self._answers = as_completed(loop=client.loop, with_results=True, raise_errors=False)

    def lines(self) -> Generator[str, None, None]:
        """The lines of all points, as JSON, in the order in which they come back.

        Raises:
            StoppedError: the call has to end.
            SchedulerLostError: the scheduler is gone.
            InputError: a worker cannot solve points: it lacks copose, say.
            CoposeError: local workers die as they start.
        """
        while not self._exhausted or self._alone or self._solving:
            heed()
            self._call_roll()
            self._hand_out()
            answers = self._answers.next_batch(block=False)
            for future, answer in answers:
                yield from self._taken(future, answer)
            while self._given_up:
                yield self._given_up.popleft().text
            if not answers:
                time.sleep(self._options.pause_s)

    @property
    def _solving(self) -> bool:
        return any(batch for member in self._members.values() for batch in member.tasks.values())

    def _call_roll(self) -> None:
        """Find out which workers have come and gone."""
        if self._client.status != "running":
            raise _lost_scheduler()
        now = time.monotonic()
        if now - self._looked < self._options.roll_s:
            return
        self._looked = now
        if self._local is not None:
            self._local.keep()
        try:
            present = set(self._client.nthreads())
        except OSError:
            raise _lost_scheduler() from None
        for address in self._members.keys() - present:
            self._lose(self._members[address])
        for address in sorted(present - self._members.keys()):
            self._members[address] = member = _Member(address)
            self._ask(member, None, find_files, self._robots.places)

    def _hand_out(self) -> None:
        """Give every worker something to do: batches, and at last points alone."""
        members = [member for member in self._members.values() if member.ready]
        for depth in range(self._options.depth):
            for member in members:
                if len(member.tasks) == depth and (points := self._next_points(member.size)):
                    self._ask(member, Batch(points), solve, member.solver)
        for member in members:
            if self._exhausted and self._alone and not member.tasks:
                self._ask(member, Batch((self._alone.popleft(),), True), solve, member.solver)

    def _next_points(self, count: int) -> tuple[Point, ...]:
        if self._exhausted:
            return ()
        points = tuple(itertools.islice(self._points, count))
        self._exhausted = len(points) < count
        return points

    def _ask(self, member: _Member, batch: Batch | None, task: Any, *arguments: Any) -> None:
        given = arguments if batch is None else (*arguments, batch)
        future = self._submitted(member, task, *given)
        member.tasks[future] = batch
        self._asked[future] = member
        self._answers.add(future)

    def _submitted(self, member: _Member, task: Any, *arguments: Any) -> Future:
        return self._client.submit(task, *arguments, workers=[member.address], pure=False)

    def _taken(self, future: Future, answer: Any) -> Iterator[str]:
        """The lines in the answer to a task, if there are any; what follows from it is done."""
        member = self._asked.pop(future, None)
        if member is None:
            # Of a worker that was lost.
            return
        batch = member.tasks.pop(future)
        if future.status == "error":
            self._failed(member, batch, answer[1])
        elif future.status != "finished":
            raise _lost_scheduler()
        elif isinstance(answer, BatchLines):
            self._resize(member, answer)
            yield from answer.lines
        elif answer is True:
            member.ready = True
            if self._local is not None:
                self._local.praise()
        elif isinstance(answer, Root):
            self._build(member, answer)
        else:
            self._ask(member, None, write_files, self._robots)

    def _resize(self, member: _Member, answer: BatchLines) -> None:
        """Fit the size of a worker's batches to the time that one took."""
        options, count = self._options, len(answer.lines)
        batch_s = options.batch_s * max(1.0, len(self._members) / options.workers)
        fitting = int(batch_s * count / max(answer.seconds, 1e-6))
        member.size = max(1, min(fitting, options.growth * count, options.largest))

    def _build(self, member: _Member, root: Root) -> None:
        # What cannot be built without dying is left to the points, which are given up in the end.
        values = self._first if self._unbuilt < self._options.deaths else None
        member.solver = self._submitted(
            member, build, self._recipe, self._robots.places, root, values, __version__
        )
        # The solver itself stays where it is.
        self._ask(member, None, ready, member.solver)

    def _failed(self, member: _Member, batch: Batch | None, error: BaseException) -> None:
        """Go on after a task has ended with an error: as a rule its worker is dead."""
        if batch is None and not isinstance(error, KilledWorker):
            said = str(error) if isinstance(error, InputError) else repr(error)
            raise InputError(f"the worker {member.address} cannot solve points: {said}")
        if not isinstance(error, KilledWorker) and batch is not None:
            self._give_up(batch, error)
            return
        self._lose(member)
        if batch is not None:
            self._split(batch)

    def _give_up(self, batch: Batch, error: BaseException) -> None:
        """Try the points of a batch that failed alone; of one that was a line says so."""
        if batch.alone:
            reason = f"internal error: {type(error).__name__}: {error}"
            self._given_up.append(PointLine(batch.points[0], "failed", reason))
        else:
            self._alone.extend(batch.points)

    def _lose(self, member: _Member) -> None:
        """Take back what a worker has been asked for."""
        del self._members[member.address]
        for future, batch in member.tasks.items():
            del self._asked[future]
            future.cancel()
            if batch is not None:
                self._split(batch)
        if member.solver is not None:
            self._unbuilt += not member.ready
            member.solver.cancel()

    def _split(self, batch: Batch) -> None:
        """Try the points of a batch that died alone: which one it was nobody knows."""
        for point in batch.points:
            deaths = self._deaths.get(point.number, 0) + batch.alone
            if batch.alone:
                self._deaths[point.number] = deaths
            if deaths < self._options.deaths:
                self._alone.append(point)
            else:
                self._given_up.append(crashed(point))


def _lost_scheduler() -> SchedulerLostError:
    return SchedulerLostError(
        "the connection to the Dask scheduler is lost; what is done is recorded, and the same "
        "command goes on with the rest"
    )
