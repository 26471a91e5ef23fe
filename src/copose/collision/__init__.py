"""What takes up room: solids, the capsules around them, and which may not touch."""

from copose.collision.capsules import Capsule, around_hull, around_surface
from copose.collision.carriers import Carrier, Placements, carrier_poses, carriers_of
from copose.collision.scene import Nearest, Scene
from copose.collision.solids import Mesh, Part, Primitive, Solid

__all__ = [
    "Capsule",
    "Carrier",
    "Mesh",
    "Nearest",
    "Part",
    "Placements",
    "Primitive",
    "Scene",
    "Solid",
    "around_hull",
    "around_surface",
    "carrier_poses",
    "carriers_of",
]
