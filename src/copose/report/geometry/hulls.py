"""Convex hulls: of points as faces and edges, and of the links of arms."""

from __future__ import annotations

import contextlib
from collections import defaultdict
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from copose.poses import Array, rotation_rows
from copose.results import Posture, ProblemRecord

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull


@dataclass(frozen=True, eq=False)
class Hull:
    """The convex hull of points in space."""

    faces: tuple[Array, ...]  # corners of each, in order, (k, 3)
    normals: Array  # unit, outwards, (f, 3)
    edges: Array  # ends of each, (e, 2, 3)
    sides: Array  # the two faces that meet in it, (e, 2)

    def outline(self, view: Array) -> Array:
        """Corners, in order, of the outline seen from afar; view: the picture's axes, (2, 3)."""
        points = np.vstack(self.faces)
        return np.asarray(points[_even_hull(points @ view.T)[0].vertices])

    @classmethod
    def of(cls, points: Array) -> Hull | None:
        """The hull of points, (k, 3); None of points in a plane."""
        # Slow to import, and planar pictures need none of it.
        from scipy.spatial import QhullError

        if len(points) < 4:
            return None
        try:
            hull, even = _even_hull(points)
        except QhullError:
            return None
        # Triangles lie in one face where their normals and distances agree to seven digits.
        planes, of_plane = np.unique(np.round(hull.equations, 7), axis=0, return_inverse=True)
        normals = planes[:, :3] @ even.T
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        borders: dict[tuple[int, int], list[int]] = defaultdict(list)
        for triangle, plane in zip(hull.simplices, of_plane.ravel(), strict=True):
            for pair in combinations(sorted(triangle.tolist()), 2):
                borders[pair].append(int(plane))
        edges = {pair: (s[0], s[-1]) for pair, s in borders.items() if s[0] != s[-1]}
        corners: dict[int, set[int]] = defaultdict(set)
        for pair, sides in edges.items():
            for side in sides:
                corners[side].update(pair)
        faces = tuple(
            _around(points[sorted(corners[k])], normal) for k, normal in enumerate(normals)
        )
        return cls(faces, normals, points[np.array(list(edges))], np.array(list(edges.values())))


def _even_hull(points: Array) -> tuple[ConvexHull, Array]:
    """The hull of points, (k, d), in coordinates in which no direction is thin, and the map there.

    Raises:
        QhullError: the points are flat.
    """
    from scipy.spatial import ConvexHull, QhullError

    offset = points - points.mean(axis=0)
    _, extents, rows = np.linalg.svd(offset, full_matrices=False)
    if extents[-1] <= 1e-12 * extents[0]:
        raise QhullError("flat")
    even = rows.T / extents
    return ConvexHull(offset @ even), even


def _around(corners: Array, normal: Array) -> Array:
    """Corners of a face in order."""
    arms = corners - corners.mean(axis=0)
    first = arms[0] / np.linalg.norm(arms[0])
    angle = np.arctan2(arms @ np.cross(normal, first), arms @ first)
    return np.asarray(corners[np.argsort(angle)])


@dataclass(frozen=True, eq=False)
class LinkBody:
    """One convex part of a link in the world."""

    arm: str | None  # name of the arm; None for a body that arms of a robot share
    frame: int  # frame of the arm that moves it, 0 for the root
    last: bool  # whether the arm's last joint moves it: a hand
    faces: Array  # triangles, (f, 3, 3)
    normals: Array  # unit, outwards, (f, 3)

    @property
    def points(self) -> Array:
        """All corners, (3 f, 3)."""
        return self.faces.reshape(-1, 3)

    @property
    def offsets(self) -> Array:
        """The d of {x : n·x ≤ d} for every face, (f,)."""
        return np.asarray(np.einsum("ij,ij->i", self.normals, self.faces[:, 0]))


@dataclass(frozen=True, eq=False)
class LinkBodies:
    """The links of all arms of a problem, each in the frame that moves it."""

    # Arm, frame, and there triangles, (f, 3, 3), and outward normals, (f, 3); flat parts are left
    # out.
    parts: tuple[tuple[str, int, Array, Array], ...]
    shared: frozenset[str]  # the arm whose root carries what several arms share, if any

    @classmethod
    def of(cls, problem: ProblemRecord) -> LinkBodies:
        """The bodies of a problem's arms; none where their shapes are not known."""
        from scipy.spatial import ConvexHull, QhullError

        parts = []
        for link in problem.links:
            points = np.array(link.points)
            with contextlib.suppress(QhullError, ValueError):
                hull = ConvexHull(points)
                normals = hull.equations[:, :3]
                parts.append((link.arm, link.frame, points[hull.simplices], normals))
        rooted = frozenset(arm for arm, frame, *_ in parts if frame == 0)
        # Of a robot with several arms the first one's root carries what stands still.
        alone = rooted.issuperset(arm for arm, *_ in parts)
        return cls(tuple(parts), frozenset() if alone else rooted)

    def placed(self, posture: Posture) -> list[LinkBody]:
        """The bodies where a posture has them."""
        placed = []
        for arm, k, triangles, normals in self.parts:
            rotation, position = _frame(posture, arm, k)
            faces = triangles @ rotation.T + position
            owner = None if k == 0 and arm in self.shared else arm
            last = k == len(posture.arms[arm].skeleton) - 2
            placed.append(LinkBody(owner, k, last, faces, normals @ rotation.T))
        return placed


def flat_links(problem: ProblemRecord, posture: Posture) -> dict[str, list[Array]]:
    """Corners, in order, of the links of planar arms, (k, 2) each, by arm.

    Only of postures that keep clear: planar links are lines else.
    """
    outlines: dict[str, list[Array]] = {}
    if posture.collision is None:
        return outlines
    from scipy.spatial import ConvexHull, QhullError

    for link in problem.links:
        rotation, position = _frame(posture, link.arm, link.frame)
        points = (np.array(link.points) @ rotation.T + position)[:, :2]
        # A link without thickness has no hull.
        with contextlib.suppress(QhullError, ValueError):
            outlines.setdefault(link.arm, []).append(points[ConvexHull(points).vertices])
    return outlines


def _frame(posture: Posture, arm: str, k: int) -> tuple[Array, Array]:
    """Rotation and origin of a frame of an arm."""
    record = posture.arms[arm]
    return np.array(rotation_rows(record.quaternions[k])), np.array(record.skeleton[k])
