"""The look of points that have no number: hatched by the arms that cannot reach."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from copose.poses import Array
from copose.report.look import LOOK
from copose.report.studies.map_content import Codes, Ending, MapContent


@dataclass(frozen=True)
class EndingLook:
    """Look of what has no number."""

    arms: tuple[str, ...] = ("///", "\\\\\\", "---", "|||")  # hatches of one arm, in their order
    several: str = "xxx"  # of several arms
    failed: str = "..."  # of what failed without saying which arm
    other: str = "++"  # of constraints other than reach
    several_color: str = "#777777"
    other_color: str = "#8B3A8B"
    tint: float = 0.2  # opacity of the ground under hatches
    light: float = 0.45  # of that, and of hatches, where nothing is proved
    markers: tuple[str, ...] = ("x", "+", "1", "2", "3", "4")  # where points are no cells


def hatch_of(ending: Ending, content: MapContent) -> dict[str, Any]:
    """Keywords of a patch."""
    if not ending.arms:
        failed = ending.status == "failed"
        color = LOOK.over if failed else EndingLook.other_color
        hatch, light = EndingLook.failed if failed else EndingLook.other, 1.0
    else:
        several = len(ending.arms) > 1
        k = content.arms.index(ending.arms[0]) if ending.arms[0] in content.arms else 0
        color = EndingLook.several_color if several else LOOK.arms[k % len(LOOK.arms)]
        hatch = EndingLook.several if several else EndingLook.arms[k % len(EndingLook.arms)]
        light = EndingLook.light if ending.status == "failed" else 1.0
    return {
        "facecolor": to_rgba(color, EndingLook.tint * light),
        "edgecolor": to_rgba(color, light),
        "hatch": hatch,
        "linewidth": 0,
    }


def shown_endings(content: MapContent) -> list[tuple[int, Ending]]:
    """What places without a number have come to, with its code."""
    codes = dict(zip(content.places.endings, range(len(content.places.endings)), strict=True))
    return [
        (codes[ending], ending)
        for ending in content.places.counted()
        if ending.status not in ("solved", "missing")
    ]


def ending_words(ending: Ending, content: MapContent) -> str:
    """The entry of an ending in a legend, with its count."""
    return f"{ending.words(len(content.arms))} ({content.places.counted()[ending]:,})"


def ending_patches(content: MapContent) -> list[Patch]:
    """Entries of a legend."""
    patches = [
        Patch(label=ending_words(ending, content), **hatch_of(ending, content))
        for _, ending in shown_endings(content)
    ]
    missing = [ending for ending in content.places.counted() if ending.status == "missing"]
    white: dict[str, Any] = {"facecolor": "white", "edgecolor": LOOK.before, "linewidth": 0.8}
    return patches + [Patch(label=ending_words(each, content), **white) for each in missing]


def draw_endings(
    ax: Axes, codes: Codes, edges: tuple[Array, Array], content: MapContent, *,
    finest: int = 250, **more: Any,
) -> None:  # fmt: skip
    """Hatch the cells of a grid that have no number, by codes of the cells, (columns, rows), and
    edges of both, one patch for each ending; so many are told apart along an axis, of more some are
    left out.
    """
    steps = [max(1, -(-size // finest)) for size in codes.shape]
    coarse = codes[:: steps[0], :: steps[1]]
    x, y = (np.append(edge[:-1][::step], edge[-1]) for edge, step in zip(edges, steps, strict=True))
    for code, ending in shown_endings(content):
        cells = coarse == code
        if cells.any():
            look = hatch_of(ending, content)
            words = ending_words(ending, content)
            ax.add_patch(PathPatch(_outline(cells, x, y), label=words, **look, **more))


def _outline(cells: NDArray[np.bool_], x: Array, y: Array) -> Path:
    """The cells of a grid as one path: a rectangle for each run along a column."""
    bounds = np.diff(np.pad(cells.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    column, low = np.nonzero(bounds == 1)
    _, high = np.nonzero(bounds == -1)
    left, right, bottom, top = x[column], x[column + 1], y[low], y[high]
    corners = np.stack([left, bottom, right, bottom, right, top, left, top, left, bottom], axis=1)
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    return Path(corners.reshape(-1, 2), np.tile(np.array(codes, dtype=Path.code_type), len(left)))


def draw_ending_marks(ax: Axes, along: tuple[Array, Array], content: MapContent) -> None:
    """Mark points that have no number, by what they have come to; one artist for each ending."""
    for k, (code, ending) in enumerate(shown_endings(content)):
        here, color = content.places.codes == code, hatch_of(ending, content)["edgecolor"]
        ax.plot(
            along[0][here], along[1][here], linestyle="", markersize=5, zorder=1,
            marker=EndingLook.markers[k % len(EndingLook.markers)], color=color,
            label=ending_words(ending, content),
        )  # fmt: skip
