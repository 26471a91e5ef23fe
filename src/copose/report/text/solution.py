"""A result as tables on a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from copose.problem import SPACES
from copose.report.text.columns import (
    aligned,
    answer_page,
    counted,
    joint_table,
    lines,
    table,
    times,
    timing_line,
)
from copose.report.text.ellipsoids import closure_row, companion_tables, ellipsoid_rows
from copose.report.text.limits import end_width, joints_table, limit_lines, limit_rows, limit_values
from copose.report.words import (
    acceleration_unit,
    evidence_words,
    gain_between,
    gain_words,
    has_before,
    objective_name,
    objective_unit,
    result_gain,
    six,
    stage_titles,
    three,
)
from copose.results import CasePosture, FreeRecord, Posture, Solution, WrenchRecord


def free_tables(solution: Solution) -> list[Table]:
    """A table of free coordinates: the range of each, and its offsets to the file's pose."""
    if all(record.after is None for record in solution.freedom):
        return []
    compared = has_before(solution)
    rows = [
        (
            record.name,
            f"{record.lower:g} … {record.upper:g}",
            *([offset(record.before)] * compared),
            offset(record.after),
            _meaning(record),
        )
        for record in solution.freedom
    ]
    return [table(("free, from the file's pose", "range", *stage_titles(solution), ""), rows)]


def offset(value: float | None) -> str:
    """An offset with its sign, m or rad; a dash where there is none."""
    return "–" if value is None else f"{round(value, 4) + 0.0:+.4f}"


def is_angle(name: str) -> bool:
    """True where a free coordinate, by its name, is an angle and no length."""
    return name.rpartition(".")[2] in ("roll", "pitch", "yaw", "angle", "twist")


def _meaning(record: FreeRecord) -> str:
    """Unit, an angle in degrees too, and whether a wider range would have let it go on."""
    now = record.after
    if not is_angle(record.name):
        words = "m"
    else:
        words = "rad" if now is None else f"rad, {round(math.degrees(now), 1) + 0.0:+g}°"
    if now is not None:
        near = end_width(record.lower, record.upper)
        for word, end in (("lower", record.lower), ("upper", record.upper)):
            if abs(now - end) <= near:
                words += f", at its {word} end"
    return words


def case_tables(solution: Solution, *, most: int = 6, a_row: int = 3) -> Iterator[RenderableType]:
    """Weight and objective of every case with the total, limits that it meets, and joints of the
    first cases, some beside one another.
    """
    cases, past = solution.cases or (), solution.cases_before or ()
    yield _objectives(solution, cases, past)
    earlier = {case.name: case for case in past}
    yield from lines(
        (f"{case.name}: {about}", words)
        for case in cases
        for about, words in limit_lines(solution, case, earlier.get(case.name))
    )
    listed = cases[:most]
    for i in range(0, len(listed), a_row):
        yield joint_table(solution.joint_names, {
            case.name: {arm: [f"{x:.4f}" for x in q] for arm, q in case.joints.items()}
            for case in listed[i : i + a_row]
        })  # fmt: skip
    if len(cases) > most:
        yield Text(f"joints of {len(cases) - most} more cases: in result.json", style="dim")
    yield _figures(solution, cases, past)


def _objectives(
    solution: Solution, cases: Sequence[CasePosture], past: Sequence[CasePosture]
) -> Table:
    """A table with a row for each case and the total."""
    unit, earlier = objective_unit(solution), {case.name: case.objective for case in past}
    name = objective_name(solution)
    rows = []
    for case in cases:
        was = earlier.get(case.name)
        cells = [six(was)] * bool(past) + [six(case.objective)]
        gained = gain_between(solution, was, case.objective)
        words = ", ".join(filter(None, (f"{name} {unit}".rstrip(), gained)))
        rows.append((case.name, f"{case.weight:g}", *cells, words))
    objective = solution.objective
    totals = [six(objective.before)] * bool(past) + [six(objective.after)]
    gained = result_gain(solution)
    words = "Σ weight · objective" + (f", {gained} on average" if gained else "")
    rows.append(("total", "", *totals, words))
    return table(("case", "weight", *stage_titles(solution), ""), rows)


def _figures(
    solution: Solution, cases: Sequence[CasePosture], past: Sequence[CasePosture]
) -> Table:
    """A table of the numbers that torque limits decide, and of the closure error, in all cases."""
    earlier = {case.name: case for case in past}
    rows = []
    for case in cases:
        values = limit_values(solution, case)
        old = limit_values(solution, earlier[case.name]) if case.name in earlier else {}
        for name, (value, unit) in values.items():
            was = three(old.get(name, (None,))[0])
            cells = [was] * bool(past) + [three(value)]
            rows.append((f"{case.name}: {name}, {unit}", *cells))
    rows.append(closure_row(solution.problem.space, [group for group in (past, cases) if group]))
    return table(("in all cases", *stage_titles(solution)), rows)


def _when(solution: Solution) -> str:
    """The word that tells the posture after from the one before."""
    return " after" if solution.before is not None else ""


def _accelerations(solution: Solution, posture: Posture) -> list[Table]:
    """A table with a row for each direction, with its opposite where that is known too."""
    after = _values(posture)
    if not after:
        return []
    shown = [after] if solution.before is None else [_values(solution.before), after]
    pairs: list[tuple[tuple[float, ...], ...]] = []
    for u in after:
        back = tuple(-x for x in u)
        if (back, u) not in pairs:
            pairs.append((u, back) if back in after else (u,))
    columns = [
        aligned([[three(values.get(u)) for u in pair] for pair in pairs], " / ") for values in shown
    ]
    names, rows = SPACES[solution.problem.space].coordinates, []
    for pair, *cells in zip(pairs, *columns, strict=True):
        touched = [name for name, x in zip(names, pair[0], strict=True) if x]
        words = " / ".join(_direction(u, names) for u in pair)
        rows.append((words, *cells, acceleration_unit(touched)))
    titles = "largest acceleration, others zero", *stage_titles(solution), ""
    return [table(titles, rows)]


def _joint_accelerations(solution: Solution, posture: Posture) -> list[Table]:
    """A table of the largest joint acceleration in each extreme and its opposite."""
    largest = {
        _extreme(name, posture, solution): max(max(map(abs, part)) for part in by_arm.values())
        for name, by_arm in (posture.joint_accelerations or {}).items()
    }
    rows: dict[str, list[str]] = {}
    for title, size in largest.items():
        name = title.removeprefix("acceleration ").replace("residual radius", "all round")
        back = name.replace("−", "+", 1) if name.startswith("−") else ""
        if back in rows:
            rows[f"{back} / {name}"] = [*rows.pop(back), three(size)]
        else:
            rows[name] = [three(size)]
    if not rows:
        return []
    titles = f"joint accelerations{_when(solution)}", "largest, rad/s² or m/s²"
    return [table(titles, zip(rows, aligned(list(rows.values()), " / "), strict=True))]


def _values(posture: Posture) -> dict[tuple[float, ...], float | None]:
    """Largest accelerations by direction."""
    records = posture.accelerations or ()
    return {tuple(round(x, 9) for x in record.direction): record.value for record in records}


def _direction(u: Sequence[float], names: Sequence[str]) -> str:
    """A direction in words: ``+x``, ``0.6 x − 0.8 y``."""
    parts = [(x, name) for x, name in zip(u, names, strict=True) if x]
    if len(parts) == 1:
        return f"{_sign(parts[0][0])}{parts[0][1]}"
    words = " ".join(f"{_sign(x)} {abs(x):.2g} {name}" for x, name in parts)
    return words.removeprefix("+ ")


def _sign(x: float) -> str:
    return "−" if x < 0 else "+"


def _wrenches(
    solution: Solution, posture: Posture, *, most: int = 8, a_row: int = 2
) -> list[RenderableType]:
    """Tables with a row for each extreme, of many only for those that are not along an axis: sizes
    of every arm's force, moment and internal force, some arms beside one another.
    """
    wrenches = posture.wrenches
    if not wrenches:
        return []
    titles = {name: _extreme(name, posture, solution) for name in wrenches}
    # The objective's direction may be along one of the axes.
    distinct = {title: name for name, title in reversed(titles.items())}
    listed = {name: title for name, title in titles.items() if distinct[title] == name}
    left_out = 0
    if len(listed) > most:
        own = {name: title for name, title in listed.items() if not _along_axis(name)}
        listed, left_out = own, len(listed) - len(own)
    space = SPACES[solution.problem.space]
    unit = "N / N·m / N" if space.rigid else "N / N"
    meaning = "force / moment / internal" if space.rigid else "force / internal"
    arms = list(posture.arms)
    tables: list[RenderableType] = []
    for i in range(0, len(arms), a_row):
        columns = [
            aligned([_sizes(wrenches[name][arm], len(space.linear)) for name in listed], " / ")
            for arm in arms[i : i + a_row]
        ]
        heads = (
            f"contact wrenches{_when(solution)},\n{meaning}",
            *(f"{arm}\n{unit}" for arm in arms[i : i + a_row]),
        )
        tables.append(table(heads, zip(listed.values(), *columns, strict=True)))
    if left_out:
        tables.append(Text(f"contact wrenches of {left_out} more: in result.json", style="dim"))
    return tables


def _along_axis(name: str) -> bool:
    """True where an extreme is along a coordinate, by its name."""
    return name.startswith(("acceleration +", "acceleration −"))


def _extreme(name: str, posture: Posture, solution: Solution) -> str:
    """The title of an extreme; one of the objective's directions is spelt out."""
    kind, _, which = name.partition(" ")
    if kind != "acceleration" or _along_axis(name):
        return name
    record = (posture.accelerations or ())[int(which or 1) - 1]
    u = [round(x, 9) for x in record.direction]
    return f"{kind} {_direction(u, SPACES[solution.problem.space].coordinates)}"


def _sizes(record: WrenchRecord, linear: int) -> list[str]:
    """Norms of the force, of the moment if contacts have one, and of the internal force."""
    parts = [record.wrench[:linear], record.wrench[linear:], record.internal[:linear]]
    return [three(float(np.linalg.norm(part))) for part in parts if part]


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
    for extremes in (_accelerations, _joint_accelerations, _wrenches):
        yield from extremes(solution, after)
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
