"""The ground that a cell stands on, and what lies behind one in the plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from copose.poses import Array
from copose.robots import Arm
from copose.viewer.looks import Look
from copose.viewer.names import node

if TYPE_CHECKING:
    from viser import SceneApi

# Width of the grid, as a share of the scene.
_WIDTH = 3.0
# Width of its cells, m.
_CELL = 0.1
# Width of its sections, m.
_SECTION = 0.5
# Grey of cells, 0 to 255.
_LIGHT = 228
# Grey of sections, 0 to 255.
_DARK = 200
# How far below what stands on it the grid is, m.
_BELOW = 0.002
# How far below the plane the grid of planar cells is, m.
_BEHIND = 0.1


def lay_grid(
    scene: SceneApi, arms: Sequence[Arm], looks: Sequence[Look], points: Array, *, planar: bool
) -> None:
    """Lay a grid under a cell, or behind it in the plane: ``/grid``.

    Args:
        scene: where.
        arms: which stand on it.
        looks: of their links.
        points: of the cell, (k, 3).
        planar: whether arms move in the x-y plane.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    width = float(np.ceil(_WIDTH * (high - low).max()))
    x, y, _ = np.round((low + high) / 2)
    scene.add_grid(
        node("grid"),
        width=width,
        height=width,
        plane="xy",
        cell_size=_CELL,
        section_size=_SECTION,
        cell_color=(_LIGHT, _LIGHT, _LIGHT),
        section_color=(_DARK, _DARK, _DARK),
        position=(float(x), float(y), -_BEHIND if planar else _lowest(arms, looks) - _BELOW),
    )


def _lowest(arms: Sequence[Arm], looks: Sequence[Look]) -> float:
    """How low what stands still reaches, m; 0 where it stands above the origin."""
    found = [0.0, *(float(arm.base.position[2]) for arm in arms)]
    for look in looks:
        if look.carrier.kind == "root":
            base = arms[look.carrier.arm].base
            found.append(float((look.vertices @ base.rotation[2]).min() + base.position[2]))
    return min(found)
