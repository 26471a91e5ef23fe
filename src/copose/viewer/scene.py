"""A cell in a viser scene: arms, object, ellipsoids, what stands around, and the first camera."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from copose.collision import primitive_of
from copose.poses import Array, Pose, rotation_rows
from copose.problem import Problem
from copose.report.geometry.camera import best_view
from copose.report.geometry.hulls import LinkBody
from copose.report.look import LOOK
from copose.results import Posture
from copose.robots import Arm
from copose.viewer.looks import Look
from copose.viewer.names import node, rgb
from copose.viewer.nodes.arms import Hands, Robots, move, object_pose, stretch
from copose.viewer.nodes.ellipsoids import DirectionArrows, ExactSets, Slices
from copose.viewer.nodes.objects import add_object, add_obstacle, lay_grid, light, light_from
from copose.viewer.surfaces.triangles import primitive_triangles

if TYPE_CHECKING:
    from viser import FrameHandle, InitialCameraConfig, SceneApi


@dataclass(frozen=True)
class CameraOptions:
    """The first view of a cell."""

    angle: float = np.radians(35.0)  # rad, from the lower to the upper edge of a page
    margin: float = 1.12  # distance of the eye by that at which the cell fills the page
    aspect: float = 1.2  # width of a page over its height, at least
    least: float = 0.05  # m, half the height of what is seen


@dataclass(frozen=True, eq=False)
class Camera:
    """An eye in the world."""

    position: Array  # of the eye, m, (3,)
    target: Array  # the point that it looks at, m, (3,)
    up: Array  # the direction that is up in the picture, (3,)
    angle: float  # that the picture shows from its lower to its upper edge, rad

    @property
    def axes(self) -> Array:
        """Unit vectors to the right, up and towards the eye, (3, 3)."""
        toward = self.position - self.target
        toward = toward / np.linalg.norm(toward)
        right = np.cross(self.up, toward)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(toward, right), toward])

    def place(self, initial: InitialCameraConfig) -> None:
        """Make a page start with this camera."""
        initial.position = self.position
        initial.look_at = self.target
        initial.up = self.up
        initial.fov = self.angle


def first_camera(
    posture: Posture,
    arms: Sequence[Arm],
    looks: Sequence[Look],
    points: Array,
    *,
    planar: bool,
    options: CameraOptions = CameraOptions(),
) -> Camera:
    """An eye that sees a posture, and points, m, (k, 3), as pictures do: hands and object above
    all; the plane from above.
    """
    if planar:
        right, up, toward = np.eye(3)
        around = np.vstack([points, *(placed(look, posture, arms) for look in looks)])
    else:
        bodies = _bodies(posture, arms, looks)
        right, up, toward = best_view([(bodies, points)]).axes
        around = np.vstack([points, *(body.points for body in bodies)])
    seen = around @ np.array([right, up, toward]).T
    low, high = seen.min(axis=0), seen.max(axis=0)
    half = np.maximum(np.ptp(seen[:, :2], axis=0) / (2 * options.aspect, 2), options.least).max()
    middle = (low + high) / 2
    away = options.margin * half / np.tan(options.angle / 2) + (high - low)[2] / 2
    target = middle @ np.array([right, up, toward])
    above = np.array([0.0, 1.0, 0.0]) if planar else np.array([0.0, 0.0, 1.0])
    return Camera(target + away * toward, target, above, float(options.angle))


def placed(look: Look, posture: Posture, arms: Sequence[Arm]) -> Array:
    """Corners of a link in the world, (v, 3)."""
    record = posture.arms[arms[look.carrier.arm].name]
    k = look.carrier.joint + 1
    rotation = np.array(rotation_rows(record.quaternions[k]))
    return np.asarray(look.vertices @ rotation.T + np.array(record.skeleton[k]))


def _bodies(posture: Posture, arms: Sequence[Arm], looks: Sequence[Look]) -> list[LinkBody]:
    """The links as rough convex bodies."""
    # Directions in which a link's hull reaches as far as the link does.
    cube = np.array([place for place in np.ndindex(3, 3, 3) if place != (1, 1, 1)]) - 1.0
    bodies = []
    for look in looks:
        arm = arms[look.carrier.arm]
        corners = placed(look, posture, arms)
        corners = corners[np.unique((corners @ cube.T).argmax(axis=0))]
        with contextlib.suppress(QhullError, ValueError):
            hull = ConvexHull(corners)
            bodies.append(
                LinkBody(
                    arm=None if look.shared else arm.name,
                    frame=look.carrier.joint + 1,
                    last=look.carrier.joint == arm.n - 1,
                    faces=corners[hull.simplices],
                    normals=hull.equations[:, :3],
                )
            )
    return bodies


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
