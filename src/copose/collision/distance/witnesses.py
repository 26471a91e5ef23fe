"""Answers of distance queries: the nearest pair of solids, and witness points of two parts."""

from __future__ import annotations

from dataclasses import dataclass

from copose.collision.carriers import Carrier
from copose.poses import Array


@dataclass(frozen=True)
class Nearest:
    """The two tested solids that are nearest to each other.

    Attributes:
        distance: of the original shapes, m; ≤ 0 where they overlap.
        pair: their names.
    """

    distance: float
    pair: tuple[str, str]


@dataclass(frozen=True, eq=False)
class Witness:
    """The points at which two shapes are nearest to each other, or overlap deepest.

    Attributes:
        pair: number of the tested pair that they are parts of.
        distance: m; where they overlap −(the depth of their hulls).
        first: the carrier of the first shape.
        second: the carrier of the other.
        a: the first's point, in its carrier's frame, (3,).
        b: the other's point, in its carrier's frame, (3,).
        normal: unit, in the world, from the first to the other, (3,): moved along with the carriers
            n·(b − a) is the distance to first order.
    """

    pair: int
    distance: float
    first: Carrier
    second: Carrier
    a: Array
    b: Array
    normal: Array
