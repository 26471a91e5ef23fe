"""States of the page in numbers, as HTML for the panel."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from html import escape

from copose.live.session.state import State
from copose.report.look import LOOK, arm_colors
from copose.report.text.columns import shared_beginning
from copose.report.text.ellipsoids import ellipsoid_rows
from copose.report.words import gain_words, objective_name, objective_unit, six
from copose.results import JointRecord, Solution

SMALL = "font-size: 0.8em; line-height: 1.35; padding: 0 0.8em"
"""Style of a block of numbers."""


def block(content: str) -> str:
    """HTML as far from the edges as numbers are."""
    return f'<div style="{SMALL}">{content}</div>'


def line(words: str) -> str:
    """A line of words."""
    return f'<div style="{SMALL}">{escape(words)}</div>'


def titled_table(title: str, rows: Iterable[tuple[str, str]], below: str, key: str) -> str:
    """Numbers under a title: names, and HTML of their values and below them; identifiers of cells
    begin with a key, and the last word of the name follows.
    """
    cells = "".join(
        f'<tr><td style="padding-right: 1em">{name}</td>'
        f'<td id="{key}-{name.split()[-1]}">{value}</td></tr>'
        for name, value in rows
    )
    return (
        f'<div style="{SMALL}"><div style="font-size: 1.1em"><b>{escape(title)}</b></div>'
        f"<table>{cells}</table>{below}</div>"
    )


def message(words: str, colour: str, key: str) -> str:
    """A line of words in colour, with an identifier that begins with a key."""
    return f'<div id="{key}-message" style="color: {colour}">{escape(words)}</div>'


def headline(state: State) -> str:
    """The objective now, at the start, and the gain; or why the arms do not hold the object."""
    shown = with_start(state)
    unit = objective_unit(shown)
    rows = (
        ("now", f"<b>{six(state.value)}</b>"),
        ("at the start", six(state.start_value)),
        ("gain", escape(gain_words(shown) or "–")),
    )
    hint = (
        '<div style="opacity: 0.7">Drag the arrows and arcs at the object: the arms follow at '
        "their best.</div>"
    )
    title = objective_name(shown) + (f", {unit}" if unit else "")
    return titled_table(title, rows, _standing(state) + hint, "copose")


def _standing(state: State) -> str:
    """A line in colour on whether the object is held, and how good the posture is."""
    if state.message:
        return message(state.message, LOOK.over, "copose")
    if state.origin:
        return message(f"as recorded at {state.origin}", LOOK.arms[1], "copose")
    words, color = "a local optimum: where the hand rests, all is searched", LOOK.arms[2]
    if state.searched and state.left is not None:
        words, color = "the best that a search finds here; only with letting go", LOOK.arms[1]
    elif state.searched:
        words, color = "the best that a search finds here", LOOK.arms[1]
    return message(words, color, "copose")


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
    legend = "joint between its limits, rad or m" if bounded else "joint, rad or m"
    legend += "" if state.shares is None else "; torque that holds the object, % of its limit"
    return f'<div style="{SMALL}"><div style="opacity: 0.7">{legend}</div>{"".join(blocks)}</div>'


def _joint_row(name: str, q: float, limits: JointRecord, color: str, share: float | None) -> str:
    """A joint's name, its place between its limits, its position, and its torque's share."""
    bar = "position: relative; height: 0.75em; background: rgba(128, 128, 128, 0.18); flex: 1"
    mark = ""
    lower, upper = limits.lower, limits.upper
    if lower is not None and upper is not None and upper > lower:
        part = min(max((q - lower) / (upper - lower), 0.0), 1.0)
        # The last hundredth of a range counts as its end.
        near = part < 0.01 or part > 1 - 0.01
        mark = (
            f'<div style="position: absolute; left: calc({100 * part:.1f}% - 2px); width: 4px; '
            f'height: 100%; background: {LOOK.over if near else color}"></div>'
        )
    torque = ""
    if share is not None:
        fill = LOOK.over if share > 1 else color
        torque = (
            f'<div style="{bar}; flex: 0.6"><div style="width: {100 * min(share, 1.0):.0f}%; '
            f'height: 100%; background: {fill}"></div></div>'
            f'<div style="width: 2.6em; text-align: right">{100 * share:.0f}%</div>'
        )
    return (
        '<div class="copose-joint" style="display: flex; gap: 0.4em; align-items: center">'
        f'<div style="width: 4.5em; overflow: hidden; white-space: nowrap">{escape(name)}</div>'
        # A joint without limits has no bar.
        f'<div style="{bar if mark else "flex: 1"}">{mark}</div>'
        f'<div style="width: 3.6em; text-align: right">{q:.3f}</div>{torque}</div>'
    )


def semi_axes(state: State) -> str:
    """Volumes and semi-axes of the posture's ellipsoids."""
    if state.solution.after is None:
        return ""
    rows = ellipsoid_rows([(state.solution, state.solution.after)])
    return _table((name, values[0]) for name, *values in rows)


def notes(texts: Sequence[str], *, most: int = 6) -> str:
    """The notes of a result, at most so many."""
    listed = texts[:most]
    left_out = len(texts) - len(listed)
    items = "".join(f"<li>{escape(note)}</li>" for note in listed)
    items += f"<li>… and {left_out} more in the result</li>" if left_out else ""
    if not listed:
        return ""
    return f'<div style="{SMALL}"><ul style="padding-left: 1.2em">{items}</ul></div>'


def _table(rows: Iterator[tuple[str, str]]) -> str:
    """A table of names and values."""
    cells = "".join(
        f'<tr><td style="padding-right: 1em; opacity: 0.8">{escape(name)}</td>'
        f"<td>{escape(value)}</td></tr>"
        for name, value in rows
    )
    return f'<div style="{SMALL}"><table>{cells}</table></div>'
