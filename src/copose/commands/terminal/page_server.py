"""A page in the browser that a command serves until ^C."""

from __future__ import annotations

import signal
import time
from typing import TYPE_CHECKING

from copose.commands.terminal.output import print_line, tell

if TYPE_CHECKING:
    from copose.live import LivePage


def serve(page: LivePage) -> None:
    """Say where a page is, and wait for ^C."""
    # A handler may come in the middle of anything: it takes no lock.
    interrupts: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    print_line(f"open at {page.address}; ^C ends it")
    while not interrupts:
        # Between two looks at whether ^C was pressed, s.
        time.sleep(0.2)
    page.stop()
    tell("interrupted: the page is closed")
