"""Results and checks as tables on a terminal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from copose.problem import SPACES, Problem
from copose.report import style
from copose.report.text.columns import (
    counted,
    heading,
    joint_table,
    lines,
    note_lines,
    sections,
    status_line,
    table,
    times,
    timing_line,
)
from copose.report.text.ellipsoids import closure_row, ellipsoid_rows
from copose.report.text.limits import joints_table, limit_lines, limit_rows, limit_tables
from copose.report.text.placement import case_tables, free_tables
from copose.report.text.starts import start_table
from copose.results import Solution
from copose.robots import ArmStart, Joint

# Local optima that are listed.
_OPTIMA = 5
# Joint positions that differ by less, rad or m, are the same.
_SAME = 1e-6


def solution_table(solution: Solution, *, verbose: bool = False) -> RenderableType:
    """What a result says, in the order in which a reader asks.

    Args:
        solution: the result.
        verbose: whether to list what was searched and how long it took.
    """
    parts: list[RenderableType] = [status_line(solution)]
    if solution.after is not None:
        parts += _posture(solution)
    elif solution.cases:
        parts += [*case_tables(solution), *free_tables(solution)]
    parts += [*note_lines(solution.notes), *map(Text, _evidence(solution, verbose))]
    return sections(parts)


def _posture(solution: Solution) -> Iterator[RenderableType]:
    """What was asked for, what limits it, the joints, and all else that is known of them."""
    after, before = solution.after, solution.before
    assert after is not None
    unit, gained = style.objective_unit(solution), style.gain_words(solution)
    words = f"{unit}, {style.gain(solution)}".removesuffix(", ") if unit else gained
    compared = before is not None
    values = solution.objective.before, solution.objective.after
    row = style.objective_name(solution), *map(style.six, values[not compared :]), words
    limited = [(name, *([was] * compared), now, unit)
               for name, was, now, unit in limit_rows(solution)]  # fmt: skip
    yield table(("", *style.stages(solution), ""), [row, *limited])
    yield from lines([*_unchanged(solution), *limit_lines(solution, after, before)])
    yield from [joints_table(solution), *free_tables(solution)]
    both = [(solution, posture) for posture in (before, after) if posture is not None]
    closure = closure_row(solution.problem.space, [[posture] for _, posture in both])
    yield table(("ellipsoid", *style.stages(solution)), [*ellipsoid_rows(both), closure])
    yield from limit_tables(solution)


def _unchanged(solution: Solution) -> Iterator[tuple[str, str]]:
    """Why nothing was gained, where the posture before is the best."""
    after, before = solution.after, solution.before
    if after is None or before is None or style.gain(solution) != "×1":
        return
    pairs = ((before.joints[arm], q) for arm, q in after.joints.items())
    if any(abs(a - b) > _SAME for pair in pairs for a, b in zip(*pair, strict=True)):
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


def _evidence(solution: Solution, verbose: bool) -> Iterator[str]:
    """What was found, and where it is asked for what was searched and how long it took."""
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
            listed = [f"{o.objective:.6f} ×{o.count}" for o in optima[:_OPTIMA]]
            yield f"the best optima: {', '.join(listed) or 'none'}"
            for failure in search.failures:
                yield f"{failure.status}: {times(failure.count)}"
        if again is not None:
            verdict = "stands" if again.stands else "did not stand"
            value = "nothing" if again.objective is None else f"{again.objective:.6f}"
            yield f"the answer {verdict}: seed {again.seed} with twice the effort found {value}"
    if verbose:
        yield timing_line(solution.timing)
    if search is not None and optima:
        found = counted(len(optima), "local optimum", "local optima")
        best = "the best met" if len(optima) > 1 else "met"
        where = "" if placements is None else f", {counted(placements.tried, 'placement')} tried"
        starts = counted(search.starts, "start")
        # Climbs are given up where a bound says that they cannot come up to the best.
        counts = [failure.count for failure in search.failures if "Best" in failure.status]
        behind, lost = sum(counts), sum(f.count for f in search.failures) - sum(counts)
        ends = [f"{behind:,} given up as they could not beat it"] if behind else []
        ends += [f"{lost:,} ended in none"] if lost else []
        none = f" ({', '.join(ends)})" if ends else ""
        yield f"{found}; {best} {times(optima[0].count)} from {starts}{none}{where}"


def chains(
    problem: Problem, starts: tuple[ArmStart, ...], notes: tuple[str, ...], way: str | None
) -> RenderableType:
    """The chains as they were read: joints in order, limits, efforts, what was locked; where they
    are at the start; and the way of the object, where it has one.
    """
    parts: list[RenderableType] = [heading(problem.name, problem.task.space)]
    arms = [start.arm for start in starts]
    for arm in arms:
        parts.append(Text(f"{arm.name}: {arm.model}, {counted(arm.n, 'joint')}"))
        if arm.locked:
            held = ", ".join(f"{joint.name} = {joint.position:g}" for joint in arm.locked)
            parts.append(Text(f"{arm.name}: locked: {held}"))
        if arm.fixed:
            parts.append(Text(f"{arm.name}: fixed: held at its start"))
    shown: dict[str, Callable[[Joint], str]] = {
        "kind": lambda joint: joint.kind,
        "lower": lambda joint: _limit(joint.lower, ".4f"),
        "upper": lambda joint: _limit(joint.upper, ".4f"),
        "effort": lambda joint: _limit(joint.effort, "g"),
        "speed": lambda joint: _limit(joint.velocity, "g"),
        "armature": lambda joint: f"{joint.armature:g}",
    }
    columns = {
        title: {arm.name: list(map(show, arm.joints)) for arm in arms}
        for title, show in shown.items()
    }
    parts.append(joint_table({arm.name: arm.joint_names for arm in arms}, columns))
    parts += start_table(problem, starts)
    if way is not None:
        parts.append(Text(way))
    parts += note_lines(notes)
    return sections(parts)


def guesses(made: Sequence[str]) -> RenderableType:
    """What a problem file was made with that nobody gave."""
    return Group(Text("guessed:"), *lines((" ", guess) for guess in made))


def _limit(value: float, digits: str) -> str:
    return "none" if math.isinf(value) else format(value, digits)
