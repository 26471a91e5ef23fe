"""Surfaces of few triangles that look like given shapes, kept from run to run in the cache."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from copose.collision import Part
from copose.errors import InputError
from copose.kernels.cache import store, stored
from copose.poses import Array, Indices, Mask
from copose.viewer.surfaces.triangles import Triangles, joined, primitive_triangles


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


def wrapped(surface: Triangles) -> Triangles:
    """A skin round a surface, not empty, as seen from outside, without what is within it."""
    low = surface.vertices.min(axis=0)
    cell = float(np.ptp(surface.vertices, axis=0).max()) / SkinOptions.cells
    points = _thinned(_points(surface, cell), cell / SkinOptions.kept)
    tree = KDTree(points)
    origin = low - 4 * cell
    shape = np.ceil((surface.vertices.max(axis=0) - low) / cell).astype(int) + 9
    level = _level(tree, points, origin, shape, cell, SkinOptions.off)
    skin = _net(level)
    corners = origin + cell * skin.vertices
    # Most of the way back to the surface: two skins of one sheet must not meet.
    away, nearest = tree.query(corners)
    share = SkinOptions.back * np.minimum(SkinOptions.off * cell / np.maximum(away, 1e-12), 1.0)
    corners += share[:, None] * (points[nearest] - corners)
    return Triangles(corners, skin.faces)


def _points(surface: Triangles, cell: float) -> Array:
    """Points of a surface, its corners among them, (k, 3)."""
    count = int(surface.areas.sum() * (SkinOptions.dense / cell) ** 2)
    rng = np.random.default_rng(SkinOptions.seed)
    scattered = surface.scattered(min(count, SkinOptions.points), rng)
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


# Most triangles of a link.
BUDGET = 1500


@dataclass(frozen=True)
class ReductionOptions:
    """The reduction of a surface to few triangles."""

    version: str = "look-2"  # names files in the cache; to be changed with the way of reduction
    triangles: int = BUDGET  # at most
    # Cells along the longest side of the grid on which points of a surface are one: Collada repeats
    # every corner for every triangle, with other normals and textures.
    grid: int = 2**18
    # Cells of the grids to which a surface is rounded in turn while it has too many triangles.
    coarse: tuple[int, ...] = (64, 48, 32, 24, 16, 12, 8)
    faithful: float = 0.016  # distance of the reduced from most of the surface, share of its size
    percent: float = 95  # of the surface that are most of it
    points: int = 4000  # of the surface, by which that is judged
    reduced_points: int = 20000  # of the reduced one
    seed: int = 0  # of these points


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface of triangles as it is sent to a page."""

    # Its corners, m, (v, 3), once for each smooth part that meets there.
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]  # corners of each triangle by number, (f, 3)


def light_surface(parts: Sequence[Part]) -> Surface | None:
    """Shapes in one frame as one surface of few triangles; None where there is none.

    It is kept in the cache folder by the content of the meshes, their scale and their pose.

    Raises:
        UnreadableError: a mesh file cannot be read.
        InputError: fast_simplification is not installed.
    """
    if not parts:
        return None
    key = f"{ReductionOptions.version}-{_digest(parts, ReductionOptions.triangles)}"
    surface = _kept(key)
    if surface is None:
        surface = creased(_reduced(joined([_triangles(part) for part in parts])))
        sink = io.BytesIO()
        np.savez(sink, vertices=surface.vertices, faces=surface.faces)
        store(key, ".npz", sink.getvalue())
    return surface if len(surface.faces) else None


def _digest(parts: Sequence[Part], budget: int) -> str:
    """A digest of all that decides a surface."""
    digest = hashlib.blake2b(f"{budget}".encode(), digest_size=16)
    for part in parts:
        digest.update(np.column_stack([part.placement.rotation, part.placement.position]).tobytes())
        digest.update(part.shape.fingerprint)
    return digest.hexdigest()


def _kept(key: str) -> Surface | None:
    """A surface in the cache folder; None where it is not there, or no surface."""
    file = stored(key, ".npz")
    if file is None:
        return None
    try:
        with np.load(io.BytesIO(file[1]), allow_pickle=False) as arrays:
            vertices, faces = arrays["vertices"], arrays["faces"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    return Surface(vertices, faces)


def _triangles(part: Part) -> Triangles:
    """A shape as triangles in its link's frame."""
    shape = part.shape
    if shape.kind == "mesh":
        triangles = Triangles(shape.vertices, shape.triangles)
    else:
        triangles = primitive_triangles(shape)
    return triangles.placed(part.placement)


def _reduced(surface: Triangles) -> Triangles:
    """A surface of few triangles that looks alike.

    Surfaces in many open pieces are reduced to splinters; a skin round them is not.
    """
    merged = _merged(surface, ReductionOptions.grid)
    if len(merged.faces) <= ReductionOptions.triangles:
        return merged
    reduced = _simplified(merged)
    if (
        len(reduced.faces) > ReductionOptions.triangles
        or _deviation(merged, reduced) > ReductionOptions.faithful
    ):
        reduced = _simplified(wrapped(merged))
    for cells in ReductionOptions.coarse:
        if len(reduced.faces) > ReductionOptions.triangles:
            reduced = _merged(reduced, cells)
    return Triangles(reduced.vertices, reduced.faces[: ReductionOptions.triangles])


def _simplified(surface: Triangles) -> Triangles:
    """A surface reduced to a number of triangles, or nearly."""
    vertices, faces = simplifier().simplify(
        surface.vertices.astype(np.float64),
        surface.faces.astype(np.int32),
        target_count=ReductionOptions.triangles,
    )
    return _merged(Triangles(vertices, faces), ReductionOptions.grid)


def _deviation(surface: Triangles, reduced: Triangles) -> float:
    """Distance of most of a surface from what it is reduced to, as a share of its size."""
    rng = np.random.default_rng(ReductionOptions.seed)
    tree = KDTree(reduced.scattered(ReductionOptions.reduced_points, rng))
    far, _ = tree.query(surface.scattered(ReductionOptions.points, rng))
    size = np.linalg.norm(np.ptp(surface.vertices, axis=0))
    return float(np.percentile(far, ReductionOptions.percent) / size)


def simplifier() -> Any:
    """The library that reduces meshes.

    Raises:
        InputError: it is not installed.
    """
    try:
        import fast_simplification
    except ImportError:
        raise InputError(
            "the package fast-simplification is not installed; pip install 'copose[live]'"
        ) from None
    return fast_simplification


def _merged(surface: Triangles, cells: int) -> Triangles:
    """A surface whose points within one cell of a grid, of at most 2^20 along its longest side, are
    one, without triangles that vanish.
    """
    low = surface.vertices.min(axis=0)
    size = float(np.ptp(surface.vertices, axis=0).max()) or 1.0
    cell = np.rint((surface.vertices - low) * (cells / size)).astype(np.int64)
    code = (cell[:, 0] << 42) | (cell[:, 1] << 21) | cell[:, 2]
    _, first, number = np.unique(code, return_index=True, return_inverse=True)
    faces = number[surface.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    # A face that is there twice, from either side, would flicker.
    _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return Triangles(surface.vertices[first], faces[np.sort(once)])


def creased(surface: Triangles, crease: float = np.radians(40.0)) -> Surface:
    """A surface whose corners are apart where its faces meet at an edge, beyond an angle, rad, and
    one elsewhere.

    A page shades smoothly over corners that faces share.
    """
    faces = surface.faces
    if not len(faces):
        return Surface(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    pairs = _smooth_corners(surface, crease)
    count = faces.size
    links = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), (count, count))
    _, part = connected_components(links, directed=False)
    _, first, number = np.unique(part, return_index=True, return_inverse=True)
    vertices = surface.vertices[faces.ravel()[first]]
    return Surface(vertices.astype(np.float32), number.reshape(-1, 3).astype(np.uint32))


def _smooth_corners(surface: Triangles, crease: float) -> Indices:
    """Pairs of corners of faces, as places in the flat list of them, that are one smooth corner."""
    faces = surface.faces
    a, b, c = np.swapaxes(surface.vertices[faces], 0, 1)
    normals: Array = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    ends = np.vstack([faces[:, [i, (i + 1) % 3]] for i in range(3)])
    places = np.vstack([3 * np.arange(len(faces))[:, None] + [i, (i + 1) % 3] for i in range(3)])
    turned = ends[:, 0] > ends[:, 1]
    ends[turned], places[turned] = ends[turned][:, ::-1], places[turned][:, ::-1]
    order = np.lexsort(ends.T)
    ends, places = ends[order], places[order]
    same = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    one, other = places[same], places[same + 1]
    cosine = np.einsum("ij,ij->i", normals[one[:, 0] // 3], normals[other[:, 0] // 3])
    smooth = cosine > np.cos(crease)
    return np.vstack([
        np.column_stack([one[smooth, end], other[smooth, end]]) for end in (0, 1)
    ])  # fmt: skip
