"""The exact sets of accelerations in a scene, where their ellipsoids are."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from copose.poses import Array, Indices
from copose.report.geometry.hulls import Hull
from copose.report.look import LOOK
from copose.report.words import ANGULAR_AXES, LINEAR_AXES
from copose.results import ExactSetRecord, Posture
from copose.viewer.names import node, rgb
from copose.viewer.nodes.ellipsoids import Slices

if TYPE_CHECKING:
    from viser import LineSegmentsHandle, MeshHandle, SceneApi


@dataclass(frozen=True)
class ExactSetLook:
    """The look of exact sets."""

    opacity: float = 0.25
    line: float = 1.2  # pixels, of edges
    sharp: float = np.radians(20.0)  # rad, angle of faces from which an edge is drawn between them
    # Distance of the farthest corner of a set that has another unit than the ellipsoid, as a share
    # of the scene.
    farthest: float = 0.25


class ExactSets:
    """The exact sets of linear and of angular accelerations: ``/exact/linear``, ``/exact/angular``.

    Within torque limits ellipsoids have the unit of the sets, and so their scale.
    """

    def __init__(
        self, scene: SceneApi, *, limits: bool, look: ExactSetLook = ExactSetLook()
    ) -> None:
        self._scene, self._look = scene, look
        self._limits = limits
        self._handles: list[MeshHandle | LineSegmentsHandle] = []

    def show(self, posture: Posture | None, slices: Slices, size: float) -> None:
        """Draw the sets of a posture; None takes them away."""
        for old in self._handles:
            old.remove()
        self._handles = []
        for kind, record in ((posture and posture.exact_sets) or {}).items():
            if posture is not None and record.vertices:
                corners = _corners(record)
                scale = slices.scales.get(kind) if self._limits else None
                if scale is None:
                    farthest = float(np.linalg.norm(corners, axis=1).max())
                    scale = self._look.farthest * size / farthest if farthest else 1.0
                self._draw(kind, scale * corners, slices.center(posture, kind))

    def _draw(self, kind: str, corners: Array, center: Array) -> None:
        faces, edges = _faces(corners), _edges(corners, self._look.sharp)
        if len(faces):
            self._handles.append(
                self._scene.add_mesh_simple(
                    node("exact", kind),
                    corners,
                    faces,
                    color=rgb(LOOK.exact_set),
                    opacity=self._look.opacity,
                    # Its front would hide the ellipsoid in it.
                    side="back" if Hull.of(corners) is not None else "double",
                    flat_shading=True,
                    cast_shadow=False,
                    receive_shadow=False,
                    position=center,
                )
            )
        if len(edges):
            self._handles.append(
                self._scene.add_line_segments(
                    node("exact", f"{kind} edges"),
                    edges,
                    rgb(LOOK.exact_set),
                    thickness=self._look.line,
                    thickness_units="screen",
                    position=center,
                )
            )


def _corners(record: ExactSetRecord) -> Array:
    """Corners along the world's axes, (k, 3)."""
    world = [(LINEAR_AXES | ANGULAR_AXES)[name] for name in record.axes]
    corners = np.zeros((len(record.vertices), 3))
    corners[:, world] = np.array(record.vertices)
    return corners


def _faces(corners: Array) -> Indices:
    """Triangles of the hull, wound outwards, (f, 3); of flat corners a fan; none of a line."""
    try:
        hull = ConvexHull(corners)
        faces = hull.simplices.astype(np.intp)
        a, b, c = np.swapaxes(corners[faces], 0, 1)
        inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
        faces[inward] = faces[inward][:, ::-1]
        return faces
    except (QhullError, ValueError):
        order = _around(corners)
    return np.array([[order[0], a, b] for a, b in pairwise(order[1:])]).reshape(-1, 3)


def _edges(corners: Array, sharp_angle: float) -> Array:
    """Edges of the hull at which faces meet at a sharp angle, rad, or more, (e, 2, 3)."""
    solid = Hull.of(corners)
    if solid is not None:
        one, other = solid.normals[solid.sides.T]
        sharp = np.einsum("ij,ij->i", one, other) < np.cos(sharp_angle)
        return np.asarray(solid.edges[sharp])
    order = _around(corners)
    if len(order) < 2:
        return np.array([[corners.min(axis=0), corners.max(axis=0)]])
    return np.array([[corners[a], corners[b]] for a, b in pairwise([*order, order[0]])])


def _around(corners: Array) -> list[int]:
    """Flat corners in order round their hull; none of corners on a line."""
    offset = corners - corners.mean(axis=0)
    _, _, rows = np.linalg.svd(offset, full_matrices=False)
    try:
        return [int(i) for i in ConvexHull(offset @ rows[:2].T).vertices]
    except (QhullError, ValueError):
        return []
