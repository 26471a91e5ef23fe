"""The plain loop: points one after the other in this process, which a crash of one would end."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Self

from copose.batch.point_solver import PointSolver, Recipe
from copose.errors import InputError
from copose.results import write_file
from copose.studies.points.line import PointLine
from copose.studies.points.points import Point


class CrashLog:
    """The point that is being solved, and those of which a process has died, in a file that
    outlives the process: a line each, by their hashes, the first one empty between points.
    """

    def __init__(self, file: Path) -> None:
        """The log that an earlier process may have left: what it was solving counts as failed.

        Raises:
            InputError: the file cannot be written.
        """
        self._file, self._none = file, " " * 32
        try:
            solving, *failed = [*file.read_text().split("\n"), ""] if file.exists() else [""]
            self._failed = [each for each in (solving.strip(), *failed) if each]
            content = "\n".join([self._none, *self._failed])
            write_file(file, content.encode())
            self._handle = os.open(file, os.O_WRONLY)
        except (OSError, ValueError) as error:
            raise InputError(f"cannot be used: {error}", file=file) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        os.close(self._handle)
        if kind is None or not self._failed:
            self._file.unlink(missing_ok=True)

    def times(self, point: Point) -> int:
        """The number of processes that have died of a point."""
        return self._failed.count(point.point_hash.hex())

    @contextlib.contextmanager
    def solving(self, point: Point) -> Iterator[None]:
        """A point that is being solved."""
        os.pwrite(self._handle, point.point_hash.hex().encode(), 0)
        try:
            yield
        finally:
            # Only of a process that dies it stays.
            os.pwrite(self._handle, self._none.encode(), 0)


def loop_lines(recipe: Recipe, points: Iterable[Point], log: CrashLog) -> Iterator[PointLine]:
    """The lines of points, in this process; of those that a process has died of before, last.

    Raises:
        StoppedError: the call has to end; nothing is said of the point that was begun.
    """
    solver = PointSolver(recipe)
    doubtful = list[Point]()
    for point in points:
        if log.times(point):
            doubtful.append(point)
            continue
        yield solver.line(point, log.solving)
    for point in doubtful:
        yield crashed(point) if log.times(point) > 1 else solver.line(point, log.solving)


def crashed(point: Point) -> PointLine:
    """The line of a point of which two processes have died."""
    return PointLine(point, "failed", "its process died twice", stopped=True)
