"""A thread that does one task at a time; of moves only the newest counts."""

from __future__ import annotations

import threading
import traceback
from collections import deque
from collections.abc import Callable
from typing import TypeAlias

Task: TypeAlias = Callable[[], object]


class Worker:
    """Does tasks in their order, and of moves only the newest.

    Moves come faster than they are done; after the last of them, when nothing has been asked for
    during a moment of rest, ``rested`` is done.
    """

    def __init__(
        self, rested: Task, failed: Callable[[Exception], object], *, rest_s: float = 0.25
    ) -> None:
        """Begin to wait for tasks; a time without a move, s, is rest."""
        self._rested, self._failed, self._rest_s = rested, failed, rest_s
        self._ready = threading.Condition()
        self._tasks: deque[Task] = deque()
        self._move: Task | None = None
        self._moved = self._ended = self._busy = False
        self._rests = True
        self._thread = threading.Thread(target=self._run, name="copose live", daemon=True)
        self._thread.start()

    def do(self, task: Task) -> None:
        """Do a task when those before it are done."""
        with self._ready:
            if self._move is not None:
                # It was asked for before.
                self._tasks.append(self._move)
                self._move, self._moved = None, self._rests
            self._tasks.append(task)
            self._ready.notify_all()

    def move(self, task: Task, *, rests: bool = True) -> None:
        """Do a task soon, unless another one like it comes first; rest may follow it."""
        with self._ready:
            self._move, self._rests = task, rests
            self._ready.notify_all()

    @property
    def waiting(self) -> bool:
        """True where a task, a move or the end is waiting."""
        return self._ended or self._move is not None or bool(self._tasks)

    @property
    def pressed(self) -> bool:
        """True where a hand moves something, or the end has come."""
        return self._ended or self._move is not None

    def settle(self, timeout_s: float = 60.0) -> bool:
        """Wait until everything is done, the work of rest too; False where that takes longer."""
        with self._ready:
            return self._ready.wait_for(
                lambda: self._ended or not (self._busy or self._moved or self.waiting), timeout_s
            )

    def end(self) -> None:
        """Do nothing more; what is being done ends first."""
        with self._ready:
            self._ended = True
            self._tasks.clear()
            self._move = None
            self._ready.notify_all()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        """Do tasks until the end."""
        while (task := self._next()) is not None:
            try:
                task()
            except Exception as error:
                # Whatever it is, the page stays and says so.
                self._tell(error)

    def _tell(self, error: Exception) -> None:
        """Tell of the error of a task."""
        try:
            self._failed(error)
        except Exception:
            # Where drawing fails, so does telling of it; the thread must go on.
            traceback.print_exc()

    def _next(self) -> Task | None:
        """The next task; None at the end."""
        with self._ready:
            self._busy = False
            self._ready.notify_all()
            rest = self._rest_s if self._moved else None
            asked = self._ready.wait_for(lambda: self.waiting, rest)
            if self._ended:
                return None
            self._busy = True
            if not asked:
                self._moved = False
                return self._rested
            if self._tasks:
                return self._tasks.popleft()
            task, self._move = self._move, None
            self._moved = self._rests
            return task
