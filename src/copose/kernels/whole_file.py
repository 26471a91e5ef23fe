"""Names of files that hold a key and a digest of the content, which tells whether it is whole.

Run as a program it tries a library in a process of its own, for one that crashes must do so there,
and prints the name that it is to have: ``whole_file.py FILE KEY NX NP NY``. It needs nothing but
the standard library.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
from pathlib import Path


def name_of(key: str, content: bytes, suffix: str) -> str:
    """The name of the file of a key with some content."""
    digest = hashlib.sha256(key.encode() + b"\0" + content).hexdigest()[:32]
    return f"{key}-{digest}{suffix}"


def settled(file: Path, key: str) -> str:
    """The name for a file of a key, once its content is on the disk.

    Otherwise a machine that loses power might keep the name without the content.
    """
    with file.open("rb") as source:
        os.fsync(source.fileno())
        return name_of(key, source.read(), file.suffix)


def _try(file: Path, sizes: list[int]) -> None:
    """Evaluate a kernel at two points."""
    x, p, y = ((ctypes.c_double * (2 * size + 1))() for size in sizes)
    evaluate = ctypes.CDLL(str(file.resolve())).evaluate
    evaluate(ctypes.c_long(2), x, p, ctypes.c_long(0), y)


if __name__ == "__main__":
    library, key, *numbers = sys.argv[1:]
    _try(Path(library), [int(number) for number in numbers])
    sys.stdout.write(settled(Path(library), key))
