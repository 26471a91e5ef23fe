"""Extremes within torque limits as tables: accelerations, and the contact wrenches in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from copose.problem import SPACES
from copose.report.text.columns import aligned, table
from copose.report.words import acceleration_unit, stage_titles, three
from copose.results import Posture, Solution, WrenchRecord


def extreme_tables(solution: Solution, posture: Posture) -> list[RenderableType]:
    """Largest accelerations of the object and of joints, and contact wrenches."""
    return [
        *_accelerations(solution, posture),
        *_joint_accelerations(solution, posture),
        *_wrenches(solution, posture),
    ]


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
