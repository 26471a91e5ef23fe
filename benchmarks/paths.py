"""Paths: what planning takes, how that grows with knots, and what it gains over following.

    python benchmarks/paths.py [--quick] [--output FILE]

Two Pandas carry a box 0.4 m sideways and 0.3 m up. Times are after building, with compiled kernels
and on CasADi's virtual machine, each in a process of its own. From every one of 20 random postures
the planned motion is compared with least-norm tracking and with gradient projection, both of
`baselines_path.py`; a posture counts from which least-norm tracking or some gain gets to the end.
Writes a page of Markdown.
"""

from __future__ import annotations

import argparse
import copy
import json
import os
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from baselines_path import GAINS, Tracked, Tracker
from building import Tables
from machine import facts
from truth import Array

import copose
from copose.motion import PathPlanner
from reference import PROBLEMS

HERE = Path(__file__).parent
KNOTS = (25, 50, 100, 200, 400)


@dataclass(frozen=True)
class Timing:
    """What planning took.

    Attributes:
        knots: that were asked for.
        told: that the motion came to.
        build_s: seconds of building, compiling left out.
        plan_s: seconds of planning after that, one for each seed.
    """

    knots: int
    told: int
    build_s: float
    plan_s: list[float]

    @property
    def median(self) -> float:
        """Of the seconds of planning."""
        return float(np.median(self.plan_s))


@dataclass(frozen=True)
class Compared:
    """Motions from one posture.

    Attributes:
        planned: aggregate of the planned motion; None where there is none.
        tracked: least-norm tracking.
        pulled: gradient projection with its best gain.
    """

    planned: float | None
    tracked: Tracked
    pulled: Tracked

    def won(self, mode: str) -> bool:
        """Whether the planned motion's aggregate is above both others'."""
        others = max(self.tracked.aggregate(mode), self.pulled.aggregate(mode))
        return self.planned is not None and self.planned > others


def carried(knots: int = 50) -> Tables:
    """The tables of the shipped path problem, with so many knots."""
    tables = tomllib.loads((PROBLEMS / "panda-carry-path.toml").read_text())
    tables["path"]["knots"] = knots
    return tables


def measured(knots: int, seeds: int) -> Timing:
    """Times of one problem, the planner warm."""
    planner = PathPlanner(copose.parse(carried(knots)))
    planner.compile()
    planner.plan(seed=0)
    spent, told = [], 0
    for seed in range(seeds):
        began = time.perf_counter()
        motion = planner.plan(seed=seed)
        spent.append(time.perf_counter() - began)
        if motion.time is None:
            raise SystemExit(f"{knots} knots, seed {seed}: {motion.status}, {motion.reason}")
        told = len(motion.time)
    return Timing(knots, told, planner.build_s, spent)


def apart(knots: int, seeds: int, compile_: str) -> Timing:
    """The same in a process of its own, with compiled kernels (``"1"``) or without."""
    command = [sys.executable, __file__, "--time", str(knots), "--seeds", str(seeds)]
    environment = os.environ | {"COPOSE_COMPILE": compile_}
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if answer.returncode != 0:
        raise SystemExit(answer.stderr)
    return Timing(**json.loads(answer.stdout.splitlines()[-1]))


def slope(timings: list[Timing]) -> float:
    """Of the logarithm of seconds over that of the knots that were asked for."""
    x, y = np.log([t.knots for t in timings]), np.log([t.median for t in timings])
    return float(np.polyfit(x, y, 1)[0])


def followed(
    tracker: Tracker, count: int, gains: tuple[float, ...], seed: int = 0
) -> list[tuple[Array, Tracked, Tracked]]:
    """Random postures from which some follower gets to the end, with what both come to."""
    found = []
    for start in tracker.starts(20 * count, seed):
        tracked, pulled = tracker.follow(start), tracker.best_of(start, gains)
        if tracked.reason is None or pulled.reason is None:
            found.append((start, tracked, pulled))
        if len(found) == count:
            break
    return found


def compared(tables: Tables, count: int, gains: tuple[float, ...]) -> list[Compared]:
    """Planning against following, from so many postures."""
    rows = []
    tracker = Tracker(tables)
    for start, tracked, pulled in followed(tracker, count, gains):
        begun = copy.deepcopy(tables)
        for arm, part in zip(begun["arms"], tracker.parts, strict=True):
            arm["start"] = start[part].tolist()
        motion = PathPlanner(copose.parse(begun)).plan()
        if motion.status != "solved":
            print(f"{motion.status}: {motion.reason}", flush=True)
        rows.append(Compared(motion.objective.after, tracked, pulled))
        print(row(len(rows), rows[-1], tracker.mode), flush=True)
    return rows


def row(number: int, one: Compared, mode: str) -> str:
    """A row of the page."""

    def shown(tracked: Tracked) -> str:
        return f"{tracked.aggregate(mode):.5f}" if tracked.reason is None else str(tracked.reason)

    planned = "–" if one.planned is None else f"{one.planned:.5f}"
    return (
        f"| {number} | {shown(one.tracked)} | {shown(one.pulled)} | {one.pulled.gain:g} "
        f"| {planned} | {'yes' if one.won(mode) else 'no'} |"
    )


def page(timings: dict[str, list[Timing]], rows: list[Compared], mode: str, seconds: float) -> str:
    """The page of Markdown."""
    times = [
        f"| {'compiled' if word == '1' else 'virtual machine'} | {t.knots} | {t.told} "
        f"| {1e3 * t.build_s:.0f} ms | {1e3 * t.median:.0f} ms | {1e3 * max(t.plan_s):.0f} ms |"
        for word, each in timings.items()
        for t in each
    ]
    slopes = ", ".join(
        f"{'compiled' if word == '1' else 'on the virtual machine'} {slope(each):.2f}"
        for word, each in timings.items()
        if len(each) > 1
    )
    machine = "; ".join(f"{key} {value}" for key, value in facts().items())
    return "\n".join([
        "# Paths", "",
        f"`python benchmarks/paths.py`, {seconds:.0f} s. Two Pandas carry a box 0.4 m sideways and "
        f"0.3 m up. {machine}.", "",
        "Planning after building; knots of the motion where more were needed between those asked "
        "for; median and longest over seeds.", "",
        "| kernels | knots | told | building | planning | longest |",
        "| --- | ---: | ---: | ---: | ---: | ---: |", *times, "",
        *([f"Slope of log time over log knots: {slopes}.", ""] if slopes else []),
        f"Aggregates ({mode}) from random postures: least-norm tracking, gradient projection with "
        "the best of its gains, and the planned motion.", "",
        "| posture | least-norm | gradient projection | gain | planned | above both |",
        "| ---: | --- | --- | ---: | ---: | --- |",
        *(row(k + 1, one, mode) for k, one in enumerate(rows)), "",
        f"{sum(one.won(mode) for one in rows)} of {len(rows)} above both.", "",
    ])  # fmt: skip


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few knots, seeds and postures")
    parser.add_argument("--output", type=Path, default=HERE / "results" / "paths.md")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--time", type=int, help="time so many knots and print that alone")
    arguments = parser.parse_args()
    if arguments.time is not None:
        print(json.dumps(vars(measured(arguments.time, arguments.seeds))))
        return
    began = time.perf_counter()
    knots, starts, seeds = (KNOTS, 20, arguments.seeds)
    gains = GAINS
    if arguments.quick:
        knots, starts, seeds, gains = (25, 50), 2, 1, (1.0, 3.0)
    timings: dict[str, list[Timing]] = {"1": [], "0": []}
    for word, each in timings.items():
        for count in knots if word == "1" or not arguments.quick else (25,):
            each.append(apart(count, seeds, word))
            print(f"{word} {count}: {each[-1].median:.3f} s", flush=True)
    tables = carried()
    rows = compared(tables, starts, gains)
    mode = str(tables["path"].get("aggregate", "mean"))
    arguments.output.write_text(page(timings, rows, mode, time.perf_counter() - began))
    print(f"written to {arguments.output}")


if __name__ == "__main__":
    main()
