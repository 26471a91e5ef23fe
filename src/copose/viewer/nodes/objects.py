"""The object, obstacles, the grid that a cell stands on or that lies behind it, and the lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from copose.collision import primitive_of
from copose.poses import Array
from copose.problem import Obstacle, PlanarObstacle, Problem
from copose.report.look import LOOK
from copose.robots import Arm
from copose.viewer.looks import Look
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
    scene: SceneApi, name: str, problem: Problem, *, ghost: bool = False
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
            thickness=ObjectLook.edge,
            thickness_units="screen",
        )
    return scene.add_mesh_simple(
        name,
        surface.vertices,
        surface.faces,
        color=rgb(LOOK.before if ghost else LOOK.held_object),
        opacity=ObjectLook.ghost if ghost else ObjectLook.object,
        # The front would hide the ellipsoid in it, translucent or not.
        side="front" if planar else "back",
        cast_shadow=not (planar or ghost),
        receive_shadow=False,
    )


def add_obstacle(scene: SceneApi, obstacle: Obstacle | PlanarObstacle) -> MeshHandle:
    """Add an obstacle where the problem has it: ``/obstacles/NAME``."""
    surface = creased(primitive_triangles(primitive_of(obstacle.shape)))
    pose = obstacle.pose
    return scene.add_mesh_simple(
        node("obstacles", obstacle.name),
        surface.vertices,
        surface.faces,
        color=rgb(LOOK.obstacle),
        opacity=ObjectLook.obstacle,
        receive_shadow=False,
        position=pose.position,
        wxyz=pose.quaternion,
    )


@dataclass(frozen=True)
class GridLook:
    """The look of the grid on the ground."""

    width: float = 3.0  # as a share of the scene
    cell: float = 0.1  # m
    section: float = 0.5  # m
    cell_color: tuple[int, int, int] = (228, 228, 228)
    section_color: tuple[int, int, int] = (200, 200, 200)
    below: float = 0.002  # m, under what stands on it
    behind: float = 0.1  # m, under the plane in planar cells


def lay_grid(
    scene: SceneApi, arms: Sequence[Arm], looks: Sequence[Look], points: Array, *, planar: bool
) -> None:
    """Lay a grid under a cell, or behind it in the plane: ``/grid``."""
    low, high = points.min(axis=0), points.max(axis=0)
    width = float(np.ceil(GridLook.width * (high - low).max()))
    x, y, _ = np.round((low + high) / 2)
    scene.add_grid(
        node("grid"),
        width=width,
        height=width,
        plane="xy",
        cell_size=GridLook.cell,
        section_size=GridLook.section,
        cell_color=GridLook.cell_color,
        section_color=GridLook.section_color,
        position=(
            float(x),
            float(y),
            -GridLook.behind if planar else _lowest(arms, looks) - GridLook.below,
        ),
    )


def _lowest(arms: Sequence[Arm], looks: Sequence[Look]) -> float:
    """The lowest coordinate of what stands still, m; 0 where it stands above the origin."""
    heights = [0.0, *(float(arm.base.position[2]) for arm in arms)]
    for look in looks:
        if look.carrier.kind == "root":
            base = arms[look.carrier.arm].base
            heights.append(float((look.vertices @ base.rotation[2]).min() + base.position[2]))
    return min(heights)


@dataclass(frozen=True)
class LightLook:
    """Brightness, colour and direction of lights."""

    around: float = 1.5  # brightness of light from all sides
    ground: tuple[int, int, int] = (150, 150, 150)  # colour of what comes from below
    front: float = 1.3  # brightness of light from beside the eye
    distance: float = 30.0  # m, of that light; only its direction counts
    aside: float = 0.45  # how far beside and above the eye it is, as a share of its distance


def light(scene: SceneApi, *, planar: bool) -> None:
    """Light a scene without pictures of surroundings, which cost most of a page's drawing."""
    scene.configure_environment_map(None)
    scene.configure_default_lights(cast_shadow=not planar)
    scene.add_light_hemisphere(
        node("lights", "around"), ground_color=LightLook.ground, intensity=LightLook.around
    )


def light_from(scene: SceneApi, right: Array, up: Array, toward: Array) -> None:
    """Light a scene from beside an eye, by unit vectors to its right, up and towards it, (3,)."""
    x, y, z = LightLook.distance * (toward + LightLook.aside * (up - right))
    scene.add_light_directional(
        node("lights", "front"), intensity=LightLook.front, position=(float(x), float(y), float(z))
    )
