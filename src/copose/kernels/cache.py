"""The user's cache folder, and compiled kernels in it.

Loading a library runs its code, so only what this user compiled is loaded: from a folder that is
the user's own and that nobody else can enter. Files in it may be damaged all the same, by a full
disk, a lost machine or another program, and a damaged library ends the process: each is read and
checked against the digest in its name first.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import shlex
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from copose.kernels import whole_file
from copose.kernels.source import FLAGS
from copose.kernels.whole_file import name_of, settled
from copose.progress import heed

# Longest time for the compiler, s.
_PATIENCE = 120.0
# First letters of the names of files in the making.
_BUILDING = ".building-"
# Libraries that this process has loaded; their names tell what is in them.
_loaded: dict[Path, ctypes.CDLL] = {}


def wanted() -> bool:
    """True where kernels are to be compiled: not with ``COPOSE_COMPILE=0``, not on Windows."""
    return os.environ.get("COPOSE_COMPILE", "1") != "0" and os.name == "posix"


def compiler() -> list[str] | None:
    """The C compiler, ``$CC`` or ``cc``, ``gcc``, ``clang`` on the path; None without one."""
    given = os.environ.get("CC")
    try:
        command = shlex.split(given) if given else []
    except ValueError:
        return None
    for name in [command[0]] if command else ["cc", "gcc", "clang"]:
        program = shutil.which(name)
        if program is not None:
            return [program, *command[1:]]
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
        state = place.lstat()
    except OSError:
        return None
    own = stat.S_ISDIR(state.st_mode) and state.st_uid == os.geteuid()
    return place if own and stat.S_IMODE(state.st_mode) & 0o077 == 0 else None


def stored(key: str, suffix: str) -> tuple[Path, bytes] | None:
    """The file of a key and its content, if it is there, whole and the user's alone.

    A file that is not whole, or not the user's alone, is removed, to be made anew.
    """
    place = folder()
    if place is None:
        return None
    with contextlib.suppress(OSError):
        for file in place.glob(f"{key}-*{suffix}"):
            content = _content(file)
            if content is not None and file.name == name_of(key, content, suffix):
                return file, content
            _remove(file)
    return None


def store(key: str, suffix: str, content: bytes) -> None:
    """Keep a content under a key; without a folder that can be written to nothing is kept."""
    place = folder()
    if place is None:
        return
    _sweep(place)
    with contextlib.suppress(OSError), _written(place, suffix, content) as file:
        file.replace(place / settled(file, key))


def library(key: str) -> ctypes.CDLL | None:
    """The compiled kernel of a key, if it is there and may be loaded.

    Raises:
        OSError: it cannot be loaded.
    """
    entry = stored(key, ".so")
    if entry is None:
        return None
    file, content = entry
    if file not in _loaded:
        _loaded[file] = _opened(file, content)
    return _loaded[file]


def _opened(file: Path, content: bytes) -> ctypes.CDLL:
    """A library, loaded from a copy that nobody else knows of, where there can be one.

    The process would end if anyone wrote to a library in use.
    """
    with contextlib.suppress(OSError), _written(file.parent, file.suffix, content) as copy:
        return ctypes.CDLL(str(copy))
    return ctypes.CDLL(str(file))


@contextlib.contextmanager
def _written(place: Path, suffix: str, content: bytes) -> Iterator[Path]:
    """A file in the making, for as long as it is needed."""
    handle, name = tempfile.mkstemp(dir=place, prefix=_BUILDING, suffix=suffix)
    try:
        with _held(Path(name)):
            with os.fdopen(handle, "wb") as sink:
                sink.write(content)
            yield Path(name)
    finally:
        Path(name).unlink(missing_ok=True)


@contextlib.contextmanager
def _held(left: Path, *, alone: bool = False) -> Iterator[int]:
    """A file or folder in the making, held while a process lives that has the handle.

    Args:
        left: where it is.
        alone: whether it must be certain that no other process holds it.

    Raises:
        OSError: it cannot be opened, or is not held alone.
    """
    # Windows has none.
    import fcntl

    handle = os.open(left, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        # Not every file system knows locks: there nothing is swept.
        with contextlib.nullcontext() if alone else contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield handle
    finally:
        os.close(handle)


def _content(file: Path) -> bytes | None:
    """The content of a file; None where it is no file, or not the user's alone."""
    try:
        state = file.lstat()
        own = stat.S_ISREG(state.st_mode) and state.st_uid == os.geteuid()
        return file.read_bytes() if own and stat.S_IMODE(state.st_mode) & 0o022 == 0 else None
    except OSError:
        return None


def _remove(file: Path) -> None:
    """Remove a file, a link or a folder, if that can be done."""
    with contextlib.suppress(OSError):
        if file.is_dir() and not file.is_symlink():
            shutil.rmtree(file, ignore_errors=True)
        else:
            file.unlink()


@dataclass(frozen=True)
class Code:
    """The code that a kernel is compiled from."""

    text: str  # in C
    sizes: tuple[int, int, int]  # numbers in x, p and y


def fill(codes: Mapping[str, Callable[[], Code]], *, wait: bool) -> None:
    """Compile kernels into the cache.

    Without a compiler or a folder the cache stays as it is. A library appears whole, by a rename,
    so that any number of processes may do this at once.

    Args:
        codes: what writes the code, by key.
        wait: until the compiler has ended; else it goes on by itself, even after this process.

    Raises:
        StoppedError: the call that it serves has to end.
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
    with contextlib.suppress(OSError), _held(scratch) as handle:
        try:
            script = _script(codes, command, place, scratch)
        except BaseException:
            shutil.rmtree(scratch, ignore_errors=True)
            raise
        shell = subprocess.Popen(
            # The shell returns at once and leaves the work to a child that nobody has to wait for.
            ["/bin/sh", "-c", script if wait else f"({script}\n) </dev/null >/dev/null 2>&1 &"],
            cwd=scratch,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=[handle],
            start_new_session=True,
        )
        try:
            shell.wait(_PATIENCE)
            return
        except subprocess.TimeoutExpired:
            with contextlib.suppress(OSError):
                os.killpg(shell.pid, signal.SIGKILL)
            shell.wait()
    shutil.rmtree(scratch, ignore_errors=True)


def _script(
    codes: Mapping[str, Callable[[], Code]], command: list[str], place: Path, scratch: Path
) -> str:
    """A shell script that compiles kernels in a folder, tries and moves each, and cleans up."""
    lines = ["umask 077"]
    patient = shutil.which("timeout")
    limited = [patient, str(int(_PATIENCE))] if patient is not None else []
    for key, write in codes.items():
        heed()
        try:
            code = write()
        except NotImplementedError:
            # The virtual machine knows more operations than are written in C.
            continue
        (scratch / f"{key}.c").write_text(code.text, encoding="utf-8")
        build = [*limited, *command, *FLAGS, "-o", f"{key}.so", f"{key}.c", "-lm"]
        sizes = map(str, code.sizes)
        trial = [*limited, sys.executable, "-I", whole_file.__file__, f"{key}.so", key, *sizes]
        lines.append(
            f"{shlex.join(build)} && name=$({shlex.join(trial)}) "
            f'&& mv -f {key}.so {shlex.quote(str(place))}/"$name"'
        )
    return "\n".join([*lines, f"cd / && rm -rf {shlex.quote(str(scratch))}"])


def _sweep(place: Path) -> None:
    """Remove what killed runs have left behind: made a second ago or more, and held by nobody."""
    for left in place.glob(f"{_BUILDING}*"):
        with contextlib.suppress(OSError):
            if time.time() - left.lstat().st_mtime > 1.0:
                with _held(left, alone=True):
                    _remove(left)
