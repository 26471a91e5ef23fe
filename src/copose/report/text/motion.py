"""A motion as a table on a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import RenderableType

from copose.problem import SPACES
from copose.report.joint_curves import limit_shares
from copose.report.text.columns import answer_page, counted, lines, table, times, timing_line
from copose.report.words import (
    evidence_words,
    failure_words,
    gain_between,
    gain_word,
    objective_name,
    objective_unit,
    percent,
    six,
    three,
)
from copose.results import Motion


def motion_table(motion: Motion, *, verbose: bool = False) -> RenderableType:
    """The objective of a motion, the limits that it uses, and the search for it; verbose also what
    was searched and how long it took.
    """
    tables: list[RenderableType] = []
    if motion.knots is not None:
        tables = [
            table(("", "least-norm", "planned", ""), _objective(motion)),
            *lines([*_unmoved(motion), *_limits(motion)]),
            table(("motion", "planned", ""), _course(motion)),
        ]
    return answer_page(motion, tables, _evidence(motion, verbose))


def _objective(motion: Motion) -> Iterator[tuple[str, str, str, str]]:
    """Rows of both aggregates of the objective, the one that was maximised first."""
    knots, tracking, objective = motion.knots, motion.least_norm, motion.objective
    assert knots is not None
    name, unit = objective_name(motion), objective_unit(motion)
    gained = gain_between(motion, objective.before, objective.after)
    words = ", ".join(filter(None, (unit, f"{gain_word(motion)} {gained}" * bool(gained))))
    before, now = six(objective.before), six(objective.after)
    yield f"{motion.aggregate} {name}", before, now, words
    kind = "worst" if motion.aggregate == "mean" else "mean"
    tracked = () if tracking is None else tracking.objective
    before, now = _aggregate(kind, tracked), _aggregate(kind, [knot.objective for knot in knots])
    yield f"{kind} {name}", before, now, unit


def _unmoved(motion: Motion) -> Iterator[tuple[str, str]]:
    """A line on why planning gains nothing, where no arm has a joint to spare."""
    gained = gain_between(motion, motion.objective.before, motion.objective.after)
    m = SPACES[motion.problem.space].m
    if gained == "×1" and all(len(names) <= m for names in motion.joint_names.values()):
        yield (
            "×1:",
            "no arm has a joint to spare: on a branch there is one motion; without a start copose "
            "chooses the branch",
        )


def _aggregate(kind: str, values: Sequence[float | None]) -> str:
    """Mean or smallest of values; – where one of them is missing."""
    known = [value for value in values if value is not None]
    if not known or len(known) < len(values):
        return six(None)
    return six(float(np.mean(known) if kind == "mean" else np.min(known)))


def _limits(motion: Motion) -> Iterator[tuple[str, str]]:
    """Lines on why least-norm tracking fails, and on the limits that are used most."""
    tracking = motion.least_norm
    if tracking is not None and tracking.reason is not None:
        yield "least-norm tracking:", f"fails {failure_words(motion)}: {tracking.reason}"
    for use in limit_shares(motion):
        share, joint, time = use.largest
        where = f"{joint}'s limit at {three(time)} s"
        yield f"largest {use.kind}:", f"{percent(share)} % of {where}"
    if motion.collision is not None:
        yield "smallest distance:", f"{three(motion.collision)} m, between knots"
    if motion.reachable_from_start is not None:
        answer = "reachable" if motion.reachable_from_start else "not reachable"
        yield "best posture:", f"{answer} from the start"


def _course(motion: Motion) -> Iterator[tuple[str, str, str]]:
    """Rows on how the joints move, and on how well the chain is closed."""
    knots = motion.knots
    assert knots is not None
    yield "duration", three(motion.duration), f"s, {counted(len(knots), 'knot')}"
    yield "smoothness", three(motion.smoothness), "rad²/s², mean of speed²"
    unit = "m, rad" if SPACES[motion.problem.space].rigid else "m"
    closure = max(error for knot in knots for error in knot.closure_error.values())
    yield "closure error", f"{closure:.1e}", f"{unit}, at knots"
    if motion.between_knots_error is not None:
        yield "", f"{motion.between_knots_error:.1e}", f"{unit}, between knots"


def _evidence(motion: Motion, verbose: bool, *, most: int = 5) -> Iterator[str]:
    """Lines on the search: its graph and routes, and with ``verbose`` samples and times."""
    search = motion.search
    if verbose:
        if search is not None:
            nodes = " × ".join(f"{count:,}" for count in search.nodes.values())
            yield (
                f"{counted(search.layers, 'layer')} of {nodes} postures, "
                f"{counted(search.combinations, 'combination')} (seed {search.seed})"
            )
            for route in search.routes[:most]:
                value = f"failed, {route.status}" if route.value is None else f"{route.value:.6f}"
                yield f"a route: {route.graph:.6f} in the graph, {value} as a motion"
        yield timing_line(motion.timing)
    if search is not None and search.routes:
        routes, layers = counted(len(search.routes), "route"), counted(search.layers, "layer")
        met = search.basins.best if search.basins is not None else 0
        where = f", met {times(met)}" if met else ""
        yield f"the best of {routes} through a graph of {layers}{where}"
    yield from filter(None, [evidence_words(motion)])
