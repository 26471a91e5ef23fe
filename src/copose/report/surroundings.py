"""What stands around a posture: obstacles, and the capsules that arms are kept apart by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from copose.poses import Array
from copose.problem import Obstacle, PlanarObstacle
from copose.report import style
from copose.report.frames import view_axes
from copose.report.shapes import cut, faces, outline, stadium
from copose.report.style import Drawn
from copose.results import Posture

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


def capsules(posture: Posture) -> dict[str, tuple[Array, str]]:
    """Rows of two ends and a radius, (count, 7), and a colour, by arm or robot."""
    colors = style.arm_colors(posture)
    return {
        name: (np.array(rows), colors.get(name, style.BEFORE))
        for name, rows in (posture.capsules or {}).items()
        if name != "object" and rows
    }


def flat_capsule(row: Array) -> Array:
    """The corners of a capsule in the plane, (k, 2)."""
    return stadium(row[:2], row[3:5], row[6])


def seen_capsule(row: Array) -> Array:
    """The corners in space, (k, 3), of a capsule's outline as pictures are seen."""
    view = view_axes()
    a, b = (view @ end for end in (row[:3], row[3:6]))
    rim = stadium(a[:2], b[:2], row[6])
    half = len(rim) // 2
    depths = np.repeat([b[2], a[2]], half)
    return np.asarray(np.column_stack([rim, depths]) @ view)


def capsule_points(posture: Posture) -> Array:
    """Points, (k, 3), that are as far out as the capsules of a posture."""
    rows = [rows for rows, _ in capsules(posture).values()]
    if not rows:
        return np.zeros((0, 3))
    every = np.vstack(rows)
    ends = np.vstack([every[:, :3], every[:, 3:6]])
    radii = np.tile(every[:, 6:], (2, 1))
    return np.vstack([ends - radii, ends + radii])
