"""Charts of a motion along time: its objective, its use of limits, its joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes

from copose.poses import Array
from copose.report.charts.legends import small_grid, small_legend
from copose.report.joint_curves import JointCurves, LimitShare, spread
from copose.report.look import LOOK
from copose.report.words import failure_words, percent, short, three, titled_objective
from copose.results import Motion


@dataclass(frozen=True)
class ChartLook:
    """Look of charts of joints and of limits along time."""

    letters: int = 9  # size of numbers and labels, points
    speed: str = "#332288"  # colours of kinds of limits
    acceleration: str = "#999933"
    torque: str = "#882255"
    darkest: float = 0.0  # part of the colour map viridis that stands out from white paper
    lightest: float = 0.88
    apart: float = 0.068  # between two labels beside a chart, as a share of its height


def draw_objective(ax: Axes, motion: Motion) -> None:
    """The objective of the motion and of least-norm tracking, aggregates in the legend."""
    assert motion.time is not None and motion.knots is not None
    time, tracking = np.array(motion.time), motion.least_norm
    after = _numbers([knot.objective for knot in motion.knots])
    if tracking is not None:
        before = _numbers(tracking.objective)
        ax.plot(time, before, color=LOOK.before, linewidth=2, label=_before_words(motion))
        ax.fill_between(time, before, after, color=LOOK.system, alpha=0.1, linewidth=0)
        known = np.flatnonzero(np.isfinite(before))
        if tracking.reason is not None and len(known):
            ax.plot(time[known[-1]], before[known[-1]], marker="X", markersize=10, color=LOOK.over,
                    markeredgecolor="white", linestyle="", zorder=5, clip_on=False)  # fmt: skip
    total = three(motion.objective.after)
    label = f"planned: {motion.aggregate} {total}"
    ax.plot(time, after, color=LOOK.system, linewidth=2.5, label=label)
    if motion.aggregate == "worst" and np.isfinite(after).any():
        k = int(np.nanargmin(after))
        ax.plot(time[k], after[k], marker="o", markersize=6, color=LOOK.system, clip_on=False)
    _title(ax, titled_objective(motion))
    _along(ax, time)
    _legend_above(ax)


def _before_words(motion: Motion) -> str:
    """The entry of tracking in the legend: its aggregate, or the time at which it fails."""
    tracking, before = motion.least_norm, motion.objective.before
    assert tracking is not None
    if tracking.reason is None:
        return f"least-norm tracking: {motion.aggregate} {three(before)}"
    return f"least-norm tracking: fails {failure_words(motion)}"


def draw_joints(ax: Axes, motion: Motion, arm: str) -> None:
    """The joints of an arm, each from −1 at its lower to 1 at its upper limit.

    Joints without limits are dashed, in turns; where none has any, all are in rad or m.
    """
    assert motion.time is not None and motion.knots is not None
    time, curves = np.array(motion.time), JointCurves.of(motion, arm)
    if curves.limited:
        for sign in (-1, 1):
            ax.axhline(sign, color=LOOK.over, linewidth=1.2, linestyle="--")
            ax.axhspan(sign, 50 * sign, color=LOOK.over, alpha=0.06, linewidth=0)
        furthest = curves.furthest
        ax.set_ylim(-furthest, furthest)
        if furthest < 2:
            ax.set_yticks([-1, -0.5, 0, 0.5, 1])
        ax.axhline(0, color="#DDDDDD", linewidth=0.8)
    else:
        ax.margins(y=0.1)
    positions = np.linspace(ChartLook.darkest, ChartLook.lightest, len(curves.bounded))
    colors = matplotlib.colormaps["viridis"](positions)
    for i, color in enumerate(colors):
        loose = curves.limited and not curves.bounded[i]
        ax.plot(
            time, curves.values[:, i], color=color, linewidth=1.8, linestyle="--" if loose else "-"
        )
    _along(ax, time)
    _labels(ax, curves.values[-1], colors)
    ax.set_ylabel(curves.unit, fontsize=ChartLook.letters, labelpad=1)
    color = dict(zip(motion.joint_names, LOOK.arms * len(motion.limits), strict=False))[arm]
    _title(ax, f"joints of arm {short(arm)}", color=color)


def _labels(ax: Axes, ends: Array, colors: Any) -> None:
    """Numbers of joints, from root to tip, at the right ends of their lines."""
    low, high = ax.get_ylim()
    heights = (ends - low) / (high - low)
    order = np.argsort(heights, kind="stable")
    placed = spread(heights[order], ChartLook.apart)
    for height, i in zip(placed, order, strict=True):
        ax.annotate(str(i + 1), (1, height), xycoords="axes fraction", xytext=(5, 0),
                    textcoords="offset points", color=colors[i], fontsize=ChartLook.letters,
                    fontweight="bold", va="center")  # fmt: skip


def draw_limits(ax: Axes, shares: list[LimitShare]) -> None:
    """The largest share of each kind of limit, in percent."""
    for share in shares:
        largest, _, _ = share.largest
        words = f"{share.kind}: up to {percent(largest)} %"
        ax.plot(share.time, 100 * share.values, color=getattr(ChartLook, share.kind), linewidth=2,
                label=words)  # fmt: skip
    highest = max(100.0, *(100 * share.largest[0] for share in shares))
    ax.axhline(100, color=LOOK.over, linewidth=1.2, linestyle="--")
    ax.set_ylim(0, 1.15 * highest)
    ax.text(1, 100, "limit", transform=ax.get_yaxis_transform(), ha="right", va="bottom",
            fontsize=8, color=LOOK.over)  # fmt: skip
    _along(ax, shares[0].time)
    _title(ax, "share of limits, the largest of all joints, %")
    _legend_above(ax)


def _numbers(values: Any) -> Array:
    """Numbers, NaN where there is none."""
    return np.array(values, dtype=float)


def _along(ax: Axes, time: Array) -> None:
    """Axes along time."""
    if time[-1] > time[0]:
        ax.set_xlim(time[0], time[-1])
    ax.locator_params(axis="x", nbins=min(8, int(1.8 * _inches(ax))))
    ax.tick_params(labelsize=ChartLook.letters)
    ax.grid(True, color=LOOK.grid, linewidth=0.8)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _title(ax: Axes, words: str, **more: Any) -> None:
    """A chart's title; ``more`` are keywords of Matplotlib."""
    ax.set_title(words, loc="left", fontsize=10, **more)


def _legend_above(ax: Axes) -> None:
    """A legend between a chart and its title."""
    _, labels = ax.get_legend_handles_labels()
    columns, rows = small_grid(labels, _inches(ax))
    small_legend(ax, loc="lower left", bbox_to_anchor=(0, 1.0), ncols=columns)
    ax.set_title(ax.get_title(loc="left"), loc="left", fontsize=10, pad=6 + 14 * rows)


def _inches(ax: Axes) -> float:
    """The width of axes."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    return float(ax.get_window_extent().width / figure.dpi)
