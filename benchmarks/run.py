"""The benchmark: problems × methods × tolerance, one command.

    python benchmarks/run.py [--quick] [--problems a,b] [--methods copose,slsqp] [--output DIR]

writes `results.md`, `results.png` and `results.json` to benchmarks/results/. A quick run takes
about two minutes, a full one about twenty. Every measurement runs in a process of its own, one at a
time; every answer is judged by Pinocchio. Full runs compile into an empty cache.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cases import NAMES, QUICK
from figure import draw
from machine import facts
from peers import PEERS
from summary import LABELS, MAIN, Record, columns
from tables import failures, report

HERE = Path(__file__).parent
METHODS = ("copose", "copose-vm", *PEERS)
_EFFORTS = ("low", "normal", "high")
_LONGEST = 1200.0


@dataclass(frozen=True)
class Amount:
    """How much a run measures: runs per job and the seconds after which a job begins no more."""

    main: dict[str, tuple[int, float]]
    other: dict[str, tuple[int, float]]
    local: int
    local_problems: tuple[str, ...]
    measured: int
    arms: tuple[int, ...]
    arms_seeds: int
    effort_problems: tuple[str, ...]
    effort_seeds: int


QUICKLY = Amount(
    main={"copose": (10, 5.0), "copose-vm": (5, 5.0), "peer": (100, 3.0)},
    other={"copose": (5, 4.0), "copose-vm": (3, 4.0), "peer": (20, 1.5)},
    local=20,
    local_problems=(MAIN,),
    measured=20_000,
    arms=(1, 2, 4),
    arms_seeds=3,
    effort_problems=(),
    effort_seeds=0,
)
FULLY = Amount(
    main={"copose": (100, 300.0), "copose-vm": (100, 120.0), "peer": (2000, 120.0)},
    other={"copose": (100, 40.0), "copose-vm": (10, 10.0), "peer": (60, 1.5)},
    local=100,
    local_problems=(MAIN, "xarm7-pair", "ur5-pair"),
    measured=100_000,
    arms=(1, 2, 3, 4, 5, 6, 7, 8),
    arms_seeds=3,
    effort_problems=(MAIN, "xarm-bar", "panda-balls"),
    effort_seeds=20,
)


def job(wanted: Record, cache: str | None) -> Record:
    """One job in a process of its own; a record with ``error`` where it fails."""
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    if cache is not None:
        environment["XDG_CACHE_HOME"] = cache
    if wanted["method"] == "copose-vm":
        environment["COPOSE_COMPILE"] = "0"
    command = [sys.executable, str(HERE / "jobs.py"), json.dumps(wanted)]
    try:
        ended = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False, timeout=_LONGEST
        )
    except subprocess.TimeoutExpired:
        return {"error": f"not done after {_LONGEST:.0f} s"}
    if ended.returncode != 0:
        lines = ended.stderr.strip().splitlines() or ["no word"]
        return {"error": lines[-1]}
    record: Record = json.loads(ended.stdout.strip().splitlines()[-1])
    return {k: columns(v) if k in ("answers", "first", "again") else v for k, v in record.items()}


class Run:
    """The jobs of a run, told as they end."""

    def __init__(self, amount: Amount, problems: list[str], methods: list[str], cache: str | None):
        """What to measure, and where compiled kernels go."""
        self.amount, self.problems, self.methods, self._cache = amount, problems, methods, cache
        self.began = time.perf_counter()
        self.results: Record = {
            "search": {}, "local": {}, "measure": {}, "arms": {}, "effort": {}
        }  # fmt: skip

    def _do(self, group: str, key: str, method: str, wanted: Record) -> None:
        record = job(wanted | {"method": method.split("@")[0]}, self._cache)
        self.results[group].setdefault(key, {})[method] = record
        word = record.get("error", "done")
        clock = time.perf_counter() - self.began
        print(f"{clock:6.0f} s  {group:8} {key:20} {method:14} {word}", flush=True)

    def all(self) -> Record:
        """Every job."""
        amount = self.amount
        copose = [method for method in self.methods if method.startswith("copose")]
        for name in self.problems:
            table = amount.main if name == MAIN else amount.other
            for method in self.methods:
                count, seconds = table.get(method, table["peer"])
                wanted = {"job": "search", "case": name, "count": count, "seconds": seconds}
                self._do("search", name, method, wanted)
        for name in (p for p in amount.local_problems if p in self.problems):
            for method in self.methods:
                wanted = {"job": "local", "case": name, "count": amount.local, "seconds": 30.0}
                self._do("local", name, method, wanted)
        if MAIN in self.problems:
            wanted = {"job": "measure", "case": MAIN, "count": amount.measured, "seconds": 10.0}
            for method in (*copose, "numpy"):
                self._do("measure", MAIN, method, wanted)
        for count in amount.arms if "copose" in self.methods and MAIN in self.problems else ():
            wanted = {"job": "search", "case": f"ring-{count}", "count": amount.arms_seeds,
                      "seconds": 120.0}  # fmt: skip
            self._do("arms", str(count), "copose", wanted)
        for name in (p for p in amount.effort_problems if p in self.problems and copose):
            for effort in _EFFORTS:
                wanted = {"job": "search", "case": name, "count": amount.effort_seeds,
                          "seconds": 60.0, "effort": effort}  # fmt: skip
                self._do("effort", name, f"copose@{effort}", wanted)
        return self.results


def chosen(given: str | None, allowed: tuple[str, ...], default: tuple[str, ...]) -> list[str]:
    """Names of a comma-separated option, or an exit that lists the legal ones."""
    names = list(default) if given is None else given.split(",")
    for name in names:
        if name not in allowed:
            raise SystemExit(f"{name!r} is not known; choose from {', '.join(allowed)}")
    return names


def write(results: Record, output: Path) -> None:
    """The table, the figure and the raw numbers."""
    output.mkdir(parents=True, exist_ok=True)
    text = json.dumps(results, separators=(",", ":"), allow_nan=False)
    (output / "results.json").write_text(text + "\n")
    (output / "results.md").write_text(report(results))
    draw(results, output / "results.png")


def main() -> None:
    """Measure, write, and say where."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few seeds of three problems")
    parser.add_argument("--problems", help=f"comma-separated, of {', '.join(NAMES)}")
    parser.add_argument("--methods", help=f"comma-separated, of {', '.join(METHODS)}")
    parser.add_argument("--output", type=Path, default=HERE / "results")
    arguments = parser.parse_args()
    problems = chosen(arguments.problems, NAMES, QUICK if arguments.quick else NAMES)
    methods = chosen(arguments.methods, METHODS, METHODS)
    skipped = [m for m in methods if m in PEERS and not PEERS[m].available()]
    for method in skipped:
        print(f"{LABELS[method]} is skipped: {PEERS[method].needs} is not installed ([bench])")
    methods = [method for method in methods if method not in skipped]
    amount = QUICKLY if arguments.quick else FULLY
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as empty:
        run = Run(amount, problems, methods, None if arguments.quick else empty)
        results: dict[str, Any] = run.all()
    results |= {
        "machine": facts(),
        "quick": arguments.quick,
        "skipped": [LABELS[method] for method in skipped],
        "seconds": round(time.perf_counter() - began),
    }
    write(results, arguments.output)
    print(f"written to {arguments.output}")
    failed = failures(results)
    if failed:
        raise SystemExit(f"{len(failed)} jobs failed; the page says which")


if __name__ == "__main__":
    main()
