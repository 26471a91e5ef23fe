"""Polygons of a scene in space that hide one another by their depth."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from copose.poses import Array
from copose.report import style
from copose.report.geometry.view import View

# Brightness of a face that the light misses.
_DARK = 0.5
# Brightness that the light adds where it meets a face squarely.
_LIGHT = 0.55
# By how much solids are paler than their colour.
_PALE = 0.1
# Where the light is: to the right, up and towards the eye.
_LAMP = np.array([-0.45, 0.6, 0.66])
# Cosine to the eye below which the face of a solid is on its far side, in perspective too.
_FAR_SIDE = -0.2
# Edges are so much nearer to the eye than the faces they are of, as a share of a piece.
_NEARER = 0.05
_LINE = 0.8
# Of a piece, at most.
_CORNERS = 4
_NONE = (0.0, 0.0, 0.0, 0.0)


class Polygons:
    """Polygons and edges of one scene, drawn from far to near.

    Matplotlib sorts the polygons of one collection by the depth of their middles, so that large
    ones are cut into pieces.
    """

    def __init__(self, view: View, piece: float) -> None:
        """Without any.

        Args:
            view: where they are seen from.
            piece: m, the longest side of a piece.
        """
        self._right_up_eye, self._piece = view.axes, piece
        self._polygons: list[Array] = []
        self._faces: list[tuple[float, ...]] = []
        self._edges: list[tuple[float, ...]] = []

    def solid(self, faces: Sequence[Array] | Array, normals: Array, color: str) -> None:
        """An opaque convex body, its faces as the light meets them."""
        base, facing = np.array(to_rgb(color)) + _PALE, normals @ self._right_up_eye[2]
        for face, bright, front in zip(faces, self._light(normals), facing, strict=True):
            if front > _FAR_SIDE:
                rgba = (*np.clip(base * bright, 0.0, 1.0), 1.0)
                # Edges of their own colour close the seams between faces.
                for piece in _pieces(face, 2 * self._piece):
                    self._add(piece, rgba, rgba)

    def clear(
        self, faces: Sequence[Array] | Array, color: str, alpha: float,
        normals: Array | None = None,
    ) -> None:  # fmt: skip
        """Faces that are seen through; with normals, (f, 3), as the light meets them."""
        light = np.ones(len(faces)) if normals is None else self._light(normals)
        for face, bright in zip(faces, light, strict=True):
            rgba = (*np.clip(bright * np.array(to_rgb(color)), 0.0, 1.0), alpha)
            for piece in _pieces(face, self._piece):
                self._add(piece, rgba, _NONE)

    def edges(self, faces: Sequence[Array], color: str = style.INK) -> None:
        """The rims of faces."""
        nearer = _NEARER * self._piece * self._right_up_eye[2]
        for face in faces:
            for a, b in pairwise([*face, face[0]]):
                count = max(1, int(np.ceil(np.linalg.norm(b - a) / self._piece)))
                ends = a + np.linspace(0, 1, count + 1)[:, None] * (b - a) + nearer
                for segment in pairwise(ends):
                    self._add(np.array(segment), _NONE, (*to_rgb(color), 1.0))

    def _light(self, normals: Array) -> Array:
        """How bright faces are, (f,)."""
        lamp = _LAMP @ self._right_up_eye
        return np.asarray(_DARK + _LIGHT * np.clip(normals @ lamp, 0.0, 1.0))

    def _add(self, polygon: Array, face: tuple[float, ...], edge: tuple[float, ...]) -> None:
        self._polygons.append(polygon)
        self._faces.append(face)
        self._edges.append(edge)

    def draw(self, ax: Any) -> None:
        """All of them into axes whose limits are set."""
        if self._polygons:
            # All of one length: of others Matplotlib counts corners that are not set.
            corners = np.arange(_CORNERS)
            evened = [each[np.minimum(corners, len(each) - 1)] for each in self._polygons]
            every = Poly3DCollection(evened, linewidths=_LINE)
            every.set_facecolor(self._faces)
            every.set_edgecolor(self._edges)
            ax.add_collection3d(every)


def _pieces(face: Array, longest: float) -> list[Array]:
    """A flat convex polygon, (k, 3), cut into triangles and quadrilaterals with no longer sides."""
    sides = np.roll(face, -1, axis=0) - face
    if len(face) <= _CORNERS and np.linalg.norm(sides, axis=1).max() <= longest:
        return [face]
    if len(face) == 4 and np.allclose(sides[0], -sides[2]):
        m, n = (max(1, int(np.ceil(np.linalg.norm(side) / longest))) for side in sides[:2])
        steps = sides[0] / m, sides[1] / n
        cell = np.array([0 * steps[0], steps[0], steps[0] + steps[1], steps[1]])
        return [face[0] + i * steps[0] + j * steps[1] + cell for i in range(m) for j in range(n)]
    found, left = [], [np.array([face[0], a, b]) for a, b in pairwise(face[1:])]
    while left:
        triangle = left.pop()
        lengths = np.linalg.norm(np.roll(triangle, -1, axis=0) - triangle, axis=1)
        k = int(lengths.argmax())
        if lengths[k] <= longest:
            found.append(triangle)
            continue
        a, b, c = np.roll(triangle, -k, axis=0)
        left += [np.array([a, (a + b) / 2, c]), np.array([(a + b) / 2, b, c])]
    return found
