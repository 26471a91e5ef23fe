"""The exceptions of copose: one root, one for wrong input."""

from __future__ import annotations

import datetime
import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path


class CoposeError(Exception):
    """The root of every exception that copose raises on purpose."""


class InputError(CoposeError):
    """Wrong input: one line that names the file, the key, what was wrong and what would be right.

    Args:
        message: what was wrong and what would be right.
        key: path of the key in the file, such as ``arms[1] (right).grasp.position``.
        file: the file at fault.
    """

    def __init__(self, message: str, *, key: str = "", file: str | Path | None = None) -> None:
        self.message = message
        self.key = key
        self.file = file
        super().__init__(message)

    def __str__(self) -> str:
        where = [str(self.file) if self.file is not None else "", self.key]
        return one_line(": ".join([part for part in where if part] + [self.message]))


@contextmanager
def blamed_on(file: str | Path | None) -> Iterator[None]:
    """Wrong input that is said to be of a file, unless it names another.

    Args:
        file: whose contents are looked at within; None for none.
    """
    try:
        yield
    except InputError as error:
        if error.file is None and file is not None:
            raise InputError(error.message, key=error.key, file=file) from None
        raise


def one_line(text: str, longest: int = 570) -> str:
    """Text with control characters replaced and its middle cut out where it is too long.

    With what the command puts in front, a message has at most 600 characters.
    """
    clean = "".join(c if c.isprintable() else " " for c in text)
    if len(clean) > longest:
        half = longest // 2 - 2
        clean = f"{clean[:half]} … {clean[-half:]}"
    return clean


def together(parts: Iterable[str], apart: str = "; ", most: int = 400) -> str:
    """As many different faults, or names, as fit, at least one, and how many more there are.

    Args:
        parts: the faults, or names.
        apart: what stands between two.
        most: characters; by default what the file and the key leave of a message.
    """
    different = list(dict.fromkeys(parts))
    kept = 1
    while kept < len(different) and len(apart.join(different[: kept + 1])) <= most:
        kept += 1
    rest = f" (and {len(different) - kept} more)" if kept < len(different) else ""
    return apart.join(different[:kept]) + rest


def arm_key(number: int, name: str) -> str:
    """The key of an arm, with its name: ``arms[0] (left)``."""
    return f"arms[{number}] ({name})"


def shown(value: object) -> str:
    """A value as it may stand in a message: its repr, shortened."""
    if isinstance(value, (dict, list, tuple)) and len(value) > 12:
        kind = "a table" if isinstance(value, dict) else "an array"
        return f"{kind} of {len(value)} entries"
    text = str(value).lower() if isinstance(value, bool) else one_line(repr(_as_lists(value)))
    return text if len(text) <= 60 else text[:57] + "…"


def _as_lists(value: object) -> object:
    if isinstance(value, tuple):
        return [_as_lists(entry) for entry in value]
    if isinstance(value, (datetime.date, datetime.time)):
        return value.isoformat()
    return value


def nearest(name: str, legal: Iterable[str]) -> str:
    """A hint «; did you mean 'x'?» with the legal name nearest to a wrong one, or the legal names.

    Args:
        name: the name that was not found.
        legal: every name that would have been right.
    """
    names = sorted(set(legal))
    close = difflib.get_close_matches(name[:100], names, n=1, cutoff=0.5)
    if close:
        return f"; did you mean {close[0]!r}?"
    listed = ", ".join(names)
    return f"; allowed: {listed}" if names and len(listed) <= 240 else ""
