"""`^C`: what commands do then, and a page that is served until it is pressed."""

from __future__ import annotations

import argparse
import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from copose.commands.terminal.output import print_line, tell
from copose.interrupt import ExitStatus

if TYPE_CHECKING:
    from copose.live import LivePage


@contextlib.contextmanager
def on_interrupt(act: Callable[[], None]) -> Iterator[None]:
    """A first ^C that does not end the process; the next does what it did before."""
    before = signal.getsignal(signal.SIGINT)
    if not callable(before) or threading.current_thread() is not threading.main_thread():
        yield
        return

    def first(*_: object) -> None:
        signal.signal(signal.SIGINT, before)
        act()

    signal.signal(signal.SIGINT, first)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def serve(open_page: Callable[..., LivePage], shown: object, arguments: argparse.Namespace) -> int:
    """Open a page as the options of `add_page` say, tell where it is, wait for ^C, and return the
    exit status.
    """
    page = open_page(
        shown, host=arguments.host, port=arguments.port, browser=not arguments.no_browser
    )
    # A handler may come in the middle of anything: it takes no lock.
    interrupts: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    print_line(f"open at {page.address}; ^C ends it")
    while not interrupts:
        # Between two looks at whether ^C was pressed, s.
        time.sleep(0.2)
    page.stop()
    tell("interrupted: the page is closed")
    return ExitStatus.INTERRUPTED
