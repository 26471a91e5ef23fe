"""The display of a page: scene and panel, which show the states of the session."""

from __future__ import annotations

import time
from dataclasses import dataclass

import viser

from copose.live.panels.panel import PagePanel
from copose.live.panels.path_panel import instant_headline
from copose.live.path_player import PathPlayer
from copose.live.scene.stage import PageScene
from copose.live.session.session import Session
from copose.live.session.state import State
from copose.live.worker import Worker
from copose.progress import Progress
from copose.results import Posture


@dataclass(frozen=True)
class PageOptions:
    """Times of a page."""

    latencies: int = 2000  # answers to drags whose times are kept
    moment: float = 0.025  # between two pictures of a transition, s
    fade: int = 30  # moments for which the posture that arms have jumped from stays as a ghost
    stroke: float = 1.0  # between two moves of a control that make one step of undo, at most, s


class Display:
    """Scene and panel of a page, which show the states of its session."""

    def __init__(
        self, server: viser.ViserServer, session: Session, worker: Worker, stage: PageScene,
        panel: PagePanel, path: PathPlayer | None, options: PageOptions,
    ) -> None:  # fmt: skip
        """The display of a page; tasks that wait at the worker end transitions."""
        self._server, self._session, self._worker = server, session, worker
        self._stage, self._panel, self._path, self._options = stage, panel, path, options
        if path is not None:
            path.told, path.shows, path.left = self._planned, self._show_instant, self._show_posture

    @property
    def moving(self) -> bool:
        """True where the scene shows the motion, and not the posture."""
        return self._path is not None and self._path.shown

    def render(self, state: State) -> None:
        """Show a state in scene and panel at once."""
        with self._server.atomic():
            self._stage.show(state)
            if self._stage.exact:
                self._show_exact_set()
            self._panel.show(state)
            if self._path is not None:
                self._path.render(state)
            if self._path is not None and self._path.shown:
                self._path.redraw()
            else:
                self._stage.show_posture(state)
        self._server.flush()

    def see(self, what: str, visible: bool) -> None:
        """Show or hide a part of the scene."""
        with self._server.atomic():
            if what == "path" and self._path is not None:
                self._path.see(visible)
                return
            self._stage.see(what, visible)
            if what == "exact set":
                self._show_exact_set()

    def waited(self) -> bool:
        """Wait a moment between two pictures of a transition; False where a task is waiting."""
        if self._worker.waiting or not self._server.get_clients():
            return False
        time.sleep(self._options.moment)
        return True

    def fade(self, left: Posture) -> None:
        """Show for a moment, as a ghost, the posture that the arms have jumped from."""
        self._stage.scene.show_before(left)
        for _ in range(self._options.fade):
            if not self.waited():
                break
        self._stage.scene.show_before(self._session.state.start)

    def progress(self, now: Progress) -> None:
        """Show progress, and interrupt the search where a hand moves."""
        if self._worker.pressed:
            # A move that came as the search began did not find it to interrupt.
            self._session.interrupt()
        self._panel.progress(now)

    def _planned(self, now: Progress | None) -> None:
        """Show the progress of planning; None once it is over."""
        if now is None:
            self._panel.progress(None)
        else:
            self.progress(now)

    def _show_instant(self) -> None:
        """Show the motion in the panel, as the scene does."""
        if self._path is not None:
            motion = self._path.motion
            self._panel.show_instant(instant_headline(motion), motion.state())

    def _show_posture(self) -> None:
        """Show the posture in the scene again."""
        self._stage.scene.show_before(self._session.state.start)
        self.render(self._session.state)

    def _show_exact_set(self) -> None:
        """Show the exact set of accelerations where it is asked for and the hand rests."""
        state, posture = self._session.state, None
        after = state.solution.after
        rests = state.searched or bool(state.origin)
        if self._stage.exact and rests and not self.moving and after is not None:
            planner = self._session.planner()
            told = planner.evaluate(after.joints, problem=state.problem, everything=True)
            posture = told.after
        self._stage.scene.show_exact_set(posture)
