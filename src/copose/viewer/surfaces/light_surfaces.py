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
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from copose.collision import Part
from copose.errors import InputError
from copose.kernels.cache import store, stored
from copose.poses import Array, Indices
from copose.viewer.surfaces.skins import wrapped
from copose.viewer.surfaces.triangles import Triangles, joined, primitive_triangles

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


def light_surface(
    parts: Sequence[Part], options: ReductionOptions = ReductionOptions()
) -> Surface | None:
    """Shapes in one frame as one surface of few triangles; None where there is none.

    It is kept in the cache folder by the content of the meshes, their scale and their pose.

    Raises:
        UnreadableError: a mesh file cannot be read.
        InputError: fast_simplification is not installed.
    """
    if not parts:
        return None
    key = f"{options.version}-{_digest(parts, options.triangles)}"
    surface = _kept(key)
    if surface is None:
        surface = creased(_reduced(joined([_triangles(part) for part in parts]), options))
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


def _reduced(surface: Triangles, options: ReductionOptions = ReductionOptions()) -> Triangles:
    """A surface of few triangles that looks alike.

    Surfaces in many open pieces are reduced to splinters; a skin round them is not.
    """
    merged = _merged(surface, options.grid)
    if len(merged.faces) <= options.triangles:
        return merged
    reduced = _simplified(merged, options)
    if (
        len(reduced.faces) > options.triangles
        or _deviation(merged, reduced, options) > options.faithful
    ):
        reduced = _simplified(wrapped(merged), options)
    for cells in options.coarse:
        if len(reduced.faces) > options.triangles:
            reduced = _merged(reduced, cells)
    return Triangles(reduced.vertices, reduced.faces[: options.triangles])


def _simplified(surface: Triangles, options: ReductionOptions) -> Triangles:
    """A surface reduced to a number of triangles, or nearly."""
    vertices, faces = simplifier().simplify(
        surface.vertices.astype(np.float64),
        surface.faces.astype(np.int32),
        target_count=options.triangles,
    )
    return _merged(Triangles(vertices, faces), options.grid)


def _deviation(surface: Triangles, reduced: Triangles, options: ReductionOptions) -> float:
    """Distance of most of a surface from what it is reduced to, as a share of its size."""
    rng = np.random.default_rng(options.seed)
    tree = KDTree(reduced.scattered(options.reduced_points, rng))
    far, _ = tree.query(surface.scattered(options.points, rng))
    size = np.linalg.norm(np.ptp(surface.vertices, axis=0))
    return float(np.percentile(far, options.percent) / size)


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
