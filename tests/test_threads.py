"""Planners shared by threads and carried into other processes: the answers of one thread alone.

What happens in threads happens in a process of its own, so that one that dies is a failing test.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import copose
from cells import planar
from copose.kernels import cache
from copose.problem import parse
from copose.results import to_json
from path_problems import single_hinged

START = """
import json, os, sys, threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import copose
from copose.results import to_json

sys.path.insert(0, {tests!r})
from cells import planar
from path_problems import single_hinged

# Threads change places often.
sys.setswitchinterval(1e-4)
WORST = planar(2, 3, objective={{"kind": "worst-direction"}})
LIMITED = planar(2, 2, objective={{"kind": "acceleration", "direction": [1, 0]}})
for arm in LIMITED["arms"]:
    arm["torque_limits"] = [20.0, 10.0]
APART = planar(1, 3, constraints={{"collision": True}})


def told(answer):
    said = json.loads(to_json(answer))
    said.pop("timing")
    return json.dumps(said)


def together(*tasks):
    "What tasks give when threads do them at the same time, twice each."
    with ThreadPoolExecutor(len(tasks)) as pool:
        return [list(each) for each in zip(*(
            [task.result() for task in [pool.submit(task) for task in tasks]] for _ in range(2)
        ))]
"""

SHARED = """
planners = [copose.Planner(copose.parse(each)) for each in {cells}]
assert all(planner.compile() for planner in planners) == {compiled}
path = copose.PathPlanner(copose.parse(single_hinged(knots=9)))
rng = np.random.default_rng(0)
tasks = []
for planner in planners:
    postures = {{
        arm.name: rng.uniform(-2, 2, (120, arm.n)) for arm in planner._model.cell.arms
    }}

    def measured(planner=planner, postures=postures):
        values = []
        for y in (0.1, 0.15, 0.2):
            where = {{"position": [0.0, y]}}
            measures = planner.measure(postures, object_pose=where)
            values += [measures.objective.tobytes(), measures.closure_error["a1"].tobytes()]
        return values

    def polished(planner=planner, postures=postures):
        ends = [planner.polish({{name: q[k] for name, q in postures.items()}}) for k in range(8)]
        return [(end.objective, *(q.tobytes() for q in end.joints.values())) for end in ends]

    tasks += [measured, measured, polished, polished, polished]
    tasks.append(lambda planner=planner: told(planner.solve(effort="low")))
if not {compiled}:
    tasks.append(lambda: told(path.plan()))
alone = [task() for task in tasks]
assert together(*tasks) == [[each] * 2 for each in alone]
"""

BUILT = """
def answer(cell):
    planner = copose.Planner(copose.parse(cell))
    start = {{arm.name: np.full(arm.n, 0.5) for arm in planner._model.cell.arms}}
    return planner.polish(start).objective, told(planner.solve(effort="low"))


tasks = [lambda cell=cell: answer(cell) for cell in (WORST, LIMITED)]
alone = [task() for task in tasks]
assert together(*tasks) == [[each] * 2 for each in alone]
"""

FORKED = """
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

planner = copose.Planner(copose.parse(WORST))
expected, ended = told(planner.solve(effort="low")), threading.Event()


def busy():
    while not ended.is_set():
        planner.solve(effort="low")


def asked(_):
    return told(planner.solve(effort="low"))


threads = [threading.Thread(target=busy) for _ in range(2)]
for thread in threads:
    thread.start()
with multiprocessing.get_context("fork").Pool(2) as pool:
    answers = pool.map(asked, range(2))
ended.set()
for thread in threads:
    thread.join()
assert answers == [expected] * 2
"""


def run(code: str, home: Path, **settings: object) -> subprocess.CompletedProcess:
    script = (START + code).format(tests=str(Path(__file__).parent), **settings)
    return subprocess.run(
        [sys.executable, "-c", script],
        env={
            **os.environ,
            "XDG_CACHE_HOME": str(home),
            "COPOSE_COMPILE": "1" if settings.get("compiled") else "0",
        },
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.mark.parametrize("compiled", [False, True])
def test_threads_share_planners(compiled: bool, tmp_path: Path) -> None:
    if compiled and cache.compiler() is None:
        pytest.skip("no C compiler here")
    cells = "[LIMITED]" if compiled else "(WORST, APART)"
    answer = run(SHARED, tmp_path, compiled=compiled, cells=cells)
    assert (answer.returncode, answer.stderr) == (0, "")


def test_threads_build_planners_at_the_same_time(tmp_path: Path) -> None:
    answer = run(BUILT, tmp_path)
    assert (answer.returncode, answer.stderr) == (0, "")


def test_measuring_does_not_wait_for_a_search() -> None:
    planner = copose.Planner(parse(planar(2, 3)))
    postures = {name: np.zeros((3, 3)) for name in ("a1", "a2")}
    begun, ended = threading.Event(), threading.Event()

    def told_to_wait(now: copose.Progress) -> None:
        begun.set()
        ended.wait(60)

    with ThreadPoolExecutor(2) as pool:
        search = pool.submit(planner.solve, effort="low", progress=told_to_wait)
        try:
            assert begun.wait(60)
            moved = {"position": [0.0, 0.15]}
            measured = pool.submit(planner.measure, postures, object_pose=moved).result(timeout=30)
        finally:
            ended.set()
        assert len(measured.objective) == 3 and search.result().status == "solved"


def test_processes_fork_while_threads_solve(tmp_path: Path) -> None:
    answer = run(FORKED, tmp_path)
    assert answer.returncode == 0, answer.stderr


def test_planners_are_pickled_by_their_problems() -> None:
    cell = planar(2, 3)
    planner = copose.Planner(parse(cell, source=Path("somewhere/cell.toml")))
    again = pickle.loads(pickle.dumps(planner))
    assert type(again) is copose.Planner and again.problem == planner.problem
    assert again.problem.source == Path("somewhere/cell.toml")
    solution = planner.solve(effort="low")
    assert told(again.solve(effort="low")) == told(solution)
    assert pickle.loads(pickle.dumps(solution)) == solution
    path = copose.PathPlanner(parse(single_hinged(knots=5)))
    motion = pickle.loads(pickle.dumps(path)).plan()
    assert motion.status == "solved"
    assert told(path.plan()) == told(motion) == told(pickle.loads(pickle.dumps(motion)))


def told(answer: copose.Solution | copose.Motion) -> dict:
    return {key: value for key, value in json.loads(to_json(answer)).items() if key != "timing"}


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_planners_go_to_other_processes(method: str) -> None:
    planner = copose.Planner(parse(planar(2, 3)))
    expected = planner.solve(effort="low")
    with ProcessPoolExecutor(1, get_context(method)) as pool:
        assert told(pool.submit(planner.solve, effort="low").result()) == told(expected)
        postures = {name: [joints] * 3 for name, joints in expected.after.joints.items()}
        measured = pool.submit(planner.measure, postures).result()
        wrong = pool.submit(planner.solve, seed=-1)
        with pytest.raises(copose.InputError, match=r"^seed: -1 is no whole number"):
            wrong.result()
    assert np.array_equal(measured.objective, planner.measure(postures).objective)
