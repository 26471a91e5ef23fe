"""Scales of axes along keys: ticks and labels of numbers and of names, edges of cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes

from copose.poses import Array
from copose.report.studies.key_axes import KeyAxis, in_lines


@dataclass(frozen=True)
class ScaleLook:
    """Sizes of scales."""

    ticked: int = 9  # values that have a tick each; more are ticked at round numbers
    named: int = 40  # names at most; of more some are left out
    letters: int = 26  # of a line of a name
    inch: int = 13  # letters to an inch
    level: int = 9  # letters of a line that a name has at least, unless it is turned


def label_scale(
    ax: Axes, which: Literal["x", "y"], axis: KeyAxis, along: Array, *, titled: bool = True,
    few: int | None = None,
) -> None:  # fmt: skip
    """Name an axis, where it is titled, and tick it along a key's different values, ascending, with
    ``few`` ticks at most where there is little room.
    """
    scale = ax.xaxis if which == "x" else ax.yaxis
    if titled:
        scale.set_label_text(axis.title)
    scale.set_tick_params(labelsize=9)
    if axis.labels is not None:
        _name_ticks(ax, which, axis.labels)
    elif few is not None:
        ax.locator_params(axis=which, nbins=few)
    elif len(along) <= ScaleLook.ticked:
        scale.set_ticks(along, [f"{value:.4g}" for value in along])


def _name_ticks(ax: Axes, which: str, labels: Sequence[str]) -> None:
    """Names at the ticks of an axis; below it they are turned where they do not fit."""
    step = -(-len(labels) // ScaleLook.named)
    shown, places = labels[::step], range(0, len(labels), step)
    if which == "y":
        ax.set_yticks(places, [in_lines(label, ScaleLook.letters) for label in shown])
        return
    figure = ax.get_figure(root=True)
    assert figure is not None
    inches = ax.get_window_extent().width / figure.dpi
    room = min(ScaleLook.letters, int(ScaleLook.inch * inches / len(shown)) - 1)
    if room >= min(ScaleLook.level, max(map(len, shown))):
        ax.set_xticks(places, [in_lines(label, room) for label in shown])
        return
    names = [in_lines(label, ScaleLook.letters) for label in shown]
    ax.set_xticks(places, names, rotation=35, ha="right", rotation_mode="anchor")


def broken(name: str, letters: int) -> str:
    """A dotted name in lines, broken before dots."""
    lines = [""]
    for i, part in enumerate(name.split(".")):
        piece = f".{part}" if i else part
        if lines[-1] and len(lines[-1]) + len(piece) > letters:
            lines.append("")
        lines[-1] += piece
    return "\n".join(lines)


def cell_edges(centres: Array) -> Array:
    """Edges of cells around ascending centres, midway between them, (count + 1,)."""
    if len(centres) == 1:
        half = 0.5 * max(abs(float(centres[0])), 1.0)
        return np.array([centres[0] - half, centres[0] + half])
    middle = (centres[1:] + centres[:-1]) / 2
    first, last = 2 * centres[0] - middle[0], 2 * centres[-1] - middle[-1]
    return np.concatenate([[first], middle, [last]])
