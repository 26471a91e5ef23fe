"""What is drawn at the object of a scene: ellipsoids, exact sets, and arrows of directions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from copose.poses import Array, Indices, Pose
from copose.problem import Problem
from copose.report.geometry.hulls import Hull
from copose.report.geometry.slices import Slice, angular_slice, linear_slice
from copose.report.look import LOOK
from copose.report.panels import holds
from copose.report.words import ANGULAR_AXES, LINEAR_AXES
from copose.results import ExactSetRecord, Posture
from copose.viewer.names import node, rgb
from copose.viewer.surfaces.light_surfaces import creased
from copose.viewer.surfaces.triangles import arrow, circle, round_arrow, turned_to

if TYPE_CHECKING:
    from viser import FrameHandle, IcosphereHandle, LineSegmentsHandle, MeshHandle, SceneApi


@dataclass(frozen=True, eq=False)
class Stretch:
    """A ball of radius 1, stretched along axes of its own, which are turned in the world."""

    quaternion: Array  # of its axes in the world, [w, x, y, z]
    # Its semi-axes along them, (3,), in the unit of the ellipsoid; of coordinates that a slice does
    # not have next to nothing.
    radii: Array

    @classmethod
    def of(cls, part: Slice, thin: float = 0.02) -> Stretch:
        """The stretch of a ball that makes it a slice; a flat one is so thin, as a share of its
        longest semi-axis.
        """
        ellipsoid, world = part.ellipsoid, list(part.world)
        columns = np.zeros((3, 3))
        columns[np.ix_(world, range(len(world)))] = ellipsoid.axes.T
        other_axes = [axis for axis in range(3) if axis not in world]
        columns[other_axes, range(len(world), 3)] = 1.0
        if np.linalg.det(columns) < 0:
            columns[:, 2] *= -1
        thickness = thin * float(ellipsoid.radii[0])
        radii = np.append(ellipsoid.radii, [thickness] * len(other_axes))
        return cls(Pose.from_rotation(columns).quaternion, radii)


@dataclass(frozen=True)
class EllipsoidLook:
    """The look of ellipsoids; lengths are shares of the scene where no unit is given."""

    colors: Mapping[str, str] = field(
        default_factory=lambda: {"linear": LOOK.system, "angular": LOOK.angular}
    )
    longest: float = 0.18  # semi-axis
    longest_flat: float = 0.3  # semi-axis in the plane
    lift: float = 0.42  # height of the angular ellipsoid above the linear one
    opacity: float = 0.6
    above: float = 0.06  # m, height of planar ellipses above the links
    outline: float = 2.5  # pixels
    stem: float = 1.2  # pixels, from the object to the angular ellipsoid


class Slices:
    """The linear and the angular slice of a posture's ellipsoid, as pictures have them.

    Nodes: ``/ellipsoid/linear``, ``/ellipsoid/angular``, and in the plane ``/ellipsoid/arms/NAME``.

    Attributes:
        look: colours, sizes and opacity.
        scales: metres per unit of linear and of angular acceleration; fixed by `fit`.
        lift: height of the angular ellipsoid above the object, m.
        shown: which of the two are to be seen.
        balls: the nodes of the two.
        rims: outlines in the plane, by arm; of the system's by "".
        stem: what joins the angular ellipsoid with the object.
        planar: whether all lies in the plane.
        all: the coordinates of the task; ``axes`` those that the ellipsoid keeps.
    """

    def __init__(self, scene: SceneApi, problem: Problem, names: Sequence[str]) -> None:
        self.look = EllipsoidLook()
        self.planar = problem.space.planar
        coordinates = problem.space.coordinates
        self.all = tuple(coordinates)
        self.axes = tuple(coordinates[i] for i in problem.axes)
        self.scales: dict[str, float] = {}
        self.lift = 0.0
        self.shown = {"linear": True, "angular": True}
        self.balls: dict[str, IcosphereHandle] = {}
        # A pure turn of the plane is a number, which no picture draws.
        for kind in ("linear",) if self.planar else ("linear", "angular"):
            self.balls[kind] = scene.add_icosphere(
                node("ellipsoid", kind),
                radius=1.0,
                color=rgb(self.look.colors[kind]),
                subdivisions=4,
                opacity=self.look.opacity,
                cast_shadow=False,
                receive_shadow=False,
                visible=False,
            )
        self.stem = scene.add_line_segments(
            node("ellipsoid", "stem"),
            np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]),
            rgb(LOOK.angular),
            thickness=self.look.stem,
            thickness_units="screen",
            visible=False,
        )
        self.rims: dict[str, LineSegmentsHandle] = {}
        if self.planar:
            self.rims[""] = self._rim(scene, node("ellipsoid", "rim"), LOOK.system)
            colors = LOOK.arms * len(names)
            for name, color in zip(names, colors, strict=False):
                self.rims[name] = self._rim(scene, node("ellipsoid", "arms", name), color)

    def fit(self, posture: Posture, size: float) -> None:
        """Choose scales by which a posture's ellipsoids are seen well in a scene of a size, m."""
        self.scales = {}
        for kind in self.balls:
            longest = [float(part.ellipsoid.radii[0]) for part in self._all(posture, kind)]
            if any(longest):
                share = self.look.longest_flat if self.planar else self.look.longest
                self.scales[kind] = share * size / max(longest)
        self.lift = self.look.lift * size if len(self.scales) > 1 else 0.0

    def _all(self, posture: Posture, kind: str) -> list[Slice]:
        """The slices of a kind that share a scale."""
        parts = [self._slice(posture, kind)]
        if self.planar:
            parts += [linear_slice(arm.ellipsoid, self.all) for arm in posture.arms.values()]
        return [part for part in parts if part is not None]

    def _slice(self, posture: Posture, kind: str) -> Slice | None:
        """The linear or the angular slice of the whole system's ellipsoid."""
        cut = linear_slice if kind == "linear" else angular_slice
        return cut(posture.ellipsoid, self.axes)

    def show(self, posture: Posture) -> None:
        """Turn and stretch the balls as a posture has them."""
        for kind, ball in self.balls.items():
            part = self._slice(posture, kind)
            ball.visible = seen = part is not None and self.shown[kind]
            if part is None:
                self._hide("")
                self.stem.visible = self.stem.visible and kind != "angular"
                continue
            if kind not in self.scales:
                # A first posture without an ellipsoid has fixed no scale.
                self.scales[kind] = 0.1 / float(part.ellipsoid.radii[0])
            stretch = Stretch.of(part)
            ball.wxyz, ball.position = stretch.quaternion, self.center(posture, kind)
            radii = self.scales[kind] * stretch.radii
            ball.scale = (float(radii[0]), float(radii[1]), float(radii[2]))
            if kind == "angular" and self.lift:
                self.stem.position, self.stem.visible = self.center(posture, "linear"), seen
                self.stem.scale = self.lift
            if self.planar:
                self._outline("", stretch, ball.position, visible=seen)
        for name, arm in posture.arms.items() if self.planar else ():
            own = linear_slice(arm.ellipsoid, self.all)
            if own is None or not holds(posture, name):
                self._hide(name)
            else:
                position = np.array([*arm.skeleton[-1][:2], self.look.above])
                self._outline(name, Stretch.of(own), position, visible=self.shown["linear"])

    def center(self, posture: Posture, kind: str) -> Array:
        """The middle of the slice of a kind as it is drawn, m, (3,)."""
        x, y, *z = posture.object.position
        if self.planar:
            return np.array([x, y, self.look.above])
        return np.array([x, y, z[0] + (self.lift if kind == "angular" else 0.0)])

    def _outline(self, name: str, stretch: Stretch, position: Array, *, visible: bool) -> None:
        rim = self.rims[name]
        radii = self.scales.get("linear", 1.0) * stretch.radii
        # The circle is about z, which is the last axis of a flat slice.
        rim.scale = (float(radii[0]), float(radii[1]), 1.0)
        rim.wxyz, rim.position, rim.visible = stretch.quaternion, position, visible

    def _hide(self, name: str) -> None:
        if name in self.rims:
            self.rims[name].visible = False

    def _rim(self, scene: SceneApi, name: str, color: str) -> LineSegmentsHandle:
        return scene.add_line_segments(
            name,
            circle(),
            rgb(color),
            thickness=self.look.outline,
            thickness_units="screen",
            visible=False,
        )


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

    def __init__(self, scene: SceneApi, *, limits: bool) -> None:
        self._scene = scene
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
                    scale = ExactSetLook.farthest * size / farthest if farthest else 1.0
                self._draw(kind, scale * corners, slices.center(posture, kind))

    def _draw(self, kind: str, corners: Array, center: Array) -> None:
        faces, edges = _faces(corners), _edges(corners, ExactSetLook.sharp)
        if len(faces):
            self._handles.append(
                self._scene.add_mesh_simple(
                    node("exact", kind),
                    corners,
                    faces,
                    color=rgb(LOOK.exact_set),
                    opacity=ExactSetLook.opacity,
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
                    thickness=ExactSetLook.line,
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


@dataclass(frozen=True)
class DirectionLook:
    """Sizes of arrows."""

    length: float = 0.28  # of a straight arrow, as a share of the scene
    radius: float = 0.1  # of one that goes round, as a share of the scene


class DirectionArrows:
    """Arrows along task directions, straight for their linear and round for their angular part.

    Nodes: ``/directions/linear/1`` … at the object, ``/directions/angular/1`` … where the angular
    ellipsoid is.

    Attributes:
        tops: the nodes above the linear and the angular arrows, which carry them.
    """

    def __init__(self, scene: SceneApi, problem: Problem) -> None:
        self._scene = scene
        coordinates = problem.space.coordinates
        self._whole = tuple(coordinates)
        self._axes = tuple(coordinates[i] for i in problem.axes)
        self.tops: dict[str, FrameHandle] = {
            kind: scene.add_frame(node("directions", kind), show_axes=False)
            for kind in ("linear", "angular")
        }
        self._drawn: tuple[tuple[float, ...], ...] = ()
        self._arrows: list[tuple[str, MeshHandle]] = []
        self._lengths = {"linear": 0.3, "angular": 0.1}

    def point(self, directions: Sequence[Sequence[float]]) -> None:
        """Draw arrows along task vectors, over all coordinates or over the objective's axes."""
        drawn = tuple(tuple(direction) for direction in directions)
        if drawn == self._drawn:
            return
        self._drawn = drawn
        for _, old in self._arrows:
            old.remove()
        self._arrows = []
        for number, direction in enumerate(directions):
            for kind, along in self._parts(direction):
                surface = creased(arrow() if kind == "linear" else round_arrow())
                pose = Pose.from_rotation(turned_to(along))
                handle = self._scene.add_mesh_simple(
                    node("directions", kind, str(number + 1)),
                    surface.vertices,
                    surface.faces,
                    color=rgb(LOOK.ink),
                    scale=self._lengths[kind],
                    cast_shadow=False,
                    receive_shadow=False,
                    wxyz=pose.quaternion,
                )
                self._arrows.append((kind, handle))

    def fit(self, size: float) -> None:
        """Give arrows their lengths in a scene of a size, m."""
        self._lengths = {
            "linear": DirectionLook.length * size,
            "angular": DirectionLook.radius * size,
        }
        for kind, handle in self._arrows:
            handle.scale = self._lengths[kind]

    def _parts(self, direction: Sequence[float]) -> Iterator[tuple[str, Array]]:
        """The linear and the angular part of a task vector, each where it is not zero, (3,)."""
        names = self._whole if len(direction) == len(self._whole) else self._axes
        for kind, world in (("linear", LINEAR_AXES), ("angular", ANGULAR_AXES)):
            along = np.zeros(3)
            for name, value in zip(names, direction, strict=True):
                if name in world:
                    along[world[name]] = value
            if np.any(along):
                yield kind, along
