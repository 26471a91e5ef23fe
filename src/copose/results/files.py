"""Results in files: JSON in and out, each file written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, TypeVar

from pydantic import ValidationError
from pydantic_core import from_json

from copose.errors import InputError
from copose.problem import read_text
from copose.results.agreement import disagreements
from copose.results.motion import Motion
from copose.results.solution import Solution

# The end of a file's name until it is whole.
_UNFINISHED = ".copose-unfinished"
_Result = TypeVar("_Result", Solution, Motion)


def to_json(solution: Solution | Motion) -> str:
    """A result as JSON text; numbers in full, never NaN or infinite."""
    return json.dumps(solution.model_dump(mode="json"), indent=1, allow_nan=False) + "\n"


def read_solution(path: str | Path) -> Solution:
    """Read a ``result.json``.

    Raises:
        InputError: it cannot be read or is no result.
    """
    return _read(path, Solution)


def read_motion(path: str | Path) -> Motion:
    """Read a ``result.json`` of `copose path`.

    Raises:
        InputError: it cannot be read or is no result.
    """
    return _read(path, Motion)


def read_result(path: str | Path, most_bytes: int = 200_000_000) -> Solution | Motion:
    """Read a ``result.json`` of either kind.

    Raises:
        InputError: it cannot be read or is no result.
    """
    file = Path(path)
    text = read_text(file, most_bytes)
    try:
        data = from_json(text)
    except ValueError as error:
        raise InputError(f"is no copose result ({error})", file=file) from None
    moves = isinstance(data, dict) and "knots" in data
    return _parsed(text, file, Motion) if moves else _parsed(text, file, Solution)


def _read(path: str | Path, model: type[_Result], most_bytes: int = 200_000_000) -> _Result:
    file = Path(path)
    return _parsed(read_text(file, most_bytes), file, model)


def _parsed(text: str, file: Path, model: type[_Result]) -> _Result:
    try:
        answer = model.model_validate_json(text, strict=True)
    except ValidationError as error:
        if model is Solution and _is(text, Motion):
            raise InputError(
                "is a motion, of copose path; a posture's result is needed", file=file
            ) from None
        first = error.errors(include_url=False, include_input=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        fault = ": ".join(part for part in (key, first["msg"]) if part)
    else:
        fault = next(disagreements(answer), "")
        if not fault:
            return answer
    raise InputError(f"is no copose result ({fault})", file=file)


def _is(text: str, model: type[Motion]) -> bool:
    try:
        model.model_validate_json(text)
    except ValidationError:
        return False
    return True


def write_file(path: Path, content: bytes) -> None:
    """Write a file beside its place and rename it there, once it is on the disk.

    What is there and is no file, such as ``/dev/stdout`` or a pipe, is written to as it is.

    Raises:
        InputError: the place cannot be written.
    """
    with whole_file(path) as file:
        file.write(content)


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[IO[bytes]]:
    """A file to write to, which comes to its place whole or not at all, see `write_file`.

    Raises:
        InputError: the place cannot be written.
    """
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            with path.open("wb") as file:
                yield file
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        with _swept(path.parent):
            handle, name = tempfile.mkstemp(
                dir=path.parent, prefix=f".{path.name[:40]}.", suffix=_UNFINISHED
            )
            try:
                with os.fdopen(handle, "wb") as file:
                    yield file
                    file.flush()
                    os.fsync(handle)
                # mkstemp makes files that only the owner can read; results are ordinary files.
                umask = os.umask(0)
                os.umask(umask)
                Path(name).chmod(0o666 & ~umask)
                Path(name).replace(path)
            except BaseException:
                Path(name).unlink(missing_ok=True)
                raise
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=path) from None


@contextlib.contextmanager
def _swept(folder: Path) -> Iterator[None]:
    """A folder without what writers that were killed have left, for as long as one writes to it.

    Writers share a lock on the folder, which ends with its process: while one can have it for
    itself, no unfinished file belongs to anybody. Where folders cannot be locked none is removed.
    """
    with contextlib.ExitStack() as locked:
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            handle = os.open(folder, os.O_RDONLY)
            locked.callback(os.close, handle)
            with contextlib.suppress(BlockingIOError):
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                for left in folder.glob(f".*{_UNFINISHED}"):
                    left.unlink()
            fcntl.flock(handle, fcntl.LOCK_SH)
        yield
