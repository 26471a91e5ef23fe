"""What a result says of limits of joints, torques and distances, of velocities and of forces."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain

import numpy as np
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from copose.problem import SPACES
from copose.report import style
from copose.report.geometry.slices import angular_slice, linear_slice
from copose.report.text.columns import aligned, joint_table, shared_beginning, table
from copose.report.text.ellipsoids import radii_words
from copose.results import EllipsoidRecord, Posture, Solution, WrenchRecord

# Extremes whose contact wrenches are all listed.
_EXTREMES = 8
# Arms beside one another.
_ARMS = 2
# Numbers beside one another.
_COLUMNS = 6
# Shares of torque limits that differ by less, relative, are equally large.
_EQUAL = 1e-6
# A joint nearer to an end of its range, as a share of the range, is at that end.
_END = 1e-4

_MEANING = {
    "payload": ", the most that can be held",
    "residual radius": ", all round from rest",
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


def limit_lines(
    solution: Solution, posture: Posture, before: Posture | None = None
) -> Iterator[tuple[str, str]]:
    """What keeps a posture from being better: joints, torques and bodies at, or next to, a limit.

    Args:
        solution: whose it is.
        posture: after.
        before: what it is compared with.
    """
    if _bounded(solution):
        ends = {
            arm: [("", " (lower)", " (upper)")[end] for end in mine]
            for arm, mine in _ends(solution, posture).items()
        }
        yield "at joint limits:", _joints(solution, lambda arm, k: ends[arm][k]) or "none"
    strained = (posture.torque_shares or {}).get(_deciding(solution, posture), {})
    if strained:
        words = _joints(solution, lambda arm, k: " " * (strained[arm][k] >= 1 - _EQUAL))
        yield "at torque limits:", words or "none"
    shares = posture.static_torque
    if shares:
        largest = style.largest_share(shares)
        words = _joints(solution, lambda arm, k: " " * (shares[arm][k] >= largest * (1 - _EQUAL)))
        earlier = before.static_torque if before is not None else None
        past = f"; before {style.percent(style.largest_share(earlier))} %" if earlier else ""
        yield "largest holding torque:", f"{style.percent(largest)} % of its limit, {words}{past}"
    if posture.collision is not None:
        was = before.collision if before is not None else None
        past = f"; before {style.three(was.distance)} m" if was is not None else ""
        distance = style.three(posture.collision.distance)
        yield "nearest bodies:", f"{distance} m, {' – '.join(posture.collision.pair)}{past}"


def _joints(solution: Solution, words: Callable[[str, int], str]) -> str:
    """The joints of which there is something to say, by arm: ``left j*: 2 (upper), 4``."""
    found = []
    for arm, names in solution.joint_names.items():
        told = [name + words(arm, k).rstrip() for k, name in enumerate(names) if words(arm, k)]
        begin = shared_beginning(names)
        if len(told) > 1 and begin:
            told = [f"{begin}*: {told[0].removeprefix(begin)}"] + [
                name.removeprefix(begin) for name in told[1:]
            ]
        if told:
            found.append(f"{arm} {', '.join(told)}")
    return "; ".join(found)


def _ends(solution: Solution, posture: Posture) -> dict[str, list[int]]:
    """At which end of its range each joint is: 1 lower, 2 upper, 0 neither or held."""
    found: dict[str, list[int]] = {}
    for arm, limits in solution.limits.items():
        found[arm] = []
        for q, limit in zip(posture.joints[arm], limits, strict=True):
            lower, upper = limit.lower, limit.upper
            near = _END * (upper - lower) if lower is not None and upper is not None else _END
            at = [end is not None and near > 0 and abs(q - end) <= near for end in (lower, upper)]
            found[arm].append(at[0] + 2 * at[1] if sum(at) == 1 else 0)
    return found


def _deciding(solution: Solution, posture: Posture) -> str:
    """The extreme that the objective is the value of, by its name; empty where there is none."""
    kind, records = solution.objective.kind, posture.accelerations or ()
    if kind == "payload":
        return kind
    if kind == "all-round":
        angular = solution.problem.axes[0] in style.ANGULAR_AXES
        return f"residual radius, {'angular' if angular else 'linear'}"
    if kind != "acceleration":
        return ""
    values = {f"{kind} {k + 1}": record.value for k, record in enumerate(records)}
    own = [name for name in (kind, *values) if name in (posture.torque_shares or {})]
    return min(own, key=lambda name: values.get(name) or 0.0, default="")


def joints_table(solution: Solution) -> Table:
    """Joint positions, before and after, within their ranges, and shares of torque limits of a
    hold; limits that are met and the largest shares have a star.
    """
    after, before = solution.after, solution.before
    assert after is not None
    columns: dict[str, Mapping[str, Sequence[str | Text]]] = {}
    for title, posture in (("before", before), (style.now(solution), after)):
        if posture is not None:
            columns[title] = {arm: list(map(_four, q)) for arm, q in posture.joints.items()}
    if _bounded(solution):
        ends = _ends(solution, after)
        for k, title in enumerate(("lower", "upper"), 1):
            columns[title] = {
                arm: [
                    "*" * (end == k) + _four(getattr(limit, title))
                    for end, limit in zip(ends[arm], limits, strict=True)
                ]
                for arm, limits in solution.limits.items()
            }
    if after.static_torque:
        largest = style.largest_share(after.static_torque)
        columns["hold, %"] = {
            arm: [_share(share, largest) for share in shares]
            for arm, shares in after.static_torque.items()
        }
    return joint_table(solution.joint_names, columns)


def _share(share: float, largest: float) -> Text:
    """In percent, with a star where it is the largest, red above the limit."""
    star = "*" * (share >= largest * (1 - _EQUAL))
    return Text(star + style.percent(share), "bold red" if share > 1 else "bold" * bool(star))


def _four(value: float | None) -> str:
    return "–" if value is None else f"{value:.4f}"


def _bounded(solution: Solution) -> bool:
    """Whether some joint is known to have a limit."""
    return any((x.lower, x.upper) != (None, None) for x in chain(*solution.limits.values()))


def limit_tables(solution: Solution) -> list[RenderableType]:
    """Accelerations, contact wrenches, velocities and forces."""
    after = solution.after
    assert after is not None
    return [
        *_accelerations(solution, after),
        *_joint_accelerations(solution, after),
        *_wrenches(solution, after),
        *_companions(solution, after),
    ]


def _when(solution: Solution) -> str:
    return " after" if solution.before is not None else ""


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
    names, rows = SPACES[solution.problem.space].coordinates, []
    for pair, *cells in zip(pairs, *columns, strict=True):
        touched = [name for name, x in zip(names, pair[0], strict=True) if x]
        words = " / ".join(_direction(u, names) for u in pair)
        rows.append((words, *cells, style.plain_unit(touched)))
    titles = "largest acceleration, others zero", *style.stages(solution), ""
    return [table(titles, rows)]


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
    titles = f"joint accelerations{_when(solution)}", "largest, rad/s² or m/s²"
    return [table(titles, zip(rows, aligned(list(rows.values()), " / "), strict=True))]


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
    unit = "N / N·m / N" if space.rigid else "N / N"
    meaning = "force / moment / internal" if space.rigid else "force / internal"
    arms = list(posture.arms)
    tables: list[RenderableType] = []
    for i in range(0, len(arms), _ARMS):
        columns = [
            aligned([_sizes(wrenches[name][arm], len(space.linear)) for name in listed], " / ")
            for arm in arms[i : i + _ARMS]
        ]
        heads = (
            f"contact wrenches{_when(solution)},\n{meaning}",
            *(f"{arm}\n{unit}" for arm in arms[i : i + _ARMS]),
        )
        tables.append(table(heads, zip(listed.values(), *columns, strict=True)))
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


def _companions(solution: Solution, posture: Posture) -> Iterator[Table]:
    """A row for each ellipsoid of velocities and of forces: its linear and angular semi-axes, and
    how far it reaches along every axis and every direction of the objective.
    """
    found, axes = posture.companions or {}, solution.problem.axes
    limited = solution.problem.torque_scaling == "limits"
    torque = "at the torque limits" if limited else "per N·m of torque"
    velocities = {name: record for name, record in found.items() if "velocity" in name}
    internal = {name: record for name, record in found.items() if name == "internal force"}
    forces = {n: record for n, record in found.items() if n not in velocities | internal}
    for title, units, records in (
        ("velocities per unit joint speed", ("m/s", "rad/s"), velocities),
        (f"forces {torque}", ("N", "N·m"), forces),
    ):
        yield from _semi_axes(title, units, records, axes)
    records = velocities | forces
    longest = max((len(record.along or ()) for record in records.values()), default=0)
    words = [*axes, *(f"direction {k + 1}" for k in range(longest - len(axes)))][:longest]
    for i in range(0, longest, _COLUMNS):
        some = slice(i, i + _COLUMNS)
        rows = [
            (name, *map(style.three, (record.along or (None,) * longest)[some]))
            for name, record in records.items()
        ]
        yield table(("the same along", *words[some]), rows)
    unit = "N and N·m" if SPACES[solution.problem.space].rigid else "N"
    squeezed = []
    for name, record in internal.items():
        radii = [style.three(radius) for radius in record.radii or ()]
        if len(radii) > _COLUMNS:
            radii[_COLUMNS - 1 : -1] = ["…"]
        squeezed.append((name, "  ".join(radii) or "–"))
    if squeezed:
        yield table((f"forces between arms {torque}", f"semi-axes, {unit}"), squeezed)


def _semi_axes(
    title: str,
    units: tuple[str, str],
    records: Mapping[str, EllipsoidRecord],
    axes: Sequence[str],
) -> Iterator[Table]:
    """A row for each ellipsoid; nothing where no posture has one."""
    titles, columns = [title], []
    for part, word, unit in zip(
        (linear_slice, angular_slice), ("linear", "angular"), units, strict=True
    ):
        found = [part(record, axes) for record in records.values()]
        if any(found):
            titles.append(f"{word} semi-axes, {unit}")
            columns.append(aligned(list(map(radii_words, found)), "  "))
    if columns:
        yield table(titles, zip(records, *columns, strict=True))
