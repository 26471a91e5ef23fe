"""Polygons of a scene in space that hide one another by their depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from copose.poses import Array
from copose.report.geometry.camera import View
from copose.report.look import LOOK

ON_TOP = 1000
"""Order of lines and names that are drawn over all polygons."""


@dataclass(frozen=True)
class PolygonLook:
    """Light on bodies in space, and their edges."""

    dark: float = 0.5  # brightness of a face that the light misses
    light: float = 0.55  # brightness that the light adds where it meets a face squarely
    pale: float = 0.1  # by which solids are paler than their colour
    piece: float = 0.07  # side of the pieces that are sorted by depth, as a share of the scene
    lamp: tuple[float, float, float] = (-0.45, 0.6, 0.66)  # to the right, up, towards the eye
    far_side: float = -0.2  # cosine to the eye below which faces of a solid are left out
    nearer: float = 0.05  # edges are nearer to the eye than their faces, as a share of a piece
    line: float = 0.8  # width of edges, points


class Polygons:
    """Polygons and edges of one scene, drawn from far to near.

    Matplotlib sorts the polygons of one collection by the depth of their middles, so that large
    ones are cut into pieces.
    """

    def __init__(self, view: View, size: float, look: PolygonLook = PolygonLook()) -> None:
        """An empty scene of a size, m, seen from a direction."""
        self._right_up_eye, self._look, self._piece = view.axes, look, look.piece * size
        self._polygons: list[Array] = []
        self._faces: list[tuple[float, ...]] = []
        self._edges: list[tuple[float, ...]] = []

    def solid(self, faces: Sequence[Array] | Array, normals: Array, color: str) -> None:
        """An opaque convex body, its faces as the light meets them."""
        base, facing = np.array(to_rgb(color)) + self._look.pale, normals @ self._right_up_eye[2]
        for face, bright, front in zip(faces, self._light(normals), facing, strict=True):
            if front > self._look.far_side:
                rgba = (*np.clip(base * bright, 0.0, 1.0), 1.0)
                # Edges of their own colour close the seams between faces.
                for piece in _pieces(face, 2 * self._piece):
                    self._add(piece, rgba, rgba)

    def clear(
        self, faces: Sequence[Array] | Array, color: str, alpha: float,
        normals: Array | None = None,
    ) -> None:  # fmt: skip
        """Transparent faces; with normals, (f, 3), as the light meets them."""
        invisible = (0.0, 0.0, 0.0, 0.0)
        light = np.ones(len(faces)) if normals is None else self._light(normals)
        for face, bright in zip(faces, light, strict=True):
            rgba = (*np.clip(bright * np.array(to_rgb(color)), 0.0, 1.0), alpha)
            for piece in _pieces(face, self._piece):
                self._add(piece, rgba, invisible)

    def edges(self, faces: Sequence[Array], color: str = LOOK.ink) -> None:
        """Rims of faces."""
        nearer = self._look.nearer * self._piece * self._right_up_eye[2]
        for face in faces:
            for a, b in pairwise([*face, face[0]]):
                count = max(1, int(np.ceil(np.linalg.norm(b - a) / self._piece)))
                ends = a + np.linspace(0, 1, count + 1)[:, None] * (b - a) + nearer
                for segment in pairwise(ends):
                    self._add(np.array(segment), (0.0, 0.0, 0.0, 0.0), (*to_rgb(color), 1.0))

    def _light(self, normals: Array) -> Array:
        """The brightness of faces, (f,)."""
        look = self._look
        lamp = np.array(look.lamp) @ self._right_up_eye
        return np.asarray(look.dark + look.light * np.clip(normals @ lamp, 0.0, 1.0))

    def _add(self, polygon: Array, face: tuple[float, ...], edge: tuple[float, ...]) -> None:
        """Add a piece with its colours."""
        self._polygons.append(polygon)
        self._faces.append(face)
        self._edges.append(edge)

    def draw(self, ax: Any) -> None:
        """Draw all of them into axes whose limits are set."""
        if self._polygons:
            # All have four corners: of unequal ones Matplotlib counts corners that are not set.
            corners = np.arange(4)
            evened = [piece[np.minimum(corners, len(piece) - 1)] for piece in self._polygons]
            collection = Poly3DCollection(evened, linewidths=self._look.line)
            collection.set_facecolor(self._faces)
            collection.set_edgecolor(self._edges)
            ax.add_collection3d(collection)


def _pieces(face: Array, longest: float) -> list[Array]:
    """Triangles and quadrilaterals, without longer sides, of a flat convex polygon, (k, 3)."""
    sides = np.roll(face, -1, axis=0) - face
    if len(face) <= 4 and np.linalg.norm(sides, axis=1).max() <= longest:
        return [face]
    if len(face) == 4 and np.allclose(sides[0], -sides[2]):
        m, n = (max(1, int(np.ceil(np.linalg.norm(side) / longest))) for side in sides[:2])
        steps = sides[0] / m, sides[1] / n
        cell = np.array([0 * steps[0], steps[0], steps[0] + steps[1], steps[1]])
        return [face[0] + i * steps[0] + j * steps[1] + cell for i in range(m) for j in range(n)]
    small, large = [], [np.array([face[0], a, b]) for a, b in pairwise(face[1:])]
    while large:
        triangle = large.pop()
        lengths = np.linalg.norm(np.roll(triangle, -1, axis=0) - triangle, axis=1)
        k = int(lengths.argmax())
        if lengths[k] <= longest:
            small.append(triangle)
            continue
        a, b, c = np.roll(triangle, -k, axis=0)
        large += [np.array([a, (a + b) / 2, c]), np.array([(a + b) / 2, b, c])]
    return small
