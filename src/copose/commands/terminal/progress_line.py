"""The progress of a command on standard error: a line that changes, or a line a stage."""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

from copose.commands.terminal.output import tell
from copose.progress import Progress, Tell, Watch, stage, watched


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
