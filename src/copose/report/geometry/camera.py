"""The view of a scene: its direction, its axes, and the best one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.report.geometry.hulls import LinkBody


@dataclass(frozen=True)
class View:
    """The direction that a scene is seen from."""

    elevation: float = 18.0  # above the horizon, degrees
    azimuth: float = -62.0  # about the vertical, from x, degrees

    @property
    def axes(self) -> Array:
        """Unit vectors to the right, up and towards the eye, (3, 3), as from afar."""
        elevation, azimuth = np.radians((self.elevation, self.azimuth))
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        flat = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        to_eye = np.cos(elevation) * flat + np.array([0.0, 0.0, np.sin(elevation)])
        return np.array([right, np.cross(to_eye, right), to_eye])


def roomy(points: Array) -> tuple[Array, Array]:
    """The box around points, (k, 3), with a margin; a flat one is made thicker to be drawn in."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    thin = np.maximum(0.35 * size - (high - low), 0.0) / 2
    return low - thin - 0.03 * size, high + thin + 0.03 * size


def frame(
    ax: Any, low: Array, high: Array, labels: Sequence[str], view: View, *, whole: bool = False
) -> None:
    """Axes from low to high at one scale.

    A tall box is drawn smaller, and with ``whole`` any, so that labels stay within the panel.
    """
    width, depth, height = high - low
    tall = height / max(width, depth)
    zoom = min(1.0 if whole else 1.08, (1.2 / tall) ** 0.5)
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_zlim(low[2], high[2])
    ax.set_box_aspect(high - low, zoom=zoom)
    ax.view_init(elev=view.elevation, azim=view.azimuth)
    ax.locator_params(nbins=4)
    ax.tick_params(labelsize=8, pad=-1)
    ax.set_xlabel(labels[0], labelpad=0)
    ax.set_ylabel(labels[1], labelpad=-2)
    ax.set_zlabel(labels[2], labelpad=1)


@dataclass(frozen=True)
class ViewOptions:
    """Views that are compared, and weights of what they show."""

    azimuths: tuple[int, ...] = tuple(range(-62, 298, 20))  # degrees, the usual one first
    elevations: tuple[int, ...] = (18, 32)  # degrees, alike
    hand: float = 3.0  # weight of a hand
    link: float = 1.0  # weight of any other link
    held_object: float = 0.25  # weight of the object, as a share of the number of links
    better: float = 0.03  # by which the best view has to beat the usual one, as a share of all
    points: int = 6  # points that stand for a body, besides its middle


def best_view(scenes: Sequence[tuple[Sequence[LinkBody], Array]]) -> View:
    """The view in which links, and hands and object above all, are hidden least; of equally good
    ones the nearest to the usual.

    Args:
        scenes: the links of each, and points of its object, (k, 3).
    """
    views = [View(e, a) for e in ViewOptions.elevations for a in ViewOptions.azimuths]
    eyes = np.array([view.axes[2] for view in views])
    seen, whole = np.zeros(len(views)), 0.0
    for links, thing in scenes:
        points, weights, own = _sights(links, thing)
        seen += _seen(points, own, links, eyes) @ weights
        whole += weights.sum()
    if not whole:
        return views[0]
    # Far turns are taken where they show more.
    first = views[0]
    turn = np.array([abs((v.azimuth - first.azimuth + 180) % 360 - 180) / 180 for v in views])
    raised = np.array([view.elevation for view in views]) > first.elevation
    worth = seen / whole - ViewOptions.better * (turn + raised)
    return views[int(worth.argmax())]


def _sights(links: Sequence[LinkBody], thing: Array) -> tuple[Array, Array, Indices]:
    """Points that are to be seen, (k, 3), their weights, (k,), and the link that each is of and
    that does not hide it, −1 for the object.
    """
    own = [k for k, link in enumerate(links) if link.arm is not None]
    points = [
        _spread(body, ViewOptions.points) for body in (*(links[k].points for k in own), thing)
    ]
    weights = [ViewOptions.hand if links[k].last else ViewOptions.link for k in own]
    weights.append(ViewOptions.held_object * len(own))
    count = len(points[0])
    return np.vstack(points), np.repeat(weights, count) / count, np.repeat([*own, -1], count)


def _spread(points: Array, count: int) -> Array:
    """The middle of points and some of them, as far from each other as may be."""
    chosen = [points.mean(axis=0)]
    for _ in range(count):
        gaps = np.min([np.linalg.norm(points - point, axis=1) for point in chosen], axis=0)
        chosen.append(points[int(gaps.argmax())])
    return np.array(chosen)


def _seen(points: Array, own: Indices, links: Sequence[LinkBody], eyes: Array) -> Mask:
    """Mask of the points that are seen from each eye, afar, (views, 3); (views, k)."""
    hidden = np.zeros((len(eyes), len(points)), dtype=bool)
    for k, link in enumerate(links):
        # A ray p + s e runs within every face's half-space between two values of s.
        room = link.offsets - points @ link.normals.T
        rise = (eyes @ link.normals.T)[:, None, :]
        with np.errstate(divide="ignore", invalid="ignore"):
            at = room[None] / rise
        leave = np.where(rise > 0, at, np.inf).min(axis=2)
        enter = np.where(rise < 0, at, -np.inf).max(axis=2)
        hidden |= (leave > np.maximum(enter, 0.0) + 1e-9) & (own != k)
    return ~hidden
