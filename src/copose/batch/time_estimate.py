"""An estimate of the time that a study takes, from three of its points."""

from __future__ import annotations

import time
from dataclasses import dataclass

from copose.batch.point_solver import PointSolver, Recipe, points_of
from copose.progress import stage
from copose.studies.study import Study


@dataclass(frozen=True)
class Estimate:
    """Time that a study takes in a plain loop.

    Attributes:
        points: different ones.
        build_s: until the first point can be solved, s.
        point_s: of the points that were tried, s each.
    """

    points: int
    build_s: float
    point_s: tuple[float, ...]

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
