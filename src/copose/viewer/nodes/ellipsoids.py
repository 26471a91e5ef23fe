"""The ellipsoids of a posture in a scene: at the object, and in the plane at every hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from copose.poses import Array, Pose
from copose.problem import Problem
from copose.report.geometry.slices import Slice, angular_slice, linear_slice
from copose.report.look import LOOK
from copose.report.panels import holds
from copose.results import Posture
from copose.viewer.names import node, rgb
from copose.viewer.surfaces.triangles import circle

if TYPE_CHECKING:
    from viser import IcosphereHandle, LineSegmentsHandle, SceneApi


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

    def __init__(
        self,
        scene: SceneApi,
        problem: Problem,
        names: Sequence[str],
        look: EllipsoidLook = EllipsoidLook(),
    ) -> None:
        self.look = look
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
                color=rgb(look.colors[kind]),
                subdivisions=4,
                opacity=look.opacity,
                cast_shadow=False,
                receive_shadow=False,
                visible=False,
            )
        self.stem = scene.add_line_segments(
            node("ellipsoid", "stem"),
            np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]),
            rgb(LOOK.angular),
            thickness=look.stem,
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
