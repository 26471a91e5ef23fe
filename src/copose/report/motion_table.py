"""A motion as a table on a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from copose.problem import SPACES
from copose.report import style
from copose.report.columns import counted, note_lines, plain_table, status_line
from copose.report.motion_limits import limit_shares
from copose.report.motion_words import failure_words
from copose.results import Motion, PathSearchRecord

# Routes that are listed.
_ROUTES = 5


def motion_table(motion: Motion) -> RenderableType:
    """What a motion is worth, what it takes of limits, and how it was found."""
    parts: list[RenderableType] = [status_line(motion)]
    if motion.knots is not None:
        parts.append(_numbers(motion))
    parts += map(Text, _evidence(motion))
    return Group(*parts, *note_lines(motion.notes))


def _numbers(motion: Motion) -> Table:
    table = plain_table("")
    for title in ("least-norm", "planned"):
        table.add_column(title, justify="right")
    table.add_column("", overflow="fold")
    for name, before, now, words in (*_objective(motion), *_course(motion)):
        table.add_row(name, before, now, Text(words))
    return table


def _objective(motion: Motion) -> Iterator[tuple[str, str, str, str]]:
    """Both aggregates of the objective, the one that was maximised first."""
    knots, tracking, objective = motion.knots, motion.least_norm, motion.objective
    assert knots is not None
    name, unit = style.objective_name(motion), style.objective_unit(motion)
    gained = style.gain_between(motion, objective.before, objective.after)
    words = ", ".join(filter(None, (unit, f"{style.gain_word(motion)} {gained}" * bool(gained))))
    before, now = style.six(objective.before), style.six(objective.after)
    yield f"{motion.aggregate} {name}", before, now, words
    kind = "worst" if motion.aggregate == "mean" else "mean"
    tracked = () if tracking is None else tracking.objective
    before, now = _aggregate(kind, tracked), _aggregate(kind, [knot.objective for knot in knots])
    yield f"{kind} {name}", before, now, unit
    if tracking is not None and tracking.reason is not None:
        yield "least-norm tracking", "", "", f"fails {failure_words(motion)}: {tracking.reason}"


def _aggregate(kind: str, values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    if not known or len(known) < len(values):
        return style.six(None)
    return style.six(float(np.mean(known) if kind == "mean" else np.min(known)))


def _course(motion: Motion) -> Iterator[tuple[str, str, str, str]]:
    """How the joints move, how well the chain is closed, and what limits leave."""
    knots = motion.knots
    assert knots is not None
    counts = f"s, {counted(len(knots), 'knot')}"
    yield "duration", "", style.three(motion.duration), counts
    yield (
        "smoothness",
        "",
        style.three(motion.smoothness),
        "rad²/s², mean of speed²",
    )
    unit = "m, rad" if SPACES[motion.problem.space].rigid else "m"
    closure = max(error for knot in knots for error in knot.closure_error.values())
    yield "closure error", "", f"{closure:.1e}", f"{unit}, at knots"
    if motion.between_knots_error is not None:
        yield "", "", f"{motion.between_knots_error:.1e}", f"{unit}, between knots"
    for each in limit_shares(motion):
        share, joint, time = each.largest
        where = f"% of {joint}'s at {style.three(time)} s"
        yield f"largest {each.kind}", "", style.percent(share), where
    if motion.collision is not None:
        yield "smallest distance", "", style.three(motion.collision), "m, between knots"
    if motion.reachable_from_start is not None:
        answer = "yes" if motion.reachable_from_start else "no"
        yield "best posture", "", answer, "reachable from the start"


def _evidence(motion: Motion) -> Iterator[str]:
    """What was searched, what was found, and how long it took."""
    timing, search = motion.timing, motion.search
    if search is not None:
        nodes = " × ".join(f"{count:,}" for count in search.nodes.values())
        yield (
            f"{counted(search.layers, 'layer')} of {nodes} postures, "
            f"{counted(search.combinations, 'combination')} (seed {search.seed})"
        )
        if search.routes:
            yield _routes(search)
    yield f"built in {timing.build_s:.2f} s, searched {timing.search_s:.2f} s ({timing.kernels})"


def _routes(search: PathSearchRecord) -> str:
    """The value of each route, in the graph and as a motion."""
    listed = [
        f"{route.graph:.6f} → "
        + (f"failed, {route.status}" if route.value is None else f"{route.value:.6f}")
        for route in search.routes[:_ROUTES]
    ]
    listed += ["…"] * (len(search.routes) > _ROUTES)
    return f"{counted(len(search.routes), 'route')}, in the graph → as a motion: " + "; ".join(
        listed
    )
