"""Where a scene is best seen from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.report.frames import View
from copose.report.link_bodies import LinkBody

# What is tried, degrees; of equally good views the one nearest to the first is taken.
_AZIMUTHS = tuple(range(-62, 298, 20))
_ELEVATIONS = (18, 32)
# What a point of a hand or of the object counts against one of another link.
_HAND, _OBJECT, _LINK = 3.0, 1.0, 1.0
# What the best view is better by than the usual one, as a share of all that could be seen.
_BETTER = 0.03
# Points of a body that stand for it.
_FEW = 6


@dataclass(frozen=True, eq=False)
class Sight:
    """Something that is to be seen.

    Attributes:
        points: in the world, (k, 3).
        weight: of all of them.
        own: number of the body they are of, which does not hide them; None of the object.
    """

    points: Array
    weight: float
    own: int | None


def best_view(scenes: Sequence[tuple[Sequence[LinkBody], Array]]) -> View:
    """The view in which links, and hands and object above all, are hidden least.

    Args:
        scenes: the links of each, and points of its object, (k, 3).
    """
    views = [View(e, a) for e in _ELEVATIONS for a in _AZIMUTHS]
    eyes = np.array([view.axes[2] for view in views])
    seen, whole = np.zeros(len(views)), 0.0
    for links, thing in scenes:
        for sight in _sights(links, thing):
            seen += sight.weight * _shares(sight, links, eyes)
            whole += sight.weight
    if not whole:
        return views[0]
    # Far turns are taken where they show more.
    turn = np.array([abs((view.azimuth + 62 + 180) % 360 - 180) / 180 for view in views])
    worth = seen / whole - _BETTER * (turn + (np.array([v.elevation for v in views]) > 18))
    return views[int(worth.argmax())]


def _sights(links: Sequence[LinkBody], thing: Array) -> list[Sight]:
    found = [
        Sight(_spread(link.points), _HAND if link.last else _LINK, k)
        for k, link in enumerate(links)
        if link.arm is not None
    ]
    return [*found, Sight(_spread(thing), _OBJECT * len(found) / 4, None)]


def _spread(points: Array) -> Array:
    """A few of some points, as far from each other as may be."""
    chosen = [points.mean(axis=0)]
    for _ in range(_FEW):
        gaps = np.min([np.linalg.norm(points - each, axis=1) for each in chosen], axis=0)
        chosen.append(points[int(gaps.argmax())])
    return np.array(chosen)


def _shares(sight: Sight, links: Sequence[LinkBody], eyes: Array) -> Array:
    """Which share of a sight's points is seen from each eye, afar, (views, 3); (views,)."""
    hidden = np.zeros((len(eyes), len(sight.points)), dtype=bool)
    for k, link in enumerate(links):
        if k != sight.own:
            # A ray p + s e runs within every face's half-space between two values of s.
            room = link.offsets - sight.points @ link.normals.T
            rise = eyes @ link.normals.T
            with np.errstate(divide="ignore", invalid="ignore"):
                at = room[None] / rise[:, None, :]
            leave = np.where(rise[:, None, :] > 0, at, np.inf).min(axis=2)
            enter = np.where(rise[:, None, :] < 0, at, -np.inf).max(axis=2)
            hidden |= leave > np.maximum(enter, 0.0) + 1e-9
    return np.asarray(1.0 - hidden.mean(axis=1))
