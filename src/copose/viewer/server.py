"""A server of pages that says nothing on the terminal."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

from copose.errors import InputError

if TYPE_CHECKING:
    from viser import ViserServer

# The console that viser prints to is that of the whole process.
_LOCK = threading.Lock()


def quiet_server(host: str = "127.0.0.1", port: int = 0, label: str | None = None) -> ViserServer:
    """A viser server that prints neither its address nor anything else; port 0 is any that is free.

    Raises:
        InputError: viser is not installed.
    """
    try:
        import viser
    except ImportError:
        raise InputError("the package viser is not installed; pip install 'copose[live]'") from None
    with _silence():
        return viser.ViserServer(host=host, port=port, label=label, verbose=False)


def stop(server: ViserServer) -> None:
    """End a server without a word."""
    with _silence():
        server.stop()


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """A time in which what viser prints is not seen; other consoles than rich's own go on."""
    import rich

    with _LOCK:
        console = rich.get_console()
        quiet, console.quiet = console.quiet, True
        try:
            yield
        finally:
            console.quiet = quiet
