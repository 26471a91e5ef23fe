"""The best view of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.report.geometry.link_bodies import LinkBody
from copose.report.geometry.view import View


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


def best_view(
    scenes: Sequence[tuple[Sequence[LinkBody], Array]], options: ViewOptions = ViewOptions()
) -> View:
    """The view in which links, and hands and object above all, are hidden least.

    Args:
        scenes: the links of each, and points of its object, (k, 3).
        options: views that are compared; of equally good ones the nearest to the usual is taken.
    """
    views = [View(e, a) for e in options.elevations for a in options.azimuths]
    eyes = np.array([view.axes[2] for view in views])
    seen, whole = np.zeros(len(views)), 0.0
    for links, thing in scenes:
        points, weights, own = _sights(links, thing, options)
        seen += _seen(points, own, links, eyes) @ weights
        whole += weights.sum()
    if not whole:
        return views[0]
    # Far turns are taken where they show more.
    first = views[0]
    turn = np.array([abs((v.azimuth - first.azimuth + 180) % 360 - 180) / 180 for v in views])
    raised = np.array([view.elevation for view in views]) > first.elevation
    worth = seen / whole - options.better * (turn + raised)
    return views[int(worth.argmax())]


def _sights(
    links: Sequence[LinkBody], thing: Array, options: ViewOptions
) -> tuple[Array, Array, Indices]:
    """Points that are to be seen, (k, 3), their weights, (k,), and the link that each is of and
    that does not hide it, −1 for the object.
    """
    own = [k for k, link in enumerate(links) if link.arm is not None]
    points = [_spread(body, options.points) for body in (*(links[k].points for k in own), thing)]
    weights = [options.hand if links[k].last else options.link for k in own]
    weights.append(options.held_object * len(own))
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
