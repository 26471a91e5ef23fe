"""Obstacles around a posture as polygons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.problem import Obstacle, PlanarObstacle
from copose.report.geometry.shapes import cut, faces, outline
from copose.report.panels import Drawn


@dataclass(frozen=True, eq=False)
class DrawnObstacle:
    """The part of an obstacle that a picture shows."""

    name: str  # name of the obstacle
    faces: tuple[Array, ...]  # polygons in the world, (k, d) each; one in the plane
    round: bool  # whether the obstacle is round, so that edges between faces are not drawn

    @property
    def points(self) -> Array:
        """All corners, (k, d)."""
        return np.vstack(self.faces)


def bodies(
    solution: Drawn, low: Array, high: Array, *, margin: float = 0.25
) -> list[DrawnObstacle]:
    """Obstacles near a scene; of those larger than it the parts that are near.

    Args:
        solution: the result, or the problem.
        low: least coordinates of arms and object, (d,).
        high: largest coordinates, (d,).
        margin: distance up to which large obstacles are drawn, as a share of the scene: a whole
            floor would dwarf what stands on it.
    """
    size = float((high - low).max())
    beyond = margin * size
    shown = []
    for obstacle in solution.problem.obstacles:
        whole = _faces(obstacle)
        parts = [cut(face, low - beyond, high + beyond) for face in whole]
        near = tuple(part for part in parts if len(part))
        if near and float(np.ptp(np.vstack(whole), axis=0).max()) <= size:
            near = tuple(whole)
        if near:
            shown.append(DrawnObstacle(obstacle.name, near, obstacle.shape.kind != "box"))
    return shown


def _faces(obstacle: Obstacle | PlanarObstacle) -> list[Array]:
    """An obstacle as polygons in the world."""
    if isinstance(obstacle, PlanarObstacle):
        return [outline(obstacle.shape, obstacle.position, obstacle.angle)]
    return faces(obstacle.shape, obstacle.position, obstacle.pose.rotation)
