"""The process of `copose` and of `python -m copose`: what holds before anything is loaded.

Whatever happens ends in an exit status, and in one line where it is neither 0 nor 141. Imports are
few: until the first line of `run` the interpreter answers ^C with a traceback.
"""

import gc
import os
import signal
import sys
import time

from copose import interrupt


def run() -> int:
    """Run the command line of this process and return its exit status."""
    # What the interpreter has computed until here is, but for waiting, since the process began.
    began = time.perf_counter() - time.process_time()
    # In the background of a script ^C is not meant for us: then it is ignored already.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda *_: interrupt.end())
    # Modules make many objects that stay: looking for garbage among them takes a tenth of the time.
    gc.set_threshold(300_000)
    # All matrices are small: threads would wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Pydantic would look through every package installed for plug-ins.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    try:
        _open_streams()
        if not sys.warnoptions:
            import warnings

            warnings.simplefilter("ignore")
        from copose.commands.command_line import main

        status = main(began=began)
    except Exception as error:
        status = _failed(error)
    # Nothing is left to interrupt; an interpreter on its way out would die of it without a word.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Nor to look for garbage: it would for a sixth of the time, in what the process takes along.
    gc.freeze()
    return status


def _open_streams() -> None:
    """Nowhere in place of streams that are closed: a file that is opened would take their place."""
    while (handle := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(handle)
    sys.stdin = sys.stdin or open(0)  # noqa: SIM115
    sys.stdout = sys.stdout or open(1, "w")  # noqa: SIM115
    sys.stderr = sys.stderr or open(2, "w")  # noqa: SIM115


def _failed(error: Exception) -> int:
    """Say what went wrong that nobody has foreseen."""
    if os.environ.get("COPOSE_DEBUG"):
        import traceback

        traceback.print_exception(error)
    words = " ".join(f"internal error: {type(error).__name__}: {error}".split())
    if isinstance(error, MemoryError):
        words = "out of memory"
    interrupt.say(f"{words[:400]} (COPOSE_DEBUG=1 in the environment shows where)")
    return interrupt.ExitStatus.FAILED


if __name__ == "__main__":
    sys.exit(run())
