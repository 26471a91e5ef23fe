"""The scene of a page: what of a state is seen in it, and the gizmos by which it is dragged."""

from __future__ import annotations

from collections.abc import Sequence

import viser

from copose.live.scene.gizmos import Dragged, Gizmos
from copose.live.state import State
from copose.poses import Pose
from copose.results import Posture
from copose.robots import load_arms
from copose.viewer.looks import link_looks
from copose.viewer.scene import CellScene

# Parts of the scene that a hand may drag, by the panel's words.
_DRAGGED = {
    "drag bases": "base",
    "drag grasps": "grasp",
    "drag obstacles": "obstacle",
    "drag waypoints": "waypoint",
}
# Size of a scene in which nothing holds the object, m.
_SIZE = 1.0


class Stage:
    """The scene and its gizmos.

    Attributes:
        scene: of the cell.
        gizmos: in it.
        exact: whether the exact set is asked for.
    """

    def __init__(self, server: viser.ViserServer, state: State, dragged: Dragged) -> None:
        """Draw the state that a page opens with.

        Args:
            server: of the page.
            state: the first.
            dragged: is told what hands drag.

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
        """Of what is drawn, m."""
        return self.scene.size or _SIZE

    def look(self, posture: Posture, way: Sequence[Pose]) -> None:
        """Let browsers begin with a posture, and the way of the object, in view."""
        self.scene.camera(posture, way).place(self._server.initial_camera)

    def see(self, what: str, visible: bool) -> None:
        """Show or hide a part, by the panel's words."""
        if what in _DRAGGED:
            self.gizmos.show(_DRAGGED[what], visible)
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
        """Show where the problem has everything but the arms and the object, and the start."""
        if state.start is not self._start:
            self._start = state.start
            self.scene.show_before(state.start)
        self.scene.point(state.problem.objective.pointed)
        self.gizmos.place(state.problem)
        for obstacle in state.problem.obstacles:
            self.scene.place_obstacle(obstacle.name, obstacle.pose)

    def show_posture(self, state: State) -> None:
        """Show the arms in the posture, and the object where it is asked to be."""
        if state.posture is not None:
            self.scene.show(state.posture)
        self.scene.place_object(state.problem.object.pose)
        self.scene.mark_object(unreachable=not state.reached)
