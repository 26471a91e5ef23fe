"""Pages opened from Python and from the command line."""

from __future__ import annotations

import contextlib
import html
import webbrowser
from importlib.util import find_spec
from typing import TYPE_CHECKING

from copose.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from copose.live.page import Page
    from copose.live.session.state import State
    from copose.problem import Problem
    from copose.results import Solution
    from copose.studies.table import StudyTable


class LivePage:
    """An open page; ends with `stop`, or with the ``with`` block that it is opened in.

    In a notebook it shows itself.
    """

    def __init__(self, page: Page) -> None:
        self._page = page

    @property
    def address(self) -> str:
        """The address at which a browser finds it."""
        return self._page.address

    @property
    def problem(self) -> Problem:
        """The problem as it is by now."""
        return self._page.state.problem

    @property
    def solution(self) -> Solution:
        """The result whose posture is shown."""
        return self._page.state.solution

    @property
    def state(self) -> State:
        """The state of the page: problem, posture, value and messages."""
        return self._page.state

    def drag(self, place: Mapping[str, object], kind: str = "object", name: str = "") -> None:
        """Drag something to a place, as a hand does; `settle` waits until the arms have followed.

        Args:
            place: ``position`` and ``rpy`` or ``quaternion``, in the plane ``angle``, in the world;
                keys that it leaves out stay.
            kind: object, base, grasp, obstacle or waypoint.
            name: name of the arm or the obstacle, or the number of the waypoint, from 0.

        Raises:
            InputError: there is no such thing, or it is no place.
        """
        from copose.live.scene.gizmos import Gizmo

        gizmo = Gizmo(kind, name)
        pose = gizmo.placed(self.problem, place)
        for phase in ("start", "update", "end"):
            self._page.drag(gizmo, pose, phase)

    def show_point(self, point: int) -> None:
        """Show a point of the study that is open, by its number, as a click on it does."""
        self._page.show_point(point)

    def settle(self, timeout_s: float = 60.0) -> bool:
        """Wait until the arms have come to rest; False where that takes longer."""
        return self._page.settle(timeout_s)

    def stop(self) -> None:
        """End the page."""
        self._page.stop()

    def __enter__(self) -> LivePage:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _repr_html_(self) -> str:
        """The page within a notebook."""
        address = html.escape(self.address)
        return f'<iframe src="{address}" style="width: 100%; height: 640px"></iframe>'


def open_live(
    problem: Problem, *, host: str = "127.0.0.1", port: int | None = None, browser: bool = False
) -> LivePage:
    """Open the page of a problem: drag the object, and the arms follow at their best.

    Args:
        problem: as read by `copose.load`.
        host: address that it is served at; by default no other machine reaches it.
        port: alike; default one that is free.
        browser: whether the user's browser opens it, too.

    Raises:
        InputError: the problem cannot be used, the port is taken, or viser is not installed.
    """
    return _opened(problem, host, port, browser=browser)


def open_study(
    table: StudyTable, *, host: str = "127.0.0.1", port: int | None = None, browser: bool = False
) -> LivePage:
    """Open the page of a study: its points in the scene, and the arms as they were recorded there.

    Args:
        table: of the study.
        host: as of `open_live`.
        port: alike.
        browser: alike.

    Raises:
        InputError: no point is done yet, and as of `open_live`.
    """
    return _opened(table, host, port, browser=browser)


def _opened(shown: Problem | StudyTable, host: str, port: int | None, *, browser: bool) -> LivePage:
    """Open the page of a problem or of a study."""
    check_installed()
    from copose.live.page import Page

    page = Page(shown, host=host, port=port or 0)
    if browser:
        with contextlib.suppress(webbrowser.Error):
            webbrowser.open(page.address)
    return LivePage(page)


def check_installed() -> None:
    """Refuse to go on where a package is missing that pages are made with.

    Raises:
        InputError: it names the extra.
    """
    packages = ("viser", "tomlkit", "fast_simplification")
    if any(find_spec(name) is None for name in packages):
        raise InputError("the live page needs viser; install it: pip install 'copose[live]'")
