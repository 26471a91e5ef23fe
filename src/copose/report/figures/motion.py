"""The picture of a motion."""

from __future__ import annotations

from matplotlib.figure import Figure

from copose.report import style
from copose.report.charts import legends
from copose.report.charts.motion import draw_joints, draw_limits, draw_objective
from copose.report.limit_use import limit_shares
from copose.report.motion_words import motion_heading
from copose.report.scene.motion import MotionScene
from copose.results import Motion

# Postures that are drawn, the last in full.
_POSTURES = 6
# Inches: the picture's width, the scene's height, a row of joints, what is above and below.
_WIDE, _SCENE, _JOINTS, _HEAD, _FOOT = 15.0, 5.9, 2.5, 0.45, 0.5
# Between charts of joints, inches.
_APART = 1.0
# Where the picture begins, as a share of its width.
_LEFT = 0.035
# Charts of joints beside one another.
_BESIDE = 4


def motion_figure(motion: Motion) -> Figure:
    """Postures along the way, what they are worth, what limits allow, and every arm's joints."""
    assert motion.time is not None
    scene, shares, arms = MotionScene.of(motion), limit_shares(motion), list(motion.joint_names)
    columns = min(len(arms), _BESIDE)
    rows = -(-len(arms) // columns)
    tall = _HEAD + _SCENE + _JOINTS * rows + _FOOT
    figure = Figure(figsize=(_WIDE, tall))
    figure.suptitle(motion_heading(motion), fontweight="bold", x=_LEFT, y=1 - 0.15 / tall,
                    ha="left", va="top")  # fmt: skip
    edge = (_FOOT + _JOINTS * rows) / tall
    top = 1 - _HEAD / tall
    beside, lines = legends.small_grid(legends.keys(arms), 0.45 * _WIDE)
    highest = top - (0.42 + 0.2 * lines) / tall
    left = figure.add_gridspec(1, 1, left=_LEFT + 0.02 * scene.planar, right=0.48,
                               bottom=edge + 0.65 / tall, top=highest)  # fmt: skip
    right = figure.add_gridspec(1 + bool(shares), 1, left=0.541, right=0.97, hspace=0.55,
                                bottom=edge + 0.65 / tall, top=top - 0.5 / tall,
                                height_ratios=[1.5, 1.0][: 1 + bool(shares)])  # fmt: skip
    width = 0.925 * _WIDE / columns - _APART * (1 - 1 / columns)
    below = figure.add_gridspec(rows, columns, left=_LEFT + 0.01, right=0.97, bottom=_FOOT / tall,
                                top=edge - 0.2 / tall, hspace=0.42,
                                wspace=_APART / width)  # fmt: skip
    ax = scene.axes(figure, left[0, 0])
    *passed, last = scene.spaced(_POSTURES)
    scene.ghosts(ax, passed)
    scene.posture(ax, last)
    times = ", ".join(style.three(motion.time[k]) for k in (*passed, last))
    figure.text(_LEFT, top - 0.15 / tall, f"light to dark: at {times} s", fontsize=10, va="top")
    scene.legend(figure, ax, _LEFT, top - 0.3 / tall, beside)
    charts = [figure.add_subplot(right[0, 0])]
    draw_objective(charts[0], motion)
    if shares:
        charts.append(figure.add_subplot(right[1, 0]))
        draw_limits(charts[-1], shares)
    for k, arm in enumerate(arms):
        charts.append(figure.add_subplot(below[divmod(k, columns)]))
        draw_joints(charts[-1], motion, arm)
    for chart in charts[bool(shares) :]:
        chart.set_xlabel("time, s", labelpad=1)
    return figure
