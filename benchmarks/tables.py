"""The results as a Markdown page."""

from __future__ import annotations

import math

from cases import NAMES, case
from enumerate_optima import known
from peers import PEERS
from summary import (
    HIT,
    LABELS,
    MAIN,
    TOLERANCES,
    Found,
    Record,
    found,
    local_times,
    ratios,
    searches,
    slope,
)


def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table; columns after the first are aligned to the right."""
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def duration(seconds: float | None) -> str:
    """Seconds in the unit that suits them, three digits."""
    if seconds is None or not math.isfinite(seconds):
        return "–"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}" if seconds < 1000 else f"{seconds:.0f} s"
    return f"{seconds:.1e} s"


def share(part: float, whole: int) -> str:
    """A count of all."""
    return f"{round(part)}/{whole}"


def expected(figures: Found | None) -> str:
    """Time to the optimum; a bound from below where it was never met."""
    if figures is None:
        return "–"
    if figures.expected is None:
        return f"> {duration(figures.spent)} (0/{figures.runs})"
    return f"{duration(figures.expected)} ({share(figures.hits, figures.runs)})"


def report(results: Record) -> str:
    """The whole page."""
    parts = [_head(results), _asked(results), _main(results), _local(results), _measure(results)]
    parts += [_copose(results), _peers(results), _tolerances(results), _arms(results)]
    parts += [_effort(results), _errors(results)]
    return "\n".join(part for part in parts if part)


def _head(results: Record) -> str:
    machine = ", ".join(f"{key} {value}" for key, value in results["machine"].items())
    kind = "Quick" if results["quick"] else "Full"
    skipped = f" Skipped: {', '.join(results['skipped'])}." if results["skipped"] else ""
    return f"""# Benchmark results

{kind} run of `benchmarks/run.py`, {duration(results["seconds"])}, one measurement at a time.
{machine}.{skipped}

A *hit* is an answer within {HIT:g} of the best known objective (`known_optima.json`, found by
enumeration) whose closure and limits hold to 1e-6 by Pinocchio. *Time to the optimum* is the mean
time of a run over the hit rate. A run of copose is one global search after building, its own
projections included; a run of a peer is one local solve from a random posture that is closed
already: *with closing the starts* adds what that took. The standard error of such a time is about
its 1/√hits. Best read as ratios: all times are of this run.

![Results](results.png)
"""


def _asked(results: Record) -> str:
    rows = [
        [what, asked, "–" if value is None else f"{value:.3g}"]
        for what, asked, value in ratios(results)
    ]
    return "## What is asked\n\n" + table(["ratio on two-panda-box", "asked", "measured"], rows)


def _main(results: Record) -> str:
    figures = searches(results).get(MAIN, {})
    rows = []
    for method, f in figures.items():
        record = results["search"][MAIN][method]
        build = duration(record["build_s"])
        if record.get("compile_s", 0.0) > 0.05:
            build += f" + {duration(record['compile_s'])}"
        rows.append(
            [LABELS[method], str(f.runs), share(f.success[1] * f.runs, f.runs),
             share(f.hits, f.runs), duration(f.seconds), duration(f.expected),
             duration(f.expected_with_closing) if f.closing else "", build,
             f"{record['memory']:.0f} MB, +{record['memory'] - record['memory_before']:.0f}"]
        )  # fmt: skip
    head = ["method", "runs", "true answers", "hits", "a run, median", "time to the optimum",
            "with closing the starts", "building", "peak memory"]  # fmt: skip
    note = (
        "Building: graphs and functions, + waiting for kernels of the C compiler. Memory: of the\n"
        "whole process, + since what it imports and its starts are there.\n"
    )
    return f"## {MAIN}\n\n" + table(head, rows) + "\n" + note if rows else ""


def _local(results: Record) -> str:
    rows = []
    for name, methods in results["local"].items():
        for method, record in methods.items():
            times = local_times(record)
            if times is not None:
                rows.append([name, LABELS[method], *map(duration, times)])
    head = ["problem", "method", "from a closed start", "after the object moved 5 mm"]
    return "## Local solves, median\n\n" + table(head, rows) if rows else ""


def _measure(results: Record) -> str:
    rows = []
    for methods in results["measure"].values():
        for method, record in methods.items():
            if "per_second" in record:
                label = LABELS.get(method, "numpy + Pinocchio loop")
                rows.append([label, f"{record['per_second']:,.0f}"])
    return f"## Postures per second, {MAIN}\n\n" + table(["method", "1/s"], rows) if rows else ""


def _copose(results: Record) -> str:
    rows = []
    for name, methods in searches(results).items():
        best = known().get(name, {})
        for method, f in methods.items():
            if method not in PEERS:
                rows.append(
                    [name, case(name).kind, method.removeprefix("copose-"),
                     results["search"][name][method]["effort"], share(f.hits, f.runs),
                     share(f.same, f.runs), f"{f.gap:.0e}", duration(f.seconds),
                     f"{f.closure:.0e}", str(best.get("local_optima", "–"))]
                )  # fmt: skip
    head = ["problem", "objective", "method", "effort", "hits", "same joints", "gap",
            "search, median", "worst closure", "known local optima"]  # fmt: skip
    about = "".join(
        f"- `{name}`: {case(name).what}\n" for name in NAMES if name in results["search"]
    )
    note = "Gap: of the best answer below the best known objective; negative where it is better.\n"
    if not rows:
        return ""
    return "## copose on every problem\n\n" + table(head, rows) + "\n" + note + "\n" + about


def _peers(results: Record) -> str:
    methods = [m for m in LABELS if any(m in f for f in searches(results).values())]
    rows = [
        [name, *(expected(figures.get(method)) for method in methods)]
        for name, figures in searches(results).items()
    ]
    head = ["problem", *(LABELS[method] for method in methods)]
    return "## Time to the optimum (hits/runs)\n\n" + table(head, rows)


def _tolerances(results: Record) -> str:
    rows = []
    for method, label in LABELS.items():
        figures = [f[method] for f in searches(results).values() if method in f]
        if figures:
            shares = [
                100 * sum(f.success[k] for f in figures) / len(figures)
                for k in range(len(TOLERANCES))
            ]
            rows.append([label, *(f"{value:.1f} %" for value in shares)])
    head = ["method", *(f"to {tolerance:g}" for tolerance in TOLERANCES)]
    title = "## Success rate: converged, closed and within limits, mean over problems\n\n"
    return title + table(head, rows)


def _arms(results: Record) -> str:
    arms, seconds, steepness = slope(results)
    if not arms:
        return ""
    rows = [["search, median", *map(duration, seconds)]]
    told = "" if steepness is None else f"\nLog–log slope over 2 … 8 arms: {steepness:.2f}.\n"
    title = "## Identical arms round a plate (7 joints each), the same samples per arm\n\n"
    return title + table(["arms", *map(str, arms)], rows) + told


def _effort(results: Record) -> str:
    rows = []
    for name, efforts in results["effort"].items():
        for key, record in efforts.items():
            f = found(name, record)
            if f is not None:
                row = [name, key.split("@")[1], share(f.hits, f.runs), duration(f.seconds)]
                rows.append([*row, duration(f.expected)])
    head = ["problem", "effort", "hits", "search, median", "time to the optimum"]
    return "## Effort, that is samples\n\n" + table(head, rows) if rows else ""


def failures(results: Record) -> list[str]:
    """What was measured by which method, and why it failed."""
    return [
        f"- {group}, {key}, {method}: {record['error']}"
        for group in ("search", "local", "measure", "arms", "effort")
        for key, methods in results[group].items()
        for method, record in methods.items()
        if "error" in record
    ]


def _errors(results: Record) -> str:
    lines = failures(results)
    return "## Jobs that failed\n\n" + "\n".join(lines) + "\n" if lines else ""
