"""Terminal output: tables and lines on standard output, messages on standard error."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from copose.errors import InputError, one_line

if TYPE_CHECKING:
    from rich.console import RenderableType


def print_rich(content: RenderableType) -> None:
    """Print a table, or whatever Rich prints, whole."""
    from rich.console import Console

    console = Console(highlight=False)
    # Tables need 80 columns to show all digits; narrower terminals wrap their lines.
    console.width = max(console.width, 80)
    with printing():
        # Rich itself would end the process where nobody reads.
        with console.capture() as printed:
            console.print(content)
        sys.stdout.writelines(f"{line.rstrip()}\n" for line in printed.get().splitlines())


def print_line(words: str) -> None:
    """Print a line that is not broken: a path in it can be copied."""
    with printing():
        sys.stdout.write(f"{one_line(words)}\n")


def print_place(place: Path) -> None:
    """Print where something was written."""
    print_line(f"written to {place}")


@contextlib.contextmanager
def printing() -> Iterator[None]:
    """Output that is written to standard output at once.

    Raises:
        BrokenPipeError: the reader has gone.
        InputError: it cannot be written to, on a full disk say.
    """
    try:
        with _emptied(sys.stdout):
            yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise InputError(f"cannot print: {error.strerror}") from None


def tell(words: str) -> None:
    """Print a line on standard error, where that can be written to."""
    with contextlib.suppress(OSError), _emptied(sys.stderr):
        sys.stderr.write(f"{one_line(f'copose: {words}')}\n")


@contextlib.contextmanager
def _emptied(stream: TextIO) -> Iterator[None]:
    """A stream that is flushed; what it cannot write is not tried again as the process ends."""
    try:
        yield
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        raise
