"""The tasks of a worker: robot files are put in place, a solver is built, points are solved."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
import threading
import time
import weakref
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from copose.batch.point_solver import PointSolver, Recipe
from copose.errors import InputError
from copose.studies.points.points import Point
from copose.studies.robot_files import PlacedProblems, RobotFiles, RobotPlaces
from copose.version import __version__


@dataclass(frozen=True)
class Batch:
    """Points that a worker solves one after the other."""

    points: tuple[Point, ...]  # at least one
    alone: bool = False  # whether it is one point, with nothing beside it on its worker


@dataclass(frozen=True)
class BatchLines:
    """The lines of a batch, as JSON, and the s that it took."""

    lines: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class Root:
    """The folder below which robot files lie; None where each is at its own path."""

    folder: Path | None


class WorkerSolver:
    """The solver of a study on one worker; its batches take turns.

    It stays on the worker for as long as the client of the run lives. A copy, which Dask makes of
    it where a worker retires, has built nothing.
    """

    def __init__(self, recipe: Recipe, robots: RobotPlaces, root: Root) -> None:
        """A solver of a recipe that reads robot files where the worker has them."""
        self._parts = recipe, robots, root
        self._turn = threading.Lock()

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return type(self), self._parts

    @cached_property
    def _solver(self) -> PointSolver:
        recipe, robots, root = self._parts
        return PointSolver(
            replace(recipe, problems=PlacedProblems(recipe.problems, robots, root.folder))
        )

    def prepare(self, values: Mapping[str, Any]) -> None:
        """Build what points with such values need; what is wrong is said of each point."""
        with self._turn, contextlib.suppress(Exception):
            self._solver.prepare(values)

    def solve(self, batch: Batch) -> BatchLines:
        """The lines of a batch."""
        lines, seconds = list[str](), 0.0
        for point in batch.points:
            self.prepare(point.values)
            with self._turn:
                began = time.perf_counter()
                lines.append(self._solver.line(point).text)
                seconds += time.perf_counter() - began
        return BatchLines(tuple(lines), seconds)


def find_files(robots: RobotPlaces) -> Root | None:
    """The folder of a study's robot files here; None where they are missing, or are others."""
    return Root(None) if robots.there else None


def write_files(files: RobotFiles) -> Root:
    """Write robot files into a folder of the worker's own."""
    from distributed import get_worker

    folder = Path(tempfile.mkdtemp(prefix="copose-", dir=get_worker().local_directory))
    files.write(folder)
    return Root(folder)


def build(
    recipe: Recipe, robots: RobotPlaces, root: Root, values: Mapping[str, Any] | None, version: str
) -> WorkerSolver:
    """The solver of a worker, ready for points with such values; robot files go when it goes.

    Raises:
        InputError: the worker has another version of copose, whose answers may differ.
    """
    if version != __version__:
        raise InputError(f"it has copose {__version__}, not {version}; one version is needed")
    solver = WorkerSolver(recipe, robots, root)
    if root.folder is not None:
        weakref.finalize(solver, shutil.rmtree, root.folder, ignore_errors=True)
    if values is not None:
        solver.prepare(values)
    return solver


def ready(_solver: WorkerSolver) -> bool:
    """True once a solver is built."""
    return True


def solve(solver: WorkerSolver, batch: Batch) -> BatchLines:
    """The lines of a batch."""
    return solver.solve(batch)
