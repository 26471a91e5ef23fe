"""Surfaces that are light enough to be shown: merged, of few triangles, kept from run to run."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from copose.collision import Mesh, MeshFile, Part, Primitive
from copose.errors import InputError
from copose.kernels.cache import store, stored
from copose.poses import Array, Indices
from copose.viewer.skins import wrapped
from copose.viewer.solids import Triangles, box, capsule, cylinder, joined

# Most triangles of a link.
BUDGET = 1500
# What the way of making meshes is called; another one has another name, and so other files.
_WAY = "look-2"
# Cells, along its longest side, of the grid on which points of a surface are one: Collada repeats
# every corner for every triangle, with other normals and textures.
_GRID = 2**18
# How far most of a surface may be from what it is reduced to, as a share of its size.
_FAITHFUL = 0.016
# The part of the surface that is "most" of it, percent.
_MOST = 95
# Points by which that is judged, on the surface.
_JUDGED = 4000
# Points of what it is reduced to.
_AGAINST = 20000
# Seed of these.
_SEED = 0
# Cells along its longest side to which a surface falls that has too many triangles still.
_COARSE = (64, 48, 32, 24, 16, 12, 8)
# Faces that meet at a larger angle have an edge between them, rad.
_CREASE = np.radians(40.0)


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface of triangles as it is sent to a page.

    Attributes:
        vertices: its corners, m, (v, 3), once for each smooth part that meets there.
        faces: corners of each triangle by number, (f, 3).
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]


def light_surface(parts: Sequence[Part]) -> Surface | None:
    """Shapes in one frame as one surface of at most `BUDGET` triangles; None where there is none.

    It is kept in the cache folder by the content of the meshes, their scale and their place.

    Raises:
        UnreadableError: a mesh file cannot be read.
        InputError: fast_simplification is not installed.
    """
    if not parts:
        return None
    key = f"{_WAY}-{_digest(parts)}"
    found = _kept(key)
    if found is None:
        found = creased(_reduced(joined([_triangles(part) for part in parts])))
        sink = io.BytesIO()
        np.savez(sink, vertices=found.vertices, faces=found.faces)
        store(key, ".npz", sink.getvalue())
    return found if len(found.faces) else None


def _digest(parts: Sequence[Part]) -> str:
    """A digest of all that decides a surface."""
    digest = hashlib.blake2b(f"{BUDGET}".encode(), digest_size=16)
    for part in parts:
        digest.update(np.column_stack([part.placement.rotation, part.placement.position]).tobytes())
        shape = part.shape
        if isinstance(shape, Primitive):
            digest.update(repr((shape.kind, shape.size)).encode())
        elif isinstance(shape, MeshFile):
            digest.update(repr(shape.scale).encode() + _content(shape.file, *_stamp(shape.file)))
        else:
            digest.update(shape.vertices.tobytes() + shape.triangles.tobytes())
    return digest.hexdigest()


def _stamp(file: Path) -> tuple[int, int]:
    """What changes as a file does."""
    try:
        state = file.stat()
    except OSError:
        return 0, 0
    return state.st_mtime_ns, state.st_size


@lru_cache(maxsize=1024)
def _content(file: Path, _changed: int, _size: int) -> bytes:
    """A digest of a file's content; empty where it cannot be read."""
    try:
        return hashlib.blake2b(file.read_bytes(), digest_size=16).digest()
    except OSError:
        return b""


def _kept(key: str) -> Surface | None:
    """A surface in the cache folder; None where it is not there, or no surface."""
    found = stored(key, ".npz")
    if found is None:
        return None
    try:
        with np.load(io.BytesIO(found[1]), allow_pickle=False) as arrays:
            vertices, faces = arrays["vertices"], arrays["faces"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    return Surface(vertices, faces)


def _triangles(part: Part) -> Triangles:
    """A shape as triangles in its link's frame."""
    shape = part.shape
    if isinstance(shape, Mesh):
        return Triangles(shape.vertices, shape.triangles).placed(part.placement)
    if shape.kind == "box":
        made = box(np.array(shape.size))
    elif shape.kind == "cylinder":
        made = cylinder(shape.size[0], shape.size[1])
    else:
        made = capsule(shape.size[0], sum(shape.size[1:]))
    return made.placed(part.placement)


def _reduced(surface: Triangles) -> Triangles:
    """A surface of at most `BUDGET` triangles that looks alike.

    Surfaces in many open pieces end as splinters; a skin round them does not.
    """
    merged = _merged(surface, _GRID)
    if len(merged.faces) <= BUDGET:
        return merged
    reduced = _simplified(merged)
    if len(reduced.faces) > BUDGET or _strayed(merged, reduced) > _FAITHFUL:
        reduced = _simplified(wrapped(merged))
    for cells in _COARSE:
        if len(reduced.faces) > BUDGET:
            reduced = _merged(reduced, cells)
    return Triangles(reduced.vertices, reduced.faces[:BUDGET])


def _simplified(surface: Triangles) -> Triangles:
    vertices, faces = simplifier().simplify(
        surface.vertices.astype(np.float64), surface.faces.astype(np.int32), target_count=BUDGET
    )
    return _merged(Triangles(vertices, faces), _GRID)


def _strayed(surface: Triangles, reduced: Triangles) -> float:
    """How far most of a surface is from what it is reduced to, as a share of its size."""
    rng = np.random.default_rng(_SEED)
    far, _ = KDTree(reduced.scattered(_AGAINST, rng)).query(surface.scattered(_JUDGED, rng))
    return float(np.percentile(far, _MOST) / np.linalg.norm(np.ptp(surface.vertices, axis=0)))


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
    """A surface whose points within one cell of a grid are one, without triangles that vanish.

    Args:
        surface: what is merged.
        cells: along its longest side, at most 2^20.
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


def creased(surface: Triangles) -> Surface:
    """A surface whose corners are apart where its faces meet at an edge, and one elsewhere.

    A page shades smoothly over corners that faces share.
    """
    faces = surface.faces
    if not len(faces):
        return Surface(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    pairs = _smooth_corners(surface)
    count = faces.size
    links = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), (count, count))
    _, part = connected_components(links, directed=False)
    _, first, number = np.unique(part, return_index=True, return_inverse=True)
    vertices = surface.vertices[faces.ravel()[first]]
    return Surface(vertices.astype(np.float32), number.reshape(-1, 3).astype(np.uint32))


def _smooth_corners(surface: Triangles) -> Indices:
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
    smooth = cosine > np.cos(_CREASE)
    return np.vstack([
        np.column_stack([one[smooth, end], other[smooth, end]]) for end in (0, 1)
    ])  # fmt: skip
