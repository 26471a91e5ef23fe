"""The grid that a cell stands on, or that lies behind a cell in the plane, and the lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from copose.poses import Array
from copose.robots import Arm
from copose.viewer.looks import Look
from copose.viewer.names import node

if TYPE_CHECKING:
    from viser import SceneApi


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
    scene: SceneApi,
    arms: Sequence[Arm],
    looks: Sequence[Look],
    points: Array,
    *,
    planar: bool,
    look: GridLook = GridLook(),
) -> None:
    """Lay a grid under a cell, or behind it in the plane: ``/grid``."""
    low, high = points.min(axis=0), points.max(axis=0)
    width = float(np.ceil(look.width * (high - low).max()))
    x, y, _ = np.round((low + high) / 2)
    scene.add_grid(
        node("grid"),
        width=width,
        height=width,
        plane="xy",
        cell_size=look.cell,
        section_size=look.section,
        cell_color=look.cell_color,
        section_color=look.section_color,
        position=(
            float(x),
            float(y),
            -look.behind if planar else _lowest(arms, looks) - look.below,
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


def light(scene: SceneApi, *, planar: bool, look: LightLook = LightLook()) -> None:
    """Light a scene without pictures of surroundings, which cost most of a page's drawing."""
    scene.configure_environment_map(None)
    scene.configure_default_lights(cast_shadow=not planar)
    scene.add_light_hemisphere(
        node("lights", "around"), ground_color=look.ground, intensity=look.around
    )


def light_from(
    scene: SceneApi, right: Array, up: Array, toward: Array, look: LightLook = LightLook()
) -> None:
    """Light a scene from beside an eye, by unit vectors to its right, up and towards it, (3,)."""
    x, y, z = look.distance * (toward + look.aside * (up - right))
    scene.add_light_directional(
        node("lights", "front"), intensity=look.front, position=(float(x), float(y), float(z))
    )
