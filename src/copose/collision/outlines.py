"""Outlines of links, for pictures: points whose convex hull is about that of a shape."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from copose.collision.carriers import Carrier
from copose.collision.solids import Solid
from copose.poses import Array

# Directions in which outlines reach as far as shapes do: in the plane, and in space.
_TURNS = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
_AROUND = np.column_stack([np.cos(_TURNS), np.sin(_TURNS), np.zeros(24)])
_CUBE = np.array([d for d in np.ndindex(5, 5, 5) if {0, 4} & set(d)]) - 2.0
_ABOUT = _CUBE / np.linalg.norm(_CUBE, axis=1, keepdims=True)
# Digits of a metre that a picture shows.
_DIGITS = 5


@dataclass(frozen=True, eq=False)
class Outline:
    """The outline of one convex part of a link.

    Attributes:
        carrier: what moves the link.
        points: in the carrier's frame, (k, 3).
    """

    carrier: Carrier
    points: Array


def link_outlines(solids: Sequence[Solid], *, planar: bool) -> list[Outline]:
    """The outlines of those solids that are links of arms."""
    links = [solid for solid in solids if solid.carrier.kind in ("root", "joint")]
    return [outline for link in links for outline in _outlines(link, planar)]


def _outlines(solid: Solid, planar: bool) -> Iterator[Outline]:
    directions = _AROUND if planar else _ABOUT
    for part in solid.parts:
        pose = solid.placement @ part.placement
        corners, beyond = part.shape.hull
        corners = corners @ pose.rotation.T + pose.position
        outermost = (corners @ directions.T).argmax(axis=0)
        points = np.round(corners[outermost] + beyond * directions, _DIGITS) + 0.0
        yield Outline(solid.carrier, np.unique(points, axis=0))
