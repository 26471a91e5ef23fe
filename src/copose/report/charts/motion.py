"""What a motion is worth and what its joints do, along time."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes

from copose.poses import Array
from copose.report import style
from copose.report.charts import legends
from copose.report.joint_curves import JointCurves, spread
from copose.report.limit_use import Shares
from copose.report.motion_words import failure_words
from copose.results import Motion

SMALL = 9
_SHARE_COLORS = {"speed": "#332288", "acceleration": "#999933", "torque": "#882255"}
# The part of the colour map that stands out from white paper.
_DARKEST, _LIGHTEST = 0.0, 0.88
# What two labels beside a chart are apart at least, as a share of its height.
_LABELS_APART = 0.068


def draw_objective(ax: Axes, motion: Motion) -> None:
    """The objective of the motion and of least-norm tracking, aggregates in the legend."""
    assert motion.time is not None and motion.knots is not None
    time, tracking = np.array(motion.time), motion.least_norm
    after = _numbers([knot.objective for knot in motion.knots])
    if tracking is not None:
        before = _numbers(tracking.objective)
        ax.plot(time, before, color=style.BEFORE, linewidth=2, label=_before_words(motion))
        ax.fill_between(time, before, after, color=style.SYSTEM, alpha=0.1, linewidth=0)
        known = np.flatnonzero(np.isfinite(before))
        if tracking.reason is not None and len(known):
            ax.plot(time[known[-1]], before[known[-1]], marker="X", markersize=10, color=style.OVER,
                    markeredgecolor="white", linestyle="", zorder=5, clip_on=False)  # fmt: skip
    total = style.three(motion.objective.after)
    label = f"planned: {motion.aggregate} {total}"
    ax.plot(time, after, color=style.SYSTEM, linewidth=2.5, label=label)
    if motion.aggregate == "worst" and np.isfinite(after).any():
        k = int(np.nanargmin(after))
        ax.plot(time[k], after[k], marker="o", markersize=6, color=style.SYSTEM, clip_on=False)
    unit = style.objective_unit(motion)
    _title(ax, ", ".join(filter(None, (style.objective_name(motion), unit))))
    _along(ax, time)
    _legend_above(ax)


def _before_words(motion: Motion) -> str:
    """What tracking is called in the legend: its aggregate, or until when it goes."""
    tracking, before = motion.least_norm, motion.objective.before
    assert tracking is not None
    if tracking.reason is None:
        return f"least-norm tracking: {motion.aggregate} {style.three(before)}"
    return f"least-norm tracking: fails {failure_words(motion)}"


def draw_joints(ax: Axes, motion: Motion, arm: str) -> None:
    """The joints of an arm, each from −1 at its lower to 1 at its upper limit.

    Joints without limits are dashed, in turns; where none has any, all are in rad or m.
    """
    assert motion.time is not None and motion.knots is not None
    time, curves = np.array(motion.time), JointCurves.of(motion, arm)
    shown, some = curves.values, curves.limited
    if some:
        for sign in (-1, 1):
            ax.axhline(sign, color=style.OVER, linewidth=1.2, linestyle="--")
            ax.axhspan(sign, 50 * sign, color=style.OVER, alpha=0.06, linewidth=0)
        furthest = curves.furthest
        ax.set_ylim(-furthest, furthest)
        if furthest < 2:
            ax.set_yticks([-1, -0.5, 0, 0.5, 1])
        ax.axhline(0, color="#DDDDDD", linewidth=0.8)
    else:
        ax.margins(y=0.1)
    positions = np.linspace(_DARKEST, _LIGHTEST, len(curves.bounded))
    colors = matplotlib.colormaps["viridis"](positions)
    for i, color in enumerate(colors):
        loose = some and not curves.bounded[i]
        ax.plot(time, shown[:, i], color=color, linewidth=1.8, linestyle="--" if loose else "-")
    _along(ax, time)
    _labels(ax, shown[-1], colors)
    ax.set_ylabel(curves.unit, fontsize=SMALL, labelpad=1)
    color = dict(zip(motion.joint_names, style.ARMS * len(motion.limits), strict=False))[arm]
    _title(ax, f"joints of arm {style.short(arm)}", color=color)


def _labels(ax: Axes, ends: Array, colors: Any) -> None:
    """The numbers of joints, from root to tip, at the right ends of their lines."""
    low, high = ax.get_ylim()
    heights = (ends - low) / (high - low)
    order = np.argsort(heights, kind="stable")
    # Each label wants to be where its line ends; a crowd is spread around where it stands.
    placed = spread(heights[order], _LABELS_APART)
    for height, i in zip(placed, order, strict=True):
        ax.annotate(str(i + 1), (1, height), xycoords="axes fraction", xytext=(5, 0),
                    textcoords="offset points", color=colors[i], fontsize=SMALL,
                    fontweight="bold", va="center")  # fmt: skip


def draw_limits(ax: Axes, shares: list[Shares]) -> None:
    """The largest share of each kind of limit, in percent."""
    for each in shares:
        largest, _, _ = each.largest
        words = f"{each.kind}: up to {style.percent(largest)} %"
        ax.plot(each.time, 100 * each.values, color=_SHARE_COLORS[each.kind], linewidth=2,
                label=words)  # fmt: skip
    highest = max(100.0, *(100 * each.largest[0] for each in shares))
    ax.axhline(100, color=style.OVER, linewidth=1.2, linestyle="--")
    ax.set_ylim(0, 1.15 * highest)
    ax.text(1, 100, "limit", transform=ax.get_yaxis_transform(), ha="right", va="bottom",
            fontsize=8, color=style.OVER)  # fmt: skip
    _along(ax, shares[0].time)
    _title(ax, "share of limits, the largest of all joints, %")
    _legend_above(ax)


def _numbers(values: Any) -> Array:
    """NaN where there is none."""
    return np.array(values, dtype=float)


def _along(ax: Axes, time: Array) -> None:
    if time[-1] > time[0]:
        ax.set_xlim(time[0], time[-1])
    ax.locator_params(axis="x", nbins=min(8, int(1.8 * _inches(ax))))
    ax.tick_params(labelsize=SMALL)
    ax.grid(True, color="#EEEEEE", linewidth=0.8)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def _title(ax: Axes, words: str, **more: Any) -> None:
    ax.set_title(words, loc="left", fontsize=10, **more)


def _legend_above(ax: Axes) -> None:
    """A legend between a chart and its title."""
    _, labels = ax.get_legend_handles_labels()
    columns, rows = legends.small_grid(labels, _inches(ax))
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=columns, **legends.SMALL)
    ax.set_title(ax.get_title(loc="left"), loc="left", fontsize=10, pad=6 + 14 * rows)


def _inches(ax: Axes) -> float:
    """How wide it is."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    return float(ax.get_window_extent().width / figure.dpi)
