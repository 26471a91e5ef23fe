"""What a result says of torque limits, of velocities and of forces, as tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from copose.problem import SPACES
from copose.report import style
from copose.report.columns import aligned, compared_table, plain_table
from copose.report.slices import angular_slice, linear_slice, semi_axes
from copose.results import CompanionRecord, EllipsoidRecord, Posture, Solution, WrenchRecord

# Extremes whose contact wrenches are all listed, and arms beside one another.
_EXTREMES, _ARMS = 8, 3
# Semi-axes of internal forces that are listed.
_SEMI_AXES = 6
# Shares that differ by less, relative, are equally large.
_EQUAL = 1e-6

_MEANING = {
    "payload": ", the most that can be held",
    "residual radius": ", all round from rest",
    "largest holding torque": "",
}


def limit_values(solution: Solution, posture: Posture) -> dict[str, tuple[float, str]]:
    """Single numbers that torque limits decide, with their units, by name; what there is."""
    found = {}
    if posture.payload is not None:
        found["payload"] = posture.payload, "kg"
    radii = [(solution.problem.axes, posture.residual_radius)]
    if posture.exact_sets:
        radii = [(each.axes, each.residual_radius) for each in posture.exact_sets.values()]
    for axes, radius in radii:
        if radius is not None:
            kind = "angular" if axes[0] in style.ANGULAR_AXES else "linear"
            found[f"residual radius, {kind}"] = radius, style.plain_unit(axes)
    if posture.static_torque:
        found["largest holding torque"] = (
            100 * style.largest_share(posture.static_torque),
            "% of its limit",
        )
    return found


def limit_rows(solution: Solution) -> Iterator[tuple[str, str, str, str]]:
    """Name, before, after and words of what `limit_values` has beside the objective."""
    after, before = (
        {} if posture is None else limit_values(solution, posture)
        for posture in (solution.after, solution.before)
    )
    said = {"payload": "payload", "all-round": "residual radius"}.get(solution.objective.kind)
    for name, (_, unit) in (before | after).items():
        kind = name.split(",")[0]
        if kind != said:
            was, now = (style.three(found.get(name, (None,))[0]) for found in (before, after))
            yield name, was, now, unit + _MEANING[kind]


def limit_tables(solution: Solution) -> list[RenderableType]:
    """Shares of torque limits, accelerations, contact wrenches, velocities and forces."""
    after = solution.after
    assert after is not None
    return [
        *_shares(solution, after),
        *_accelerations(solution, after),
        *_joint_accelerations(solution, after),
        *_wrenches(solution, after),
        *_companions(solution, after),
    ]


def _when(solution: Solution) -> str:
    return " after" if solution.before is not None else ""


def _shares(solution: Solution, posture: Posture) -> list[Table]:
    """A row for each arm, a share of its limit for each joint; ``*`` largest, ``!`` too large."""
    shares = posture.static_torque
    if not shares:
        return []
    largest = style.largest_share(shares)
    over = largest > 1

    def words(share: float) -> str:
        mark = "!" * (share > 1) + "*" * (share >= largest * (1 - _EQUAL))
        return f"{style.percent(share)}{mark:<{1 + over}}"

    lines = aligned([[words(share) for share in mine] for mine in shares.values()], "  ")
    legend = "* largest, ! over the limit" if over else "* largest"
    title = f"torque to hold the object{_when(solution)}, % of each joint's limit ({legend})"
    table = plain_table("arm", title)
    for name, line in zip(shares, lines, strict=True):
        text = Text(line)
        text.highlight_regex(r"\S+\*", "bold")
        text.highlight_regex(r"\S+!\*?", "bold red")
        table.add_row(Text(name), text)
    return [table]


def _accelerations(solution: Solution, posture: Posture) -> list[Table]:
    """A row for each direction, with its opposite where that is known too."""
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
        aligned([[style.three(values.get(u)) for u in pair] for pair in pairs], " / ")
        for values in shown
    ]
    table = compared_table(solution, "largest acceleration, others zero")
    names = SPACES[solution.problem.space].coordinates
    for pair, *cells in zip(pairs, *columns, strict=True):
        touched = [name for name, x in zip(names, pair[0], strict=True) if x]
        words = " / ".join(_direction(u, names) for u in pair)
        table.add_row(words, *cells, style.plain_unit(touched))
    return [table]


def _joint_accelerations(solution: Solution, posture: Posture) -> list[Table]:
    """A row for each extreme, with its opposite: the largest of all joints."""
    largest = {
        _extreme(name, posture, solution): max(max(map(abs, part)) for part in by_arm.values())
        for name, by_arm in (posture.joint_accelerations or {}).items()
    }
    rows: dict[str, list[str]] = {}
    for title, size in largest.items():
        name = title.removeprefix("acceleration ").replace("residual radius", "all round")
        back = name.replace("−", "+", 1) if name.startswith("−") else ""
        if back in rows:
            rows[f"{back} / {name}"] = [*rows.pop(back), style.three(size)]
        else:
            rows[name] = [style.three(size)]
    if not rows:
        return []
    table = plain_table(f"joint accelerations{_when(solution)}")
    table.add_column("largest, rad/s² or m/s²", justify="right")
    for name, cell in zip(rows, aligned(list(rows.values()), " / "), strict=True):
        table.add_row(name, cell)
    return [table]


def _values(posture: Posture) -> dict[tuple[float, ...], float | None]:
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


def _wrenches(solution: Solution, posture: Posture) -> list[RenderableType]:
    """A row for each extreme, for each arm the sizes of its force, moment and internal force."""
    wrenches = posture.wrenches
    if not wrenches:
        return []
    titles = {name: _extreme(name, posture, solution) for name in wrenches}
    # The objective's direction may be along one of the axes.
    distinct = {title: name for name, title in reversed(titles.items())}
    listed = {name: title for name, title in titles.items() if distinct[title] == name}
    left_out = 0
    if len(listed) > _EXTREMES:
        own = {name: title for name, title in listed.items() if not _along_axis(name)}
        listed, left_out = own, len(listed) - len(own)
    space = SPACES[solution.problem.space]
    first, parts = f"contact wrenches{_when(solution)}", "N / N·m / N" if space.rigid else "N / N"
    meaning = "force / moment / internal force" if space.rigid else "force / internal force"
    arms = list(posture.arms)
    tables: list[RenderableType] = []
    for i in range(0, len(arms), _ARMS):
        some = arms[i : i + _ARMS]
        table = plain_table(f"{first}:\n{meaning}")
        columns = []
        for arm in some:
            table.add_column(Text(f"{arm}\n{parts}"), justify="right", overflow="fold")
            sizes = [_sizes(wrenches[name][arm], len(space.linear)) for name in listed]
            columns.append(aligned(sizes, " / "))
        for title, *cells in zip(listed.values(), *columns, strict=True):
            table.add_row(title, *cells)
        tables.append(table)
    if left_out:
        tables.append(Text(f"contact wrenches of {left_out} more: in result.json", style="dim"))
    return tables


def _along_axis(name: str) -> bool:
    return name.startswith(("acceleration +", "acceleration −"))


def _extreme(name: str, posture: Posture, solution: Solution) -> str:
    """What an extreme is called; one of the objective's directions is spelt out."""
    kind, _, which = name.partition(" ")
    if kind != "acceleration" or _along_axis(name):
        return name
    record = (posture.accelerations or ())[int(which or 1) - 1]
    u = [round(x, 9) for x in record.direction]
    return f"{kind} {_direction(u, SPACES[solution.problem.space].coordinates)}"


def _sizes(record: WrenchRecord, linear: int) -> list[str]:
    """Norms of the force, of the moment where there is one, of the internal force."""
    parts = [record.wrench[:linear], record.wrench[linear:], record.internal[:linear]]
    return [style.three(float(np.linalg.norm(part))) for part in parts if part]


def _companions(solution: Solution, posture: Posture) -> list[Table]:
    """A row for each ellipsoid of velocities and of forces: its linear and angular semi-axes."""
    found = posture.companions or {}
    limited = solution.problem.torque_scaling == "limits"
    torque = "at the torque limits" if limited else "per N·m of torque"
    velocities = {name: record for name, record in found.items() if "velocity" in name}
    internal = {name: record for name, record in found.items() if name == "internal force"}
    forces = {n: record for n, record in found.items() if n not in velocities | internal}
    tables = [
        _semi_axes("velocities per unit joint speed", ("m/s", "rad/s"), velocities, solution),
        _semi_axes(f"forces {torque}", ("N", "N·m"), forces, solution),
    ]
    along = _along(velocities | forces, solution)
    unit = "N and N·m" if SPACES[solution.problem.space].rigid else "N"
    squeeze = plain_table(f"forces between arms {torque}", f"semi-axes, {unit}")
    for name, record in internal.items():
        radii = [style.three(radius) for radius in record.radii or ()]
        if len(radii) > _SEMI_AXES:
            radii[_SEMI_AXES - 1 : -1] = ["…"]
        squeeze.add_row(name, ", ".join(radii) or "–")
    tables.append(along)
    return [table for table in (*tables, squeeze) if table is not None and table.row_count]


def _along(records: Mapping[str, CompanionRecord], solution: Solution) -> Table | None:
    """How far each reaches along every axis and every direction of the objective."""
    longest = max((len(record.along or ()) for record in records.values()), default=0)
    if not longest:
        return None
    table = plain_table("the same along")
    axes = solution.problem.axes
    for word in (*axes, *(f"direction {k + 1}" for k in range(longest - len(axes)))):
        table.add_column(word, justify="right")
    for name, record in records.items():
        cells = [style.three(value) for value in record.along or ()] or ["–"] * longest
        table.add_row(name, *cells)
    return table


def _semi_axes(
    title: str, units: tuple[str, str], records: Mapping[str, EllipsoidRecord], solution: Solution
) -> Table | None:
    """A row for each ellipsoid; None where no posture has one."""
    axes = solution.problem.axes
    table, columns = plain_table(title), []
    for part, word, unit in zip(
        (linear_slice, angular_slice), ("linear", "angular"), units, strict=True
    ):
        found = [part(record, axes) for record in records.values()]
        if any(found):
            table.add_column(f"{word} semi-axes, {unit}", justify="right")
            columns.append([semi_axes(each) for each in found])
    for name, *cells in zip(records, *columns, strict=True):
        table.add_row(name, *cells)
    return table if columns else None
