"""A state in numbers, as HTML for the panel: value, gain, joints, semi-axes, notes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from copose.live.state import State
from copose.report.look import LOOK, arm_colors
from copose.report.numbers import six
from copose.report.text.columns import shared_beginning
from copose.report.text.ellipsoids import ellipsoid_rows
from copose.report.words import gain_words, objective_name, objective_unit
from copose.results import JointRecord, Solution

# Share of a joint's range within which it counts as at its limit.
_AT_LIMIT = 0.01
# Notes that are listed.
_NOTES = 6
_HINT = (
    '<div style="opacity: 0.7">Drag the arrows and arcs at the object: the arms follow at their '
    "best.</div>"
)
_SMALL = "font-size: 0.8em; line-height: 1.35; padding: 0 0.8em"
_BAR = "position: relative; height: 0.75em; background: rgba(128, 128, 128, 0.18); flex: 1"


def headline(state: State) -> str:
    """The objective now, at the start, and the gain; or why the arms do not hold the object."""
    shown = with_start(state)
    unit = objective_unit(shown)
    rows = (
        ("now", f"<b>{six(state.value)}</b>"),
        ("at the start", six(state.start_value)),
        ("gain", escape(gain_words(shown) or "–")),
    )
    cells = "".join(
        f'<tr><td style="padding-right: 1em">{name}</td><td id="copose-{name.split()[-1]}">{value}'
        "</td></tr>"
        for name, value in rows
    )
    title = escape(objective_name(shown)) + (f", {escape(unit)}" if unit else "")
    return (
        f'<div style="{_SMALL}"><div style="font-size: 1.1em"><b>{title}</b></div>'
        f"<table>{cells}</table>{_standing(state)}{_HINT}</div>"
    )


def _standing(state: State) -> str:
    """A line in colour on whether the object is held, and by what kind of posture."""
    if state.message:
        return f'<div id="copose-message" style="color: {LOOK.over}">{escape(state.message)}</div>'
    words, color = "a local optimum: where the hand rests, all is searched", LOOK.arms[2]
    if state.searched and state.left is not None:
        words, color = "the best that a search finds here; only with letting go", LOOK.arms[1]
    elif state.searched:
        words, color = "the best that a search finds here", LOOK.arms[1]
    return f'<div id="copose-message" style="color: {color}">{escape(words)}</div>'


def with_start(state: State) -> Solution:
    """The result that is shown, compared with the start of the page."""
    objective = state.solution.objective.model_copy(update={"before": state.start_value})
    return state.solution.model_copy(update={"objective": objective})


def joint_bars(state: State) -> str:
    """Each joint between its limits and each share of a torque limit, by arm."""
    posture = state.posture
    if posture is None:
        return ""
    solution, colors = state.solution, arm_colors(posture)
    blocks = []
    for arm, q in posture.joints.items():
        shares = None if state.shares is None else state.shares[arm]
        names = solution.joint_names[arm]
        begin = shared_beginning(names)
        rows = "".join(
            _joint_row(name, x, limits, colors[arm], share)
            for name, x, limits, share in zip(
                [name.removeprefix(begin) for name in names], q, solution.limits[arm],
                [None] * len(q) if shares is None else shares, strict=True,
            )
        )  # fmt: skip
        title = escape(f"{arm}: {begin}*" if begin else arm)
        look = f"color: {colors[arm]}; margin-top: 0.4em"
        blocks.append(f'<div style="{look}"><b>{title}</b></div>{rows}')
    bounded = any(None not in (x.lower, x.upper) for arm in solution.limits.values() for x in arm)
    told = "joint between its limits, rad or m" if bounded else "joint, rad or m"
    told += "" if state.shares is None else "; torque that holds the object, % of its limit"
    return f'<div style="{_SMALL}"><div style="opacity: 0.7">{told}</div>{"".join(blocks)}</div>'


def _joint_row(name: str, q: float, limits: JointRecord, color: str, share: float | None) -> str:
    """A joint's name, where it is between its limits, its position, and its torque's share."""
    mark = ""
    lower, upper = limits.lower, limits.upper
    if lower is not None and upper is not None and upper > lower:
        part = min(max((q - lower) / (upper - lower), 0.0), 1.0)
        near = part < _AT_LIMIT or part > 1 - _AT_LIMIT
        mark = (
            f'<div style="position: absolute; left: calc({100 * part:.1f}% - 2px); width: 4px; '
            f'height: 100%; background: {LOOK.over if near else color}"></div>'
        )
    torque = ""
    if share is not None:
        fill = LOOK.over if share > 1 else color
        torque = (
            f'<div style="{_BAR}; flex: 0.6"><div style="width: {100 * min(share, 1.0):.0f}%; '
            f'height: 100%; background: {fill}"></div></div>'
            f'<div style="width: 2.6em; text-align: right">{100 * share:.0f}%</div>'
        )
    return (
        '<div class="copose-joint" style="display: flex; gap: 0.4em; align-items: center">'
        f'<div style="width: 4.5em; overflow: hidden; white-space: nowrap">{escape(name)}</div>'
        # A joint without limits is nowhere between them.
        f'<div style="{_BAR if mark else "flex: 1"}">{mark}</div>'
        f'<div style="width: 3.6em; text-align: right">{q:.3f}</div>{torque}</div>'
    )


def semi_axes(state: State) -> str:
    """Volumes and semi-axes of the posture's ellipsoids."""
    if state.solution.after is None:
        return ""
    rows = ellipsoid_rows([(state.solution, state.solution.after)])
    return _table((name, values[0]) for name, *values in rows)


def line(words: str) -> str:
    """A line of words."""
    return f'<div style="{_SMALL}">{escape(words)}</div>'


def notes(texts: Sequence[str]) -> str:
    """The notes of a result."""
    told = texts[:_NOTES]
    more = len(texts) - len(told)
    items = "".join(f"<li>{escape(note)}</li>" for note in told)
    items += f"<li>… and {more} more in the result</li>" if more else ""
    if not told:
        return ""
    return f'<div style="{_SMALL}"><ul style="padding-left: 1.2em">{items}</ul></div>'


def _table(rows: Iterator[tuple[str, str]]) -> str:
    cells = "".join(
        f'<tr><td style="padding-right: 1em; opacity: 0.8">{escape(name)}</td>'
        f"<td>{escape(value)}</td></tr>"
        for name, value in rows
    )
    return f'<div style="{_SMALL}"><table>{cells}</table></div>'
