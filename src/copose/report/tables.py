"""Results and checks as tables on a terminal."""

from __future__ import annotations

import math

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from copose.capability import RESOLUTIONS
from copose.problem import SPACES, Problem
from copose.report import style
from copose.report.columns import (
    compared_table,
    counted,
    heading,
    note_lines,
    plain_table,
    status_line,
)
from copose.report.limits import limit_rows, limit_tables
from copose.report.placement import case_tables, distance_rows, free_tables, placement_lines
from copose.report.slices import angular_slice, linear_slice, semi_axes
from copose.report.starts import start_table
from copose.results import Solution
from copose.robots import ArmStart

# Local optima that are listed.
_OPTIMA = 5


def solution_table(solution: Solution) -> RenderableType:
    """What a result says, in the order in which a reader asks."""
    parts: list[RenderableType] = []
    parts.append(status_line(solution))
    if solution.after is not None:
        parts += [_numbers(solution), _volumes(solution)]
        parts += [*limit_tables(solution), _joints(solution), *free_tables(solution)]
    elif solution.cases:
        parts += [*case_tables(solution), *free_tables(solution)]
    parts.append(Text(_evidence(solution)))
    parts += note_lines(solution.notes)
    return Group(*parts)


def _numbers(solution: Solution) -> Table:
    after = solution.after
    assert after is not None
    compared = solution.before is not None
    table = compared_table(solution, "")

    def row(name: str, before: str, now: str, words: str = "") -> None:
        table.add_row(*([name, before, now, words] if compared else [name, now, words]))

    objective, unit = solution.objective, style.objective_unit(solution)
    gained = ", ".join(filter(None, (unit, style.gain(solution))))
    said = gained if unit else style.gain_words(solution)
    values = style.six(objective.before), style.six(objective.after)
    row(style.objective_name(solution), *values, said)
    before = solution.before
    axes = solution.problem.axes
    titles = ("linear semi-axes", "angular semi-axes")
    kinds = zip(titles, (linear_slice, angular_slice), style.units(solution), strict=True)
    for title, part, unit in kinds:
        found = part(after.ellipsoid, axes)
        if found is not None:
            was = part(before.ellipsoid, axes) if before is not None else None
            row(title, semi_axes(was), semi_axes(found), unit)
    if any(after.ellipsoid.center or ()):
        past = style.numbers(before.ellipsoid.center or ()) if before is not None else ""
        row("centre, at zero torque", past, style.numbers(after.ellipsoid.center or ()), "")
    for limit in limit_rows(solution):
        row(*limit)
    space = SPACES[solution.problem.space]
    errors = [p.closure_error for p in (solution.before, after) if p is not None]
    closure = [f"{max(error.values()):.1e}" for error in errors]
    row("closure error", closure[0], closure[-1], "m, rad" if space.rigid else "m")
    for distance in distance_rows([solution.before] if solution.before else [], [after]):
        row(*distance)
    return table


def _volumes(solution: Solution) -> Table:
    """Both resolutions' volumes, whichever is optimised, and what each assumes."""
    table = compared_table(solution, "log-volume")
    after, before = solution.after, solution.before
    assert after is not None
    for name, volume in after.log_volumes.items():
        values = [style.six(volume)]
        if before is not None:
            values.insert(0, style.six(before.log_volumes.get(name)))
        table.add_row(name, *values, RESOLUTIONS[name].assumes)
    return table


def _joints(solution: Solution) -> Table:
    after = solution.after
    assert after is not None
    table = plain_table(
        "arm", "joints after, rad or m" if style.now(solution) == "after" else "joints"
    )
    for name, positions in after.joints.items():
        table.add_row(Text(name), " ".join(f"{position:.4f}" for position in positions))
    return table


def _evidence(solution: Solution) -> str:
    """What was searched, what was found, and how long it took."""
    timing, search = solution.timing, solution.search
    lines = [
        f"built in {timing.build_s:.2f} s, searched {timing.search_s:.2f} s ({timing.kernels})"
    ]
    if search is None:
        return lines[0]
    placements = placement_lines(search)
    if not search.local_optima:
        return "\n".join([*placements, *lines])
    best = search.local_optima
    listed = [f"{o.objective:.6f}" + (f" ×{o.count}" if o.count > 1 else "") for o in best]
    if len(listed) > _OPTIMA:
        listed = [*listed[:_OPTIMA], "…"]
    starts = counted(search.starts, "start")
    found = f"{counted(len(best), 'local optimum', 'local optima')} from {starts}: "
    lines.insert(0, found + ", ".join(listed))
    if search.samples:
        postures = " × ".join(str(sample.closed) for sample in search.samples.values())
        combined = f"{postures} closed postures, {counted(search.combinations, 'combination')}"
        if search.best_sample is not None:
            combined += f", the best {search.best_sample:.6f}"
        lines.insert(0, f"{combined} (seed {search.seed}, {search.effort} effort)")
    if search.failures:
        ways = ", ".join(f"{failure.status} ×{failure.count}" for failure in search.failures)
        lines.insert(-1, f"failed: {ways}")
    again = search.verification
    if again is not None:
        verdict = "stands" if again.stands else "did not stand"
        value = "nothing" if again.objective is None else f"{again.objective:.6f}"
        lines.insert(
            -1, f"the answer {verdict}: seed {again.seed} with twice the effort found {value}"
        )
    return "\n".join([*placements, *lines])


def chains(
    problem: Problem, starts: tuple[ArmStart, ...], notes: tuple[str, ...], way: str | None
) -> RenderableType:
    """The chains as they were read: joints in order, limits, efforts, what was locked; where they
    are at the start; and the way of the object, where it has one.
    """
    parts: list[RenderableType] = [heading(problem.name, problem.task.space)]
    for arm in (start.arm for start in starts):
        table = Table(
            title=Text(f"{arm.name}: {arm.model}, {arm.n} joints"),
            title_justify="left",
            show_edge=False,
            pad_edge=False,
        )
        table.add_column("joint", overflow="fold")
        for column in ("kind", "lower", "upper", "effort", "speed", "armature"):
            table.add_column(column, justify="right")
        for joint in arm.joints:
            limits = (joint.lower, joint.upper, joint.effort, joint.velocity)
            shown = [_limit(value) for value in limits]
            table.add_row(Text(joint.name), joint.kind, *shown, f"{joint.armature:g}")
        parts.append(table)
        if arm.locked:
            held = ", ".join(f"{joint.name} = {joint.position:g}" for joint in arm.locked)
            parts.append(Text(f"locked: {held}"))
        if arm.fixed:
            parts.append(Text("fixed: held at its start"))
        parts.append(Text(""))
    parts += [*start_table(problem, starts), Text("")]
    if way is not None:
        parts += [Text(way), Text("")]
    parts += note_lines(notes)
    return Group(*parts)


def _limit(value: float) -> str:
    return "none" if math.isinf(value) else f"{value:.5g}"
