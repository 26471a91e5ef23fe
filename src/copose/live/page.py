"""The page: a server with a scene and a panel, and a worker that answers hands."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from copose.errors import InputError
from copose.live.display import Display, PageOptions
from copose.live.files import file_named, save
from copose.live.panels import objectives as aims
from copose.live.panels.panel import PagePanel
from copose.live.path_player import PathPlayer
from copose.live.problem_file.document import Document, case_names, same_layout
from copose.live.scene.gizmos import Gizmo
from copose.live.scene.stage import PageScene
from copose.live.session.jog import ByHand
from copose.live.session.session import Session
from copose.live.session.state import SearchAim, State
from copose.live.studies.study_player import StudyPlayer
from copose.live.worker import Task, Worker
from copose.poses import Pose
from copose.problem import Problem
from copose.progress import StoppedError
from copose.results import Optimum
from copose.studies.table import StudyTable
from copose.viewer.server import quiet_server, stop


class Page:
    """One problem on one address; every browser that opens it sees the same.

    Attributes:
        server: the server of viser.
        stage: the scene.
        session: the problem and its posture.
        path: the motion along the path; None where the problem has none.
        study: the points of a study; None where a problem was opened.
        latencies: times from drags to the sending of their answers, s, the newest last.
    """

    def __init__(
        self,
        problem: Problem | StudyTable,
        *,
        host: str,
        port: int,
        options: PageOptions | None = None,
    ) -> None:
        """Find the opening posture, of a study that of its best point, and serve the page; port 0
        is any that is free.

        Raises:
            InputError: the problem or the port cannot be used.
        """
        port = free_port(host, port)
        self._options = options = options or PageOptions()
        self.latencies: deque[float] = deque(maxlen=options.latencies)
        self._written: set[Path] = set()
        self._stroke: tuple[object, float] = (None, 0.0)
        self._stroked = threading.Lock()
        self.study: StudyPlayer | None = None
        if isinstance(problem, StudyTable):
            self.study = StudyPlayer(problem)
            self.session = self.study.choice.session
        else:
            self.session = Session(Document.of(problem), lambda state: None)
            self.session.open()
        state = self.session.state
        self.server = quiet_server(host, port, state.problem.name)
        self.server.request_share_url = _not_shared  # type: ignore[method-assign]
        self._worker = Worker(self._rested, self._failed)
        try:
            with self.server.atomic():
                self._set_up()
                self._build(state)
                self._look_at(state)
            self.session.told, self.session.waited = self._render, lambda: self._display.waited()
            self._render(state)
        except BaseException:
            self._worker.end()
            stop(self.server)
            raise
        if self.path is not None:
            self.path.open()
        self._worker.do(self._look)

    def _set_up(self) -> None:
        """Set up what stays, whatever is shown."""
        gui = self.server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.main_panel.dock_right()
        self.server.on_client_disconnect(lambda _: self.stage.gizmos.release())
        if self.study is not None:
            self.study.shows = self.show_point
            self.study.build(self.server, self._worker)

    def _build(self, state: State) -> None:
        """Build the scene and the panel."""
        gui, names = self.server.gui, case_names(self.session.document.whole)
        self._built = self.session.document
        self._hand = ByHand(self.session, self.session.spare)
        self.stage = PageScene(self.server, state, self._dragged)
        self.path: PathPlayer | None = None
        if state.problem.path is not None:
            self.path = PathPlayer(self.session, self._worker, self.server, self.stage.scene)
        kinds = aims.offered(self.session.document, state.solution)
        self.panel = PagePanel(gui, state.problem, self.session.spare, self, kinds, names)
        if self.path is not None:
            self.path.panel = self.panel.path
        self._display = Display(
            self.server, self.session, self._worker, self.stage, self.panel, self.path,
            self._options,
        )  # fmt: skip
        if self.study is not None:
            self.study.draw(self.stage.size)

    def _look_at(self, state: State) -> None:
        """Let browsers begin with everything in view."""
        if state.posture is not None:
            way = [] if self.path is None else self.path.way
            around = None if self.study is None else self.study.places
            self.stage.look(state.posture, way, around)

    def _render(self, state: State) -> None:
        """Show a state; of a problem with other bodies in a new scene."""
        document = self.session.document
        if document is not self._built:
            if same_layout(document.whole, self._built.whole):
                self._built = document
                self.panel.open(state.problem)
            else:
                with self.server.atomic():
                    self.panel.remove()
                    self.server.scene.reset()
                    self._build(state)
        self._display.render(state)
        if self.study is not None:
            with self.server.atomic():
                self.study.render()
            self.server.flush()

    def _of_posture(self, task: Task) -> Task:
        """A task with the posture, which is shown first in place of the motion."""
        path = self.path
        if path is None:
            return task
        path.halt()

        def done() -> None:
            path.leave()
            task()

        return done

    @property
    def address(self) -> str:
        """The address at which a browser finds the page."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    @property
    def state(self) -> State:
        """The state that is shown."""
        return self.session.state

    def settle(self, timeout_s: float = 60.0) -> bool:
        """Wait until everything that was asked for is done; False where that takes longer."""
        return self._worker.settle(timeout_s)

    def stop(self) -> None:
        """End the page; browsers keep what they show."""
        if self.path is not None:
            self.path.halt()
        self.session.interrupt()
        self._worker.end()
        stop(self.server)

    def drag(self, gizmo: Gizmo, pose: Pose, phase: str = "update") -> None:
        """Drag a gizmo to a pose in the world as a hand does; the phase is start, update or end."""
        self.stage.gizmos.drag(gizmo, pose, phase, self._dragged)

    # Actions of the panel, see `Acts`.

    def set(self, changes: Mapping[str, Any]) -> None:
        """Change settings; a search answers."""
        self.session.interrupt()
        self._worker.do(self._of_posture(lambda: self._changed(changes)))

    def steer(self, changes: Mapping[str, Any]) -> None:
        """Change numbers that the arms follow."""
        self._begin(tuple(changes))
        self.session.interrupt()
        self._worker.move(self._of_posture(lambda: self.session.move(changes)))

    def search(self, aim: SearchAim) -> None:
        """Search everything."""
        self._ask(lambda: self._searched(aim))

    def choose(self, optimum: Optimum) -> None:
        """Go to a local optimum."""
        joints = optimum.joints
        if joints is not None:
            self._ask(lambda: self.session.choose(joints))
            self._worker.do(self._look)

    def show_point(self, point: int) -> None:
        """Show a point of the study."""

        def show() -> None:
            self._study_taken(point)

        self._begin("point")
        self.session.interrupt()
        self._worker.move(self._of_posture(show), rests=False)

    def undo(self) -> None:
        """Undo the last step."""
        self._stroke = (None, 0.0)
        self.stage.gizmos.release()
        self.session.interrupt()
        self._worker.do(self._undone)
        self._worker.do(self._look)

    def pick(self, case: str) -> None:
        """Show another case."""
        self.session.interrupt()
        self._worker.do(lambda: self._picked(case))

    def slide(self, arm: str, share: float) -> None:
        """Move an arm along its self-motion."""
        self._begin(arm)
        self.session.interrupt()
        task = self._of_posture(lambda: self._moved(lambda: self._hand.slide(arm, share)))
        self._worker.move(task, rests=False)

    def jog(self, arm: str, direction: int, amount: float) -> None:
        """Move an arm along one of several directions."""
        self._begin(arm)
        self.session.interrupt()
        self._worker.do(
            self._of_posture(lambda: self._moved(lambda: self._hand.jog(arm, direction, amount)))
        )

    def show(self, what: str, visible: bool) -> None:
        """Show or hide a part of the scene."""
        self._worker.do(lambda: self._display.see(what, visible))

    def save(self, kind: str, file: str) -> None:
        """Write a file, and say so in the panel."""
        self._worker.do(lambda: self._saved(kind, file))

    def _saved(self, kind: str, name: str) -> None:
        """Write a file, and say so; files that this page has written it may write again."""
        try:
            file = file_named(name)
            save(self.state, kind, file, overwrite=file.absolute() in self._written)
        except InputError as error:
            self.panel.said(str(error))
            return
        self._written.add(file.absolute())
        self.panel.said(f"written to {file.absolute()}")

    def _ask(self, task: Any) -> None:
        """Do a task as a step that can be undone, unless it fails."""

        def asked() -> None:
            self.session.mark()
            try:
                task()
            except InputError:
                self.session.unmark()
                raise

        self._stroke = (None, 0.0)
        self.session.interrupt()
        self._worker.do(self._of_posture(asked))

    def _begin(self, what: object) -> None:
        """Make one step that can be undone of moves of one control that follow each other."""
        with self._stroked:
            (last, when), now = self._stroke, time.monotonic()
            self._stroke = what, now
            if what != last or now - when > self._options.stroke:
                self._worker.do(self.session.mark)

    def _dragged(self, gizmo: Gizmo, pose: Pose, phase: str) -> None:
        """Follow a gizmo that a hand has dragged; on the server's thread."""
        began = time.perf_counter()
        if phase == "start":
            self._stroke = (None, 0.0)
            self._worker.do(self.session.mark)
        self.session.interrupt()
        if gizmo.kind == "waypoint":
            self._waypoint_dragged(gizmo, pose)
            return

        def follow() -> None:
            changes = gizmo.changes(self.session.state.problem, pose)
            self.session.move(changes)
            self.latencies.append(time.perf_counter() - began)

        self._worker.move(self._of_posture(follow))

    def _waypoint_dragged(self, gizmo: Gizmo, pose: Pose) -> None:
        """Follow a waypoint that a hand has dragged; the motion is planned on request."""

        def follow() -> None:
            self.session.put(gizmo.changes(self.session.state.problem, pose))

        if self.path is not None:
            self.path.halt()
            self._worker.move(follow, rests=False)

    def _undone(self) -> None:
        """Undo a step; where that concerns the posture, it is shown."""
        before = self.state.solution
        self.session.undo()
        if self.path is not None and self.state.solution is not before:
            self.path.leave()

    def _rested(self) -> None:
        """Look for a better posture while the hand rests."""
        self._searched(None)
        if self.path is not None:
            self.path.resume()

    def _searched(self, aim: SearchAim | None) -> None:
        """Search, and show as a ghost the posture that the arms have jumped from."""
        try:
            self.session.search(aim, self._display.progress)
        finally:
            self.panel.progress(None)
        if self.state.left is not None and not self._display.moving:
            self._display.fade(self.state.left)
        self._look()

    def _changed(self, changes: Mapping[str, Any]) -> None:
        """Change settings, and search."""
        try:
            self.session.change(changes, self._display.progress)
        finally:
            self.panel.progress(None)
        self._look()

    def _picked(self, case: str) -> None:
        """Show another case."""
        point = self.session.document.point
        if self.study is None or point is None:
            self.session.pick(case)
            self._look()
        else:
            self._study_taken(point, case)

    def _study_taken(self, point: int, case: str = "") -> None:
        """Show a point of the study, or say why it cannot be shown."""
        if self.study is not None:
            self.study.choice.take(point, case)
            self._look()

    def _moved(self, move: Callable[[], None]) -> None:
        """Move an arm, and show it on its self-motion."""
        move()
        with self.server.atomic():
            self.panel.hand.show(self._hand)

    def _look(self) -> None:
        """Follow the self-motions from the present posture, unless a hand moves meanwhile."""
        if self._worker.waiting:
            return
        with contextlib.suppress(StoppedError), self.session.watched():
            self._hand.look()
            with self.server.atomic():
                self.panel.hand.show(self._hand)
                self.panel.hand.rest()

    def _failed(self, error: Exception) -> None:
        """Show the error of a task."""
        words = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        self.session.fail(words)


def free_port(host: str, port: int) -> int:
    """A free port: the one that is asked for, for 0 any.

    Raises:
        InputError: it is taken, or the address is not this machine's.
    """
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with socket.socket(family) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
            return int(probe.getsockname()[1])
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot serve on {host}, port {port}: {why}", key="--port") from None


def _not_shared(*_: object, **__: object) -> None:
    """The page stays on this machine, whoever asks."""
