"""The page's part for the motion along the path: planning, showing an instant, playing."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import viser

from copose.errors import InputError
from copose.live.files import file_named
from copose.live.panels.path_panel import PathPanel
from copose.live.session.path_motion import PathMotion
from copose.live.session.session import Session
from copose.live.session.state import State
from copose.live.worker import Worker
from copose.motion.path.object_motion import waypoint_poses
from copose.poses import Pose
from copose.progress import Progress
from copose.viewer.names import node, rgb
from copose.viewer.scene import CellScene


@dataclass(frozen=True)
class PathLook:
    """Look of the path in the scene."""

    colour: str = "#2F8FD0"
    line: float = 3.0  # thickness of the line, pixels
    axis: float = 0.07  # length of a waypoint's axes, as a share of the scene
    thick: float = 0.05  # radius of the axes, as a share of their length
    ball: float = 0.16  # radius of the ball between them, alike


class PathDrawing:
    """The path of a page: nodes ``/path/line`` and ``/path/waypoints/1``, ``2`` and so on."""

    def __init__(
        self, scene: viser.SceneApi, waypoints: Sequence[Pose], size: float,
        look: PathLook = PathLook(),
    ) -> None:  # fmt: skip
        """Draw a path through poses of the object in a scene of a size, m."""
        self._waypoints: list[Pose] = []
        self._top = scene.add_frame(node("path"), show_axes=False)
        length = look.axis * size
        self._frames = [
            scene.add_frame(
                node("path", "waypoints", str(k + 1)), axes_length=length,
                axes_radius=look.thick * length, origin_radius=look.ball * length,
                origin_color=rgb(look.colour),
            )
            for k in range(len(waypoints))
        ]  # fmt: skip
        self._line = scene.add_line_segments(
            node("path", "line"), _segments(waypoints), rgb(look.colour), thickness=look.line,
            thickness_units="screen",
        )  # fmt: skip
        self.place(waypoints)

    def see(self, visible: bool) -> None:
        """Show or hide the path."""
        self._top.visible = visible

    def place(self, waypoints: Sequence[Pose]) -> None:
        """Draw the same number of waypoints where they are now."""
        known = [each is other for each, other in zip(waypoints, self._waypoints, strict=False)]
        if known and all(known):
            return
        self._waypoints = list(waypoints)
        for frame, pose in zip(self._frames, waypoints, strict=True):
            frame.position, frame.wxyz = pose.position, pose.quaternion
        self._line.points = _segments(waypoints)


def _segments(waypoints: Sequence[Pose]) -> np.ndarray:
    """Segments from each waypoint to the next, (n − 1, 2, 3)."""
    points = np.array([pose.position for pose in waypoints], dtype=np.float32)
    return np.stack([points[:-1], points[1:]], axis=1)


class PathPlayer:
    """The actions of the tab of the path; long ones are the work of the page's worker.

    Attributes:
        motion: the motion that is planned and shown.
        shown: whether the scene shows the motion, and not the posture of ``[object]``.
        panel: the tab's controls; the page sets them.
        told: function that is told of progress, of None at the end; the page sets it.
        shows: function that is called when an instant is shown; the page sets it.
        left: function that shows the posture again; the page sets it.
    """

    panel: PathPanel
    told: Callable[[Progress | None], object]
    shows: Callable[[], object]
    left: Callable[[], object]

    def __init__(
        self, session: Session, worker: Worker, server: viser.ViserServer, scene: CellScene
    ) -> None:
        """Draw the path of a session's problem in a scene that is fit to a posture."""
        self.motion, self.shown = PathMotion(session), False
        self._session, self._worker, self._server, self._scene = session, worker, server, scene
        self._playing = self._planning = False
        self._resumes = True
        self._drawing = PathDrawing(server.scene, self.way, scene.size or 1.0)

    @property
    def way(self) -> list[Pose]:
        """The waypoints of the object."""
        return waypoint_poses(self._session.state.problem)

    # What the tab can have done, see `PathActs`.

    def plan(self) -> None:
        """Plan the motion, or end planning that is under way."""
        self._resumes = not self._planning
        self.halt()
        self._session.interrupt()
        if self._resumes:
            self._worker.do(self._plan)

    def go(self, time: float) -> None:
        """Show an instant, s."""
        self.halt()
        self._worker.move(lambda: self._show(time), rests=False)

    def play(self) -> None:
        """Play the motion from where it is, from its beginning where it is at the end; or stop."""
        if self._playing:
            self.halt()
        else:
            self._playing = True
            self._worker.do(self._begin)

    def save(self, kind: str, place: str) -> None:
        """Write the motion, and say so in the tab."""
        self._worker.do(lambda: self._saved(kind, place))

    # What the page has done.

    def halt(self) -> None:
        """Stop playing; from any thread."""
        self._playing = False

    def leave(self) -> None:
        """Show the posture again: a hand does something with it; on the worker's thread."""
        self.halt()
        if self.shown:
            self.shown = False
            self.left()

    def see(self, visible: bool) -> None:
        """Show or hide the path."""
        self._drawing.see(visible)

    def redraw(self) -> None:
        """Show the same instant once more; on the worker's thread."""
        self._show(self.motion.time)

    def resume(self) -> None:
        """Plan again where a hand has interrupted planning; on the worker's thread."""
        if self.motion.interrupted and self._resumes:
            self._plan()

    def render(self, state: State) -> None:
        """Show the path of a state, and its motion."""
        self._drawing.place(waypoint_poses(state.problem))
        self.panel.show(self.motion)

    def open(self) -> None:
        """Plan the motion that the page opens with."""
        self._worker.do(self._plan)

    def _plan(self) -> None:
        """Plan, and show the instant of the new motion."""
        self._planning = True
        self.panel.planning(True)
        try:
            planned = self.motion.plan(self.told)
        finally:
            self._planning = False
            self.told(None)
            self.panel.planning(False)
        with self._server.atomic():
            if planned and not self.motion.interrupted:
                self._show(self.motion.time)
            self.panel.show(self.motion)
        self._server.flush()

    def _show(self, time: float) -> None:
        """Show an instant in the scene."""
        course = self.motion.course
        if course is None:
            return
        posture = self.motion.look(time)
        self.shown = True
        with self._server.atomic():
            self._scene.show(posture)
            self._scene.mark_object(unreachable=False)
            self._scene.show_exact_set(None)
            self._scene.show_before(None)
            self.panel.show_instant(self.motion)
            self.shows()
        self._server.flush()

    def _begin(self) -> None:
        """Play from where the motion is."""
        course = self.motion.course
        if course is None:
            self._playing = False
            return
        if self.motion.time >= course.duration:
            self.motion.time = 0.0
        began = time.perf_counter() - self.motion.time
        self.panel.playing(True)
        self._run(began)

    def _run(self, began: float) -> None:
        """Show picture after picture until the end, or until something else is to be done."""
        course = self.motion.course
        while self._playing and course is not None:
            now = time.perf_counter()
            self._show(now - began)
            if self.motion.time >= course.duration:
                break
            if self._worker.waiting:
                # Other tasks are done first; then the motion plays on.
                self._worker.do(lambda: self._run(began))
                return
            # Thirty pictures a second, if they are drawn in time.
            time.sleep(max(0.0, now + 1 / 30 - time.perf_counter()))
        self._playing = False
        self.panel.playing(False)

    def _saved(self, kind: str, place: str) -> None:
        """Write the motion, and say so."""
        try:
            written = self.motion.save(kind, file_named(place))
        except InputError as error:
            self.panel.said(str(error))
            return
        self.panel.said(f"written to {written.absolute()}")
