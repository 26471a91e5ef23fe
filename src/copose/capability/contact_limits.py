"""Limits of contact wrenches as half-spaces: what a grip bears, and how hard arms may squeeze."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from copose.poses import Array


@dataclass(frozen=True, eq=False)
class WrenchBounds:
    """{h : matrix h ≤ 1}, on the stacked contact wrenches in root axes."""

    matrix: Array

    @property
    def none(self) -> WrenchBounds:
        """No bounds on the same wrenches."""
        return WrenchBounds(self.matrix[:0])


def inner_polyhedron(dimension: int, corners: int = 32) -> tuple[Array, float]:
    """{x : n·x ≤ d} inside the unit ball: unit normals, (facets, dimension), and d.

    Its corners lie on the sphere. In the plane it is a regular polygon, in space it has 92 facets.
    """
    if dimension == 1:
        return np.array([[1.0], [-1.0]]), 1.0
    if dimension == 2:
        angles = 2 * np.pi * np.arange(corners) / corners
        return np.column_stack([np.cos(angles), np.sin(angles)]), float(np.cos(np.pi / corners))
    from scipy.spatial import ConvexHull

    normals = _geodesic()
    hull = ConvexHull(normals)
    # By polarity the corners of {n·x ≤ 1} are the facets of the normals' hull over their offsets.
    farthest = float((-1 / hull.equations[:, -1]).max())
    return normals, 1 / farthest


def _geodesic() -> Array:
    """92 points of the sphere: corners, thirds of edges and middles of faces of an icosahedron."""
    golden = (1 + 5**0.5) / 2
    corners = np.array(
        [
            np.roll([0.0, one, other * golden], shift)
            for shift in range(3)
            for one in (-1, 1)
            for other in (-1, 1)
        ]
    )
    apart = np.linalg.norm(corners[:, None] - corners, axis=2)
    edges = np.argwhere(np.isclose(apart, 2.0))
    thirds = [(2 * corners[i] + corners[j]) / 3 for i, j in edges]
    faces = {
        tuple(sorted((int(i), int(j), k)))
        for i, j in edges
        for k in range(12)
        if np.isclose(apart[i, k], 2.0) and np.isclose(apart[j, k], 2.0)
    }
    middles = [corners[list(face)].mean(axis=0) for face in sorted(faces)]
    points = np.vstack([corners, thirds, middles])
    return np.asarray(points / np.linalg.norm(points, axis=1, keepdims=True))


def wrench_bounds(
    turns: Sequence[Array],
    linear: Sequence[int],
    angular: Sequence[int],
    grips: Sequence[tuple[float | None, float | None]],
    internal_force: float | None,
) -> WrenchBounds:
    """Limits of contact forces and moments as half-spaces, inside the balls that norms describe.

    Args:
        turns: R_i from root axes to world axes by arm, (m, m).
        linear: rows of forces in a wrench.
        angular: rows of moments.
        grips: by arm, the largest norms of its force, N, and moment, N·m; None where none.
        internal_force: the largest norm of the force of (I − W⁺W)h at each contact, N, with the
            nonsqueezing W⁺: that of f_i less the mean of all.
    """
    K, m = len(turns), len(turns[0])
    rows = [np.zeros((0, K * m))]
    whole = np.hstack(turns)
    for i, grip in enumerate(grips):
        for part, most in zip((linear, angular), grip, strict=True):
            if most is not None and len(part):
                normals, depth = inner_polyhedron(len(part))
                row = np.zeros((len(normals), K * m))
                row[:, m * i + np.array(part)] = normals / (most * depth)
                rows.append(row)
        if internal_force is not None and K > 1:
            normals, depth = inner_polyhedron(len(linear))
            own = np.zeros((m, K * m))
            own[:, m * i : m * i + m] = turns[i]
            rows.append(normals @ (own - whole / K)[list(linear)] / (internal_force * depth))
    return WrenchBounds(np.vstack(rows))
