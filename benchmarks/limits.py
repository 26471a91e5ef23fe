"""Objectives that torque limits decide, and their kin: do searches reach what a dense sample has?

    python benchmarks/limits.py [--seeds 20] [--output FILE]

For every problem and objective the best of all pairs of closed postures, drawn and closed without
copose, is compared with what searches from many seeds find; and the time of a search for the
largest acceleration with that of one for the volume, compiled and not. Writes a page of Markdown.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from cases import Case, case
from sampling import closed_postures, spread_out
from truth import Array, Truth

import copose
from reference import PROBLEMS as REFERENCE

HERE = Path(__file__).parent
UP = [0.0, 0.0, 1.0]
OBJECTIVES: dict[str, dict[str, Any]] = {
    "acceleration": {"kind": "acceleration"},
    "payload": {"kind": "payload"},
    "all-round": {"kind": "all-round", "axes": ["x", "y", "z"]},
    "velocity-volume": {"kind": "velocity-volume"},
    "force-volume": {"kind": "force-volume"},
    "volume, held": {"kind": "volume"},
}
BALLS = "two-panda-balls"
PROBLEMS = ("two-panda-box", "baxter-box", "xarm-bar", BALLS)
# Those of `problems/` whose own objective torque limits decide.
SHIPPED = ("panda-lift", "panda-payload", "panda-heavy")
# Postures of an arm in the sample, and where a posture takes a thousand times longer to judge.
DRAWN, DENSE, DEAR = 8192, 250, 60
# What the volume's object weighs, as a share of the most that can be held.
HEAVY = 0.9


def tables_of(name: str) -> dict[str, Any]:
    """The tables of a problem; two Pandas may hold their box by ball joints."""
    if name == BALLS:
        return dict(case("two-panda-box").tables) | {"task": {"space": "spatial-linear"}}
    return dict(case(name).tables)


def posed(name: str, objective: str) -> Case:
    """A problem with another objective, or as it is shipped."""
    if name in SHIPPED:
        return Case(name, "", tomllib.loads((REFERENCE / f"{name}.toml").read_text()))
    tables = tables_of(name)
    tables["objective"] = dict(OBJECTIVES[objective])
    if objective == "acceleration":
        m = 6 if tables["task"]["space"] == "spatial" else 3
        tables["objective"]["direction"] = UP + [0.0] * (m - 3)
    if objective == "volume, held":
        tables["constraints"] = {"static_torque": True}
        tables["object"] = tables["object"] | {"mass": heavy(name)}
    return Case(name, "", tables)


def heavy(name: str) -> float:
    """A mass that few postures hold."""
    tables = tables_of(name)
    tables["constraints"] = {"static_torque": True}
    tables["object"] = tables["object"] | {"mass": 1000.0}
    reason = copose.solve(copose.parse(tables)).reason or ""
    return HEAVY * float(reason.split("a mass of ")[1].split(" kg")[0])


@cache
def postures(name: str, count: int) -> tuple[Array, Array]:
    """Closed postures of either arm of a problem, spread out."""
    truth = Truth(posed(name, "volume, held" if name in SHIPPED else "velocity-volume"))
    one, other = (
        spread_out(truth, i, closed_postures(truth, i, DRAWN, 0), count) for i in range(2)
    )
    return one, other


def sampled(problem: Case, planner: copose.Planner, objective: str) -> float:
    """The best of all pairs of closed postures."""
    arms = postures(problem.name, DEAR if objective == "all-round" else DENSE)
    names = [arm["name"] for arm in problem.tables["arms"]]
    best = -np.inf
    for row in arms[0]:
        pair = {names[0]: np.tile(row, (len(arms[1]), 1)), names[1]: arms[1]}
        measured = planner.measure(pair)
        values = np.where(np.isfinite(measured.objective), measured.objective, -np.inf)
        if measured.share is not None:
            values = np.where(measured.share <= 1, values, -np.inf)
        best = max(best, float(values.max()))
    return best


def asked_of(name: str) -> list[str]:
    """The objectives of a problem; with ball joints all-round would take hours."""
    if name in SHIPPED:
        return ["as shipped"]
    return [each for each in OBJECTIVES if (name, each) != (BALLS, "all-round")]


def line(name: str, objective: str, seeds: int) -> str:
    """A row of the page."""
    problem = posed(name, objective)
    planner = copose.Planner(problem.problem)
    planner.compile()
    best = sampled(problem, planner, objective)
    found, spent = [], []
    for seed in range(seeds):
        solution = planner.solve(seed=seed, effort=problem.effort)
        after = solution.objective.after
        found.append(-np.inf if after is None else after)
        spent.append(solution.timing.search_s)
    reached = sum(value >= best - 1e-7 * max(1.0, abs(best)) for value in found)
    same = sum(value >= max(found) - 1e-6 * max(1.0, abs(max(found))) for value in found)
    return (
        f"| {name} | {objective} | {best:.6g} | {min(found):.8g} … {max(found):.8g} "
        f"| {reached}/{seeds} | {same}/{seeds} | {1e3 * float(np.median(spent)):.3g} ms |"
    )


def seconds(kind: str) -> float:
    """The median time of a search with two Pandas and a box."""
    planner = copose.Planner(posed("two-panda-box", kind).problem)
    planner.compile()
    planner.solve(seed=0)
    spent = []
    for seed in range(30):
        spent.append(planner.solve(seed=seed).timing.search_s)
    return float(np.median(spent))


def ratio() -> tuple[float, float]:
    """Seconds of a search for the volume and for the largest acceleration upwards."""
    OBJECTIVES["volume"] = {"kind": "volume"}
    return seconds("volume"), seconds("acceleration")


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--problems", default=",".join((*SHIPPED, *PROBLEMS)))
    parser.add_argument("--output", type=Path, default=HERE / "results" / "limits.md")
    parser.add_argument("--ratio", action="store_true", help="print one ratio and nothing else")
    arguments = parser.parse_args()
    if arguments.ratio:
        print(*ratio())
        return
    began = time.perf_counter()
    rows = []
    for name in arguments.problems.split(","):
        for objective in asked_of(name):
            rows.append(line(name, objective, arguments.seeds))
            print(rows[-1], flush=True)
    times = []
    for word, compile_ in (("compiled", "1"), ("virtual machine", "0")):
        environment = os.environ | {"COPOSE_COMPILE": compile_}
        command = [sys.executable, __file__, "--ratio"]
        answer = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True
        )
        volume, acceleration = map(float, answer.stdout.split())
        times.append(
            f"| {word} | {1e3 * volume:.3g} ms | {1e3 * acceleration:.3g} ms "
            f"| {acceleration / volume:.2f} |"
        )
        print(times[-1], flush=True)
    text = "\n".join([
        "# What torque limits decide", "",
        f"`python benchmarks/limits.py`, {time.perf_counter() - began:.0f} s.",
        f"*Sample*: the best of {DENSE} × {DENSE} closed postures ({DEAR} × {DEAR} for all-round).",
        "*Reached*: seeds whose answer is at least that. *Best*: seeds that found the best of all.",
        "",
        "| problem | objective | sample | found | reached | best | a search, median |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |", *rows, "",
        "Two Pandas and a box, a search after building, median of 30 seeds:", "",
        "| kernels | volume | acceleration | ratio |", "| --- | ---: | ---: | ---: |", *times, "",
    ])  # fmt: skip
    arguments.output.write_text(text)
    print(f"written to {arguments.output}")


if __name__ == "__main__":
    main()
