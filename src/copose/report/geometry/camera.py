"""Where a scene is best seen from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from copose.poses import Array, Indices, Mask
from copose.report.geometry.link_bodies import LinkBody
from copose.report.geometry.view import View

# What is tried, degrees; of equally good views the one nearest to the first is taken.
_AZIMUTHS = tuple(range(-62, 298, 20))
_ELEVATIONS = (18, 32)
# Weight of a hand.
_HAND = 3.0
# Weight of any other link.
_LINK = 1.0
# Weight of the object, as a share of the links' number.
_OBJECT = 0.25
# What the best view is better by than the usual one, as a share of all that could be seen.
_BETTER = 0.03
# Points of a body that stand for it.
_FEW = 6


def best_view(scenes: Sequence[tuple[Sequence[LinkBody], Array]]) -> View:
    """The view in which links, and hands and object above all, are hidden least.

    Args:
        scenes: the links of each, and points of its object, (k, 3).
    """
    views = [View(e, a) for e in _ELEVATIONS for a in _AZIMUTHS]
    eyes = np.array([view.axes[2] for view in views])
    seen, whole = np.zeros(len(views)), 0.0
    for links, thing in scenes:
        points, weights, own = _sights(links, thing)
        seen += _seen(points, own, links, eyes) @ weights
        whole += weights.sum()
    if not whole:
        return views[0]
    # Far turns are taken where they show more.
    turn = np.array([abs((view.azimuth + 62 + 180) % 360 - 180) / 180 for view in views])
    worth = seen / whole - _BETTER * (turn + (np.array([v.elevation for v in views]) > 18))
    return views[int(worth.argmax())]


def _sights(links: Sequence[LinkBody], thing: Array) -> tuple[Array, Array, Indices]:
    """What is to be seen: points, (k, 3), what they count, (k,), and the link each is of, which
    does not hide it, −1 for the object's.
    """
    own = [k for k, link in enumerate(links) if link.arm is not None]
    points = [*(_spread(links[k].points) for k in own), _spread(thing)]
    each = [_HAND if links[k].last else _LINK for k in own] + [_OBJECT * len(own)]
    count = len(points[0])
    return np.vstack(points), np.repeat(each, count) / count, np.repeat([*own, -1], count)


def _spread(points: Array) -> Array:
    """A few of some points, as far from each other as may be."""
    chosen = [points.mean(axis=0)]
    for _ in range(_FEW):
        gaps = np.min([np.linalg.norm(points - each, axis=1) for each in chosen], axis=0)
        chosen.append(points[int(gaps.argmax())])
    return np.array(chosen)


def _seen(points: Array, own: Indices, links: Sequence[LinkBody], eyes: Array) -> Mask:
    """Which points are seen from each eye, afar, (views, 3); (views, k)."""
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
