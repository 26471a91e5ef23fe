"""The grid that a cell stands on, or that lies behind a cell in the plane."""

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
    """Lay a grid under a cell, or behind it in the plane: ``/grid``.

    Args:
        scene: where it is drawn.
        arms: which stand on it.
        looks: of their links.
        points: of the cell, m, (k, 3).
        planar: whether arms move in the x-y plane.
        look: sizes and colours.
    """
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
