"""Studies on a Dask cluster: one table whatever the workers, and whatever becomes of them."""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import psutil
import pytest

from cells import toml
from copose.batch.cluster.cluster import cluster_lines
from copose.batch.cluster.dispatcher import SchedulerLostError
from copose.batch.cluster.local_workers import LocalWorkers
from copose.batch.point_solver import PointSolver, Recipe, points_of
from copose.errors import CoposeError, InputError
from copose.problem import Problem
from copose.progress import StoppedError, watched
from copose.studies import Study
from copose.studies.points.problems import PointProblems
from copose.studies.robot_files import RobotFiles
from reference import PROBLEMS
from study_robots import arm_study, package

Table: TypeAlias = dict[int, dict[str, Any]]


def masses(folder: Path, steps: int = 24) -> Study:
    """A study of two planar arms that push, by the object's mass."""
    file = folder / "study.toml"
    vary = {"key": "object.mass", "from": 0.05, "to": 0.5, "steps": steps}
    study = {
        "format": 1,
        "name": "masses",
        "effort": "low",
        "problem": str(PROBLEMS / "push-x.toml"),
    }
    file.write_text(toml({**study, "vary": [vary]}))
    return Study.read(file)


def run(study: Study, recipe: Recipe | None = None, **options: Any) -> Iterator[str]:
    """The lines of all points of a study."""
    return cluster_lines(
        Recipe.of(study) if recipe is None else recipe,
        points_of(study, range(len(study.points))),
        RobotFiles.of(study.problems, study.file),
        **{"workers": 2} | options,
    )


def table(lines: Iterator[str]) -> Table:
    """The lines by point, but for seconds; none stands twice."""
    found: Table = {}
    for text in lines:
        line = json.loads(text)
        del line["seconds"]
        assert line["point"] not in found
        found[line["point"]] = line
    return found


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return masses(tmp_path_factory.mktemp("masses"))


@pytest.fixture(scope="module")
def plain(study: Study) -> Table:
    return table(plain_lines(study))


def plain_lines(study: Study) -> Iterator[str]:
    """The lines of all points without workers."""
    solver = PointSolver(Recipe.of(study))
    return (solver.line(point).text for point in points_of(study, range(len(study.points))))


def worker_processes() -> list[psutil.Process]:
    """The local workers of this process that are alive."""
    return [
        child
        for child in psutil.Process().children()
        if child.status() != psutil.STATUS_ZOMBIE
        and any("local_worker" in a for a in child.cmdline())
    ]


@contextlib.contextmanager
def scheduler(folder: Path, workers: int) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A scheduler of its own, and workers that are in a folder without anything."""
    folder.mkdir()
    file = folder / "scheduler.json"
    common = ["--scheduler-file", str(file), "--no-dashboard"]
    programs = [["dask_scheduler", "--host", "127.0.0.1", "--port", "0", *common]] + [
        ["dask_worker", *common, "--nthreads", "1", "--memory-limit", "0", "--no-nanny"]
    ] * workers
    path = os.pathsep.join(filter(None, sys.path))
    environment = {**os.environ, "PYTHONPATH": path, "DASK_TEMPORARY_DIRECTORY": str(folder)}
    processes = []
    try:
        for name, *arguments in programs:
            while processes and not file.exists():
                assert processes[0].poll() is None
                time.sleep(0.05)
            processes.append(
                subprocess.Popen(
                    [sys.executable, "-W", "ignore", "-m", f"distributed.cli.{name}", *arguments],
                    cwd=folder,
                    env=environment,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )
            )
        while not file.stat().st_size:
            time.sleep(0.05)
        yield json.loads(file.read_text())["address"], processes[0]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_one_table_whatever_the_workers(
    study: Study,
    plain: Table,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    assert len(plain) == 24
    assert {line["status"] for line in plain.values()} == {"solved"}
    assert table(run(study)) == plain
    assert worker_processes() == []
    with scheduler(tmp_path / "elsewhere", workers=2) as (address, _):
        assert table(run(study, scheduler=address)) == plain
    assert capfd.readouterr() == ("", "")


def killed_at_random(study: Study, kills: int, apart_s: float) -> Table:
    """The table of a run in which so many workers are killed, whatever they are at."""
    drawn = random.Random(0)
    recipe = replace(Recipe.of(study), problems=Slow(study.problems.tables, study.problems.file))
    next_kill, found = 0.0, []
    for text in run(study, recipe):
        found.append(text)
        if kills and time.monotonic() > next_kill and (alive := worker_processes()):
            drawn.choice(alive).kill()
            kills -= 1
            next_kill = time.monotonic() + drawn.uniform(0, 2 * apart_s)
    assert kills == 0
    return table(iter(found))


class Slow(PointProblems):
    """Problems that take their time."""

    def at(self, values: Mapping[str, Any]) -> Problem:
        time.sleep(0.02)
        return super().at(values)


def test_killed_workers_lose_nothing(study: Study, plain: Table) -> None:
    assert killed_at_random(study, 3, 0.3) == plain


@pytest.mark.long
def test_twenty_killed_workers_lose_nothing(tmp_path: Path) -> None:
    study = masses(tmp_path, 800)
    assert killed_at_random(study, 20, 0.5) == table(plain_lines(study))


class Deadly(PointProblems):
    """Problems of which the first one ends the process, even as it is built."""

    def at(self, values: Mapping[str, Any]) -> Problem:
        if values["object.mass"] == 0.05 and "local_worker" in sys.argv[0]:
            os._exit(1)
        return super().at(values)


def test_a_point_that_kills_its_process_is_a_line(study: Study, plain: Table) -> None:
    recipe = replace(Recipe.of(study), problems=Deadly(study.problems.tables, study.problems.file))
    found = table(run(study, recipe))
    dead = found.pop(0)
    assert (dead["status"], dead["reason"]) == ("failed", "its process died twice")
    assert dead["stopped"]
    assert dead["hash"] == plain[0]["hash"]
    assert found == {i: line for i, line in plain.items() if i > 0}


def test_an_interrupt_ends_at_once(study: Study, capfd: pytest.CaptureFixture[str]) -> None:
    with watched() as watch:
        lines = run(study)
        next(lines)
        began = time.monotonic()
        watch.interrupt()
        with pytest.raises(StoppedError):
            list(lines)
    assert time.monotonic() - began < 2
    assert worker_processes() == []
    assert capfd.readouterr() == ("", "")


ORPHANS = """
import sys, time
from copose.batch.cluster.local_workers import LocalWorkers
workers = LocalWorkers(2, "tcp://127.0.0.1:1")
workers.keep()
print("started", flush=True)
time.sleep(60)
"""


def test_workers_end_with_their_parent() -> None:
    parent = subprocess.Popen([sys.executable, "-c", ORPHANS], stdout=subprocess.PIPE)
    assert parent.stdout is not None
    assert parent.stdout.readline() == b"started\n"
    workers = psutil.Process(parent.pid).children()
    assert len(workers) == 2
    # ^C of a terminal does not reach them.
    assert {os.getsid(worker.pid) for worker in workers} == {worker.pid for worker in workers}
    time.sleep(1.5)
    assert all(worker.is_running() for worker in workers)
    parent.kill()
    parent.communicate()
    gone, alive = psutil.wait_procs(workers, timeout=10)
    assert (len(gone), alive) == (2, [])


def test_a_scheduler_that_goes_away_ends_the_run(
    study: Study, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with scheduler(tmp_path / "there", workers=1) as (address, process):
        lines = run(study, scheduler=address)
        next(lines)
        process.send_signal(signal.SIGKILL)
        with pytest.raises(SchedulerLostError, match="what is done is recorded"):
            list(lines)
    assert capfd.readouterr() == ("", "")


def test_robot_files_travel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The workers have neither the problem's folder nor the package, and collisions are tested."""
    home = tmp_path / "home"
    package(home / "src/parts")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(home / "src"))
    vary = [{"key": "object.position.x", "values": [0.5, 0.6]}]
    study = arm_study(home, vary, urdf="package://parts/urdf/arm.urdf")
    expected = table(plain_lines(study))
    assert {line["status"] for line in expected.values()} == {"solved"}
    files, points = RobotFiles.of(study.problems, study.file), points_of(study, range(2))
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    home.rename(tmp_path / "moved")
    with scheduler(tmp_path / "elsewhere", workers=1) as (address, _):
        assert table(cluster_lines(Recipe.of(study), points, files, 1, address)) == expected
        # The worker removes them once it hears that the run has ended.
        until = time.monotonic() + 20
        while any(
            name.endswith(".stl")
            for _, _, names in os.walk(tmp_path / "elsewhere")
            for name in names
        ):
            assert time.monotonic() < until
            time.sleep(0.1)


def test_faults_are_one_line(study: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    for address, told in (
        ("tcp://127.0.0.1:9", "no Dask scheduler answers at tcp://127.0.0.1:9"),
        ("127.0.0.1", "'127.0.0.1' is no address of a Dask scheduler; tcp://HOST:PORT is expected"),
    ):
        with pytest.raises(InputError) as refused:
            next(run(study, scheduler=address))
        assert str(refused.value) == f"--scheduler: {told}"
    monkeypatch.setattr("copose.batch.cluster.dispatcher.__version__", "0.0.0")
    with pytest.raises(InputError, match=r"cannot solve points: it has copose .*, not 0\.0\.0;"):
        next(run(study, workers=1))
    monkeypatch.setattr(sys, "executable", "/bin/false")
    local = LocalWorkers(1, "tcp://127.0.0.1:9", patience=1)
    with pytest.raises(CoposeError, match=r"4 worker processes have died .* exit status 1"):
        while True:
            local.keep()
    local.stop()
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'copose\[study\]'"):
        next(run(study))
