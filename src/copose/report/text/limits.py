"""Limits of joints, torques and distances that a posture meets, as lines and columns of tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain

from rich.table import Table
from rich.text import Text

from copose.report.text.columns import joint_table, shared_beginning
from copose.report.words import (
    ANGULAR_AXES,
    acceleration_unit,
    answer_word,
    largest_share,
    objective_words,
    percent,
    three,
)
from copose.results import Posture, Solution


def limit_values(solution: Solution, posture: Posture) -> dict[str, tuple[float, str]]:
    """Numbers that torque limits decide, with their units, by name; those that a posture states."""
    values = {}
    if posture.payload is not None:
        values["payload"] = posture.payload, "kg"
    radii = [(solution.problem.axes, posture.residual_radius)]
    if posture.exact_sets:
        radii = [(exact.axes, exact.residual_radius) for exact in posture.exact_sets.values()]
    for axes, radius in radii:
        if radius is not None:
            values[f"residual radius, {_axes_kind(axes)}"] = radius, acceleration_unit(axes)
    return values


def _axes_kind(axes: Sequence[str]) -> str:
    """The kind of accelerations along some axes: angular or linear."""
    return "angular" if axes[0] in ANGULAR_AXES else "linear"


def limit_rows(solution: Solution) -> Iterator[tuple[str, str, str, str]]:
    """Rows of name, before, after and words: `limit_values` but for the objective itself."""
    meanings = {
        "payload": ", the most that can be held",
        "residual radius": ", all round from rest",
    }
    after, before = (
        {} if posture is None else limit_values(solution, posture)
        for posture in (solution.after, solution.before)
    )
    for name, (_, unit) in (before | after).items():
        kind = name.split(",")[0]
        if kind != objective_words(solution).stated:
            was, now = (three(values.get(name, (None,))[0]) for values in (before, after))
            yield name, was, now, unit + meanings[kind]


def limit_lines(
    solution: Solution, posture: Posture, before: Posture | None = None
) -> Iterator[tuple[str, str]]:
    """Limits that keep a posture from being better: joints, torques and bodies at, or near, them,
    and what they were before.
    """
    if _bounded(solution):
        ends = {
            arm: [("", " (lower)", " (upper)")[end] for end in joints]
            for arm, joints in _ends(solution, posture).items()
        }
        yield "at joint limits:", _joints(solution, lambda arm, k: ends[arm][k]) or "none"
    strained = (posture.torque_shares or {}).get(_deciding(solution, posture), {})
    if strained:
        words = _joints(solution, lambda arm, k: " " * _reaches(strained[arm][k], 1.0))
        yield "at torque limits:", words or "none"
    shares = posture.static_torque
    if shares:
        largest = largest_share(shares)
        words = _joints(solution, lambda arm, k: " " * _reaches(shares[arm][k], largest))
        earlier = before.static_torque if before is not None else None
        past = f"; before {percent(largest_share(earlier))} %" if earlier else ""
        yield "largest holding torque:", f"{percent(largest)} % of its limit, {words}{past}"
    if posture.collision is not None:
        was = before.collision if before is not None else None
        past = f"; before {three(was.distance)} m" if was is not None else ""
        distance = three(posture.collision.distance)
        yield "nearest bodies:", f"{distance} m, {' – '.join(posture.collision.pair)}{past}"


def _joints(solution: Solution, words: Callable[[str, int], str]) -> str:
    """Joints with the words on each, by arm: ``left j*: 2 (upper), 4``; without words left out."""
    listed = []
    for arm, names in solution.joint_names.items():
        told = [name + words(arm, k).rstrip() for k, name in enumerate(names) if words(arm, k)]
        begin = shared_beginning(names)
        if len(told) > 1 and begin:
            told = [f"{begin}*: {told[0].removeprefix(begin)}"] + [
                name.removeprefix(begin) for name in told[1:]
            ]
        if told:
            listed.append(f"{arm} {', '.join(told)}")
    return "; ".join(listed)


def _ends(solution: Solution, posture: Posture) -> dict[str, list[int]]:
    """The end of its range that each joint is at: 1 lower, 2 upper, 0 neither or held."""
    ends: dict[str, list[int]] = {}
    for arm, limits in solution.limits.items():
        ends[arm] = []
        for q, limit in zip(posture.joints[arm], limits, strict=True):
            lower, upper = limit.lower, limit.upper
            near = end_width(lower, upper)
            at = [end is not None and near > 0 and abs(q - end) <= near for end in (lower, upper)]
            ends[arm].append(at[0] + 2 * at[1] if sum(at) == 1 else 0)
    return ends


def end_width(lower: float | None, upper: float | None) -> float:
    """The width of an end of a range, rad or m: within it a value is at that end."""
    return 1e-4 * (upper - lower) if lower is not None and upper is not None else 1e-4


def _reaches(share: float, limit: float) -> bool:
    """True where a share of a torque limit is as large as another, but for rounding."""
    return share >= limit * (1 - 1e-6)


def _deciding(solution: Solution, posture: Posture) -> str:
    """The name of the extreme whose value the objective is; empty where there is none."""
    stated, records = objective_words(solution).stated, posture.accelerations or ()
    if not stated:
        return ""
    values = {f"{stated} {k + 1}": record.value for k, record in enumerate(records)}
    names = stated, f"{stated}, {_axes_kind(solution.problem.axes)}", *values
    stating = [name for name in names if name in (posture.torque_shares or {})]
    return min(stating, key=lambda name: values.get(name) or 0.0, default="")


def joints_table(solution: Solution) -> Table:
    """Joint positions, before and after, within their ranges, and shares of torque limits of a
    hold; limits that are met and the largest shares have a star.
    """
    after, before = solution.after, solution.before
    assert after is not None
    columns: dict[str, Mapping[str, Sequence[str | Text]]] = {}
    for title, posture in (("before", before), (answer_word(solution), after)):
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
        largest = largest_share(after.static_torque)
        columns["hold, %"] = {
            arm: [_share(share, largest) for share in shares]
            for arm, shares in after.static_torque.items()
        }
    return joint_table(solution.joint_names, columns)


def _share(share: float, largest: float) -> Text:
    """A share in percent, with a star where it is the largest, red above the limit."""
    star = "*" * _reaches(share, largest)
    return Text(star + percent(share), "bold red" if share > 1 else "bold" * bool(star))


def _four(value: float | None) -> str:
    return "–" if value is None else f"{value:.4f}"


def _bounded(solution: Solution) -> bool:
    """True where some joint is known to have a limit."""
    return any((x.lower, x.upper) != (None, None) for x in chain(*solution.limits.values()))
