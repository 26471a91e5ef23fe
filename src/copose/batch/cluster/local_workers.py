"""Worker processes on this machine, started anew where they die.

They are no nannies' children: a nanny waits for a task to end where these are killed, and gives up
a worker that dies while it starts.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

from copose.errors import CoposeError

# All matrices are small: threads would wait for each other.
_ONE_THREAD = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"
)


class LocalWorkers:
    """So many worker processes of a scheduler; they end with this process, whatever ends it."""

    def __init__(self, count: int, address: str, patience: int = 10) -> None:
        """None yet; `keep` starts them. Before one is ready some may die, beside two of each."""
        self._address = address
        self._most_deaths = patience + 2 * count
        self._deaths = 0
        self._folder = tempfile.TemporaryDirectory(prefix="copose-", ignore_cleanup_errors=True)
        self._processes: list[subprocess.Popen[bytes] | None] = [None] * count

    def keep(self) -> None:
        """Start the processes that are not there.

        Raises:
            CoposeError: one after the other dies before it is ready.
        """
        for i, process in enumerate(self._processes):
            if process is None:
                self._processes[i] = self._started()
            elif process.poll() is not None:
                self._deaths += 1
                if self._deaths > self._most_deaths:
                    raise CoposeError(
                        f"{self._deaths} worker processes have died before one was ready, the last "
                        f"with {_end_of(process)}"
                    )
                self._close(process)
                self._processes[i] = self._started()

    def praise(self) -> None:
        """Take note that a process is ready for points."""
        self._deaths = 0

    def stop(self) -> None:
        """End all processes at once."""
        started = [process for process in self._processes if process is not None]
        for process in started:
            process.kill()
        for process in started:
            self._close(process)
        self._folder.cleanup()

    def _started(self) -> subprocess.Popen[bytes]:
        program = [sys.executable, "-P", "-m", f"{__package__}.local_worker"]
        # It imports what this process imports; in a session of its own no ^C of the terminal
        # reaches it, nor what it starts.
        path = os.pathsep.join(filter(None, sys.path))
        return subprocess.Popen(
            [*program, self._address, self._folder.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **_ONE_THREAD, "PYTHONPATH": path},
            start_new_session=True,
        )

    @staticmethod
    def _close(process: subprocess.Popen[bytes]) -> None:
        process.wait()
        if process.stdin is not None:
            process.stdin.close()


def _end_of(process: subprocess.Popen[bytes]) -> str:
    code = process.returncode
    return f"signal {-code}" if code < 0 else f"exit status {code}"
