"""Whether every seed ends in one value: each problem searched with many seeds, misses listed.

    python benchmarks/seeds.py [NAME ...] [--seeds 20] [--workers 2] [--again] [--output DIR]

Without names the problems are those of `problems/` and the forty of `random_problems.py`, which are
written beside the answers; a name may be a problem's, a part of one, or a file. Each problem is
searched at the default effort. Answers are appended to `seeds.jsonl` as they come and what is there
already is not done again, but with `--again`. A run misses where its value is below the best of all
by more than 1e-6 (1 + |best|). The value of a path is what is maximised, aggregate minus
smoothness, or minus its duration where that is to be the shortest. Writes `seeds.md`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock
from typing import Any

from machine import facts
from random_problems import written
from tables import table

import copose
from copose.motion import PathPlanner
from reference import PROBLEMS

HERE = Path(__file__).parent
MISSED = 1e-6
Line = dict[str, Any]


def kind_of(tables: dict[str, Any]) -> str:
    """What is free in a problem, or what is special about it."""
    free = [what for arm in tables["arms"] for what in arm.get("freedom", {})]
    kind = str(tables.get("objective", {}).get("kind", "volume"))
    kinds = (
        ("path", "path" in tables),
        ("cases", "cases" in tables),
        ("free object", "freedom" in tables["object"]),
        ("free " + " and ".join(sorted({*free})), bool(free)),
        ("reachable", bool(tables.get("search", {}).get("reachable"))),
        (kind, kind in ("acceleration", "payload", "all-round")),
        ("three arms", len(tables["arms"]) > 2),
        ("ball contacts", tables["task"]["space"] == "spatial-linear"),
        ("planar", tables["task"]["space"].startswith("planar")),
    )
    return next((word for word, so in kinds if so), "plain")


def value_of(answer: copose.Solution | copose.Motion, problem: copose.Problem) -> float | None:
    """What is maximised; None where there is no answer."""
    if answer.objective.after is None:
        return None
    if not isinstance(answer, copose.Motion) or problem.path is None:
        return answer.objective.after
    if problem.path.duration == "shortest":
        return None if answer.duration is None else -answer.duration
    smoothness = problem.path.smoothness * (answer.smoothness or 0.0)
    return answer.objective.after - smoothness


def search(file: Path, seeds: Iterable[int]) -> None:
    """Search one problem with seeds and print a line of JSON for each."""
    tables = tomllib.loads(file.read_text())
    problem = copose.load(file)
    planner = copose.Planner(problem) if problem.path is None else PathPlanner(problem)
    planner.compile()
    for seed in seeds:
        began = time.process_time()
        answer = (
            planner.solve(seed=seed)
            if isinstance(planner, copose.Planner)
            else planner.plan(seed=seed)
        )
        line = {
            "problem": file.stem, "kind": kind_of(tables), "seed": seed, "status": answer.status,
            "value": value_of(answer, problem), "seconds": time.process_time() - began,
        }  # fmt: skip
        print(json.dumps(line), flush=True)


class Store:
    """Answers as they come, a line each."""

    def __init__(self, file: Path) -> None:
        """Read what is there."""
        self._file, self._lock = file, Lock()
        self.lines: list[Line] = []
        if file.exists():
            self.lines = [json.loads(line) for line in file.read_text().splitlines()]

    def missing(self, problem: str, seeds: range) -> list[int]:
        """Seeds of a problem that have no answer yet."""
        there = {line["seed"] for line in self.lines if line["problem"] == problem}
        return [seed for seed in seeds if seed not in there]

    def forget(self, problems: Iterable[str]) -> None:
        """Drop the answers of problems."""
        names = {*problems}
        self.lines = [line for line in self.lines if line["problem"] not in names]
        self._file.write_text("".join(json.dumps(line) + "\n" for line in self.lines))

    def add(self, text: str) -> None:
        """One more line."""
        with self._lock, self._file.open("a") as file:
            self.lines.append(json.loads(text))
            file.write(text + "\n")


def searched(file: Path, seeds: list[int], store: Store, limit: float) -> None:
    """Search a problem in a process of its own, which is ended after so many seconds."""
    if not seeds:
        return
    command = [sys.executable, __file__, "--search", str(file), *map(str, seeds)]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    began = time.monotonic()
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        for text in process.stdout or ():
            store.add(text.strip())
            if time.monotonic() - began > limit:
                process.terminate()
                break
    took = time.monotonic() - began
    print(f"{file.stem}: {took:.0f} s, {told(store.lines, file.stem)}", flush=True)


def best_and_missed(lines: list[Line]) -> tuple[float | None, list[Line]]:
    """The best value of a problem's answers, and those that miss it."""
    values = [line["value"] for line in lines if line["value"] is not None]
    if not values:
        return None, lines
    best = max(values)
    floor = best - MISSED * (1 + abs(best))
    return best, [line for line in lines if line["value"] is None or line["value"] < floor]


def told(lines: list[Line], problem: str) -> str:
    """A line about one problem: how many of its runs missed, and what they came to."""
    best, missed = best_and_missed([line for line in lines if line["problem"] == problem])
    return f"best {best}, {len(missed)} missed: " + ", ".join(map(_miss, missed))


def _miss(line: Line) -> str:
    value = line["status"] if line["value"] is None else f"{line['value']:.9g}"
    return f"seed {line['seed']} {value}"


def page(lines: list[Line]) -> str:
    """The page of Markdown: a line a problem, the misses in full."""
    rows, count = list[list[str]](), 0
    for name in sorted({line["problem"] for line in lines}):
        these = sorted((x for x in lines if x["problem"] == name), key=lambda x: int(x["seed"]))
        best, missed = best_and_missed(these)
        count += len(missed)
        seconds = sorted(line["seconds"] for line in these)[len(these) // 2]
        rows.append(
            [name, these[0]["kind"], str(len(these)), "–" if best is None else f"{best:.9g}",
             str(len(missed)), ", ".join(map(_miss, missed)), f"{seconds:.2f}"]
        )  # fmt: skip
    heads = ["problem", "kind", "runs", "best", "missed", "which", "processor s"]
    share = 100 * count / max(1, len(lines))
    machine = ", ".join(f"{key} {value}" for key, value in facts().items())
    return (
        "# Seeds\n\n"
        f"{len(lines)} runs at the default effort, {count} of which ({share:.2f} %) missed the "
        f"best of their problem by more than {MISSED:g} (1 + |best|). Seconds are medians after "
        f"building.\n\n{table(heads, rows)}\n\n{machine}\n"
    )


def chosen(names: list[str], folder: Path) -> list[Path]:
    """Files of problems by their names or parts of them, all without one."""
    files = [*sorted(PROBLEMS.glob("*.toml")), *written(folder)]
    given = [Path(name) for name in names if name.endswith(".toml")]
    words = [name for name in names if not name.endswith(".toml")]
    return given + [f for f in files if not names or any(word in f.stem for word in words)]


def main() -> None:
    """Search what is missing and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--limit", type=float, default=1800.0, help="s, of one problem")
    parser.add_argument("--again", action="store_true", help="what is stored, too")
    parser.add_argument("--search", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--output", type=Path, default=HERE / "results")
    arguments = parser.parse_args()
    if arguments.search:
        search(Path(arguments.names[0]), map(int, arguments.names[1:]))
        return
    arguments.output.mkdir(parents=True, exist_ok=True)
    files = chosen(arguments.names, arguments.output / "random")
    store = Store(arguments.output / "seeds.jsonl")
    if arguments.again:
        store.forget(file.stem for file in files)
    with ThreadPoolExecutor(arguments.workers) as pool:
        for file in files:
            seeds = store.missing(file.stem, range(arguments.seeds))
            pool.submit(searched, file, seeds, store, arguments.limit)
    (arguments.output / "seeds.md").write_text(page(store.lines))


if __name__ == "__main__":
    main()
