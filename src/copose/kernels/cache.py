"""Compiled kernels in the user's cache folder.

Loading a library runs its code, so only what this user compiled is loaded: from a folder that is
the user's own and that nobody else can enter.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from copose.kernels.source import FLAGS

_PATIENCE = 120.0
_BUILDING = ".building-"
# After which files of a compilation are taken to be left over, s.
_STALE = 2 * _PATIENCE


def wanted() -> bool:
    """Whether kernels are to be compiled: not with ``COPOSE_COMPILE=0``, not on Windows."""
    return os.environ.get("COPOSE_COMPILE", "1") != "0" and os.name == "posix"


def compiler() -> list[str] | None:
    """The C compiler, ``$CC`` or ``cc``, ``gcc``, ``clang`` on the path; None without one."""
    given = os.environ.get("CC")
    try:
        command = shlex.split(given) if given else []
    except ValueError:
        return None
    for name in [command[0]] if command else ["cc", "gcc", "clang"]:
        found = shutil.which(name)
        if found is not None:
            return [found, *command[1:]]
    return None


def folder() -> Path | None:
    """The cache folder, made if need be; None where there is none that can be trusted."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    try:
        if Path(given).is_absolute():
            home = Path(given)
        else:
            usual = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
            home = Path(usual).expanduser()
    except RuntimeError:
        return None
    if not home.is_absolute():
        return None
    place = home / "copose"
    try:
        home.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileExistsError):
            place.mkdir(mode=0o700)
        found = place.lstat()
    except OSError:
        return None
    own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid()
    return place if own and stat.S_IMODE(found.st_mode) & 0o077 == 0 else None


def library(key: str) -> Path | None:
    """The compiled kernel of a key, if it is there and may be loaded."""
    place = folder()
    if place is None:
        return None
    file = place / f"{key}.so"
    try:
        found = file.lstat()
    except OSError:
        return None
    own = stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid()
    return file if own and stat.S_IMODE(found.st_mode) & 0o022 == 0 else None


@dataclass(frozen=True)
class Code:
    """What a kernel is compiled from.

    Attributes:
        text: in C.
        sizes: of x, p and y.
    """

    text: str
    sizes: tuple[int, int, int]


# A library that crashes must do so in a process of its own.
_TRIAL = """\
import ctypes, sys
sizes = [int(size) for size in sys.argv[2:]]
x, p, y = ((ctypes.c_double * (2 * size + 1))() for size in sizes)
evaluate = ctypes.CDLL(sys.argv[1]).evaluate
evaluate(ctypes.c_long(2), x, p, ctypes.c_long(0), y)
"""


def fill(codes: Mapping[str, Callable[[], Code]], *, wait: bool) -> None:
    """Compile kernels into the cache.

    Nothing is raised: without a compiler or a folder the cache stays as it is. A library appears
    whole, by a rename, so that any number of processes may do this at once.

    Args:
        codes: what writes the code, by key.
        wait: until the compiler has ended; else it goes on by itself, even after this process.
    """
    place, command = folder(), compiler()
    if place is None or command is None or not codes:
        return
    _sweep(place)
    try:
        if wait:
            scratch = Path(tempfile.mkdtemp(dir=place, prefix=_BUILDING))
        else:
            # Of many processes that start at once one sets the compiler to work.
            scratch = place / f"{_BUILDING}{next(iter(codes))}"
            scratch.mkdir(mode=0o700)
    except OSError:
        return
    try:
        (scratch / "trial.py").write_text(_TRIAL, encoding="utf-8")
        lines = ["umask 077"]
        patient = shutil.which("timeout")
        limited = [patient, str(int(_PATIENCE))] if patient is not None else []
        for key, write in codes.items():
            try:
                code = write()
            except NotImplementedError:
                # The virtual machine knows more operations than we write in C.
                continue
            (scratch / f"{key}.c").write_text(code.text, encoding="utf-8")
            steps = (
                [*limited, *command, *FLAGS, "-o", f"{key}.so", f"{key}.c", "-lm"],
                [*limited, sys.executable, "-I", "trial.py", f"./{key}.so", *map(str, code.sizes)],
                ["mv", "-f", f"{key}.so", f"{place}/"],
            )
            lines.append(" && ".join(shlex.join(step) for step in steps))
    except OSError:
        shutil.rmtree(scratch, ignore_errors=True)
        return
    script = "\n".join([*lines, f"cd / && rm -rf {shlex.quote(str(scratch))}"])
    # The shell returns at once and leaves the work to a child that nobody has to wait for.
    run = script if wait else f"({script}\n) </dev/null >/dev/null 2>&1 &"
    with contextlib.suppress(OSError):
        shell = subprocess.Popen(
            ["/bin/sh", "-c", run],
            cwd=scratch,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            shell.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(OSError):
                os.killpg(shell.pid, signal.SIGKILL)
            shell.wait()
            shutil.rmtree(scratch, ignore_errors=True)


def _sweep(place: Path) -> None:
    """Remove what compilations that were killed have left behind."""
    for left in place.glob(f"{_BUILDING}*"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > _STALE:
                shutil.rmtree(left, ignore_errors=True)
