"""Everything that people build on the search, each against a baseline in the same run, as a page.

    python benchmarks/everything.py [NAME ...] [--quick] [--profile] [--page] [--output DIR]

Without names all rows of `rows.py` are measured, each in a process of its own, one at a time; with
names only these. What is measured is kept in `everything.json`, of which `everything.md` is made;
`--page` makes it of what is kept. `--profile` adds the five places where a search spends most. A
full run takes about half an hour, `--quick` about five minutes.

Seconds are of the processor, after building; those of copose are medians of the first five seeds.
A run hits where its value is within 1e-6 (1 + |best|) of the best of copose and all baselines. What
a baseline takes to the best is the time of all its tries over the number of those that hit.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from machine import facts
from rows import ROWS, Amount, profile
from tables import duration, table

Record = dict[str, Any]
HERE = Path(__file__).parent
HIT = 1e-6
FULLY, QUICKLY = Amount(20, 60.0), Amount(3, 6.0)
_LONGEST = 1200.0


def measured(name: str, amount: Amount, *, profiled: bool) -> Record:
    """A row, in a process of its own; a record with ``error`` where it fails."""
    command = [sys.executable, __file__, "--row", name, "--amount", str(amount.seeds),
               str(amount.budget), *(["--profile"] if profiled else [])]  # fmt: skip
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        ended = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False, timeout=_LONGEST
        )
    except subprocess.TimeoutExpired:
        return {"error": f"not done after {_LONGEST:.0f} s"}
    if ended.returncode != 0:
        return {"error": (ended.stderr.strip().splitlines() or ["no word"])[-1]}
    record: Record = json.loads(ended.stdout.strip().splitlines()[-1])
    return record


def row(name: str, amount: Amount, *, profiled: bool) -> Record:
    """A row measured here."""
    record = ROWS[name].measure(amount)
    record["seeds"] = amount.seeds
    if profiled:
        record["profile"] = profile(ROWS[name])
    return record


def best_of(record: Record) -> float | None:
    """The best value of copose and all baselines."""
    tries = [record["own"], *record["baselines"].values()]
    values = [value for each in tries for value in each["values"] if value is not None]
    return max(values, default=None)


def hits(each: Record, best: float | None) -> int:
    """How many runs reached the best."""
    if best is None:
        return 0
    floor = best - HIT * (1 + abs(best))
    return sum(value is not None and value >= floor for value in each["values"])


def compared(name: str, record: Record) -> list[list[str]]:
    """Lines of the first table: copose, then each baseline."""
    best, own = best_of(record), record["own"]
    typical = float(np.median(own["seconds"][:5]))
    target = ROWS[name].target
    lines = [
        [ROWS[name].what, "copose", duration(typical), duration(target), _rate(own, best),
         _value(own), duration(typical), "1"]
    ]  # fmt: skip
    for label, each in record["baselines"].items():
        one = float(np.median(each["seconds"])) if each["seconds"] else None
        to_best: float | None = one
        if best is not None:
            count = hits(each, best)
            to_best = sum(each["seconds"]) / count if count else None
        ratio = "–" if to_best is None else f"{to_best / typical:.3g}"
        reached = duration(to_best) if to_best is not None else f"not in {_spent(each)}"
        lines.append(
            ["", label, duration(one), "", _rate(each, best), _value(each), reached, ratio]
        )
    return lines


def _spent(each: Record) -> str:
    return duration(sum(each["seconds"]))


def _rate(each: Record, best: float | None) -> str:
    return "–" if best is None else f"{hits(each, best)}/{len(each['values'])}"


def _value(each: Record) -> str:
    return f"{value:.8g}" if (value := max_of(each)) is not None else "–"


def max_of(each: Record) -> float | None:
    """The best value of some runs."""
    return max((value for value in each["values"] if value is not None), default=None)


def growth(name: str, record: Record) -> list[str]:
    """A line of the second table: seconds by size, and the power with which they grow."""
    sizes = {int(size): float(np.median(each["seconds"]))
             for size, each in record["growth"].items()}  # fmt: skip
    x, y = np.log(list(sizes)), np.log(list(sizes.values()))
    power = f"{np.polyfit(x, y, 1)[0]:.2f}" if len(sizes) > 1 else "–"
    listed = ", ".join(f"{size}: {duration(seconds)}" for size, seconds in sizes.items())
    return [ROWS[name].what.removeprefix("growth in "), listed, power]


def page(stored: dict[str, Record]) -> str:
    """The page of Markdown, of what was measured."""
    done = {name: stored[name] for name in ROWS if name in stored}
    good = {name: record for name, record in done.items() if "error" not in record}
    lines = [line for name, each in good.items() if "own" in each for line in compared(name, each)]
    grown = [growth(name, record) for name, record in good.items() if "growth" in record]
    parts = ["# Everything", _INTRODUCTION]
    if lines:
        heads = ["work", "by", "one run", "to reach", "hits", "best", "to the best", "ratio"]
        parts.append(table(heads, lines))
    if grown:
        heads = ["in", "processor seconds, medians of 5 seeds", "power"]
        parts += ["## Growth", table(heads, grown)]
    profiled = {name: record["profile"] for name, record in good.items() if record.get("profile")}
    if profiled:
        parts.append("## Where the time goes")
    for name, places in profiled.items():
        rows = [
            [f"`{where}`", duration(own), f"{100 * share:.0f} %"] for where, own, share in places
        ]
        parts += [ROWS[name].what, table(["function", "own time, profiled", "share"], rows)]
    failed = [f"{name}: {record['error']}" for name, record in done.items() if "error" in record]
    parts += failed
    when = sorted({record["when"] for record in done.values()})
    machine = ", ".join(f"{key} {value}" for key, value in facts().items())
    parts.append(f"Measured {' … '.join(dict.fromkeys([*when[:1], *when[-1:]]))}. {machine}.")
    return "\n\n".join(part.rstrip() for part in parts) + "\n"


_INTRODUCTION = """\
`python benchmarks/everything.py`. Processor seconds after building, with compiled kernels. *One
run* is the median of the first five seeds of copose, or of all tries of a baseline. *Hits* are runs
within 1e-6 (1 + |best|) of the best value that anything came to. *To the best* is one run of
copose, and of a baseline the time of all its tries over its hits; *ratio* is that over copose's.
The plain program for `shortest` keeps limits by differences of its knots alone; copose's motions
keep them in the accelerations and torques that are reported, which takes longer."""


def main() -> None:
    """Measure, keep, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(ROWS)}")
    parser.add_argument("--quick", action="store_true", help="few seeds, little time")
    parser.add_argument("--profile", action="store_true", help="also where the time goes")
    parser.add_argument("--page", action="store_true", help="only the page of what is kept")
    parser.add_argument("--output", type=Path, default=HERE / "results")
    parser.add_argument("--row", help=argparse.SUPPRESS)
    parser.add_argument("--amount", nargs=2, type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.row:
        amount = Amount(int(arguments.amount[0]), arguments.amount[1])
        print("\n" + json.dumps(row(arguments.row, amount, profiled=arguments.profile)))
        return
    unknown = [name for name in arguments.names if name not in ROWS]
    if unknown:
        raise SystemExit(f"{unknown[0]!r} is not known; choose from {', '.join(ROWS)}")
    arguments.output.mkdir(parents=True, exist_ok=True)
    file = arguments.output / "everything.json"
    stored: dict[str, Record] = json.loads(file.read_text()) if file.exists() else {}
    began = time.perf_counter()
    for name in () if arguments.page else arguments.names or ROWS:
        amount = QUICKLY if arguments.quick else FULLY
        record = measured(name, amount, profiled=arguments.profile)
        stored[name] = record | {"when": time.strftime("%Y-%m-%d %H:%M")}
        file.write_text(json.dumps(stored, separators=(",", ":")) + "\n")
        word = record.get("error", "done")
        print(f"{time.perf_counter() - began:6.0f} s  {name:14} {word}", flush=True)
    (arguments.output / "everything.md").write_text(page(stored))
    print(f"written to {arguments.output / 'everything.md'}")


if __name__ == "__main__":
    main()
