"""The run of a study: what is missing in its record is done, and nothing twice."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from copose.batch.plain_loop import CrashLog, loop_lines
from copose.batch.point_solver import Recipe, points_of
from copose.batch.validation import check_study
from copose.errors import InputError
from copose.poses import Indices
from copose.progress import StoppedError, Tell, attained, sheltered, stage, watched
from copose.studies.columns import write_parquet
from copose.studies.points.points import Point
from copose.studies.record import RecordLines, StudyRecord
from copose.studies.robot_files import RobotFiles
from copose.studies.study import Study, StudyFolder
from copose.studies.table import StudyTable


@dataclass(frozen=True)
class RunOptions:
    """Options of a run."""

    workers: int = 1  # processes of a local cluster; 1 is a plain loop in this process
    scheduler: str | None = None  # address of a Dask scheduler that exists
    point_limit: float | None = None  # s that a point may take
    retry: bool = False  # whether points are done again that a limit or a crash has ended


@dataclass(frozen=True)
class RunOutcome:
    """The end of a run."""

    points: int  # different ones that the study asks for
    done: int  # of them in the record now
    stopped: bool  # whether it was stopped before its end


def run_study(
    file: str | Path,
    folder: str | Path | None = None,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    point_limit: float | None = None,
    retry: bool = False,
    progress: Tell | None = None,
    time_limit: float | None = None,
) -> Path:
    """Run a study, or what is missing of it; `copose.read_study` reads what comes of it.

    Args:
        file: the study file.
        folder: for ``study.jsonl`` and ``study.parquet``; default the study's name.
        workers: processes of a local Dask cluster; 1 is a plain loop in this process.
        scheduler: address of a Dask scheduler in place of a local cluster.
        point_limit: s that a point may take.
        retry: do points again that a limit or a crash has ended.
        progress: called with a `copose.Progress` as points are done.
        time_limit: s, after which the study stops; calling again goes on.

    Returns:
        The folder.

    Raises:
        InputError: the study is wrong, or what it needs is not installed.
    """
    with watched(progress, time_limit):
        study = Study.read(file)
        check_study(study)
        place = StudyFolder(Path(study.file.name) if folder is None else Path(folder))
        run_points(study, place, RunOptions(workers, scheduler, point_limit, retry))
        with sheltered(), contextlib.suppress(ImportError):
            import pyarrow  # noqa: F401

            write_parquet(StudyTable.of(study, place), place.parquet)
    return place.path


def run_points(study: Study, folder: StudyFolder, options: RunOptions = RunOptions()) -> RunOutcome:
    """Do the points of a study that are missing in a folder's record.

    Raises:
        InputError: the record cannot be written, or what the options need is not installed.
    """
    recipe, there = Recipe.of(study, options.point_limit), folder.path.exists()
    with StudyRecord(folder.record) as record, _removed_if_empty(folder, there=there):
        stage("reading the record")
        todo = _todo(study, folder.record, retry=options.retry)
        total = len(study.index)
        done = total - len(todo)
        points = points_of(study, map(int, todo))
        try:
            with contextlib.closing(_lines(study, recipe, points, folder, options)) as lines:
                for number, line in enumerate(_told(lines, done, total)):
                    if number == 0:
                        # Until now the folder may be another study's.
                        folder.remember(study)
                    record.append(line)
                    done += 1
        except StoppedError:
            return RunOutcome(total, done, stopped=True)
        folder.remember(study)
    return RunOutcome(total, done, stopped=False)


@contextlib.contextmanager
def _removed_if_empty(folder: StudyFolder, *, there: bool) -> Iterator[None]:
    """A record of this process that is removed where a run fails before the first line of all, with
    the folder, unless that was there.
    """
    try:
        yield
    except InputError:
        with contextlib.suppress(OSError):
            if folder.record.stat().st_size == 0:
                folder.record.unlink()
                if not there:
                    folder.path.rmdir()
        raise


def _lines(
    study: Study,
    recipe: Recipe,
    points: Iterator[Point],
    folder: StudyFolder,
    options: RunOptions,
) -> Generator[str, None, None]:
    """The lines of points as they are done."""
    if options.workers > 1 and options.scheduler is not None:
        raise InputError("and --scheduler exclude each other; leave out one", key="--workers")
    if options.workers > 1 or options.scheduler is not None:
        from copose.batch.cluster.cluster import cluster_lines

        robots = RobotFiles.of(study.problems, study.file)
        yield from cluster_lines(recipe, points, robots, options.workers, options.scheduler)
        return
    with CrashLog(folder.crashes) as log:
        for line in loop_lines(recipe, points, log):
            yield line.text


def _told(lines: Iterator[str], done: int, total: int) -> Iterator[str]:
    """Lines whose progress is told, with the time that is left at the rate until then."""
    began, first = time.perf_counter(), done
    stage("solving points", done, total)
    for line in lines:
        yield line
        done += 1
        left = (time.perf_counter() - began) / (done - first) * (total - done)
        best = json.loads(line)["objective"]
        if best is not None:
            attained(best)
        stage("solving points", done, total, left)


def _todo(study: Study, record: Path, *, retry: bool) -> Indices:
    """Numbers of the points that have to be done, ascending; of points with equal values one."""
    offsets = study.index.offsets(record)
    if retry and (offsets >= 0).any():
        lines = RecordLines(record)
        for point in np.flatnonzero(offsets >= 0).tolist():
            if lines.at(int(offsets[point]))["stopped"]:
                offsets[point] = -1
    own = study.index.twins == np.arange(len(offsets))
    return np.flatnonzero((offsets < 0) & own)
