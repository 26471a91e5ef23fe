"""The scene of a page: a state of it is drawn, and gizmos drag its parts."""

from __future__ import annotations

from collections.abc import Sequence

import viser

from copose.live.scene.gizmos import Dragged, Gizmos
from copose.live.session.state import State
from copose.poses import Array, Pose
from copose.results import Posture
from copose.robots import load_arms
from copose.viewer.looks import link_looks
from copose.viewer.scene import CameraOptions, CellScene


class PageScene:
    """The scene and its gizmos.

    Attributes:
        scene: the cell.
        gizmos: the gizmos in it.
        exact: whether the exact set is asked for.
    """

    def __init__(self, server: viser.ViserServer, state: State, dragged: Dragged) -> None:
        """Draw the state that a page opens with; ``dragged`` is told of drags.

        Raises:
            InputError: a robot cannot be read.
        """
        problem = state.problem
        arms = load_arms(problem)
        self._server, self._seen = server, {"linear": True, "angular": True}
        self.scene = CellScene(server.scene, problem, arms, link_looks(problem, arms))
        self.exact = False
        if state.posture is not None:
            self.scene.fit(state.posture)
        self.gizmos = Gizmos(server.scene, problem, dragged, self.size)
        self._start = state.start
        self.scene.show_before(state.start)

    @property
    def size(self) -> float:
        """The size of the scene, m; 1 where nothing holds the object."""
        return self.scene.size or 1.0

    def look(
        self, posture: Posture, way: Sequence[Pose], around: Array | None, between: float = 0.85
    ) -> None:
        """Let browsers begin with everything in view.

        Args:
            posture: of the arms.
            way: poses of the object along its path.
            around: places of a study's points, m, (count, 3); None without a study.
            between: width over height of what is seen between the panels of a study and of a page.
        """
        options = CameraOptions() if around is None else CameraOptions(aspect=between)
        camera = self.scene.camera(posture, way, around, options)
        camera.place(self._server.initial_camera)

    def see(self, what: str, visible: bool) -> None:
        """Show or hide a part, by the panel's words."""
        dragged = {
            "drag bases": "base", "drag grasps": "grasp", "drag obstacles": "obstacle",
            "drag waypoints": "waypoint",
        }  # fmt: skip
        if what in dragged:
            self.gizmos.show(dragged[what], visible)
        elif what == "frames":
            self.scene.show_frames(visible)
        elif what == "start, as a ghost":
            self.scene.show_ghosts(visible)
        elif what == "exact set":
            self.exact = visible
        else:
            self._seen[what.partition(" ")[0]] = visible
            self.scene.show_ellipsoids(self._seen["linear"], self._seen["angular"])

    def show(self, state: State) -> None:
        """Show the start, and everything but the arms and the object."""
        if state.start is not self._start:
            self._start = state.start
            self.scene.show_before(state.start)
        self.scene.point(state.problem.objective.pointed)
        self.gizmos.place(state.problem)
        for obstacle in state.problem.obstacles:
            self.scene.place_obstacle(obstacle.name, obstacle.pose)

    def show_posture(self, state: State) -> None:
        """Show the arms in the posture, and the object at the problem's pose."""
        if state.posture is not None:
            self.scene.show(state.posture)
        self.scene.place_object(state.problem.object.pose)
        self.scene.mark_object(unreachable=not state.reached)
