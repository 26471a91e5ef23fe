"""Pictures of motions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from copose.report.charts.legends import legend_entries, small_grid
from copose.report.charts.motion import draw_joints, draw_limits, draw_objective
from copose.report.limit_use import limit_shares
from copose.report.numbers import three
from copose.report.scene.motion import MotionScene
from copose.report.words import motion_heading
from copose.results import Motion


@dataclass(frozen=True)
class MotionLook:
    """Sizes of the picture of a motion, inches but for the last three."""

    wide: float = 15.0  # width of the picture
    scene: float = 5.9  # height of the scene
    joints: float = 2.5  # height of a row of joints
    head: float = 0.45  # height above the scene
    foot: float = 0.5  # height below the joints
    apart: float = 1.0  # between charts of joints
    left: float = 0.035  # where the picture begins, as a share of its width
    in_row: int = 4  # charts of joints in a row
    postures: int = 6  # postures that are drawn, the last in full


def motion_figure(motion: Motion, look: MotionLook = MotionLook()) -> Figure:
    """Postures along the path, the objective, the use of limits, and every arm's joints."""
    shares, arms = limit_shares(motion), list(motion.joint_names)
    columns = min(len(arms), look.in_row)
    rows = -(-len(arms) // columns)
    tall = look.head + look.scene + look.joints * rows + look.foot
    figure = Figure(figsize=(look.wide, tall))
    figure.suptitle(motion_heading(motion), fontweight="bold", x=look.left, y=1 - 0.15 / tall,
                    ha="left", va="top")  # fmt: skip
    edge = (look.foot + look.joints * rows) / tall
    top = 1 - look.head / tall
    scene = MotionScene.of(motion)
    right = figure.add_gridspec(1 + bool(shares), 1, left=0.541, right=0.97, hspace=0.55,
                                bottom=edge + 0.65 / tall, top=top - 0.5 / tall,
                                height_ratios=[1.5, 1.0][: 1 + bool(shares)])  # fmt: skip
    width = 0.925 * look.wide / columns - look.apart * (1 - 1 / columns)
    below = figure.add_gridspec(rows, columns, left=look.left + 0.01, right=0.97,
                                bottom=look.foot / tall, top=edge - 0.2 / tall, hspace=0.42,
                                wspace=look.apart / width)  # fmt: skip
    _draw_scene(figure, scene, look, edge, top, tall)
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


def _draw_scene(
    figure: Figure, scene: MotionScene, look: MotionLook, edge: float, top: float, tall: float
) -> None:
    """Postures at the left, light to dark, with their times and a legend above.

    Args:
        figure: the figure.
        scene: the scene.
        look: sizes.
        edge: the scene's lower edge, as a share of the height; ``top`` its upper one.
        top: as ``edge``.
        tall: height of the figure, inches.
    """
    motion = scene.motion
    assert motion.time is not None
    columns, lines = small_grid(legend_entries(motion.joint_names), 0.45 * look.wide)
    highest = top - (0.42 + 0.2 * lines) / tall
    place: Any = figure.add_gridspec(1, 1, left=look.left + 0.02 * scene.planar, right=0.48,
                                     bottom=edge + 0.65 / tall, top=highest)[0, 0]  # fmt: skip
    ax = scene.axes(figure, place)
    *passed, last = scene.spaced(look.postures)
    scene.ghosts(ax, passed)
    scene.posture(ax, last)
    times = ", ".join(three(motion.time[k]) for k in (*passed, last))
    figure.text(look.left, top - 0.15 / tall, f"light to dark: at {times} s", fontsize=10,
                va="top")  # fmt: skip
    scene.legend(figure, ax, look.left, top - 0.3 / tall, columns)
