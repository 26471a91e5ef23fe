"""Answers that keep clear: are they clear, as good as a dense sample has it, and what do they cost?

    python benchmarks/collision.py [--problems 10] [--output FILE]

Random cells of two Pandas and of two xArm7 with obstacles in their way. Of pairs of closed
postures, drawn and closed without copose, the best counts that keeps 4 cm more than the clearance,
measured on the original meshes; links of one arm and the object, which are nearer than that in most
postures, keep the clearance. Processor times are those of a solve with collision over one without,
in one run. Writes a page of Markdown.
"""

from __future__ import annotations

import argparse
import copy
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

# One thread, so that processor time is what a quiet machine takes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from cases import Case, case
from sampling import closed_postures, spread_out
from truth import Array, Truth

import copose
from copose.collision import Scene, configurations
from copose.robots import load_arms

HERE = Path(__file__).parent
CLEARANCE, BEYOND = 0.01, 0.04
DRAWN, DENSE, LOOKED_AT = 4096, 200, 4000
REPEATS = 5


def random_cell(robot: str, seed: int) -> Case:
    """Two arms, an object about where the shipped problem has it, and obstacles among them."""
    rng = np.random.default_rng([seed, len(robot)])
    name = {"panda": "two-panda-box", "xarm7": "xarm-bar"}[robot]
    tables = copy.deepcopy(dict(case(name).tables))
    thing = tables["object"]
    thing["position"] = [*(np.array(thing["position"]) + rng.uniform(-0.08, 0.08, 3))]
    thing["rpy"] = [0.0, 0.0, rng.uniform(-0.3, 0.3)]
    tables["obstacles"] = [obstacle(robot, k, rng) for k in range(3)]
    tables["constraints"] = {"collision": True, "clearance": CLEARANCE}
    return Case(f"{robot} {seed}", "", tables)


def obstacle(robot: str, number: int, rng: np.random.Generator) -> dict[str, Any]:
    """A post, a ball or a bar near where elbows may go, away from the object."""
    centre = np.array([0.5, 0.0, 0.5]) if robot == "panda" else np.array([0.42, 0.0, 0.25])
    angle = rng.uniform(-np.pi, np.pi)
    away = [0.5 * np.cos(angle), 0.5 * np.sin(angle), rng.uniform(-0.1, 0.45)]
    place = centre + np.array(away)
    shapes = [
        {"kind": "cylinder", "radius": 0.03, "length": 0.5},
        {"kind": "sphere", "radius": 0.08},
        {"kind": "capsule", "radius": 0.03, "length": 0.4},
    ]
    return {
        "name": f"obstacle {number}",
        "shape": shapes[number % 3],
        "position": [float(x) for x in place],
        "rpy": [float(x) for x in rng.uniform(-1, 1, 3)],
    }


def without(tables: dict[str, Any]) -> dict[str, Any]:
    """The same cell blind to collisions."""
    return {**tables, "constraints": {}}


class Bodies:
    """Distances in a cell, on the original meshes."""

    def __init__(self, problem: copose.Problem) -> None:
        """Read the robots."""
        self.problem, self.arms = problem, load_arms(problem)
        self.scene = Scene.of(problem, self.arms)
        self.bodies = self.scene.bodies(self.arms, CLEARANCE)
        carriers = [solid.carrier for solid in self.scene.solids]
        own = np.array([
            carriers[a].arm == carriers[b].arm or "object" in (carriers[a].kind, carriers[b].kind)
            for a, b in self.scene.pairs
        ])  # fmt: skip
        self._own, self._others = np.flatnonzero(own), np.flatnonzero(~own)

    def clear(self, joints: list[Array]) -> bool:
        """Whether a posture keeps 4 cm more than the clearance; one arm and the object that."""
        if self.distance(joints, self._others) < CLEARANCE + BEYOND:
            return False
        return self.distance(joints, self._own) >= CLEARANCE

    def distance(self, joints: list[Array], pairs: Array | None = None) -> float:
        """The smallest."""
        bases = [arm.base for arm in self.arms]
        x = configurations(self.arms, bases, joints, self.problem.object.pose)[0]
        nearest = self.bodies.nearest(x, pairs)
        return np.inf if nearest is None else nearest.distance


def sampled(given: Case, bodies: Bodies) -> float | None:
    """The best of all pairs of closed postures that keeps 4 cm more than the clearance."""
    truth = Truth(Case(given.name, "", without(given.tables)))
    planner = copose.Planner(copose.parse(without(given.tables)))
    planner.compile()
    one, other = (spread_out(truth, i, closed_postures(truth, i, DRAWN, 1), DENSE) for i in (0, 1))
    if not len(one) or not len(other):
        return None
    names = [arm["name"] for arm in given.tables["arms"]]
    table = np.array([
        planner.measure({names[0]: np.tile(row, (len(other), 1)), names[1]: other}).objective
        for row in one
    ])  # fmt: skip
    table = np.where(np.isfinite(table), table, -np.inf)
    for flat in np.argsort(-table, axis=None)[:LOOKED_AT]:
        i, j = np.unravel_index(flat, table.shape)
        if bodies.clear([one[i], other[j]]):
            return float(table[i, j])
    return None


def seconds(tables: dict[str, Any]) -> tuple[float, float]:
    """Median processor times of a solve, building included, and of a search after building."""
    problem = copose.parse(tables)
    planner = copose.Planner(problem)
    planner.compile()
    return (
        timed(lambda seed: copose.solve(problem, seed=seed)),
        timed(lambda seed: planner.solve(seed=seed)),
    )


def timed(work: Callable[[int], object]) -> float:
    """The median processor time of seeds, after one for what is built."""
    work(0)
    found = []
    for seed in range(REPEATS):
        began = time.process_time()
        work(seed)
        found.append(time.process_time() - began)
    return float(np.median(found))


def line(robot: str, seed: int) -> tuple[str, tuple[float, float]]:
    """A row of the page, and the ratios of times."""
    given = random_cell(robot, seed)
    bodies = Bodies(given.problem)
    blind = without(given.tables)
    solution, free = copose.solve(given.problem), copose.solve(copose.parse(blind))
    if solution.after is None:
        reason = f"| {given.name} | {solution.status} | {solution.reason} |||||||"
        return reason, (np.nan, np.nan)
    assert free.after is not None
    blindly = bodies.distance([np.array(q) for q in free.after.joints.values()])
    distance = bodies.distance([np.array(q) for q in solution.after.joints.values()])
    best = sampled(given, bodies)
    value = solution.objective.after
    assert value is not None
    with_it, without_it = seconds(given.tables), seconds(blind)
    ratios = with_it[0] / without_it[0], with_it[1] / without_it[1]
    fine = distance >= CLEARANCE - 1e-6 and (best is None or value >= best - 1e-9)
    shown = "–" if best is None else f"{best:.5f}"
    return (
        f"| {given.name} | {free.objective.after:.5f} | {1e3 * blindly:.1f} | {value:.5f} "
        f"| {1e3 * distance:.1f} | {shown} | {ratios[0]:.2f} | {ratios[1]:.1f} "
        f"| {'yes' if fine else 'NO'} |"
    ), ratios


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=10, help="of either robot")
    parser.add_argument("--output", type=Path, default=HERE / "results" / "collision.md")
    arguments = parser.parse_args()
    began = time.perf_counter()
    rows, ratios = [], []
    for robot in ("panda", "xarm7"):
        for seed in range(arguments.problems):
            row, both = line(robot, seed)
            rows.append(row)
            ratios.append(both)
            print(row, flush=True)
    found = np.array(ratios)
    found = found[np.isfinite(found[:, 0])]
    text = "\n".join([
        "# Keeping clear", "",
        f"`python benchmarks/collision.py`, {time.perf_counter() - began:.0f} s. Volume; clearance "
        f"{1e3 * CLEARANCE:g} mm; *sample*: the best of {DENSE} × {DENSE} closed postures that "
        f"keeps {1e3 * (CLEARANCE + BEYOND):g} mm on the original meshes, {1e3 * CLEARANCE:g} mm "
        "between links of one arm and to the object.",
        "",
        "| cell | blind | its distance, mm | answer | its distance, mm | sample "
        "| solve over blind | search over blind | clear, no worse |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |", *rows, "",
        "Processor times over those of the same without collision, medians and the largest: of a "
        f"solve, building included, {np.median(found[:, 0]):.2f} and {found[:, 0].max():.2f}; of "
        f"the search alone, {np.median(found[:, 1]):.1f} and {found[:, 1].max():.1f}.", "",
    ])  # fmt: skip
    arguments.output.write_text(text)
    print(f"written to {arguments.output}")


if __name__ == "__main__":
    main()
