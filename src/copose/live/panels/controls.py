"""Controls of the panel, which tell a hand's changes from the page's own."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import viser


class Controls:
    """Makes controls whose handlers are called for hands alone.

    Viser calls handlers whoever has changed a control, for hands on threads of their own and in any
    order.

    Attributes:
        gui: the panel of viser.
    """

    def __init__(self, gui: viser.GuiApi) -> None:
        self.gui = gui
        self._setter: int | None = None

    @contextmanager
    def setting(self) -> Iterator[None]:
        """A time in which this thread sets controls, so that handlers are not called."""
        self._setter = threading.get_ident()
        try:
            yield
        finally:
            self._setter = None

    def when(self, control: Any, act: Callable[[Any], object]) -> None:
        """Do something with the value of a control when a hand changes it."""

        def changed(_: object) -> None:
            if threading.get_ident() != self._setter:
                act(control.value)

        control.on_update(changed)

    def clicked(self, button: Any, act: Callable[[], object]) -> None:
        """Do something when a hand clicks a button."""
        button.on_click(lambda _: act())

    def add_saving(
        self, save: Callable[[str, str], object], *files: tuple[str, str, str | None]
    ) -> viser.GuiHtmlHandle:
        """Add a name and a button that saves for each kind of file: kind, usual name, hint.

        Returns:
            HTML below them, for the outcome.
        """

        def written(kind: str, text: viser.GuiInputHandle[str]) -> None:
            save(kind, text.value)

        for kind, name, hint in files:
            text = self.gui.add_text(kind, name, hint=hint)
            button = self.gui.add_button(f"Save {kind}")
            self.clicked(button, partial(written, kind, text))
        return self.gui.add_html("")


def put(control: Any, value: object) -> None:
    """Set the value of a control, where it is another."""
    if control.value != value:
        control.value = value


def see(control: Any, visible: bool) -> None:
    """Show or hide a control."""
    if control.visible != visible:
        control.visible = visible


def put_content(control: Any, content: str) -> None:
    """Set the HTML of a control, where it is another."""
    if control.content != content:
        control.content = content
