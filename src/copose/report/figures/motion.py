"""Pictures and films of motions."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from copose.report.charts.legends import legend_entries, small_grid
from copose.report.charts.motion import draw_joints, draw_limits, draw_objective
from copose.report.joint_curves import limit_shares
from copose.report.look import LOOK
from copose.report.scene.motion import MotionScene
from copose.report.words import motion_heading, three
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
    """Postures at the left, from a lower edge to an upper one, shares of the height, light to dark,
    with their times and a legend above.
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


@dataclass(frozen=True)
class FilmLook:
    """Size and pace of a film."""

    rate: float = 25.0  # frames a second, at most
    most: int = 100  # frames of a long motion
    least: int = 12  # frames of a short motion
    rest: float = 0.8  # time for which the end is seen, s
    width: float = 10.0  # inches
    height: float = 4.8  # inches
    dpi: int = 90  # pixels to an inch
    left: float = 0.03  # where the frame begins, as a share of its width


def motion_film(motion: Motion, look: FilmLook = FilmLook()) -> bytes:
    """A GIF in real time, of the knots that are nearest to its instants."""
    assert motion.time is not None and motion.knots is not None
    time = np.array(motion.time)
    duration = max(float(time[-1] - time[0]), 1 / look.rate)
    count = min(len(time), max(look.least, min(look.most, round(look.rate * duration))))
    ks = np.linspace(0, len(time) - 1, count).round().astype(int)
    rate = min(look.rate, max(count - 1, 1) / duration)
    scene, figure = MotionScene.of(motion), _figure(motion, look)
    columns, lines = small_grid(legend_entries(motion.joint_names), 0.48 * look.width)
    left = figure.add_gridspec(1, 1, left=look.left + 0.04 * scene.planar, right=0.52, bottom=0.11,
                               top=1 - (0.5 + 0.2 * lines) / look.height)  # fmt: skip
    right = figure.add_gridspec(1, 1, left=0.59, right=0.96, bottom=0.11, top=0.79)
    ax = scene.axes(figure, left[0, 0])
    chart = figure.add_subplot(right[0, 0])
    draw_objective(chart, motion)
    chart.set_xlabel("time, s", labelpad=1)
    line = chart.axvline(time[0], color=LOOK.ink, linewidth=1)
    (marker,) = chart.plot([], [], marker="o", markersize=8, color=LOOK.system,
                           markeredgecolor="white", zorder=6, clip_on=False)  # fmt: skip
    still = set(ax.get_children())
    scene.posture(ax, 0)
    scene.legend(figure, ax, look.left, 1 - 0.4 / look.height, columns)
    frames = []
    for k in ks:
        _clear(ax, still)
        scene.posture(ax, k)
        value = motion.knots[k].objective
        line.set_xdata([time[k], time[k]])
        marker.set_data([time[k]], [np.nan if value is None else value])
        frames.append(_pixels(figure, look))
    shown = [round(1000 / rate)] * len(frames)
    shown[-1] += round(1000 * look.rest)
    gif = io.BytesIO()
    frames[0].save(gif, "GIF", save_all=True, append_images=frames[1:], duration=shown, loop=0)
    return gif.getvalue()


def _figure(motion: Motion, look: FilmLook) -> Figure:
    """A figure with the heading alone."""
    figure = Figure(figsize=(look.width, look.height), facecolor="white")
    figure.suptitle(motion_heading(motion), fontweight="bold", fontsize=10, x=look.left, y=0.975,
                    ha="left", va="top")  # fmt: skip
    return figure


def _pixels(figure: Figure, look: FilmLook) -> Image.Image:
    size = round(look.width * look.dpi), round(look.height * look.dpi)
    pixels = io.BytesIO()
    figure.savefig(pixels, format="rgba", dpi=look.dpi)
    return Image.frombytes("RGBA", size, pixels.getvalue()).convert("RGB")


def _clear(ax: Any, still: set[Any]) -> None:
    """Axes without what moves."""
    for artist in ax.get_children():
        if artist not in still:
            artist.remove()
