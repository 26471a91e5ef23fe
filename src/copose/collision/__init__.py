"""Solids of a cell, the pairs of them that may not touch, and their distances."""

from copose.collision.carriers import Carrier, Placements, configurations, joint_columns
from copose.collision.distance.bodies import Bodies, Witness
from copose.collision.distance.paired_solids import PartPoses
from copose.collision.scene import Scene, link_looks, link_solids, primitive_of
from copose.collision.shapes.primitives import Primitive
from copose.collision.shapes.solids import Part, Solid, link_outlines

__all__ = [
    "Bodies",
    "Carrier",
    "Part",
    "PartPoses",
    "Placements",
    "Primitive",
    "Scene",
    "Solid",
    "Witness",
    "configurations",
    "joint_columns",
    "link_looks",
    "link_outlines",
    "link_solids",
    "primitive_of",
]
