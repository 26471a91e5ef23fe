"""What takes up room: solids, which of them may not touch, and how near they come."""

from copose.collision.bodies import Bodies, Nearest, Places, Witness
from copose.collision.carriers import (
    Carrier,
    Placements,
    carrier_poses,
    carriers_of,
    configurations,
    joint_columns,
)
from copose.collision.mesh_files import MeshFile, UnreadableError
from copose.collision.outlines import Outline, link_outlines
from copose.collision.scene import Scene, link_looks, link_solids
from copose.collision.solids import LinkLook, Mesh, Part, Primitive, Solid

__all__ = [
    "Bodies",
    "Carrier",
    "LinkLook",
    "Mesh",
    "MeshFile",
    "Nearest",
    "Outline",
    "Part",
    "Placements",
    "Places",
    "Primitive",
    "Scene",
    "Solid",
    "UnreadableError",
    "Witness",
    "carrier_poses",
    "carriers_of",
    "configurations",
    "joint_columns",
    "link_looks",
    "link_outlines",
    "link_solids",
]
