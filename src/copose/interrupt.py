"""How ^C ends the process at once. Imports are few: this is loaded before anything else."""

import contextlib
import os

INTERRUPTED = 128 + 2


def end(found: str = "") -> None:
    """End at once: of an exception IPOPT would make a solution, and libraries a traceback.

    Args:
        found: what the line tells beside, such as where an answer is.
    """
    if os.isatty(2) and os.environ.get("TERM", "dumb") != "dumb":
        # Without the bar that shows progress, and with the cursor that it hides.
        os.write(2, b"\r\x1b[K\x1b[?25h")
    say(f"interrupted{found}")
    os._exit(INTERRUPTED)


def say(words: str) -> None:
    """Write a line past Python's stream: an interrupt may come in the middle of a call of it."""
    with contextlib.suppress(OSError):
        os.write(2, f"copose: {words}\n".encode(errors="replace"))
