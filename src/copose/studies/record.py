"""The record of a study: a file with a line of JSON for each point that is done."""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

from copose.errors import InputError

# The end of a line as `PointLine.text` writes it; other lines are read as JSON.
_HASH = b'"hash": "'
_DIGITS = 32


class StudyRecord:
    """A record that lines are appended to, by one process at a time.

    What a killed process has left of a line is cut off as the record is opened.
    """

    def __init__(self, file: Path, sync_s: float = 1.0) -> None:
        """Open a record, or begin one; lines go to the disk every ``sync_s`` seconds.

        Raises:
            InputError: it cannot be written, or another process writes to it.
        """
        self.file, self._sync_s, self._synced = file, sync_s, time.monotonic()
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._handle = os.open(file, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}", file=file) from None
        _lock(self._handle, file)
        self._size = _whole_size(self._handle)
        os.ftruncate(self._handle, self._size)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self.sync()
        finally:
            os.close(self._handle)

    def append(self, line: str) -> None:
        """Append a line; it is in the file at once, and on the disk after `sync`.

        Raises:
            InputError: the disk is full, say; no part of the line is left behind.
        """
        content = f"{line}\n".encode()
        try:
            written = os.write(self._handle, content)
            while written < len(content):
                written += os.write(self._handle, content[written:])
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._handle, self._size)
            raise InputError(f"cannot be written: {error.strerror}", file=self.file) from None
        self._size += len(content)
        if time.monotonic() - self._synced > self._sync_s:
            self.sync()

    def sync(self) -> None:
        """Wait until all lines are on the disk.

        Raises:
            InputError: the disk fails.
        """
        try:
            os.fsync(self._handle)
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}", file=self.file) from None
        self._synced = time.monotonic()


def lines_of(file: Path) -> Iterator[tuple[bytes, int]]:
    """The hash and the offset of each whole line of a record; what is no such line is skipped.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        with file.open("rb") as content:
            offset = 0
            for line in content:
                point_hash = _hash_of(line)
                if point_hash is not None:
                    yield point_hash, offset
                offset += len(line)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=file) from None


def _hash_of(line: bytes) -> bytes | None:
    """The hash at the end of a line; None where it is no line of a record."""
    end = len(line) - len(b'"}\n')
    begin = end - _DIGITS
    if line[end:] == b'"}\n' and line[begin - len(_HASH) : begin] == _HASH:
        with contextlib.suppress(ValueError):
            return bytes.fromhex(line[begin:end].decode("ascii", "replace"))
    with contextlib.suppress(ValueError, KeyError, TypeError):
        if line.endswith(b"\n"):
            return bytes.fromhex(json.loads(line)["hash"])
    return None


class RecordLines:
    """The lines of a record, read where they stand, so that a large one needs no memory."""

    def __init__(self, file: Path) -> None:
        """The lines of a file, which is not empty.

        Raises:
            InputError: it cannot be read.
        """
        self._file = file
        try:
            with file.open("rb") as content:
                self._bytes = mmap.mmap(content.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise InputError(f"cannot be read: {reason}", file=file) from None

    def at(self, offset: int) -> dict[str, Any]:
        """The line that begins at an offset.

        Raises:
            InputError: it is damaged.
        """
        end = self._bytes.find(b"\n", offset)
        try:
            line: dict[str, Any] = json.loads(self._bytes[offset:end])
            if _is_line(line):
                return line
        except ValueError:
            pass
        number = self._bytes[:offset].count(b"\n") + 1
        text = f"line {number} is damaged; delete it, and the study does its point again"
        raise InputError(text, file=self._file)


def _is_line(line: Any) -> bool:
    """True where the parts of a line are of their kinds."""
    kinds: dict[str, type | tuple[type, ...]] = {
        "status": str,
        "reason": (str, type(None)),
        "objective": (float, int, type(None)),
        "joints": (dict, type(None)),
        "placement": (dict, type(None)),
        "record": dict,
        "missing": list,
        "seconds": (float, int),
        "stopped": bool,
    }
    return isinstance(line, dict) and all(
        key in line and isinstance(line[key], kind) for key, kind in kinds.items()
    )


def _lock(handle: int, file: Path) -> None:
    """Refuse a record that another process writes to, where files can be locked."""
    with contextlib.suppress(ImportError):
        import fcntl

        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            raise InputError(
                "another process is writing to it; wait for its end", file=file
            ) from None
        except OSError:
            return


def _whole_size(handle: int, block: int = 1 << 16) -> int:
    """Where the last whole line ends, bytes from the beginning."""
    end = os.fstat(handle).st_size
    while end > 0:
        begin = max(end - block, 0)
        newline = os.pread(handle, end - begin, begin).rfind(b"\n")
        if newline >= 0:
            return begin + newline + 1
        end = begin
    return 0
