"""What the cache keeps is whole, or made anew: a damaged library would end the process.

Every kind of damage is done in a process of its own, so that one that dies is a test that fails.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import casadi as ca
import pytest

from copose.kernels import Kernel, build, cache

DAMAGE = """
import io, json, os, shutil, sys
from pathlib import Path

import casadi as ca
import numpy as np

from copose.kernels import Kernel, build

home = Path(os.environ["XDG_CACHE_HOME"]) / "copose"


def kernel(factor):
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
    return Kernel(x, p, ca.vertcat(factor * ca.sin(x) * p[0], ca.exp(x[0]) + p[1]))


def array(rows):
    file = io.BytesIO()
    np.save(file, rows)
    return file.getvalue()


def anything(whole):
    return np.random.default_rng(0).bytes(len(whole))


# What a whole file holds, in which the kind of damage is done; and another's of the same folder.
CONTENTS = {
    "truncated": lambda whole, other: whole[: len(whole) // 2],
    "empty": lambda whole, other: b"",
    "zeroed": lambda whole, other: bytes(len(whole)),
    "one bit": lambda whole, other: whole[:-9] + bytes([whole[-9] ^ 1]) + whole[-8:],
    "head alone": lambda whole, other: whole[:64],
    "longer": lambda whole, other: whole + b"more",
    "any bytes": lambda whole, other: anything(whole),
    "another's content": lambda whole, other: other,
    "no rows": lambda whole, other: array(np.zeros((0, 7))),
    "no numbers": lambda whole, other: array(np.full((2, 7), np.nan)),
    "another shape": lambda whole, other: array(np.zeros(7)),
}


def damage(kind, file, other):
    if kind in CONTENTS:
        file.write_bytes(CONTENTS[kind](file.read_bytes(), other.read_bytes()))
        return
    if kind == "another's name":
        key, digest = file.stem.split("-")
        file.unlink()
        shutil.copy(other, other.with_name(f"{key}-{other.stem.split('-')[1]}{other.suffix}"))
        return
    whole = file.rename(home.parent / file.name)
    if kind == "folder":
        file.mkdir()
        (file / "inside").write_text("")
    elif kind == "link":
        file.symlink_to(whole)
    elif kind == "link to nothing":
        file.symlink_to("nowhere")
    elif kind == "pipe":
        os.mkfifo(file)
    elif kind == "open to others":
        file.write_bytes(whole.read_bytes())
        file.chmod(0o666)


def library(kind):
    x, p = np.random.default_rng(1).normal(size=(40, 3)), np.array([2.0, 3.0])
    first, second = kernel(1.0), kernel(2.0)
    expected = first(x, p)
    assert build([first, second], wait=True)
    damage(kind, *(next(home.glob(f"{each.key}-*.so")) for each in (first, second)))
    again = kernel(1.0)
    assert not again.load() and build([again], wait=True) and kernel(1.0).load()
    # What is in use already is none the worse.
    assert all(np.array_equal(each(x, p), expected) for each in (first, again))


what, *kinds = sys.argv[1:]
for kind in kinds:
    child = os.fork()
    if not child:
        try:
            globals()[what](kind)
        except BaseException as error:
            print(what, kind, repr(error), file=sys.stderr, flush=True)
            os._exit(1)
        os._exit(0)
    print(json.dumps([kind, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])]), flush=True)
"""

EVERY = (
    "truncated", "empty", "zeroed", "one bit", "any bytes", "another's content", "another's name",
    "folder", "link",
)  # fmt: skip
KINDS = {
    "library": (*EVERY, "head alone"),
}  # fmt: skip


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """How the process of each kind of damage ended, and what those of one kind of file said."""
    ends = {}
    for what, kinds in KINDS.items():
        if what == "library" and cache.compiler() is None:
            continue
        home = tmp_path_factory.mktemp(what)
        answer = subprocess.run(
            [sys.executable, "-c", DAMAGE, what, *kinds],
            env={**os.environ, "XDG_CACHE_HOME": str(home), "COPOSE_COMPILE": "1"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert answer.returncode == 0, answer.stderr
        for line in answer.stdout.splitlines():
            kind, status = json.loads(line)
            ends[what, kind] = status
        ends[what] = answer.stderr
    return ends


@pytest.mark.parametrize(
    ("what", "kind"), [(what, kind) for what, kinds in KINDS.items() for kind in kinds]
)
def test_what_is_damaged_is_made_anew(what: str, kind: str, outcomes: dict) -> None:
    if what == "library" and cache.compiler() is None:
        pytest.skip("no C compiler here")
    assert outcomes[what, kind] == 0, outcomes[what]


def test_what_is_damaged_is_made_anew_silently(outcomes: dict) -> None:
    assert all(outcomes[what] == "" for what in KINDS if what in outcomes)


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "copose"


def test_names_have_the_digest_of_key_and_content(home: Path) -> None:
    cache.store("0a1b", ".npy", b"content")
    (file,) = home.iterdir()
    assert (
        file.name == f"0a1b-{hashlib.sha256(b'0a1b' + bytes(1) + b'content').hexdigest()[:32]}.npy"
    )
    assert cache.stored("0a1b", ".npy") == (file, b"content")
    assert cache.stored("0a1", ".npy") is None and cache.stored("0a1b", ".so") is None


def test_what_killed_runs_leave_behind_is_swept(home: Path) -> None:
    """Not what another process is making: it holds that as long as it lives."""
    assert cache.folder() == home
    for name in ("left.npy", "held.npy"):
        (home / f".building-{name}").write_bytes(b"half")
    for name in ("left", "held"):
        (home / f".building-{name}").mkdir()
        (home / f".building-{name}" / "kernel.c").write_text("")
    for left in home.iterdir():
        os.utime(left, (time.time() - 5, time.time() - 5))
    with cache._held(home / ".building-held"), cache._held(home / ".building-held.npy"):
        cache.store("0a1b", ".npy", b"one")
        names = sorted(file.name for file in home.glob(".*"))
        assert names == [".building-held", ".building-held.npy"]
    cache.store("0a1c", ".npy", b"other")
    assert [file.suffix for file in home.iterdir()] == [".npy"] * 2


@pytest.mark.skipif(cache.compiler() is None, reason="no C compiler here")
def test_a_compiler_at_work_holds_its_folder(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it makes stays while it lives, whoever began it, and goes once it is killed."""
    slow = tmp_path / "cc"
    pid = tmp_path / "pid"
    slow.write_text(f"#!/bin/sh\necho $$ > {pid}.new; mv {pid}.new {pid}\nexec sleep 60\n")
    slow.chmod(0o755)
    monkeypatch.setenv("CC", str(slow))
    monkeypatch.setenv("COPOSE_COMPILE", "1")
    # That would be a group of its own, which is to be killed as a whole.
    which = shutil.which
    monkeypatch.setattr(shutil, "which", lambda name: None if name == "timeout" else which(name))
    x = ca.SX.sym("x")
    build([Kernel(x, ca.SX(0, 1), 3 * x)])
    while not pid.exists():
        time.sleep(0.02)
    (scratch,) = home.glob(".building-*")
    os.utime(scratch, (time.time() - 5, time.time() - 5))
    cache.store("0a1b", ".npy", b"")
    assert scratch.exists()
    os.killpg(os.getpgid(int(pid.read_text())), signal.SIGKILL)
    for _ in range(500):
        cache.store("0a1b", ".npy", b"")
        if not scratch.exists():
            return
        time.sleep(0.02)
    raise AssertionError("a killed compiler's folder is still there")


FULL = """
import resource
import casadi as ca
import numpy as np
from copose.kernels import Kernel, build, cache
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
x = ca.SX.sym("x", 2)
kernel = Kernel(x, ca.SX(0, 1), 2 * x)
assert not build([kernel], wait=True)
assert np.array_equal(kernel(np.ones((1, 2)), np.zeros(0)), [[2.0, 2.0]])
cache.store("0a1b", ".npy", b"one")
assert cache.stored("0a1b", ".npy") is None
"""


def test_a_full_disk_is_survived(home: Path) -> None:
    """No file can grow beyond 0 bytes, which root may not do either."""
    answer = subprocess.run(
        [sys.executable, "-c", FULL],
        env={**os.environ, "COPOSE_COMPILE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (answer.returncode, answer.stderr) == (0, "")
    assert list(home.iterdir()) == []
