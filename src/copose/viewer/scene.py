"""A cell in a viser scene: arms, object, ellipsoids, and what stands around."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from copose.collision import primitive_of
from copose.poses import Array, Pose
from copose.problem import Problem
from copose.report.look import LOOK
from copose.results import Posture
from copose.robots import Arm
from copose.viewer.camera import Camera, CameraOptions, first_camera
from copose.viewer.looks import Look
from copose.viewer.names import node, rgb
from copose.viewer.nodes.arms import Robots
from copose.viewer.nodes.directions import DirectionArrows
from copose.viewer.nodes.ellipsoids import Slices
from copose.viewer.nodes.exact_sets import ExactSets
from copose.viewer.nodes.ground import lay_grid, light, light_from
from copose.viewer.nodes.hands import Hands, move, object_pose, stretch
from copose.viewer.nodes.objects import add_object, add_obstacle
from copose.viewer.surfaces.triangles import primitive_triangles

if TYPE_CHECKING:
    from viser import FrameHandle, SceneApi


class CellScene:
    """The scene of a problem and a posture of its arms.

    Nodes are called ``/arms/NAME/…``, ``/before/NAME/…``, ``/object``, ``/grasps/NAME``,
    ``/obstacles/NAME``, ``/ellipsoid/…``, ``/exact/…``, ``/directions/…``, ``/path``, ``/grid``
    and ``/world``; a slash in a name is written ``%2F``.

    Attributes:
        object: the frame of the object's centre of mass.
        obstacles: of each its mesh, by name.
        robots: the frames of the arms.
        slices: the ellipsoids.
        aims: the arrows of directions.
        size: of the scene, m; 0 until it is fit to a posture.
    """

    def __init__(
        self, scene: SceneApi, problem: Problem, arms: Sequence[Arm], looks: Sequence[Look]
    ) -> None:
        self._scene = scene
        self._problem = problem
        self._arms = tuple(arms)
        self._looks = tuple(looks)
        self._planar = problem.space.planar
        self.size = 0.0
        scene.set_up_direction("+y" if self._planar else "+z")
        light(scene, planar=self._planar)
        self.robots = Robots(scene, arms, looks, planar=self._planar)
        self.object: FrameHandle = scene.add_frame(
            node("object"), show_axes=problem.object.shape is None
        )
        self._shape = add_object(scene, node("object", "shape"), problem)
        self.slices = Slices(scene, problem, [arm.name for arm in arms])
        self._exact = ExactSets(scene, limits=problem.ellipsoid.torque_scaling == "limits")
        self.aims = DirectionArrows(scene, problem)
        self.aims.point(problem.objective.pointed)
        self.obstacles = {
            obstacle.name: add_obstacle(scene, obstacle) for obstacle in problem.obstacles
        }
        self._hands = Hands(scene, arms, rigid=problem.space.rigid)
        self._world = scene.add_frame(node("world"))
        self._ghost: Robots | None = None
        self._ghost_object: FrameHandle | None = None
        self._ghosts, self._before = True, False
        self._left: Posture | None = None
        self._shown: Posture | None = None

    def fit(self, posture: Posture) -> None:
        """Choose once for all how large ellipsoids, axes and the grid are: by a posture."""
        points = self._points(posture)
        self.size = max(float(np.ptp(points, axis=0).max()), 0.1)
        self.slices.fit(posture, self.size)
        self.aims.fit(self.size)
        self._hands.fit(self.size)
        stretch(self._world, 2 * self.size)
        stretch(self.object, self.size)
        lay_grid(self._scene, self._arms, self._looks, points, planar=self._planar)

    def show(self, posture: Posture) -> None:
        """Move everything to where a posture has it; no mesh is sent again."""
        if not self.size:
            self.fit(posture)
        if posture is not self._shown:
            self.robots.show(posture)
        place = object_pose(posture)
        move(self.object, place)
        self._shown = posture
        self._hands.show(posture, place)
        self._see_ghosts()
        self.slices.show(posture)
        for kind, top in self.aims.tops.items():
            top.position = self.slices.center(posture, kind)

    def show_before(self, posture: Posture | None) -> None:
        """Show an earlier posture as a ghost; None takes it away."""
        self._before, self._left = posture is not None, posture
        if posture is not None:
            if self._ghost is None:
                self._ghost = Robots(
                    self._scene, self._arms, self._looks, planar=self._planar, ghost=True
                )
                self._ghost_object = self._scene.add_frame(
                    node("before", "object"), show_axes=False
                )
                add_object(
                    self._scene, node("before", "object", "shape"), self._problem, ghost=True
                )
            self._ghost.show(posture)
            if self._ghost_object is not None:
                move(self._ghost_object, object_pose(posture))
        self._see_ghosts()

    def show_ghosts(self, visible: bool) -> None:
        """Show or hide what `show_before` has drawn."""
        self._ghosts = visible
        self._see_ghosts()

    def show_frames(self, visible: bool) -> None:
        """Show or hide the axes of hands, grasps and world."""
        for frame in (*self._hands.frames, self._world):
            frame.visible = visible

    def show_ellipsoids(self, linear: bool, angular: bool) -> None:
        """Show or hide the slices of the ellipsoid."""
        self.slices.shown = {"linear": linear, "angular": angular}
        if self._shown is not None:
            self.slices.show(self._shown)

    def show_exact_set(self, posture: Posture | None) -> None:
        """Show what a posture's torque limits allow exactly, where it says so; None hides it."""
        self._exact.show(posture, self.slices, self.size)

    def show_path(self, postures: Sequence[Posture]) -> None:
        """Draw the line that the object goes along, from posture to posture."""
        points = np.array([object_pose(posture).position for posture in postures])
        self._scene.add_line_segments(
            node("path"),
            np.stack([points[:-1], points[1:]], axis=1),
            rgb(LOOK.ink),
            thickness=1.5,
            thickness_units="screen",
        )

    def mark_object(self, unreachable: bool) -> None:
        """Colour the object red where the arms do not reach it, else as it is."""
        if self._shape is not None:
            self._shape.color = rgb(LOOK.over if unreachable else LOOK.held_object)

    def place_object(self, pose: Pose) -> None:
        """Move the object to where it is asked to be, which the arms may not reach.

        Grasps go with it, and a line joins each with the hand that misses it.
        """
        move(self.object, pose)
        self._see_ghosts()
        if self._shown is not None:
            self._hands.show(self._shown, pose)

    def place_obstacle(self, name: str, pose: Pose) -> None:
        """Move an obstacle."""
        move(self.obstacles[name], pose)

    def point(self, directions: Sequence[Sequence[float]]) -> None:
        """Draw arrows along task vectors, over all coordinates or over the objective's axes."""
        self.aims.point(directions)

    def camera(
        self,
        posture: Posture,
        way: Sequence[Pose] = (),
        others: Array | None = None,
        options: CameraOptions | None = None,
    ) -> Camera:
        """The camera from which pictures see a posture, other poses of the object, and other
        points, m, (k, 3); light comes from there too.
        """
        moved = [self._corners(posture)]
        for kind in self.slices.scales:
            # Ellipsoids are drawn a share of the scene long.
            around = 0.15 * self.size * np.vstack([np.eye(3), -np.eye(3)])
            moved.append(self.slices.center(posture, kind) + around)
        origin = object_pose(posture).position
        carried = [np.vstack(moved) + pose.position - origin for pose in way]
        points = np.vstack([self._points(posture), *moved, *carried])
        if others is not None:
            points = np.vstack([points, others])
        for obstacle in self._problem.obstacles:
            corners = primitive_triangles(primitive_of(obstacle.shape)).vertices
            corners = corners @ obstacle.pose.rotation.T + obstacle.pose.position
            # A floor would dwarf what stands on it.
            if np.ptp(corners, axis=0).max() <= self.size:
                points = np.vstack([points, corners])
        camera = first_camera(
            posture,
            self._arms,
            self._looks,
            points,
            planar=self._planar,
            options=options or CameraOptions(),
        )
        light_from(self._scene, *camera.axes)
        return camera

    def _points(self, posture: Posture) -> Array:
        """Points of arms and object, (k, 3)."""
        points = [np.array(arm.skeleton) for arm in posture.arms.values()]
        return np.vstack([*points, self._corners(posture)])

    def _corners(self, posture: Posture) -> Array:
        """Points of the object, (k, 3)."""
        place = object_pose(posture)
        shape = self._problem.object.shape
        corners = np.zeros((1, 3))
        if shape is not None:
            corners = primitive_triangles(primitive_of(shape)).vertices
        return np.asarray(corners @ place.rotation.T + place.position)

    def _see_ghosts(self) -> None:
        if self._ghost is not None and self._ghost_object is not None:
            # Arms that stand in their own ghost would flicker.
            stands = self._left is self._shown
            self._ghost.top.visible = self._before and self._ghosts and not stands
            # Two objects at one place, to within 1e-6 m or rad, would flicker.
            now, ghost = self.object, self._ghost_object
            turned = abs(float(now.wxyz @ ghost.wxyz)) < 1 - 1e-6
            moved = bool(np.linalg.norm(now.position - ghost.position) > 1e-6)
            ghost.visible = turned or moved
