"""The command `copose live`: its arguments and what it does."""

from __future__ import annotations

import argparse
import signal
import time
from typing import TYPE_CHECKING

from copose.terminal import print_line, tell

if TYPE_CHECKING:
    from copose.problem import Problem

# The largest port.
_PORTS = 65535
# Between two looks at whether ^C was pressed, s.
_MOMENT = 0.2


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Give a parser the command's arguments."""
    command.add_argument(
        "--port", type=_port, default=8080, metavar="N", help="of the page (default: 8080)"
    )
    command.add_argument(
        "--host", default="127.0.0.1", metavar="ADDRESS",
        help="of the page (default: 127.0.0.1, which no other machine reaches)",
    )  # fmt: skip
    command.add_argument(
        "--no-browser", action="store_true", help="do not open the page in the browser"
    )


def serve(problem: Problem, arguments: argparse.Namespace) -> None:
    """Serve the page of a problem until ^C.

    Raises:
        InputError: the problem cannot be used, or the port is taken.
    """
    from copose.live import open_live

    page = open_live(
        problem, host=arguments.host, port=arguments.port, browser=not arguments.no_browser
    )
    # A handler may come in the middle of anything: it takes no lock.
    ended: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: ended.append(number))
    print_line(f"open at {page.address}; ^C ends it")
    while not ended:
        time.sleep(_MOMENT)
    page.stop()
    tell("interrupted: the page is closed")


def _port(text: str) -> int:
    port = int(text) if text.isascii() and text.isdigit() and len(text) < 6 else -1
    if not 0 <= port <= _PORTS:
        raise argparse.ArgumentTypeError(f"{text!r} is no port, a whole number to {_PORTS}")
    return port
