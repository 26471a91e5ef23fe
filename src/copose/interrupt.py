"""The end of the command's process: exit statuses, and ^C. This is loaded before anything else."""

import contextlib
import os
from enum import IntEnum


class ExitStatus(IntEnum):
    """The exit statuses of `copose`."""

    SOLVED = 0
    WRONG_INPUT = 2
    INFEASIBLE = 3
    FAILED = 4
    # As a shell says it of signals: 128 and SIGINT, SIGPIPE.
    INTERRUPTED = 128 + 2
    READER_GONE = 128 + 13


def end(answer: str = "") -> None:
    """End at once: of an exception IPOPT would make a solution, and libraries a traceback.

    Args:
        answer: what the line tells beside, such as where an answer is.
    """
    if os.isatty(2) and os.environ.get("TERM", "dumb") != "dumb":
        # Without the bar that shows progress, and with the cursor that it hides.
        os.write(2, b"\r\x1b[K\x1b[?25h")
    say(f"interrupted{answer}")
    os._exit(ExitStatus.INTERRUPTED)


def say(words: str) -> None:
    """Write a line past Python's stream: an interrupt may come in the middle of a call of it."""
    with contextlib.suppress(OSError):
        os.write(2, f"copose: {words}\n".encode(errors="replace"))
