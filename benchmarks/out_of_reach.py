"""What a pose out of reach costs beside a solved one, and whether one in reach is "infeasible".

    python benchmarks/out_of_reach.py [--poses 20] [--only NAME]
    python benchmarks/out_of_reach.py --rim 2000 [--only NAME]

The object moves along random rays, turned at random a little, until an arm cannot hold it: as far
as postures can be followed that close without copose. The first form times one planner with
compiled kernels at poses in reach, and at those 2 mm, 5 cm and 0.5 m beyond the rim: medians. The
second looks at poses within 1 cm of the rim on either side: none that closes from 200 random
postures or those that were followed may be called infeasible, and few may be missed. Prints a table
in Markdown.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass
from typing import Any

import building
import numpy as np
import pinocchio as pin
from cases import Case, case
from sampling import CLOSED, project
from truth import Array, Truth

import copose
from copose.robots import finite_range

PAIRS = ("two-panda-box", "ur5-pair", "xarm7-pair", "planar-pair")
BEYOND = (0.002, 0.05, 0.5)
PROJECTIONS = 200
STEP, FINE, FAR = 0.05, 1e-5, 4.0
TURN = 0.4
# From the rim, m, and how many poses of a ray are judged.
NEAR, OF_EACH = 0.01, 4


def pair(name: str) -> Case:
    """A pair of arms by name."""
    if name == "planar-pair":
        return Case(name, "", building.planar(name, 4, 2, 3, "planar")[0])
    return case(name)


@dataclass(frozen=True)
class Ray:
    """A way of the object's out of the arms' reach.

    Attributes:
        start: pose at its beginning, a `pinocchio.SE3`.
        direction: unit, world axes, (3,).
        rim: how far along it both arms were found to hold the object, m.
        postures: by arm, those that did there, (count, n).
    """

    start: Any
    direction: Array
    rim: float
    postures: tuple[Array, ...]

    def at(self, distance: float) -> Any:
        """The pose so far along."""
        return pin.SE3(self.start.rotation, self.start.translation + distance * self.direction)


class Rays:
    """Random rays from about where a case has its object."""

    def __init__(self, given: Case) -> None:
        """From where a case has its object."""
        self.truth = Truth(given)
        self._nominal = self.truth.reference.object
        self.planar = given.problem.space.planar

    def drawn(self, rng: np.random.Generator) -> Ray | None:
        """One; none where the arms do not even close at its beginning."""
        direction, turn = rng.normal(size=3), rng.uniform(-TURN, TURN, 3)
        if self.planar:
            direction[2] = turn[0] = turn[1] = 0.0
        turned = self._nominal.rotation @ pin.exp3(turn)
        start = pin.SE3(turned, self._nominal.translation)
        ray = Ray(start, direction / np.linalg.norm(direction), 0.0, ())
        at, step = 0.0, STEP
        postures = self.closed(ray.at(0.0), self.random(rng))
        while postures is not None and step > FINE and at < FAR:
            more = self.closed(ray.at(at + step), postures)
            if more is None and step == STEP:
                more = self.closed(ray.at(at + step), self.random(rng))
            if more is None:
                step /= 2
            else:
                at, postures = at + step, more
        return None if postures is None else Ray(ray.start, ray.direction, at, postures)

    def random(self, rng: np.random.Generator) -> tuple[Array, ...]:
        """Postures by arm, (200, n)."""
        bounds = zip(self.truth.lower, self.truth.upper, strict=True)
        ranges = [finite_range(*each) for each in bounds]
        return tuple(rng.uniform(low, high, (PROJECTIONS, len(low))) for low, high in ranges)

    def closed(self, where: Any, starts: tuple[Array, ...]) -> tuple[Array, ...] | None:
        """Postures that hold the object somewhere, by arm; none where one has none."""
        self.truth.place(where)
        found = []
        for i, q in enumerate(starts):
            ends, gaps = project(self.truth, i, q)
            if not (gaps < CLOSED).any():
                return None
            found.append(ends[gaps < CLOSED])
        return tuple(found)

    def pose(self, where: Any) -> dict[str, Any]:
        """As a planner takes it."""
        if self.planar:
            angle = float(np.arctan2(where.rotation[1, 0], where.rotation[0, 0]))
            return {"position": where.translation[:2].tolist(), "angle": angle}
        rpy = pin.rpy.matrixToRpy(where.rotation)
        return {"position": where.translation.tolist(), "rpy": rpy.tolist()}


def timed(planner: copose.Planner, pose: dict[str, Any]) -> tuple[float, str]:
    """Seconds of processor time that an answer takes, and its status."""
    began = time.process_time()
    solution = planner.solve(object_pose=pose)
    return time.process_time() - began, solution.status


def costs(name: str, count: int) -> str:
    """A row of times."""
    given = pair(name)
    planner = copose.Planner(given.problem)
    planner.compile()
    rays, rng = Rays(given), np.random.default_rng(5)
    solved: list[float] = []
    beyond: dict[float, list[float]] = {by: [] for by in BEYOND}
    told: dict[float, Counter[str]] = {by: Counter() for by in BEYOND}
    planner.solve()
    while len(solved) < count:
        ray = rays.drawn(rng)
        if ray is None:
            continue
        seconds, status = timed(planner, rays.pose(ray.at(rng.uniform(0, 0.9) * ray.rim)))
        if status == "solved":
            solved.append(seconds)
        for by in BEYOND:
            seconds, status = timed(planner, rays.pose(ray.at(ray.rim + by)))
            # Where limits end a ray it may come into reach again.
            if status != "solved":
                beyond[by].append(seconds)
            told[by][status] += 1
    one = float(np.median(solved))
    cells = [name, f"{1e3 * one:.0f} ms"]
    for by in BEYOND:
        took, most = float(np.median(beyond[by])), max(beyond[by])
        ends = ", ".join(f"{n} {status}" for status, n in sorted(told[by].items()))
        cells.append(f"{took / one:.2f}× (at most {most / one:.1f}×; {ends})")
    return " | ".join(cells)


def judged(name: str, count: int, *, compiled: bool = True) -> Counter[tuple[str, bool]]:
    """How often poses at the rim end in each status, and whether they close without copose."""
    given = pair(name)
    planner = copose.Planner(given.problem)
    if compiled:
        planner.compile()
    rays, rng = Rays(given), np.random.default_rng(6)
    seen: Counter[tuple[str, bool]] = Counter()
    while seen.total() < count:
        ray = rays.drawn(rng)
        if ray is None:
            continue
        for offset in NEAR * rng.uniform(-1, 1, OF_EACH) ** 3:
            where = ray.at(ray.rim + offset)
            starts = tuple(
                np.vstack(both) for both in zip(ray.postures, rays.random(rng), strict=True)
            )
            closes = rays.closed(where, starts) is not None
            status = planner.solve(object_pose=rays.pose(where), effort="low").status
            seen[status, closes] += 1
    return seen


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=20, help="solved ones that are timed")
    parser.add_argument("--rim", type=int, help="poses at the rim of reach that are judged")
    parser.add_argument("--only", choices=PAIRS, help="one pair of arms")
    asked = parser.parse_args()
    names = (asked.only,) if asked.only else PAIRS
    if asked.rim:
        print("| pair | solved that close | failed that close | infeasible that close |")
        print("| --- | --- | --- | --- |")
        for name in names:
            seen = judged(name, asked.rim // len(names))
            cells = [
                f"{seen[status, True]} of {seen[status, True] + seen[status, False]}"
                for status in ("solved", "failed", "infeasible")
            ]
            print(f"| {' | '.join([name, *cells])} |", flush=True)
        return
    print("| pair | solved | " + " | ".join(f"{1e3 * by:g} mm too far" for by in BEYOND) + " |")
    print("| --- | --- |" + " --- |" * len(BEYOND))
    for name in names:
        print(f"| {costs(name, asked.poses)} |", flush=True)


if __name__ == "__main__":
    main()
