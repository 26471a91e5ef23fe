"""Terminal output: tables, lines and progress, and messages on standard error."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from copose.errors import InputError, one_line
from copose.progress import Progress, Tell, Watch, stage, watched

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


@contextlib.contextmanager
def watching(arguments: argparse.Namespace) -> Iterator[Watch]:
    """A command that shows its progress."""
    with _shown(arguments) as told, watched(told, began=arguments.began) as watch:
        stage("reading")
        yield watch


@contextlib.contextmanager
def _shown(arguments: argparse.Namespace) -> Iterator[Tell | None]:
    """The callback that shows progress on stderr: lines if they are asked for, else one that
    changes on a terminal; None in a pipe.
    """
    if arguments.quiet or not (arguments.verbose or sys.stderr.isatty()):
        yield None
        return
    from rich.console import Console

    console = Console(stderr=True)
    if arguments.verbose or console.is_dumb_terminal:
        last = ""

        def told(now: Progress) -> None:
            nonlocal last
            if now.stage != last:
                last = now.stage
                tell(_in_words(replace(now, done=None, total=None), now.elapsed))

        yield told
        return
    from rich.live import Live
    from rich.text import Text

    latest: Progress | None = None

    def line() -> Text:
        words = "" if latest is None else _in_words(latest, time.perf_counter() - arguments.began)
        return Text(words, no_wrap=True, overflow="ellipsis")

    with Live(get_renderable=line, console=console, transient=True, refresh_per_second=8) as live:

        def show(now: Progress) -> None:
            nonlocal latest
            another = latest is None or now.stage != latest.stage
            latest = now
            if another:
                # What follows may leave the thread that shows the time no turn.
                live.refresh()

        yield show


def _in_words(now: Progress, elapsed: float) -> str:
    """Progress in words: time, stage, count and the best so far."""
    count = "" if now.done is None else f" {now.done}"
    count += "" if now.total is None else f"/{now.total}"
    best = "" if now.best is None else f", best so far {now.best:.6g}"
    left = "" if now.left is None else f", about {in_short(now.left)} left"
    return f"{elapsed:.1f} s: {now.stage}{count}{best}{left}"


def in_short(seconds: float) -> str:
    """A duration as a person would say it: ``30 ms``, ``8 s``, ``3 min``, ``2.5 h``."""
    if seconds < 1:
        return f"{1e3 * seconds:.0f} ms"
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.3g} h"
