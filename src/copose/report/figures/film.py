"""A motion as a film: the arms move, and a marker runs along what they are worth."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from copose.report import style
from copose.report.charts import legends
from copose.report.charts.motion import draw_objective
from copose.report.motion_words import motion_heading
from copose.report.scene.motion import MotionScene
from copose.results import Motion

# Pictures a second at most, and in all at most and, of a short motion, at least.
_RATE, _MOST, _LEAST = 25.0, 100, 12
# s, that the end is seen.
_REST = 0.8
_SIZE, _DPI, _LEFT = (10.0, 4.8), 90, 0.03


def film(motion: Motion) -> bytes:
    """A GIF in real time, of the knots that are nearest to its instants."""
    assert motion.time is not None and motion.knots is not None
    time = np.array(motion.time)
    duration = max(float(time[-1] - time[0]), 1 / _RATE)
    count = min(len(time), max(_LEAST, min(_MOST, round(_RATE * duration))))
    ks = np.linspace(0, len(time) - 1, count).round().astype(int)
    rate = min(_RATE, max(count - 1, 1) / duration)
    scene = MotionScene.of(motion)
    figure = Figure(figsize=_SIZE, facecolor="white")
    figure.suptitle(motion_heading(motion), fontweight="bold", fontsize=10, x=_LEFT, y=0.975,
                    ha="left", va="top")  # fmt: skip
    columns, lines = legends.small_grid(legends.keys(motion.joint_names), 0.48 * _SIZE[0])
    below = 1 - (0.5 + 0.2 * lines) / _SIZE[1]
    left = figure.add_gridspec(1, 1, left=_LEFT + 0.04 * scene.planar, right=0.52, bottom=0.11,
                               top=below)  # fmt: skip
    right = figure.add_gridspec(1, 1, left=0.59, right=0.96, bottom=0.11, top=0.79)
    ax = scene.axes(figure, left[0, 0])
    chart = figure.add_subplot(right[0, 0])
    draw_objective(chart, motion)
    chart.set_xlabel("time, s", labelpad=1)
    line = chart.axvline(time[0], color=style.INK, linewidth=1)
    (marker,) = chart.plot([], [], marker="o", markersize=8, color=style.SYSTEM,
                           markeredgecolor="white", zorder=6, clip_on=False)  # fmt: skip
    still = set(ax.get_children())
    scene.posture(ax, 0)
    scene.legend(figure, ax, _LEFT, 1 - 0.4 / _SIZE[1], columns)
    frames, size = [], (round(_SIZE[0] * _DPI), round(_SIZE[1] * _DPI))
    for k in ks:
        _clear(ax, still)
        scene.posture(ax, k)
        value = motion.knots[k].objective
        line.set_xdata([time[k], time[k]])
        marker.set_data([time[k]], [np.nan if value is None else value])
        pixels = io.BytesIO()
        figure.savefig(pixels, format="rgba", dpi=_DPI)
        frames.append(Image.frombytes("RGBA", size, pixels.getvalue()).convert("RGB"))
    shown = [round(1000 / rate)] * len(frames)
    shown[-1] += round(1000 * _REST)
    film = io.BytesIO()
    frames[0].save(film, "GIF", save_all=True, append_images=frames[1:], duration=shown, loop=0)
    return film.getvalue()


def _clear(ax: Any, still: set[Any]) -> None:
    """Axes without what moves."""
    for artist in ax.get_children():
        if artist not in still:
            artist.remove()
