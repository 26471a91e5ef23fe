"""Handles in the scene by which object, bases, grasps, obstacles and waypoints are dragged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import viser

from copose.errors import InputError
from copose.live.problem_file.document import Changes, key, place
from copose.motion.path.object_motion import waypoint_poses
from copose.poses import Pose
from copose.problem import Problem, RobotArm, placement

Dragged: TypeAlias = Callable[["Gizmo", Pose, str], object]
"""Called with the gizmo, its pose in the world, and the phase: start, update or end."""


@dataclass(frozen=True)
class GizmoLook:
    """Sizes of gizmos."""

    object: float = 0.16  # length of the arrows at the object, as a share of the scene
    other: float = 0.1  # length of all other arrows, alike
    hint: float = 1.15  # height of the hint over the object, as a share of its arrows


@dataclass(frozen=True)
class Gizmo:
    """A thing that is dragged."""

    kind: str  # object, base, grasp, obstacle or waypoint
    # Of the arm or the obstacle, the number of the waypoint from 0; empty of the object.
    name: str = ""

    @property
    def node(self) -> str:
        """Its node in the scene."""
        return "/".join(("/drag", self.kind, *([self.name.replace("/", "_")] if self.name else ())))

    def pose(self, problem: Problem) -> Pose:
        """Its pose in the world."""
        center = problem.object.pose
        if self.kind == "object":
            return center
        if self.kind == "waypoint":
            return waypoint_poses(problem)[int(self.name)]
        if self.kind == "obstacle":
            return next(o.pose for o in problem.obstacles if o.name == self.name)
        arm: Any = next(arm for arm in problem.arms if arm.name == self.name)
        base: Pose = arm.base.pose
        return base if self.kind == "base" else center @ arm.grasp.pose

    def placed(self, problem: Problem, given: Mapping[str, object]) -> Pose:
        """A pose in the world by the keys of a place, ``position`` and ``rpy`` or ``quaternion``,
        in the plane ``angle``; those that it leaves out stay.

        Raises:
            InputError: there is no such gizmo, or it is no place.
        """
        names = {
            "object": ("",),
            "base": tuple(arm.name for arm in problem.arms),
            "grasp": tuple(arm.name for arm in problem.arms),
            "obstacle": tuple(obstacle.name for obstacle in problem.obstacles),
        }
        if problem.path is not None:
            names["waypoint"] = _waypoints(problem)
        if self.kind not in names:
            raise InputError(f"{self.kind!r} is none of {', '.join(names)}", key="kind")
        if self.name not in names[self.kind]:
            raise InputError(f"no {self.kind} is called {self.name!r}", key="name")
        current = place(self.pose(problem), planar=problem.space.planar)
        if "quaternion" in given:
            del current["rpy"]
        return placement({**current, **given}, planar=problem.space.planar)

    def changes(self, problem: Problem, pose: Pose) -> Changes:
        """The changes of a problem where it is dragged to a pose in the world."""
        planar = problem.space.planar
        if self.kind == "grasp":
            grasp = problem.object.pose.inverse() @ pose
            return {key("arms", self.name, "grasp"): place(grasp, planar=planar)}
        if self.kind == "base":
            # Arms of one robot stand on one base.
            names = robot_mates(problem, self.name)
            return {key("arms", name, "base"): place(pose, planar=planar) for name in names}
        if self.kind == "waypoint":
            return self._waypoint_changes(problem, pose)
        path = ("object",) if self.kind == "object" else ("obstacles", self.name)
        return {key(*path, what): value for what, value in place(pose, planar=planar).items()}

    def _waypoint_changes(self, problem: Problem, pose: Pose) -> Changes:
        """The keys of a waypoint that a drag changes: no others are added to the file."""
        planar = problem.space.planar
        before = place(self.pose(problem), planar=planar)
        return {
            f"path.waypoints.{self.name}.{what}": value
            for what, value in place(pose, planar=planar).items()
            # A drag that turns nothing, or shifts nothing, leaves numbers to 1e-6 rad or m.
            if not np.allclose(value, before[what], 0, 1e-6)
        }


def _waypoints(problem: Problem) -> tuple[str, ...]:
    """The numbers of the path's waypoints, from 0 as keys have them."""
    path = problem.path
    return () if path is None else tuple(str(k) for k in range(len(path.waypoints)))


def robot_mates(problem: Problem, name: str) -> tuple[str, ...]:
    """The arms that are parts of one robot with an arm, itself among them: one file at one base."""
    arms = {arm.name: arm for arm in problem.arms}
    named = arms[name]
    if not isinstance(named, RobotArm):
        return (name,)

    def robot(arm: RobotArm) -> tuple[object, ...]:
        return arm.urdf, arm.mjcf, arm.root, arm.base

    return tuple(
        other
        for other, arm in arms.items()
        if isinstance(arm, RobotArm) and robot(arm) == robot(named)
    )


class Gizmos:
    """The gizmos of a page."""

    def __init__(
        self, scene: viser.SceneApi, problem: Problem, dragged: Dragged, size: float,
        look: GizmoLook = GizmoLook(),
    ) -> None:  # fmt: skip
        """Add all gizmos, of which only the object's is seen, to a scene of a size, m; ``dragged``
        is told of drags, on the page's thread and in order.
        """
        self._planar, self._size, self._look = problem.space.planar, size, look
        self._active: Gizmo | None = None
        self._handles: dict[Gizmo, viser.TransformControlsHandle] = {}
        gizmos = [Gizmo("object")]
        names = [arm.name for arm in problem.arms]
        gizmos += [Gizmo("base", name) for name in names if robot_mates(problem, name)[0] == name]
        gizmos += [Gizmo("grasp", name) for name in names]
        gizmos += [Gizmo("obstacle", each.name) for each in problem.obstacles]
        gizmos += [Gizmo("waypoint", number) for number in _waypoints(problem)]
        for gizmo in gizmos:
            self._handles[gizmo] = self._added(scene, gizmo, problem, dragged)
        along = [0.0, 1.0, 0.0] if self._planar else [0.0, 0.0, 1.0]
        over = problem.object.pose.inverse().rotation @ along
        self._hint: viser.LabelHandle | None = scene.add_label(
            f"{Gizmo('object').node}/hint", "drag an arrow or an arc",
            position=look.hint * look.object * size * over, anchor="bottom-center",
        )  # fmt: skip

    def show(self, kind: str, visible: bool) -> None:
        """Show or hide all gizmos of a kind."""
        for gizmo, handle in self._handles.items():
            if gizmo.kind == kind:
                handle.visible = visible

    def place(self, problem: Problem) -> None:
        """Put the gizmos at the poses of a problem, but for the one that a hand holds."""
        for gizmo, handle in self._handles.items():
            if gizmo != self._active:
                _move(handle, gizmo.pose(problem))

    def release(self) -> None:
        """Forget the gizmo that a hand holds: it let go unseen, as when its browser is closed."""
        self._active = None

    def drag(self, gizmo: Gizmo, pose: Pose, phase: str, dragged: Dragged) -> None:
        """Move a gizmo as a hand does with the mouse."""
        if self._hint is not None:
            self._hint.remove()
            self._hint = None
        self._active = None if phase == "end" else gizmo
        dragged(gizmo, pose, phase)

    def _added(
        self, scene: viser.SceneApi, gizmo: Gizmo, problem: Problem, dragged: Dragged
    ) -> viser.TransformControlsHandle:
        """The handle of a gizmo in the scene."""
        pose = gizmo.pose(problem)
        handle = scene.add_transform_controls(
            gizmo.node,
            scale=self._size * (self._look.object if gizmo.kind == "object" else self._look.other),
            # In the plane two arrows and a turn about z.
            active_axes=(True, True, not self._planar),
            depth_test=False,
            wxyz=pose.quaternion,
            position=pose.position,
            visible=gizmo.kind == "object",
        )

        @handle.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            # On the event loop, so that phases keep their order.
            target = event.target
            pose = Pose.from_quaternion(target.position, target.wxyz)
            self.drag(gizmo, pose, event.phase, dragged)

        return handle


def _move(handle: viser.TransformControlsHandle, pose: Pose) -> None:
    """Put a handle at a pose; nothing is sent where it is there."""
    if tuple(handle.position) != tuple(pose.position):
        handle.position = pose.position
    if tuple(handle.wxyz) != tuple(pose.quaternion):
        handle.wxyz = pose.quaternion
