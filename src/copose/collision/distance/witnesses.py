"""Answers of distance queries: the nearest pair of solids, and witness points of two parts."""

from __future__ import annotations

from dataclasses import dataclass

from copose.collision.carriers import Carrier
from copose.poses import Array


@dataclass(frozen=True)
class Nearest:
    """The two tested solids that are nearest to each other."""

    distance: float  # of the original shapes, m; ≤ 0 where they overlap
    pair: tuple[str, str]  # their names


@dataclass(frozen=True, eq=False)
class Witness:
    """The points at which two shapes are nearest to each other, or overlap deepest."""

    pair: int  # number of the tested pair that they are parts of
    distance: float  # m; where they overlap −(the depth of their hulls)
    first: Carrier  # the carrier of the first shape
    second: Carrier  # the carrier of the other
    a: Array  # the first's point, in its carrier's frame, (3,)
    b: Array  # the other's point, in its carrier's frame, (3,)
    # Unit, in the world, from the first to the other, (3,): moved along with the carriers n·(b − a)
    # is the distance to first order.
    normal: Array
