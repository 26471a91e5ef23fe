"""Results in files: JSON in and out, each file written whole or not at all."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from copose.errors import InputError
from copose.problem import read_text
from copose.results.motion import Motion
from copose.results.solution import Solution

_MOST_BYTES = 200_000_000
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


def _read(path: str | Path, model: type[_Result]) -> _Result:
    file = Path(path)
    text = read_text(file, _MOST_BYTES)
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        if model is Solution and _is(text, Motion):
            raise InputError(
                "is a motion, of copose path; a posture's result is needed", file=file
            ) from None
        first = error.errors(include_url=False, include_input=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        why = ": ".join(part for part in (key, first["msg"]) if part)
        raise InputError(f"is no copose result ({why})", file=file) from None


def _is(text: str, model: type[Motion]) -> bool:
    try:
        model.model_validate_json(text)
    except ValidationError:
        return False
    return True


def write_file(path: Path, content: bytes) -> None:
    """Write a file beside its place and rename it there.

    Raises:
        InputError: the place cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}.")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
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
