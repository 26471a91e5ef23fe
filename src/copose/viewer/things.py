"""The object and obstacles as nodes of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from copose.problem import Obstacle, PlanarObstacle, Problem
from copose.report import style
from copose.viewer.bodies import body, edges
from copose.viewer.meshes import creased
from copose.viewer.names import node
from copose.viewer.robots import rgb

if TYPE_CHECKING:
    from viser import MeshHandle, SceneApi

# Opacity of the object: its ellipsoid is to be seen in it.
_OBJECT = 0.35
# Opacity of the object before.
_GHOST = 0.2
# Thickness of the edges of boxes, pixels.
_EDGE = 1.5
# Opacity of obstacles.
_OBSTACLE = 0.45


def add_object(
    scene: SceneApi, name: str, problem: Problem, *, ghost: bool = False
) -> MeshHandle | None:
    """Add the object's shape and its edges; None where it has no shape.

    Args:
        scene: where.
        name: of the node.
        problem: whose object.
        ghost: whether it is but where the object was before.
    """
    shape, planar = problem.object.shape, problem.space.planar
    if shape is None:
        return None
    made, rims = creased(body(shape)), edges(shape)
    if len(rims):
        scene.add_line_segments(
            f"{name}/edges",
            rims,
            rgb(style.BEFORE if ghost else style.INK),
            thickness=_EDGE,
            thickness_units="screen",
        )
    return scene.add_mesh_simple(
        name,
        made.vertices,
        made.faces,
        color=rgb(style.BEFORE if ghost else style.OBJECT),
        opacity=_GHOST if ghost else _OBJECT,
        # The front would hide the ellipsoid in it, translucent or not.
        side="front" if planar else "back",
        cast_shadow=not (planar or ghost),
        receive_shadow=False,
    )


def add_obstacle(scene: SceneApi, obstacle: Obstacle | PlanarObstacle) -> MeshHandle:
    """Add an obstacle where the problem has it: ``/obstacles/NAME``."""
    made, pose = creased(body(obstacle.shape)), obstacle.pose
    return scene.add_mesh_simple(
        node("obstacles", obstacle.name),
        made.vertices,
        made.faces,
        color=rgb(style.OBSTACLE),
        opacity=_OBSTACLE,
        receive_shadow=False,
        position=pose.position,
        wxyz=pose.quaternion,
    )
