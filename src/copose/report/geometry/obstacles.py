"""What stands around a posture: obstacles, and the bodies of links."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.problem import Obstacle, PlanarObstacle
from copose.report.geometry.shapes import cut, faces, outline
from copose.report.style import Drawn

# How far beyond arms and object large obstacles are drawn, as a share of the scene: a floor would
# dwarf what stands on it.
_BEYOND = 0.25


@dataclass(frozen=True, eq=False)
class Body:
    """What a picture shows of an obstacle.

    Attributes:
        name: the obstacle's.
        faces: polygons in the world, (k, d) each; one in the plane.
        round: whether the edges between faces are none of its own.
    """

    name: str
    faces: tuple[Array, ...]
    round: bool

    @property
    def points(self) -> Array:
        """All corners, (k, d)."""
        return np.vstack(self.faces)


def bodies(solution: Drawn, low: Array, high: Array) -> list[Body]:
    """Obstacles near a scene from low to high; of those larger than it the parts that are near."""
    size = float((high - low).max())
    beyond = _BEYOND * size
    found = []
    for obstacle in solution.problem.obstacles:
        whole = _faces(obstacle)
        parts = [cut(face, low - beyond, high + beyond) for face in whole]
        near = tuple(part for part in parts if len(part))
        if near and float(np.ptp(np.vstack(whole), axis=0).max()) <= size:
            near = tuple(whole)
        if near:
            found.append(Body(obstacle.name, near, obstacle.shape.kind != "box"))
    return found


def _faces(obstacle: Obstacle | PlanarObstacle) -> list[Array]:
    if isinstance(obstacle, PlanarObstacle):
        return [outline(obstacle.shape, obstacle.position, obstacle.angle)]
    return faces(obstacle.shape, obstacle.position, obstacle.pose.rotation)
