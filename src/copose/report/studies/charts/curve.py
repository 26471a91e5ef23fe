"""A number along one key: a curve over numbers, a row for each name."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from copose.poses import Array, Indices
from copose.report.look import LOOK
from copose.report.studies.charts.endings import draw_endings, ending_words, hatch_of, shown_endings
from copose.report.studies.charts.key_scales import broken, cell_edges, label_scale
from copose.report.studies.map_content import Codes, MapContent
from copose.report.words import three


@dataclass(frozen=True)
class SwitchRule:
    """When a step of an arm between two neighbours is a switch."""

    least: float = 0.3  # rad or m that its joint which moves most moves at least
    times: float = 4.0  # the arm's usual step, the median over all neighbours
    most_points: int = 5000  # beyond so many points none is looked for


@dataclass(frozen=True)
class Switch:
    """A step from one branch to another."""

    at: float  # where along the axis, midway between the two neighbours
    arms: tuple[str, ...]  # that take it


def branch_switches(along: Array, joints: Sequence[Mapping[str, Any] | None]) -> list[Switch]:
    """The switches along a curve.

    The step of an arm is max_k |Δq_k| between two neighbours without whole turns. Where the best
    posture stays on its branch, it follows the point smoothly and steps are in proportion to the
    distance of the neighbours; so a switch is a step that is larger than ``SwitchRule.least`` and
    larger than ``SwitchRule.times`` its arm's median rate times that distance.

    Args:
        along: places on the axis, ascending.
        joints: at each by arm, or by case and arm; None where there is no posture, and no
            neighbour.
    """
    by_arm = [None if each is None else _flat(each) for each in joints]
    pairs = [
        i for i in range(len(along) - 1) if by_arm[i] is not None and by_arm[i + 1] is not None
    ]
    if not pairs:
        return []
    apart = np.maximum(np.diff(along)[pairs], 1e-300)
    jumping: dict[int, list[str]] = {}
    for arm in by_arm[pairs[0]] or ():
        steps = np.array([_step(by_arm[i], by_arm[i + 1], arm) for i in pairs])
        usual = float(np.median(steps / apart))
        for k in np.flatnonzero(
            (steps > SwitchRule.least) & (steps > SwitchRule.times * usual * apart)
        ):
            jumping.setdefault(pairs[int(k)], []).append(arm)
    return [
        Switch(float(along[i] + along[i + 1]) / 2, tuple(arms))
        for i, arms in sorted(jumping.items())
    ]


def _flat(joints: Mapping[str, Any]) -> dict[str, Array]:
    """Joints by arm; of cases by case and arm."""
    flat = dict[str, Array]()
    for name, entry in joints.items():
        if isinstance(entry, Mapping):
            flat |= {f"{name} {arm}": np.array(q, dtype=float) for arm, q in entry.items()}
        else:
            flat[name] = np.array(entry, dtype=float)
    return flat


def _step(one: dict[str, Array] | None, other: dict[str, Array] | None, arm: str) -> float:
    """The step of an arm; 0 where its joints are not those of the neighbour."""
    if one is None or other is None or arm not in one or arm not in other:
        return 0.0
    if one[arm].shape != other[arm].shape:
        return 0.0
    steps = other[arm] - one[arm]
    return float(np.abs(steps - math.tau * np.round(steps / math.tau)).max(initial=0.0))


@dataclass(frozen=True)
class StudyCurveLook:
    """Look of curves."""

    dotted: int = 500  # points that have a dot each
    blocks: int = 2000  # of a curve of many points, of which the extremes are drawn
    stretches: int = 1000  # stretches without a number; of more points some are left out
    width: float = 2.2
    named_switches: int = 12  # that the arms stand beside; of more there are the lines alone


def draw_curve(ax: Axes, content: MapContent, look: StudyCurveLook = StudyCurveLook()) -> None:
    """The number along a key, with what has none and where the posture switches branches."""
    along, order = np.unique(content.along(content.axes[0]), return_index=True)
    values, codes = content.places.values[order], content.places.codes[order]
    dots = "o" if len(along) <= look.dotted else "," * content.sampled
    if dots:
        ax.plot(along, values, linestyle="", marker=dots, markersize=4.5, color=LOOK.system,
                rasterized=True)  # fmt: skip
    if not content.sampled:
        jumps = _switches(along, order, content)
        _draw_switches(ax, jumps, content, look)
        at = [jump.at for jump in jumps]
        # The curve is broken where the posture leaves its branch.
        places = np.searchsorted(along, at)
        x, y = np.insert(along, places, at), np.insert(values, places, np.nan)
        some = _extremes(y, look.blocks)
        ax.plot(x[some], y[some], color=LOOK.system, linewidth=look.width)
    edges = cell_edges(along)
    ax.set_xlim(edges[0], edges[-1])
    _draw_endings(ax, codes, edges, content, look)
    _draw_best(ax, content)
    label_scale(ax, "x", content.axes[0], along if not content.sampled else np.zeros(99))
    ax.set_ylabel(content.title)
    _plain(ax)


def _extremes(values: Array, blocks: int) -> Indices:
    """Points that decide the look of a curve: of many the smallest and the largest of each of some
    blocks of neighbours.
    """
    size = len(values) // blocks
    if size < 3:
        return np.arange(len(values))
    whole = values[: blocks * size].reshape(blocks, size)
    begins = np.arange(blocks) * size
    low = begins + np.where(np.isnan(whole), np.inf, whole).argmin(axis=1)
    high = begins + np.where(np.isnan(whole), -np.inf, whole).argmax(axis=1)
    return np.unique(np.concatenate([low, high, np.arange(blocks * size, len(values))]))


def _draw_endings(
    ax: Axes, codes: Codes, edges: Array, content: MapContent, look: StudyCurveLook
) -> None:
    """Hatch stretches in which points have no number; what failed outright is a cross a point."""
    hatched = codes.copy()
    for code, ending in shown_endings(content):
        if ending.status != "failed" or ending.arms:
            continue
        hatched[codes == code] = 0
        here = np.flatnonzero(codes == code)
        some = here[:: -(-len(here) // look.stretches)]
        ax.plot((edges[some] + edges[some + 1]) / 2, np.full(len(some), 0.03), linestyle="",
                marker="x", markersize=7, color=LOOK.over, markeredgewidth=1.8,
                transform=ax.get_xaxis_transform(), label=ending_words(ending, content),
                )  # fmt: skip
    draw_endings(ax, hatched[:, None], (edges, np.array([0.0, 1.0])), content,
                 finest=look.stretches, transform=ax.get_xaxis_transform(), zorder=0)  # fmt: skip


def _draw_best(ax: Axes, content: MapContent) -> None:
    place = content.best
    if place is None:
        return
    value = float(content.places.values[place])
    x = content.where(place)[0]
    ax.plot([x], [value], marker="*", markersize=17, color="white", markeredgecolor=LOOK.ink,
            linestyle="", zorder=6, label=f"{content.best_word}: {three(value)}")  # fmt: skip


def _switches(along: Array, order: Indices, content: MapContent) -> list[Switch]:
    """The switches along the curve; none of very many points."""
    if len(along) > SwitchRule.most_points:
        return []
    points, solved = content.places.points[order].tolist(), content.places.solved[order]
    lines = [content.table.line(p) if s else None for p, s in zip(points, solved, strict=True)]
    return branch_switches(along, [None if line is None else line["joints"] for line in lines])


def _draw_switches(
    ax: Axes, jumps: list[Switch], content: MapContent, look: StudyCurveLook
) -> None:
    """A dashed line wherever an arm's posture leaves its branch, with the arm's name above it."""
    for k, switch in enumerate(jumps):
        label = "an arm's posture switches to another branch" if k == 0 else None
        ax.axvline(switch.at, color=LOOK.ink, linewidth=1, linestyle="--", zorder=1, label=label)
        if len(jumps) <= look.named_switches:
            arms = "both" if len(switch.arms) == 2 == len(content.arms) else ", ".join(switch.arms)
            ax.text(switch.at, 1.01, arms, transform=ax.get_xaxis_transform(), rotation=30,
                    ha="left", va="bottom", fontsize=8, color=LOOK.ink)  # fmt: skip


def draw_rows(ax: Axes, content: MapContent) -> None:
    """A row for each name, with its number as a dot and in digits; what has none is hatched."""
    places = np.unique(content.along(content.axes[0]), return_index=True)[1]
    values, codes = content.places.values[places], content.places.codes[places]
    rows = np.arange(len(places))
    ax.plot(values, rows, linestyle="", marker="o", markersize=9, color=LOOK.system)
    for row, value in zip(rows.tolist(), values.tolist(), strict=True):
        if np.isfinite(value) and len(rows) <= 60:
            ax.annotate(three(value), (value, row), xytext=(13, 0), textcoords="offset points",
                        va="center", fontsize=9)  # fmt: skip
    for code, ending in shown_endings(content):
        for k, row in enumerate(rows[codes == code].tolist()):
            ax.axhspan(row - 0.4, row + 0.4, zorder=0, **hatch_of(ending, content),
                       label=ending_words(ending, content) if k == 0 else None)  # fmt: skip
    if content.best is not None:
        best = float(content.places.values[content.best])
        at = content.where(content.best)[0]
        ax.plot([best], [at], marker="*", markersize=19, color="white", linestyle="",
                markeredgecolor=LOOK.ink, label=f"{content.best_word}: {three(best)}")  # fmt: skip
    ax.margins(x=0.15)
    label_scale(ax, "y", content.axes[0], rows.astype(float), titled=False)
    ax.set_ylabel(broken(content.axes[0].title, 24))
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.set_xlabel(content.title)
    _plain(ax)


def _plain(ax: Axes) -> None:
    ax.grid(True, color=LOOK.grid, linewidth=0.8)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=9)
    ax.spines[["top", "right"]].set_visible(False)
