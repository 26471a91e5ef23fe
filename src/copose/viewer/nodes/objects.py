"""The object and obstacles as nodes of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from copose.collision import primitive_of
from copose.problem import Obstacle, PlanarObstacle, Problem
from copose.report.look import LOOK
from copose.viewer.names import node, rgb
from copose.viewer.surfaces.light_surfaces import creased
from copose.viewer.surfaces.triangles import primitive_edges, primitive_triangles

if TYPE_CHECKING:
    from viser import MeshHandle, SceneApi


@dataclass(frozen=True)
class ObjectLook:
    """The look of the object and of obstacles."""

    object: float = 0.35  # opacity, through which its ellipsoid is seen
    ghost: float = 0.2  # opacity of the object in an earlier posture
    obstacle: float = 0.45  # opacity
    edge: float = 1.5  # pixels, thickness of edges


def add_object(
    scene: SceneApi,
    name: str,
    problem: Problem,
    *,
    ghost: bool = False,
    look: ObjectLook = ObjectLook(),
) -> MeshHandle | None:
    """Add the object's shape and its edges; None where it has no shape."""
    shape, planar = problem.object.shape, problem.space.planar
    if shape is None:
        return None
    primitive = primitive_of(shape)
    surface, edges = creased(primitive_triangles(primitive)), primitive_edges(primitive)
    if len(edges):
        scene.add_line_segments(
            f"{name}/edges",
            edges,
            rgb(LOOK.before if ghost else LOOK.ink),
            thickness=look.edge,
            thickness_units="screen",
        )
    return scene.add_mesh_simple(
        name,
        surface.vertices,
        surface.faces,
        color=rgb(LOOK.before if ghost else LOOK.held_object),
        opacity=look.ghost if ghost else look.object,
        # The front would hide the ellipsoid in it, translucent or not.
        side="front" if planar else "back",
        cast_shadow=not (planar or ghost),
        receive_shadow=False,
    )


def add_obstacle(
    scene: SceneApi, obstacle: Obstacle | PlanarObstacle, look: ObjectLook = ObjectLook()
) -> MeshHandle:
    """Add an obstacle where the problem has it: ``/obstacles/NAME``."""
    surface = creased(primitive_triangles(primitive_of(obstacle.shape)))
    pose = obstacle.pose
    return scene.add_mesh_simple(
        node("obstacles", obstacle.name),
        surface.vertices,
        surface.faces,
        color=rgb(LOOK.obstacle),
        opacity=look.obstacle,
        receive_shadow=False,
        position=pose.position,
        wxyz=pose.quaternion,
    )
