"""Task directions of an objective as arrows at the object."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from copose.poses import Array, Pose
from copose.problem import Problem
from copose.report.look import LOOK
from copose.report.words import ANGULAR_AXES, LINEAR_AXES
from copose.viewer.names import node, rgb
from copose.viewer.surfaces.light_surfaces import creased
from copose.viewer.surfaces.triangles import arrow, round_arrow, turned_to

if TYPE_CHECKING:
    from viser import FrameHandle, MeshHandle, SceneApi


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

    def __init__(
        self, scene: SceneApi, problem: Problem, look: DirectionLook = DirectionLook()
    ) -> None:
        self._scene, self._look = scene, look
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
        self._lengths = {"linear": self._look.length * size, "angular": self._look.radius * size}
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
