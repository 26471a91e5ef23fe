"""Checks of a study before it runs, and an estimate of its time."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from copose.batch.point_solver import PointSolver, Recipe, points_of
from copose.cell.cell import Cell
from copose.errors import InputError, shown
from copose.problem import Problem, same_structure
from copose.progress import stage
from copose.results import Motion, Solution
from copose.studies.points.line import check_recorded
from copose.studies.points.points import Axis
from copose.studies.study import Study


@dataclass(frozen=True)
class ValidationOptions:
    """Limits of the validation of a large study."""

    rows: int = 100_000  # of one key; of a longer grid so many, evenly
    structures: int = 200  # problems whose robots are read


def check_study(study: Study, options: ValidationOptions = ValidationOptions()) -> None:
    """Refuse a study with a key, a value or a recorded number that is wrong.

    Every value is tried with the first value of all other keys; combinations are not.

    Raises:
        InputError: of the study file, with the ``[[vary]]`` table and the value.
    """
    source = study.file.source
    answer = Motion if study.file.command == "path" else Solution
    for i, path in enumerate(study.file.record):
        try:
            check_recorded(path, answer, f"record[{i}]")
        except InputError as error:
            raise InputError(error.message, key=error.key, file=source) from None
    study.problems.at({})
    for i, axis in enumerate(study.points.axes):
        # A first value that is wrong by itself is not to be blamed on another key.
        _check_alone(study, axis, f"vary[{i}]{'' if axis.ranged else '.values[0]'}")
    read = list[Problem]()
    for key, axis, row in _trials(study.points.axes, options.rows):
        first = {name: at for other in study.points.axes for name, at in _pairs(other, 0.0)}
        values = {**first, **dict(zip(axis.keys, row, strict=True))}
        with _blamed(study, axis, values, key):
            problem = study.problems.at(values)
            known = any(same_structure(problem, other, movable=True) for other in read)
            if not known and len(read) < options.structures:
                Cell.of(problem)
                read.append(problem)
            _check_starts(problem, study)


def _check_alone(study: Study, axis: Axis, key: str) -> None:
    """Refuse first values of one axis that are wrong with all else as in the problem file, and
    still are with the first values of all others.
    """
    alone = dict(_pairs(axis, 0.0))
    first = {name: at for other in study.points.axes for name, at in _pairs(other, 0.0)}
    for values in (first, alone):
        try:
            study.problems.at(values)
        except InputError:
            continue
        return
    with _blamed(study, axis, alone, key):
        study.problems.at(alone)


@contextmanager
def _blamed(study: Study, axis: Axis, values: Mapping[str, Any], key: str) -> Iterator[None]:
    """Wrong input that is said to be of an axis of the study file, with these values."""
    try:
        yield
    except InputError as error:
        told = ", ".join(f"{name} = {shown(values[name])}" for name in axis.keys)
        where = f"{error.key}: " if error.key and error.key not in axis.keys else ""
        raise InputError(
            f"{told}: {where}{error.message}", key=key, file=study.file.source
        ) from None


def _trials(axes: tuple[Axis, ...], most: int) -> Iterator[tuple[str, Axis, tuple[Any, ...]]]:
    """Rows of values of every axis, with the key in the study file."""
    for i, axis in enumerate(axes):
        if axis.rows is None:
            yield f"vary[{i}].from", axis, axis.row(0.0)
            yield f"vary[{i}].to", axis, (axis.upper,)
            continue
        count = len(axis.rows)
        for j in np.unique(np.linspace(0, count - 1, min(count, most)).astype(int)).tolist():
            listed = not axis.ranged
            yield f"vary[{i}].values[{j}]" if listed else f"vary[{i}]", axis, axis.rows[j]


def _pairs(axis: Axis, share: float) -> Iterator[tuple[str, Any]]:
    yield from zip(axis.keys, axis.row(share), strict=True)


def _check_starts(problem: Problem, study: Study) -> None:
    """Refuse to evaluate a problem that names no posture."""
    if study.file.command == "evaluate":
        for arm in problem.arms:
            if arm.start is None:
                text = "is evaluated at the start, which is missing"
                raise InputError(text, key=f"arms.{arm.name}.start")


@dataclass(frozen=True)
class Estimate:
    """Time that a study takes in a plain loop."""

    points: int  # different ones
    build_s: float  # until the first point can be solved, s
    point_s: tuple[float, ...]  # of the points that were tried, s each

    @property
    def mean_s(self) -> float:
        """Mean time of a point, s."""
        return sum(self.point_s) / len(self.point_s)

    @property
    def total_s(self) -> float:
        """Time of all points, s."""
        return self.build_s + self.points * self.mean_s


def estimate(study: Study) -> Estimate:
    """The time of a study, from its first point, its last and the one in the middle."""
    count, began = len(study.points), time.perf_counter()
    solver = PointSolver(Recipe.of(study))
    stage("building")
    chosen = sorted({0, count // 2, count - 1})
    for point in points_of(study, chosen):
        solver.prepare(point.values)
    # What the first solution needs beside is built with it.
    solver.line(next(points_of(study, chosen)))
    build_s, seconds = time.perf_counter() - began, list[float]()
    for i, point in enumerate(points_of(study, chosen)):
        stage("solving points", i, len(chosen))
        seconds.append(solver.line(point).seconds)
    return Estimate(len(study.index), build_s, tuple(seconds))
