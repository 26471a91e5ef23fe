"""Legends of pictures."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import Any

from matplotlib.transforms import ScaledTranslation

from copose.report.words import short


class Entry(StrEnum):
    """Entries of legends."""

    TOGETHER = "together, at the object"
    ALONE = "each arm alone, at its tip"
    RANGES = "free range"
    OTHER = "the other one's ellipsoids"


def legend_entries(arms: Iterable[str], *more: str) -> list[str]:
    """Entries of a picture's legend: its arms, and further ones."""
    return [f"arm {short(name)}" for name in arms] + list(more)


def legend_grid(entries: list[str], inches: float) -> tuple[int, int]:
    """Columns and rows in which a legend's entries fit into a width, inches."""
    # A letter takes about a twelfth of an inch at the size that legends are set in.
    widest = max(0.6 + len(entry) / 12 for entry in entries)
    columns = max(1, min(len(entries), int(inches / widest)))
    return columns, -(-len(entries) // columns)


def small_grid(entries: list[str], inches: float) -> tuple[int, int]:
    """Columns and rows in which the entries of a `small_legend` fit into a width, inches."""
    if sum(0.45 + 0.066 * len(entry) for entry in entries) <= inches:
        return len(entries), 1
    return legend_grid(entries, 11 / 9 * inches)


def small_legend(target: Any, *entries: list[Any], **place: Any) -> None:
    """A small legend without a frame; without handles and labels axes have their own. Keywords of
    Matplotlib say where, and in how many columns.
    """
    target.legend(*entries, frameon=False, fontsize=9, borderaxespad=0.1, columnspacing=1.2,
                  handlelength=1.6, **place)  # fmt: skip


def legend_below(
    ax: Any, handles: list[Any], labels: list[str], *, columns: int, points: float
) -> None:
    """A legend at a distance under axes, points; flush with their right where they are flat."""
    down = ScaledTranslation(0, -points / 72, ax.get_figure().dpi_scale_trans)
    place, x = ("upper center", 0.5) if ax.name == "3d" else ("upper right", 1.0)
    ax.legend(handles, labels, loc=place, bbox_to_anchor=(x, 0), ncols=columns,
              bbox_transform=ax.transAxes + down, frameon=False, fontsize=9, columnspacing=1.0,
              handlelength=1.4, handletextpad=0.5, borderaxespad=0)  # fmt: skip
