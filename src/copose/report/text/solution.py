"""A result as tables on a terminal."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import RenderableType

from copose.problem import SPACES
from copose.report.text.columns import answer_page, counted, lines, table, times, timing_line
from copose.report.text.ellipsoids import closure_row, companion_tables, ellipsoid_rows
from copose.report.text.extremes import extreme_tables
from copose.report.text.limits import joints_table, limit_lines, limit_rows
from copose.report.text.placement import case_tables, free_tables
from copose.report.words import (
    evidence_words,
    gain_words,
    objective_name,
    objective_unit,
    result_gain,
    six,
    stage_titles,
)
from copose.results import Solution


def solution_table(solution: Solution, *, verbose: bool = False) -> RenderableType:
    """The tables of a result, in the order in which a reader asks; verbose also what was searched
    and how long it took.
    """
    tables: list[RenderableType] = []
    if solution.after is not None:
        tables += _posture(solution)
    elif solution.cases:
        tables += [*case_tables(solution), *free_tables(solution)]
    return answer_page(solution, tables, _evidence(solution, verbose))


def _posture(solution: Solution) -> Iterator[RenderableType]:
    """The objective, limits that it meets, joints, ellipsoids, and extremes."""
    after, before = solution.after, solution.before
    assert after is not None
    unit, gained = objective_unit(solution), gain_words(solution)
    words = f"{unit}, {result_gain(solution)}".removesuffix(", ") if unit else gained
    compared = before is not None
    values = solution.objective.before, solution.objective.after
    row = objective_name(solution), *map(six, values[not compared :]), words
    limited = [(name, *([was] * compared), now, unit)
               for name, was, now, unit in limit_rows(solution)]  # fmt: skip
    yield table(("", *stage_titles(solution), ""), [row, *limited])
    yield from lines([*_unchanged(solution), *limit_lines(solution, after, before)])
    yield from [joints_table(solution), *free_tables(solution)]
    both = [(solution, posture) for posture in (before, after) if posture is not None]
    closure = closure_row(solution.problem.space, [[posture] for _, posture in both])
    yield table(("ellipsoid", *stage_titles(solution)), [*ellipsoid_rows(both), closure])
    yield from extreme_tables(solution, after)
    yield from companion_tables(solution, after)


def _unchanged(solution: Solution) -> Iterator[tuple[str, str]]:
    """A line on why nothing was gained, where the posture before is the best."""
    after, before = solution.after, solution.before
    if after is None or before is None or result_gain(solution) != "×1":
        return
    # Within 1e-6 rad or m joints are where they were.
    pairs = ((before.joints[arm], q) for arm, q in after.joints.items())
    if any(abs(a - b) > 1e-6 for pair in pairs for a, b in zip(*pair, strict=True)):
        return
    m = SPACES[solution.problem.space].m
    held = {arm: all(x.lower is not None and x.lower == x.upper for x in limits)
            for arm, limits in solution.limits.items()}  # fmt: skip
    spare = any(len(names) > m and not held.get(arm) for arm, names in solution.joint_names.items())
    if spare or solution.freedom:
        yield "×1:", "the posture before is the best that was found"
    else:
        yield (
            "×1:",
            "nothing was free: the arms have no joint to spare; ranges of [object.freedom], "
            "[arms.freedom.base] or [arms.freedom.grasp] would give freedom (copose manual cells)",
        )


def _evidence(solution: Solution, verbose: bool, *, most: int = 5) -> Iterator[str]:
    """Lines on the search: local optima, and with ``verbose`` samples, failures and times."""
    search = solution.search
    if search is not None:
        again, optima, placements = search.verification, search.local_optima, search.placements
        if verbose:
            if placements is not None:
                yield (
                    f"{counted(placements.tried, 'placement')} tried, {placements.closed:,} of "
                    f"them closed, {placements.polished:,} polished"
                )
            postures = " × ".join(f"{sample.closed:,}" for sample in search.samples.values())
            best = "" if search.best_sample is None else f", the best {search.best_sample:.6f}"
            yield (
                f"{postures or 'no'} closed postures, {counted(search.combinations, 'combination')}"
                f"{best} (seed {search.seed}, {search.effort} effort)"
            )
            listed = [f"{o.objective:.6f} ×{o.count}" for o in optima[:most]]
            yield f"the best optima: {', '.join(listed) or 'none'}"
            for failure in search.failures:
                yield f"{failure.status}: {times(failure.count)}"
        if again is not None:
            verdict = "stands" if again.stands else "did not stand"
            value = "nothing" if again.objective is None else f"{again.objective:.6f}"
            yield f"the answer {verdict}: seed {again.seed} with twice the effort found {value}"
        if search.proof is not None:
            yield search.proof.statement
    if verbose:
        yield timing_line(solution.timing)
    if search is not None and optima:
        number = counted(len(optima), "local optimum", "local optima")
        best = "the best met" if len(optima) > 1 else "met"
        where = "" if placements is None else f", {counted(placements.tried, 'placement')} tried"
        starts = counted(search.starts, "start")
        # Climbs are given up where a bound says that they cannot come up to the best.
        counts = [failure.count for failure in search.failures if "Best" in failure.status]
        behind, lost = sum(counts), sum(f.count for f in search.failures) - sum(counts)
        ends = [f"{behind:,} given up as they could not beat it"] if behind else []
        ends += [f"{lost:,} ended in none"] if lost else []
        none = f" ({', '.join(ends)})" if ends else ""
        yield f"{number}; {best} {times(optima[0].count)} from {starts}{none}{where}"
    yield from filter(None, [evidence_words(solution)])
