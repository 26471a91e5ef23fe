"""Closed skins round surfaces in pieces, which can be reduced where the pieces cannot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, label
from scipy.spatial import KDTree

from copose.poses import Array, Indices, Mask
from copose.viewer.surfaces.triangles import Triangles


@dataclass(frozen=True)
class SkinOptions:
    """The grid and the points by which a skin is found."""

    cells: int = 64  # along the surface's longest side
    off: float = 0.9  # cells from the surface to the skin; narrower holes are closed
    back: float = 0.9  # share of that by which the skin is moved back
    dense: float = 2.5  # points cast on the surface, to a cell's width each way
    kept: float = 2.0  # of these kept, to a cell's width each way: sheets may lie on each other
    points: int = 500_000  # cast at most
    seed: int = 0  # of the points


def wrapped(surface: Triangles, options: SkinOptions = SkinOptions()) -> Triangles:
    """A skin round a surface, not empty, as seen from outside, without what is within it."""
    low = surface.vertices.min(axis=0)
    cell = float(np.ptp(surface.vertices, axis=0).max()) / options.cells
    points = _thinned(_points(surface, cell, options), cell / options.kept)
    tree = KDTree(points)
    origin = low - 4 * cell
    shape = np.ceil((surface.vertices.max(axis=0) - low) / cell).astype(int) + 9
    level = _level(tree, points, origin, shape, cell, options.off)
    skin = _net(level)
    corners = origin + cell * skin.vertices
    # Most of the way back to the surface: two skins of one sheet must not meet.
    away, nearest = tree.query(corners)
    share = options.back * np.minimum(options.off * cell / np.maximum(away, 1e-12), 1.0)
    corners += share[:, None] * (points[nearest] - corners)
    return Triangles(corners, skin.faces)


def _points(surface: Triangles, cell: float, options: SkinOptions) -> Array:
    """Points of a surface, its corners among them, (k, 3)."""
    count = int(surface.areas.sum() * (options.dense / cell) ** 2)
    rng = np.random.default_rng(options.seed)
    scattered = surface.scattered(min(count, options.points), rng)
    return np.vstack([surface.vertices, scattered])


def _thinned(points: Array, cell: float) -> Array:
    """The mean of the points of every cell, (k, 3)."""
    place = ((points - points.min(axis=0)) / cell).astype(np.int64)
    code = (place[:, 0] << 42) | (place[:, 1] << 21) | place[:, 2]
    _, number, count = np.unique(code, return_inverse=True, return_counts=True)
    sums = [np.bincount(number, coordinate) for coordinate in points.T]
    return np.column_stack(sums) / count[:, None]


def _level(
    tree: KDTree, points: Array, origin: Array, shape: Indices, cell: float, off: float
) -> Array:
    """Signed distance of corners of cells from the skin, in cells; below zero within it."""
    near = np.zeros(shape, dtype=bool)
    near[tuple(np.rint((points - origin) / cell).astype(int).T)] = True
    near = binary_dilation(near, np.ones((3, 3, 3), bool), iterations=2)
    level = np.full(shape, 2.0)
    where = np.argwhere(near)
    level[near] = tree.query(origin + cell * where)[0] / cell - off
    outside, _ = label(level > 0)
    # The corner of the box is outside.
    level[outside != outside[0, 0, 0]] = np.minimum(level, -0.5)[outside != outside[0, 0, 0]]
    return level


def _net(level: Array) -> Triangles:
    """The zero surface of a function on a grid, as a net with one corner in each cell that it
    crosses, in units of the grid.
    """
    inside = level < 0
    cells = np.zeros(np.array(level.shape) - 1, dtype=int)
    corners = np.array(list(np.ndindex(2, 2, 2)))
    for corner in corners:
        cells += _shifted(inside, corner)
    crossed: Mask = (cells > 0) & (cells < 8)
    number = np.full(cells.shape, -1)
    number[crossed] = np.arange(crossed.sum())
    where = np.argwhere(crossed)
    total, count = np.zeros((len(where), 3)), np.zeros((len(where), 1))
    for axis in range(3):
        step = np.eye(3, dtype=int)[axis]
        for corner in corners[corners[:, axis] == 0]:
            begin = level[tuple((where + corner).T)]
            end = level[tuple((where + corner + step).T)]
            cut = (begin < 0) != (end < 0)
            share = np.where(cut, begin / np.where(cut, begin - end, 1.0), 0.0)
            total += np.where(cut[:, None], corner + share[:, None] * step, 0.0)
            count += cut[:, None]
    faces = np.vstack([_quads(inside, number, axis) for axis in range(3)])
    triangles = np.vstack([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    return Triangles(where + total / count, triangles)


def _shifted(grid: Mask, corner: Indices) -> Mask:
    x, y, z = corner
    nx, ny, nz = np.array(grid.shape) - 1
    return np.asarray(grid[x : x + nx, y : y + ny, z : z + nz])


def _quads(inside: Mask, number: Indices, axis: int) -> Indices:
    """Squares of the net round the grid's edges along an axis that it crosses, wound outwards."""
    step = np.eye(3, dtype=int)
    one, two = step[(axis + 1) % 3], step[(axis + 2) % 3]
    first = np.moveaxis(inside, axis, 0)
    cut = np.moveaxis(first[1:] != first[:-1], 0, axis)
    edges = np.argwhere(cut)
    outwards = inside[tuple(edges.T)]
    ring = [edges, edges - one, edges - one - two, edges - two]
    quads = np.column_stack([number[tuple(each.T)] for each in ring])
    quads[~outwards] = quads[~outwards][:, ::-1]
    return quads
