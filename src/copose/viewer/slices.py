"""The ellipsoids of a posture in a scene: at the object, and in the plane at every hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from copose.poses import Array
from copose.problem import Problem
from copose.report import style
from copose.report.geometry.slices import Slice, angular_slice, linear_slice
from copose.results import Posture
from copose.viewer.ellipsoids import Stretch, circle
from copose.viewer.names import node
from copose.viewer.robots import rgb

if TYPE_CHECKING:
    from viser import IcosphereHandle, LineSegmentsHandle, SceneApi

# The longest semi-axis that is drawn, as a share of the scene.
_SHARE = 0.18
# The same in the plane.
_FLAT_SHARE = 0.3
# How high the angular ellipsoid floats above the linear one, as a share of the scene.
_LIFT = 0.42
# Opacity of ellipsoids.
_OPACITY = 0.6
# How far above links ellipses of the plane lie, m: a page sees them from above.
_ABOVE = 0.06
# Thickness of outlines, pixels.
_LINE = 2.5
# Thickness of the stem from the object to the angular ellipsoid, pixels.
_STEM = 1.2

_PARTS = {"linear": linear_slice, "angular": angular_slice}
COLORS = {"linear": style.SYSTEM, "angular": style.ANGULAR}


class Slices:
    """The linear and the angular slice of a posture's ellipsoid, as pictures have them.

    Nodes: ``/ellipsoid/linear``, ``/ellipsoid/angular``, and in the plane ``/ellipsoid/arms/NAME``.

    Attributes:
        scales: metres per unit of linear and of angular acceleration; fixed by `fit`.
        lift: how far the angular ellipsoid floats above the object, m.
        shown: which of the two are to be seen.
        balls: the nodes of the two.
        rims: outlines in the plane, by arm; of the system's by "".
        stem: what joins the angular ellipsoid with the object.
        planar: whether all lies in the plane.
        all: the coordinates of the task; ``axes`` those that the ellipsoid keeps.
    """

    def __init__(self, scene: SceneApi, problem: Problem, names: Sequence[str]) -> None:
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
                color=rgb(COLORS[kind]),
                subdivisions=4,
                opacity=_OPACITY,
                cast_shadow=False,
                receive_shadow=False,
                visible=False,
            )
        self.stem = scene.add_line_segments(
            node("ellipsoid", "stem"),
            np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]),
            rgb(style.ANGULAR),
            thickness=_STEM,
            thickness_units="screen",
            visible=False,
        )
        self.rims: dict[str, LineSegmentsHandle] = {}
        if self.planar:
            self.rims[""] = _rim(scene, node("ellipsoid", "rim"), style.SYSTEM)
            colors = style.ARMS * len(names)
            for name, color in zip(names, colors, strict=False):
                self.rims[name] = _rim(scene, node("ellipsoid", "arms", name), color)

    def fit(self, posture: Posture, size: float) -> None:
        """Choose scales by which a posture's ellipsoids are seen well in a scene of a size, m."""
        self.scales = {}
        for kind in self.balls:
            longest = [float(each.ellipsoid.radii[0]) for each in self._all(posture, kind)]
            if any(longest):
                share = _FLAT_SHARE if self.planar else _SHARE
                self.scales[kind] = share * size / max(longest)
        self.lift = _LIFT * size if len(self.scales) > 1 else 0.0

    def _all(self, posture: Posture, kind: str) -> list[Slice]:
        """The slices of a kind that share a scale."""
        found = [_PARTS[kind](posture.ellipsoid, self.axes)]
        if self.planar:
            found += [linear_slice(arm.ellipsoid, self.all) for arm in posture.arms.values()]
        return [each for each in found if each is not None]

    def show(self, posture: Posture) -> None:
        """Turn and stretch the balls as a posture has them."""
        for kind, ball in self.balls.items():
            part = _PARTS[kind](posture.ellipsoid, self.axes)
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
            if own is None or posture.closure_error[name] > style.OPEN:
                self._hide(name)
            else:
                position = np.array([*arm.skeleton[-1][:2], _ABOVE])
                self._outline(name, Stretch.of(own), position, visible=self.shown["linear"])

    def center(self, posture: Posture, kind: str) -> Array:
        """Where the slice of a kind is drawn, m, (3,)."""
        x, y, *z = posture.object.position
        if self.planar:
            return np.array([x, y, _ABOVE])
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


def _rim(scene: SceneApi, name: str, color: str) -> LineSegmentsHandle:
    return scene.add_line_segments(
        name, circle(), rgb(color), thickness=_LINE, thickness_units="screen", visible=False
    )
