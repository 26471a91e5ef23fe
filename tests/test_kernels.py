"""Kernels: compiled and interpreted alike to the last bit, and nothing loaded that is not ours."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import copose
from cells import planar, two_pandas
from copose.cell.cell import Cell
from copose.kernels import Kernel, build, cache, source
from copose.problem import parse
from copose.self_motion.kernels import ArmKernels

needs_compiler = pytest.mark.skipif(cache.compiler() is None, reason="no C compiler here")


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of the test's own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("COPOSE_COMPILE", raising=False)
    return tmp_path / "copose"


def small(factor: float = 1.0) -> Kernel:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 1)
    inside = ca.if_else(x[0] < 0.5, ca.exp(x[0]), ca.fmin(x[1], p))
    y = ca.vertcat(
        factor * ca.sin(x[0]) * p, inside, ca.log(ca.fabs(x[1]) + 1) / 3, ca.sqrt(x[0] ** 2 + 2),
        ca.logic_and(x[0] > 0, x[1] <= 0), ca.sign(x[1]) - 1 / (3 + x[0]),
    )  # fmt: skip
    return Kernel(x, p, y)


def points(kernel: Kernel, inputs: int, given: int, count: int = 77) -> tuple:
    rng = np.random.default_rng(0)
    return rng.normal(size=(count, inputs)), rng.normal(size=given)


@needs_compiler
def test_compiled_and_interpreted_are_the_same_bits(home: Path) -> None:
    kernel = small()
    x, p = points(kernel, 2, 1)
    each = np.random.default_rng(1).normal(size=(len(x), 1))
    expected, by_row = kernel(x, p), kernel(x, each)
    assert build([kernel], wait=True) and kernel.compiled
    assert np.array_equal(kernel(x, p), expected) and np.array_equal(kernel(x, each), by_row)
    for count in (0, 1, 2, 3):
        assert np.array_equal(kernel(x[:count], p), expected[:count])
    row = x[5]
    assert expected[5, 0] == pytest.approx(np.sin(row[0]) * p[0], rel=1e-15)


@needs_compiler
@pytest.mark.parametrize("resolution", ["pseudoinverse", "torque-optimal"])
def test_kernels_of_an_arm_are_the_same_bits(resolution: str, home: Path) -> None:
    cell = planar(2, 4, ellipsoid={"resolution": resolution})
    ready = Cell.of(parse(cell))
    kernels = ArmKernels.of(ready.system.arms[0], ready.resolution)
    before = [kernel(*points(kernel, kernel._nx, kernel._np)) for kernel in kernels.all]
    assert build(kernels.all, wait=True)
    for kernel, expected in zip(kernels.all, before, strict=True):
        again = kernel(*points(kernel, kernel._nx, kernel._np))
        assert np.array_equal(again, expected, equal_nan=True)


@needs_compiler
@pytest.mark.parametrize("lanes", [2, 4, 8])
def test_vectors_of_any_width_give_the_same_bits(
    lanes: int, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Compilers make do with narrower vectors than they are told of."""
    monkeypatch.setattr(source, "_LANES", lanes)
    x = ca.SX.sym("x", 2)
    # The register of an angle is used again between its cosine and its sine.
    y = ca.vertcat(ca.cos(x[0]) * x[1], ca.sin(x[0]), ca.sin(x[0] * x[1]), ca.fmax(x[1], 0.2))
    for kernel in (small(), Kernel(x, ca.SX(1, 1), y)):
        inputs = np.random.default_rng(2).normal(size=(2 * lanes + 1, 2))
        expected = kernel(inputs, np.array([0.3]))
        # Whatever another width has left in the cache is of another key.
        monkeypatch.setattr(kernel, "_key", f"{lanes}{kernel.key}"[:32])
        assert build([kernel], wait=True) and kernel.compiled
        for count in range(len(inputs) + 1):
            assert np.array_equal(kernel(inputs[:count], np.array([0.3])), expected[:count])


@needs_compiler
@pytest.mark.parametrize("wait", [False, True], ids=["virtual machine", "compiled"])
def test_shapes_that_do_not_fit_are_refused(wait: bool, home: Path) -> None:
    kernel = small()
    if wait:
        assert build([kernel], wait=True)
    nx, np_ = kernel._nx, kernel._np
    for x, p in (((nx,), (np_,)), ((3, nx + 1), (np_,)), ((3, nx), (np_ + 1,)), ((3, nx), (2, np_)),
                 ((), (np_,))):  # fmt: skip
        with pytest.raises(ValueError, match="shapes"):
            kernel(np.zeros(x), np.zeros(p))


@needs_compiler
def test_the_answer_does_not_wait_and_one_process_compiles(home: Path) -> None:
    kernel = small()
    assert not build([kernel]) and not kernel.compiled
    building = list(home.glob(".building-*"))
    again = small()
    build([again])
    assert list(home.glob(".building-*")) in (building, [])
    for _ in range(300):
        if kernel.load() and not list(home.glob(".building-*")):
            break
        time.sleep(0.1)
    assert kernel.compiled and not list(home.glob(".building-*"))


@needs_compiler
def test_arms_of_one_model_share_their_kernels() -> None:
    planner = copose.Planner(parse(two_pandas()))
    assert planner._model.arms[0] is planner._model.arms[1]


@needs_compiler
def test_the_cache_is_kept_and_private(home: Path) -> None:
    first = small()
    assert build([first], wait=True)
    assert home.stat().st_mode & 0o777 == 0o700
    files = {file: file.stat().st_mtime_ns for file in home.iterdir()}
    assert [file.suffix for file in files] == [".so"]
    again = small()
    # Planners may come and go: a process has each library once.
    assert again.load() and again._evaluate is first._evaluate
    assert {file: file.stat().st_mtime_ns for file in home.iterdir()} == files
    assert small(2.0).key != again.key


@needs_compiler
@pytest.mark.parametrize("mode", [0o770, 0o702, 0o755])
def test_a_folder_open_to_others_is_not_trusted(mode: int, home: Path) -> None:
    assert build([small()], wait=True)
    home.chmod(mode)
    fresh = small()
    assert not build([fresh], wait=True) and not fresh.compiled


@needs_compiler
def test_a_library_that_others_can_write_to_is_not_loaded(home: Path) -> None:
    assert build([small()], wait=True)
    next(home.iterdir()).chmod(0o722)
    assert not small().load()


@needs_compiler
def test_links_are_not_followed(home: Path, tmp_path: Path) -> None:
    assert build([small()], wait=True)
    elsewhere = tmp_path / "elsewhere"
    home.rename(elsewhere)
    home.symlink_to(elsewhere)
    assert not small().load()
    home.unlink()
    home.mkdir(mode=0o700)
    library = next(elsewhere.iterdir())
    (home / library.name).symlink_to(library)
    assert not small().load()


@needs_compiler
def test_a_library_that_computes_something_else_is_refused(home: Path) -> None:
    other, kernel = small(2.0), small()
    assert build([other], wait=True)
    _, content = cache.stored(other.key, ".so")
    cache.store(kernel.key, ".so", content)
    assert not kernel.load()
    x, p = points(kernel, 2, 1)
    assert kernel(x, p)[3, 0] == pytest.approx(np.sin(x[3, 0]) * p[0])


@pytest.mark.parametrize("compiler", ["/bin/false", "/bin/true", "no-such-compiler", "'"])
def test_a_broken_compiler_is_survived(
    compiler: str, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", compiler)
    kernel = small()
    assert not build([kernel], wait=True)
    x, p = points(kernel, 2, 1)
    assert np.isfinite(kernel(x, p)).all()
    assert not home.exists() or not list(home.iterdir())


def test_no_cache_folder_is_survived(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert not build([small()], wait=True)


def test_compiling_can_be_forbidden(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COPOSE_COMPILE", "0")
    planner = copose.Planner(parse(planar()))
    assert not planner.compile() and planner.solve().timing.kernels == "virtual machine"
    assert not home.exists()


RUN = """
import json, sys
import copose
from copose.results import to_json
sys.path.insert(0, {tests!r})
from cells import planar
solution = copose.solve(copose.parse(planar(2, 4, "planar")))
answer = json.loads(to_json(solution))
print(answer.pop("timing")["kernels"])
print(json.dumps(answer))
"""


def run(environment: dict) -> subprocess.Popen:
    code = RUN.format(tests=str(Path(__file__).parent))
    return subprocess.Popen(
        [sys.executable, "-c", code],
        env={**os.environ, "COPOSE_COMPILE": "1", **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@needs_compiler
def test_two_processes_at_once_and_one_after_them_answer_alike(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cold twice at once, warm, forbidden, without a folder: the same result, bit for bit."""
    environment = {"XDG_CACHE_HOME": str(tmp_path)}
    both = [run(environment), run(environment)]
    said = [process.communicate() for process in both]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("COPOSE_COMPILE", "1")
    assert copose.Planner(parse(planar(2, 4, "planar"))).compile()
    later = [
        run(environment),
        run({**environment, "COPOSE_COMPILE": "0"}),
        run({"XDG_CACHE_HOME": "/dev/null/no", "HOME": "/dev/null/no"}),
    ]
    said += [process.communicate() for process in later]
    assert [error for _, error in said] == [""] * 5
    kernels, answers = zip(*(out.splitlines() for out, _ in said), strict=True)
    assert kernels[2:] == ("compiled", "virtual machine", "virtual machine")
    assert len(set(answers)) == 1


@needs_compiler
def test_a_library_that_crashes_never_reaches_the_cache(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A compiler that makes `evaluate` fall over: the trial dies, not the planner."""
    crash = tmp_path / "crash.c"
    crash.write_text("void evaluate(void) { *(volatile int *)0 = 1; }")
    fake = tmp_path / "cc"
    real = cache.compiler()[0]
    fake.write_text(
        f'#!/bin/sh\nwhile [ "$1" != -o ]; do shift; done\n'
        f'exec {real} -shared -fPIC -o "$2" {crash}\n'
    )
    fake.chmod(0o755)
    monkeypatch.setenv("CC", str(fake))
    kernel = small()
    assert not build([kernel], wait=True) and not kernel.compiled
    x, p = points(kernel, 2, 1)
    assert np.isfinite(kernel(x, p)).all()


@needs_compiler
def test_a_compiler_that_hangs_is_given_up(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake = tmp_path / "cc"
    fake.write_text("#!/bin/sh\nexec sleep 60\n")
    fake.chmod(0o755)
    monkeypatch.setenv("CC", str(fake))
    monkeypatch.setattr(cache, "_PATIENCE", 1.0)
    began = time.monotonic()
    assert not build([small()], wait=True)
    assert time.monotonic() - began < 10
    assert not list(home.glob(".building-*"))


def test_without_a_compiler_no_code_is_written(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")

    def never(self: Kernel) -> cache.Code:
        raise AssertionError("code was written that nobody compiles")

    monkeypatch.setattr(Kernel, "code", never)
    assert not build([small()])


def test_no_home_is_survived(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless(self: Path) -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "expanduser", homeless)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("COPOSE_COMPILE", "1")
    assert cache.folder() is None and not build([small()], wait=True)
